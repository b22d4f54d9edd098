//! The light of coats that depends on the direction.
//!
//! Most of a coat's light is diffuse, and few samples leave it towards the eye. So the filter finds
//! the mean light of samples from all directions first. This module adds what samples towards the
//! eye show beyond it, as far as it is more than noise.
//!
//! Invariant: without coats, nothing is computed.

use crate::cell::{Sums, luminance};
use crate::estimate::{Estimate, Lit};
use crate::planes::{Planes, Square};
use glam::Vec3;

/// Expected difference between the light towards the eye and the mean of all directions, relative
/// to that mean.
const SPREAD: f32 = 0.1;

/// Number of standard errors up to which a difference is taken for noise.
const SIGNIFICANT: f32 = 2.0;

/// Number of samples from which a difference counts by half. A few samples may agree by chance.
const CONFIRMED: f32 = 64.0;

/// The sums of a square and its neighbourhoods over samples towards the eye, and over those from
/// all directions, by the same weights.
pub(crate) struct Towards<'a> {
    /// From the squares' own sums to the widest.
    pub eye: &'a [Planes<5>],
    pub all: &'a [Planes<5>],
}

impl Towards<'_> {
    /// Returns what samples towards the eye show beyond the mean of all directions. `light` is
    /// that mean.
    pub fn beyond(&self, at: Square, light: &Estimate) -> Estimate {
        let bright = luminance(light.light.to_array());
        let mut beyond =
            Estimate { light: Vec3::ZERO, error: SPREAD * bright, variance: light.variance };
        for (eye, all) in self.eye.iter().zip(self.all).rev() {
            let (eye, all) = (Lit::from(eye.at(at)), Lit::from(all.at(at)));
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

/// Returns the mean light of a square's samples: of those towards the eye, and of those from all
/// directions with what is `beyond` added. Each counts by its noise. `None` without samples.
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
