//! Light that rough metal mirrors, from the cube of its object.

use glam::Vec3;
use holo_optics::facets;
use holo_reflection_cube::{CubeAnswer, ReflectionCube};

/// A direction without light has that of directions within so many times its own share.
const STAND_IN: f32 = 4.0;

/// A point of a metal surface that is too rough for a mirror.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoughMetal {
    pub point: Vec3,
    /// The unit normal of the smooth surface, towards the eye.
    pub normal: Vec3,
    /// The unit direction to the eye.
    pub eye: Vec3,
    /// GGX roughness.
    pub alpha: f32,
}

impl RoughMetal {
    /// Returns the mean light that facets mirror. `None` if nothing is known of it.
    pub fn light(&self, cube: &ReflectionCube) -> Option<Vec3> {
        let (mut sum, mut known) = (Vec3::ZERO, 0.0);
        for facet in facets(self.normal, self.eye, self.alpha) {
            let widths = facet.width..=STAND_IN * facet.width;
            if let CubeAnswer::Light(light) = cube.look_up(self.point, facet.towards, widths) {
                sum += facet.share * Vec3::from(light.radiance);
                known += facet.share;
            }
        }
        (known > 0.0).then(|| sum / known)
    }
}
