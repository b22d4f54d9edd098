//! Rays that workers trace for one view alone. They belong to no beam, and no file stores them.

use glam::DVec3;
use holo_section::{RayCoords, Sample};

use crate::camera::Camera;

/// A ray of a view and its result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveSample {
    /// Where the ray begins, in the scene.
    pub origin: DVec3,
    /// The direction of the ray, a unit vector.
    pub direction: DVec3,
    /// Radiance, finite and not negative.
    pub radiance: [f32; 3],
    /// Distance to the surface that the ray hit, scene units; infinite if it hit nothing.
    pub distance: f64,
}

impl LiveSample {
    /// Returns the point that the ray hit and the ray's direction, in camera coordinates. A ray
    /// that hit nothing is drawn at distance 1.
    pub fn place(&self, camera: &Camera) -> (DVec3, DVec3) {
        let direction = camera.to_camera(self.direction);
        let distance = if self.distance.is_finite() { self.distance } else { 1.0 };
        (camera.to_camera(self.origin - camera.eye) + direction * distance, direction)
    }

    /// Returns the radiance as RGBE, as samples store it. Dither keeps the mean without bias.
    pub fn rgbe(&self) -> [u8; 4] {
        let bits = self.direction.x.to_bits() ^ self.direction.y.to_bits().rotate_left(21);
        let dither = ((bits ^ bits >> 32) as u32).wrapping_mul(0x9E37_79B9);
        Sample::encode(RayCoords::default(), self.radiance, self.distance, 1.0, dither).rgbe
    }
}
