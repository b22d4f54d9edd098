//! The filter: smooths the light of squares of pixels along surfaces, as widely as its noise needs.
//!
//! It sums over ever wider neighbourhoods (à-trous), in two passes. In the first, weights depend on
//! geometry alone, and each square uses the narrowest neighbourhood with a small enough standard
//! error. In the second, weights also depend on differences of the light that the first found. A
//! network and the significance of detail then determine how much each neighbourhood counts beside
//! the next wider one.
//! `docs/notes/filter-network.md` has its figures.
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
mod passes;
mod refine;
mod scales;
mod sums;
mod training;

use crate::behind::BehindPanes;
use crate::estimate::{Estimate, LightSums};
use crate::light_store::{LightStore, Sums};
use crate::planes::{Difference, Geometry, SquareLayout, Weights};
use crate::squares::Squares;
use crate::view::SurfaceView;
use crate::visible::VisiblePoint;
use glam::Vec3;
use holo_display::Interrupt;
use passes::{GeometrySums, Passes, Second, by_other_half};
use rayon::prelude::*;
pub(crate) use sums::OfSquares;
use sums::{SCALES, Sum};
pub use training::EXAMPLE;

/// Binary logarithm of the ratio of distances from edges at which two squares no longer count for
/// each other, because shadows lie along edges.
const DIFFERENT_DISTANCE: f32 = 2.0;

/// Share of the first pass's error that the second keeps, because its weights follow the first
/// light.
const FIRST_ERROR_SHARE: f32 = 0.25;

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

impl Squares {
    /// Returns the light of every square. `behind` has the squares that lie behind panes. If
    /// `once`, the second pass is left out, because a denoiser replaces the light of squares with
    /// samples. `None` if it was interrupted.
    pub fn filter(
        &self,
        (view, store): (&SurfaceView, &LightStore),
        sums: &OfSquares,
        behind: &BehindPanes,
        once: bool,
        interrupt: &Interrupt,
    ) -> Option<Filtered> {
        let (passes, sums) = Passes::new(self, (view, store), sums, behind, !once, interrupt)?;
        let first = passes.choice().lights(|scale, at| sums.at(scale, at), choose::FIRST);
        let halves = match sums {
            GeometrySums::Halves(halves) => halves,
            GeometrySums::All(scales) => {
                let beyond = passes.beyond((view, self), &first, &scales, [None, None]);
                return Some(Filtered::new(first, beyond));
            }
        };
        let Second { light, scales, details } = passes.second(halves, interrupt)?;
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
        (6 - self.step.ilog2() as usize).min(SCALES - 1)
    }

    /// Returns the weights of all scales, by geometry and distance from edges.
    fn weights(&self, layout: &SquareLayout) -> Vec<Weights> {
        let geometry = self.geometry(layout);
        let of_scale = |scale: usize, by| layout.weights(&geometry, self.step, 1 << scale, by);
        let values = &layout.edge_distances(&of_scale(0, None));
        let by_edges = Difference { values, limit: DIFFERENT_DISTANCE };
        (0..SCALES).map(|scale| of_scale(scale, Some(by_edges))).collect()
    }

    /// Returns the sums of squares that show coats, and 0 for others.
    fn of_coats(&self, view: &SurfaceView, layout: &SquareLayout, sums: &[Sums]) -> Sum {
        layout.planes(|at| match view.shows_coat(&self.seen[at.number]) {
            true => LightSums::new(&sums[at.number]).to_array(),
            false => [0.0; 5],
        })
    }

    fn layout(&self) -> SquareLayout {
        let occupied = |row: &[VisiblePoint]| {
            let begin = row.iter().position(VisiblePoint::is_surface).unwrap_or(0);
            begin..row.iter().rposition(VisiblePoint::is_surface).map_or(begin, |last| last + 1)
        };
        SquareLayout {
            size: self.size,
            occupied: self.seen.par_chunks(self.size.0).map(occupied).collect(),
        }
    }

    fn geometry(&self, layout: &SquareLayout) -> Geometry {
        layout.planes(|at| {
            let VisiblePoint { point, normal, width, light, .. } = self.seen[at.number];
            [point.x, point.y, point.z, normal.x, normal.y, normal.z, width, light as f32]
        })
    }
}
