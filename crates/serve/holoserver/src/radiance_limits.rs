//! Limits that a scene sets to the light and distance of its samples.

use holo_scene::{PunctualLight, Scene, Sun};
use serde::{Deserialize, Serialize};

/// Limits that a scene sets, stored in the file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RadianceLimits {
    /// The lowest corner of the scene's bounds, world coordinates.
    pub low: [f64; 3],
    /// The highest corner.
    pub high: [f64; 3],
    /// The greatest radiance of any lamp, punctual light and sun, and of the sky, in any channel,
    /// W·sr⁻¹·m⁻².
    pub brightest: f32,
}

impl RadianceLimits {
    /// Returns the limits that a scene sets.
    pub fn of(scene: &Scene) -> RadianceLimits {
        let (low, high) = scene.bounds();
        let lamps = scene.brightest_emissions().flatten();
        let suns = scene.all_suns().flat_map(Sun::radiance);
        let points = scene.punctual_lights.iter().flat_map(PunctualLight::radiance);
        let brightest =
            lamps.chain([scene.sky.brightest()]).chain(suns).chain(points).fold(0.0, f32::max);
        RadianceLimits { low: low.to_array(), high: high.to_array(), brightest }
    }

    /// Returns the distance from a point to the farthest point within the bounds.
    pub(crate) fn farthest(&self, from: [f64; 3]) -> f64 {
        let side =
            |at: usize| (from[at] - self.low[at]).abs().max((from[at] - self.high[at]).abs());
        (0..3).map(|at| side(at).powi(2)).sum::<f64>().sqrt()
    }
}
