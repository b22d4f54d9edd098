//! Light that rough metal mirrors, from the cube of its object.
//!
//! A few facets stand for all that the eye sees. Each mirrors the mean light of its share of
//! directions (Křivánek and Colbert 2008, "Real-time Shading with Filtered Importance Sampling").

use glam::Vec3;
use holo_optics::{Ggx, reflect};
use holo_reflection_cube::{CubeAnswer, ReflectionCube};

/// Places of facets among those that the eye sees: the points of Hammersley.
const FACETS: [[f32; 2]; 8] = [
    [0.0625, 0.0625],
    [0.1875, 0.5625],
    [0.3125, 0.3125],
    [0.4375, 0.8125],
    [0.5625, 0.1875],
    [0.6875, 0.6875],
    [0.8125, 0.4375],
    [0.9375, 0.9375],
];

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
        let (right, ahead) = self.normal.any_orthonormal_pair();
        let local = |v: Vec3| Vec3::new(v.dot(right), v.dot(ahead), v.dot(self.normal));
        let (eye, ggx) = (local(self.eye), Ggx::new(self.alpha));
        let (mut sum, mut known) = (Vec3::ZERO, 0.0);
        for numbers in FACETS {
            let facet = ggx.sample(eye, numbers);
            let towards = reflect(eye, facet);
            if towards.z <= 0.0 {
                continue;
            }
            let density = ggx.pdf(eye, facet) / (4.0 * eye.dot(facet));
            let width = (1.0 / (FACETS.len() as f32 * density)).sqrt().min(1.0);
            let direction = towards.x * right + towards.y * ahead + towards.z * self.normal;
            let answer = cube.look_up(self.point, direction, width..=STAND_IN * width);
            if let CubeAnswer::Light(light) = answer {
                let share = ggx.shadowing(eye, towards);
                sum += share * Vec3::from(light.radiance);
                known += share;
            }
        }
        (known > 0.0).then(|| sum / known)
    }
}
