//! Suns: lights so far away that their rays are nearly parallel.

use glam::{DVec3, Vec3};
use serde::Serialize;

use crate::Rgb;
use crate::limits::MAX_RADIANCE;

/// Most suns of a scene. Each costs a shadow ray at every point that samples the lights.
pub const MAX_SUNS: usize = 16;

/// Half of the angle of a sun's disc, in radians: that of the real sun.
pub const SUN_RADIUS: f64 = 0.004_65;

/// A disc in the sky that gives light and shadows. A sun of a model is not seen: pictures show the
/// sky there, directly and in mirrors. The sun of a [`crate::Sky`] is seen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sun {
    /// The unit direction from the scene to the middle of the disc.
    pub towards: [f32; 3],
    /// Irradiance of a surface that faces it, W·m⁻².
    pub irradiance: Rgb,
}

impl Sun {
    /// Returns the solid angle of its disc, projected onto a surface that faces it.
    #[must_use]
    pub fn projected_solid_angle() -> f64 {
        std::f64::consts::PI * SUN_RADIUS.sin().powi(2)
    }

    /// Returns the radiance of its disc, W·sr⁻¹·m⁻².
    #[must_use]
    pub fn radiance(&self) -> Rgb {
        let per_irradiance = (1.0 / Sun::projected_solid_angle()) as f32;
        self.irradiance.map(|irradiance| irradiance * per_irradiance)
    }

    /// Returns whether a unit direction points into its disc.
    #[must_use]
    pub fn is_at(&self, direction: DVec3) -> bool {
        let towards = Vec3::from(self.towards).as_dvec3();
        // The sine is exact where the cosine has no digits left.
        direction.dot(towards) > 0.0
            && direction.cross(towards).length_squared() < SUN_RADIUS.sin().powi(2)
    }

    /// Returns whether it has a direction and a plausible irradiance.
    pub(crate) fn is_valid(&self) -> bool {
        let most = MAX_RADIANCE * Sun::projected_solid_angle() as f32;
        (Vec3::from(self.towards).length() - 1.0).abs() < 1e-3
            && self.irradiance.iter().all(|c| (0.0..=most).contains(c))
            && self.irradiance.iter().any(|&c| c > 0.0)
    }
}
