//! The filter: smooths the light of squares of pixels along surfaces, as widely as its noise needs.
//!
//! It sums over ever wider neighbourhoods (à-trous). Each square uses the narrowest one with a
//! small enough standard error. There are two passes. In the first, weights depend on geometry
//! alone. In the second, they also depend on differences of the light that the first found. There,
//! a narrow neighbourhood counts only as far as it differs from the next wider one by more than
//! noise.
//!
//! The first pass finds the light twice, each time from half of the squares. In the second pass,
//! weights for the samples of one half depend on the light of the other half (Rousselle, Knaus &
//! Zwicker 2012). If samples chose their own weights, they would count most where their noise is
//! alike, and blotches of noise would stay.
//!
//! Invariants:
//! - No light crosses a crease or a sheet. Weights fall to 0 with the distance from either plane,
//!   and are 0 between sides that face away from each other.
//! - A sample contributes at most a tenth of the light of its wide neighbourhood. The limit grows
//!   with the number of samples, so the bias that it causes vanishes as they grow.

mod choose;
mod denoise;
mod limit;
mod network;
mod refine;
mod scales;
mod training;

use crate::behind::BehindPanes;
use crate::cell::{Sums, luminance};
use crate::coats::CoatScales;
use crate::estimate::{Estimate, Lit};
use crate::likely::LikelyLight;
use crate::planes::{Difference, Geometry, Layout, Planes, Weights};
use crate::squares::Squares;
use crate::store::Store;
use crate::view::{Seen, View};
use choose::Choice;
use glam::Vec3;
use holo_display::Interrupt;
use limit::Limit;
use rayon::prelude::*;
use refine::Refinement;
pub use training::EXAMPLE;

/// Number of neighbourhoods. Each is twice as wide as the one before.
const SCALES: usize = 6;

/// Binary logarithm of the ratio of distances from edges at which two squares no longer count for
/// each other, because shadows lie along edges.
const DIFFERENT_DISTANCE: f32 = 2.0;

/// Natural logarithm of the ratio of light at which two squares no longer count for each other, in
/// the second pass.
const DIFFERENT_LIGHT: f32 = 0.5;

/// Share of the first pass's error that the second keeps, because its weights follow the first
/// light.
const FIRST_ERROR_SHARE: f32 = 0.25;

/// The sums of each square: light (3), count, square.
type Sum = Planes<5>;

/// The sums of all squares.
pub(crate) struct OfSquares {
    /// Over samples that count for the view.
    pub towards_eye: Vec<Sums>,
    /// Over samples from all directions on coats, and as above elsewhere. `None` without coats.
    pub from_all: Option<Vec<Sums>>,
}

impl OfSquares {
    /// Returns true if no square has a sample, as at the start of a new holodeck.
    pub fn are_empty(&self) -> bool {
        let all = self.from_all.as_ref().unwrap_or(&self.towards_eye);
        all.iter().all(|sums| sums.count == 0)
    }
}

/// Filtered light of all squares.
pub(crate) struct Filtered {
    /// The light towards the eye.
    pub lights: Vec<Estimate>,
    /// The part of it that coats send beyond the mean of all directions. Empty without coats.
    pub beyond: Vec<Estimate>,
}

impl Filtered {
    /// Adds `beyond` to the mean light of all directions.
    fn new(mut lights: Vec<Estimate>, beyond: Vec<Estimate>) -> Filtered {
        for (light, beyond) in lights.iter_mut().zip(&beyond) {
            light.light = (light.light + beyond.light).max(Vec3::ZERO);
            light.error = light.error.hypot(beyond.error);
        }
        Filtered { lights, beyond }
    }
}

/// What both passes use.
struct Passes {
    layout: Layout,
    weights: Vec<Weights>,
    /// Likely light of squares with few samples, as [`Likely::to_array`] returns it.
    likely: Planes<4>,
    /// Sums of all scales by geometry.
    of_all: Vec<Sum>,
    /// The same for each half of the squares, until the second pass takes them.
    of_halves: Option<[Vec<Sum>; 2]>,
    /// Sums of coats towards the eye.
    of_coats: Option<Sum>,
    limiting_scale: usize,
    step: usize,
}

/// What the second pass chooses by.
struct Second {
    /// Logarithms of the light of each half.
    light: [Planes<1>; 2],
    /// Sums of all scales by geometry and light.
    scales: Vec<Sum>,
    details: Vec<Planes<2>>,
}

/// Returns the differences that lower the weights of the samples of each half.
fn by_other_half([of_even, of_odd]: &[Planes<1>; 2]) -> [Option<Difference<'_>>; 2] {
    [of_odd, of_even].map(|values| Some(Difference { values, limit: DIFFERENT_LIGHT }))
}

impl Passes {
    /// Prepares the first pass, and the second one if it is `twice`. `None` if it was interrupted.
    fn new(
        squares: &Squares,
        (view, store): (&View, &Store),
        OfSquares { towards_eye, from_all }: &OfSquares,
        behind: &BehindPanes,
        twice: bool,
        interrupt: &Interrupt,
    ) -> Option<Passes> {
        let layout = squares.layout();
        let weights = squares.weights(&layout);
        interrupt.check()?;

        let sums = from_all.as_ref().unwrap_or(towards_eye);
        let own = layout.planes(|at| Lit::new(&sums[at.number]).to_array());
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

        let of_halves = twice.then(|| {
            scales::halves(&layout, &own).map(|half| scales::all(&layout, half, &weights, None))
        });
        let of_all = match &of_halves {
            Some([even, odd]) => scales::both(&layout, even, odd),
            None => scales::all(&layout, own, &weights, None),
        };
        interrupt.check()?;

        let likely = layout.planes(|at| {
            let [.., count, _] = of_all[SCALES].at(at);
            likely.at(at, count).unwrap_or_default().to_array()
        });
        let step = squares.step;
        Some(Passes { layout, weights, likely, of_all, of_halves, of_coats, limiting_scale, step })
    }

    fn choice(&self) -> Choice<'_> {
        Choice {
            layout: &self.layout,
            wide: &self.of_all[self.limiting_scale],
            likely: &self.likely,
        }
    }

    fn refinement<'a>(&'a self, by_light: &'a [Sum], details: &'a [Planes<2>]) -> Refinement<'a> {
        let (choice, by_geometry, step) = (self.choice(), &self.of_all, self.step);
        Refinement { choice, by_light, by_geometry, details, step }
    }

    /// Prepares the second pass. Without one, the inner result is `None`. The outer one is `None`
    /// if it was interrupted.
    fn second(&mut self, interrupt: &Interrupt) -> Option<Option<Second>> {
        let Some(of_halves) = self.of_halves.take() else { return Some(None) };
        let this = &*self;
        let Passes { layout, weights, of_all, .. } = this;
        let light = of_halves.map(|half| {
            let found = this.choice().lights(&half, choose::HALF);
            let bright = |light: &Estimate| luminance(light.light.to_array()).max(1.0).ln();
            layout.planes(|at| [bright(&found[at.number])])
        });
        interrupt.check()?;
        let scales = scales::by_halves(layout, &of_all[0], weights, by_other_half(&light));
        interrupt.check()?;
        let details = refine::details(&this.choice(), &scales, weights);
        Some(Some(Second { light, scales, details }))
    }

    /// Returns what coats send towards the eye beyond the mean of all directions, `lights`.
    /// `from_all` are the sums of that mean. Empty without coats.
    fn beyond(
        &self,
        (view, squares): (&View, &Squares),
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

impl Squares {
    /// Returns the light of every square. `behind` tells which squares lie behind panes. If `once`,
    /// the second pass is left out, because a denoiser replaces the light of squares with samples.
    /// `None` if it was interrupted.
    pub fn filter(
        &self,
        (view, store): (&View, &Store),
        sums: &OfSquares,
        behind: &BehindPanes,
        once: bool,
        interrupt: &Interrupt,
    ) -> Option<Filtered> {
        let mut passes = Passes::new(self, (view, store), sums, behind, !once, interrupt)?;
        let first = passes.choice().lights(&passes.of_all, choose::FIRST);
        let Some(Second { light, scales, details }) = passes.second(interrupt)? else {
            let beyond = passes.beyond((view, self), &first, &passes.of_all, [None, None]);
            return Some(Filtered::new(first, beyond));
        };
        let mut lights = passes.refinement(&scales, &details).lights();
        for (light, first) in lights.iter_mut().zip(&first) {
            light.error = light.error.hypot(FIRST_ERROR_SHARE * first.error);
        }
        interrupt.check()?;
        let beyond = passes.beyond((view, self), &lights, &scales, by_other_half(&light));
        Some(Filtered::new(lights, beyond))
    }

    /// Returns the number of the scale that judges brightest samples. It spans as many pixels at
    /// any step.
    fn limiting_scale(&self) -> usize {
        if self.step == 4 { 4 } else { 5 }
    }

    /// Returns the weights of all scales, by geometry and distance from edges.
    fn weights(&self, layout: &Layout) -> Vec<Weights> {
        let geometry = self.geometry(layout);
        let of_scale = |scale: usize, by| layout.weights(&geometry, self.step, 1 << scale, by);
        let values = &layout.edge_distances(&of_scale(0, None));
        let by_edges = Difference { values, limit: DIFFERENT_DISTANCE };
        (0..SCALES).map(|scale| of_scale(scale, Some(by_edges))).collect()
    }

    /// Returns the sums of squares that show coats, and 0 for others.
    fn of_coats(&self, view: &View, layout: &Layout, sums: &[Sums]) -> Sum {
        layout.planes(|at| match view.shows_coat(&self.seen[at.number]) {
            true => Lit::new(&sums[at.number]).to_array(),
            false => [0.0; 5],
        })
    }

    fn layout(&self) -> Layout {
        let occupied = |row: &[Seen]| {
            let begin = row.iter().position(Seen::is_surface).unwrap_or(0);
            begin..row.iter().rposition(Seen::is_surface).map_or(begin, |last| last + 1)
        };
        Layout {
            size: self.size,
            occupied: self.seen.par_chunks(self.size.0).map(occupied).collect(),
        }
    }

    fn geometry(&self, layout: &Layout) -> Geometry {
        layout.planes(|at| {
            let Seen { point, normal, width, light, .. } = self.seen[at.number];
            [point.x, point.y, point.z, normal.x, normal.y, normal.z, width, light as f32]
        })
    }
}
