//! Rays that were traced for one view, by their geometry: of no beam, and stored nowhere.

use glam::DVec3;
use holo_section::{RayCoords, Sample};

use crate::camera::Camera;

/// A ray of a view, and what it saw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveSample {
    /// Where it begins: where the view's rays begin.
    pub origin: DVec3,
    /// Where it goes, unit.
    pub direction: DVec3,
    /// Radiance, finite and not negative.
    pub radiance: [f32; 3],
    /// Distance to the surface that it met, scene units; infinite if it met nothing.
    pub distance: f64,
}

impl LiveSample {
    /// What it saw, in camera coordinates, and where it goes. What it met nothing is seen at distance 1 along it.
    pub fn place(&self, camera: &Camera) -> (DVec3, DVec3) {
        let direction = camera.to_camera(self.direction);
        let distance = if self.distance.is_finite() { self.distance } else { 1.0 };
        (camera.to_camera(self.origin - camera.eye) + direction * distance, direction)
    }

    /// Its radiance as samples hold it, without bias.
    pub fn rgbe(&self) -> [u8; 4] {
        let bits = self.direction.x.to_bits() ^ self.direction.y.to_bits().rotate_left(21);
        let dither = ((bits ^ bits >> 32) as u32).wrapping_mul(0x9E37_79B9);
        Sample::encode(RayCoords::default(), self.radiance, self.distance, 1.0, dither).rgbe
    }
}
