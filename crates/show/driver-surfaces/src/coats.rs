//! The light of coats that depends on the direction.
//!
//! Most of a coat's light is diffuse, and only few of its samples have a direction near the view's.
//! So the filter first finds the mean light of samples from all directions. This module finds how
//! the light towards the eye differs from that mean, if it differs by more than noise.
//!
//! Invariant: without coats, nothing is computed.

use crate::estimate::{Estimate, LightSums};
use crate::light_store::{Sums, luminance};
use crate::planes::{Square, SquareLayout, SquarePlanes};
use crate::view::SurfaceView;
use crate::visible::VisiblePoint;
use glam::Vec3;
use rayon::prelude::*;

/// Expected difference between the light towards the eye and the mean of all directions, relative
/// to that mean.
const SPREAD: f32 = 0.1;

/// Number of standard errors up to which a difference is taken for noise.
const SIGNIFICANT: f32 = 2.0;

/// Number of samples from which a difference counts by half. A few samples may agree by chance.
const CONFIRMED: f32 = 64.0;

/// The sums of squares and of their neighbourhoods by the same weights, from the squares' own sums
/// to the widest.
pub(crate) struct CoatScales<'a> {
    /// Over samples towards the eye.
    pub towards_eye: &'a [SquarePlanes<5>],
    /// Over samples from all directions.
    pub from_all: &'a [SquarePlanes<5>],
}

impl CoatScales<'_> {
    /// Returns for each square what its coat sends towards the eye beyond the mean of all
    /// directions, and 0 for squares that show no coat. `lights` are these means.
    pub fn beyond(
        &self,
        (view, seen): (&SurfaceView, &[VisiblePoint]),
        layout: &SquareLayout,
        lights: &[Estimate],
    ) -> Vec<Estimate> {
        let (width, height) = layout.size;
        let mut beyond = vec![Estimate::default(); width * height];
        beyond.par_chunks_mut(width).enumerate().for_each(|(row, beyond)| {
            for at in layout.squares(row).filter(|at| view.shows_coat(&seen[at.number])) {
                beyond[at.column] = self.of_square(at, &lights[at.number]);
            }
        });
        beyond
    }

    /// Returns the same for one square. `light` is its mean of all directions.
    fn of_square(&self, at: Square, light: &Estimate) -> Estimate {
        let bright = luminance(light.light.to_array());
        let mut beyond =
            Estimate { light: Vec3::ZERO, error: SPREAD * bright, variance: light.variance };
        for (eye, all) in self.towards_eye.iter().zip(self.from_all).rev() {
            let (eye, all) = (LightSums::from(eye.at(at)), LightSums::from(all.at(at)));
            if eye.count <= 0.0 {
                continue;
            }
            let own = eye.mean() - all.mean();
            let differs = luminance((own - beyond.light).to_array());
            let noise = eye.variance(light.variance);
            let real = (differs * differs - SIGNIFICANT * SIGNIFICANT * noise).max(0.0);
            let share =
                eye.count / (eye.count + CONFIRMED) * real / (real + noise).max(f32::MIN_POSITIVE);
            beyond.light += share * (own - beyond.light);
            beyond.error += share * (noise.sqrt() - beyond.error);
        }
        beyond
    }
}

/// Returns the light of a square that shows a coat, from its own samples only, for a denoiser. The
/// mean of those towards the eye and the mean of all, with `beyond` added, each count by the
/// inverse of their noise. `None` without samples.
pub(crate) fn mean_of_samples(eye: &Sums, all: &Sums, beyond: &Estimate) -> Option<Vec3> {
    if all.count == 0 {
        return None;
    }
    let others = all.paths as f32;
    let spread = beyond.error * beyond.error / beyond.variance.max(f32::MIN_POSITIVE);
    let weight = 1.0 / (1.0 / others + spread);
    let own = eye.paths as f32;
    Some((own * eye.mean() + weight * (all.mean() + beyond.light)) / (own + weight))
}
