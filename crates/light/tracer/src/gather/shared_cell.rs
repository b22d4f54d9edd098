//! A cell as processes exchange it.

use glam::Vec3;
use holo_raycast::{NO_TRIANGLE, SurfacePoint};

use super::estimates::Estimates;
use super::place::Spot;

/// Number of levels. The last is never reached: its cells would need 4^12 estimates each.
pub(super) const LEVELS: u32 = 12;

/// The light of a cell, as processes exchange it: sums over estimates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedCell {
    /// The first point that taught the cell, relative to the scene's origin.
    pub point: [f32; 3],
    /// Unit normal there, on the lit side.
    pub normal: [f32; 3],
    /// Sum of the reflected light.
    pub light: [f32; 3],
    /// Sum of the albedos.
    pub albedo: [f32; 3],
    /// Number of estimates.
    pub count: u32,
    /// Number of the surface's material.
    pub material: u32,
    /// Number of further bounces whose light counts; `u32::MAX` without a limit.
    pub bounces: u32,
    /// Number of times that the width of the widest cells was halved.
    pub level: u32,
}

impl SharedCell {
    /// Returns where it lies.
    pub(super) fn spot(&self) -> Spot {
        let point = Vec3::from(self.point);
        // A few roundings of the coordinates.
        let error = point.abs() * (4.0 * f32::EPSILON);
        let normal = Vec3::from(self.normal);
        let point = SurfacePoint { point, error, normal, triangle: NO_TRIANGLE };
        Spot { point, normal, material: self.material, bounces: self.bounces }
    }

    /// Returns its estimates.
    pub(super) fn estimates(&self) -> Estimates {
        Estimates { light: self.light.into(), albedo: self.albedo.into(), count: self.count as f32 }
    }

    /// Returns whether a worker could have made it.
    pub(super) fn is_valid(&self) -> bool {
        let positive = |v: [f32; 3]| v.iter().all(|x| x.is_finite() && *x >= 0.0);
        self.level < LEVELS
            && self.count > 0
            && Vec3::from(self.point).is_finite()
            && (Vec3::from(self.normal).length_squared() - 1.0).abs() < 1e-3
            && positive(self.light)
            && positive(self.albedo)
    }
}
