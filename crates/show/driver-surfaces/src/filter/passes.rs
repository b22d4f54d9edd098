//! Sums, weights and differences of both passes, in the order in which they are found.

use super::choose::{self, Choice};
use super::limit::Limit;
use super::refine::{self, Refinement};
use super::scales;
use super::sums::{OfSquares, SCALES, Sum};
use crate::behind::BehindPanes;
use crate::coats::CoatScales;
use crate::estimate::{Estimate, LightSums};
use crate::light_store::{LightStore, luminance};
use crate::likely::LikelyLight;
use crate::planes::{Difference, Square, SquareLayout, SquarePlanes, Weights};
use crate::squares::Squares;
use crate::view::SurfaceView;
use holo_display::Interrupt;

/// Natural logarithm of the ratio of light at which two squares no longer count for each other, in
/// the second pass.
const DIFFERENT_LIGHT: f32 = 0.5;

/// The quantities that both passes use.
pub(super) struct Passes {
    pub layout: SquareLayout,
    weights: Vec<Weights>,
    /// Likely light of squares with few samples: its channels, and 1 if it is the light around.
    likely: SquarePlanes<4>,
    /// Sums of the squares.
    own: Sum,
    /// Sums by geometry of the neighbourhood that judges noise.
    wide: Sum,
    /// Samples by geometry of all scales but the narrowest. Empty if there is one pass.
    counts: Vec<SquarePlanes<1>>,
    /// Sums of coats towards the eye.
    of_coats: Option<Sum>,
    step: usize,
}

/// Sums of all scales by geometry. They take more memory than everything else that is filtered.
pub(super) enum GeometrySums {
    /// For a single pass.
    All(Vec<Sum>),
    /// For two passes: those of each half of the squares.
    Halves([Vec<Sum>; 2]),
}

/// The quantities by which the second pass chooses.
pub(super) struct Second {
    /// Logarithms of the light of each half.
    pub light: [SquarePlanes<1>; 2],
    /// Sums of all scales by geometry and light.
    pub scales: Vec<Sum>,
    /// Details of all scales except the widest.
    pub details: Vec<SquarePlanes<2>>,
}

/// Returns the differences that lower the weights of the samples of each half.
pub(super) fn by_other_half(
    [of_even, of_odd]: &[SquarePlanes<1>; 2],
) -> [Option<Difference<'_>>; 2] {
    [of_odd, of_even].map(|values| Some(Difference { values, limit: DIFFERENT_LIGHT }))
}

impl GeometrySums {
    /// Returns the sums of a scale at a square.
    pub fn at(&self, scale: usize, at: Square) -> [f32; 5] {
        match self {
            GeometrySums::All(scales) => scales[scale].at(at),
            GeometrySums::Halves([even, odd]) => scales::added([&even[scale], &odd[scale]], at),
        }
    }
}

impl Passes {
    /// Prepares the first pass, or both if it is `twice`. `None` if it was interrupted.
    pub fn new(
        squares: &Squares,
        (view, store): (&SurfaceView, &LightStore),
        OfSquares { towards_eye, from_all }: &OfSquares,
        behind: &BehindPanes,
        twice: bool,
        interrupt: &Interrupt,
    ) -> Option<(Passes, GeometrySums)> {
        let layout = squares.layout();
        let weights = squares.weights(&layout);
        interrupt.check()?;

        let sums = from_all.as_ref().unwrap_or(towards_eye);
        let own = layout.planes(|at| LightSums::new(&sums[at.number]).to_array());
        let likely = LikelyLight::new((view, store), squares, &layout, &own);
        let limiting_scale = squares.limiting_scale();
        let mean = luminance(likely.mean.to_array());
        let limit = Limit { weights: &weights[..limiting_scale], mean, behind };
        let of_coats = from_all.as_ref().map(|_| {
            let own = squares.of_coats(view, &layout, towards_eye);
            limit.brightest(&layout, &own, towards_eye)
        });
        let own = limit.brightest(&layout, &own, sums);
        interrupt.check()?;

        let sums = match twice {
            true => GeometrySums::Halves(
                scales::halves(&layout, &own).map(|half| scales::all(&layout, half, &weights)),
            ),
            false => GeometrySums::All(scales::all(&layout, own.clone(), &weights)),
        };
        interrupt.check()?;

        let likely = layout.planes(|at| {
            let [.., count, _] = sums.at(SCALES, at);
            likely.at(at, count).unwrap_or_default().to_array()
        });
        let wide = layout.planes(|at| sums.at(limiting_scale, at));
        let count = |scale: usize| {
            layout.planes(|at| {
                let [.., count, _] = sums.at(scale, at);
                [count]
            })
        };
        let counts = if twice { (1..=SCALES).map(count).collect() } else { Vec::new() };
        let step = squares.step;
        Some((Passes { layout, weights, likely, own, wide, counts, of_coats, step }, sums))
    }

    pub fn choice(&self) -> Choice<'_> {
        Choice { layout: &self.layout, wide: &self.wide, likely: &self.likely }
    }

    pub fn refinement<'a>(
        &'a self,
        by_light: &'a [Sum],
        details: &'a [SquarePlanes<2>],
    ) -> Refinement<'a> {
        let (choice, counts, step) = (self.choice(), &self.counts, self.step);
        Refinement { choice, by_light, counts, details, step }
    }

    /// Prepares the second pass by the sums of both halves. `None` if it was interrupted.
    pub fn second(&self, of_halves: [Vec<Sum>; 2], interrupt: &Interrupt) -> Option<Second> {
        let Passes { layout, weights, own, .. } = self;
        let light = of_halves.map(|half| {
            let found = self.choice().lights(|scale, at| half[scale].at(at), choose::HALF);
            let bright = |light: &Estimate| luminance(light.light.to_array()).max(1.0).ln();
            layout.planes(|at| [bright(&found[at.number])])
        });
        interrupt.check()?;
        let scales = scales::by_halves(layout, own, weights, by_other_half(&light));
        interrupt.check()?;
        let details = refine::details(&self.choice(), &scales, weights);
        Some(Second { light, scales, details })
    }

    /// Returns what coats send towards the eye beyond the mean of all directions, `lights`.
    /// `from_all` are the sums of that mean. Empty without coats.
    pub fn beyond(
        &self,
        (view, squares): (&SurfaceView, &Squares),
        lights: &[Estimate],
        from_all: &[Sum],
        lowered_by: [Option<Difference>; 2],
    ) -> Vec<Estimate> {
        let of_coats = |own: &Sum| {
            let towards_eye = &scales::by_halves(&self.layout, own, &self.weights, lowered_by);
            let scales = CoatScales { towards_eye, from_all };
            scales.beyond((view, &squares.seen), &self.layout, lights)
        };
        self.of_coats.as_ref().map(of_coats).unwrap_or_default()
    }
}
