//! Rays against a scene: the nearest hit, whether anything is in the way, and the surface that a ray meets.
//!
//! A [`Raycaster`] is an 8-wide bounding volume hierarchy over the triangles of a [`Scene`](holo_scene::Scene), traced one ray at a
//! time, or the rays of a beam or of neighbouring pixels together; where there are at most 64 triangles, a single ray is tested against all. Coordinates are the
//! scene's f32 coordinates, relative to `scene.origin`.
//!
//! Always true:
//! - A closed mesh does not leak: adjacent triangles are tested with exactly opposite edge functions (Woop, Benthin,
//!   Wald 2013), and boxes are wide enough for every rounding in that test.
//! - Results do not depend on the processor, nor on whether rays are traced alone or together: triangles are tested with the same
//!   roundings everywhere, boxes are conservative, and of triangles at the same distance the one of least index counts.
//! - Any bit pattern is an acceptable ray. One with a NaN, an infinite or zero direction, or an infinite origin hits nothing.
//! - Both sides of a triangle are hit.
//! - A query neither allocates nor panics nor runs longer than the hierarchy has nodes.

mod build;
mod dispatch;
mod kernel;
mod node;
mod packet;
mod raycaster;
mod shaft;
mod simd;
mod surface;
mod tile;
mod triangle;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use raycaster::{BuildError, MAX_COORDINATE, MAX_TRIANGLES, Quality, Raycaster};
pub use shaft::Shaft;
pub use surface::{SurfacePoint, spawn};

use glam::Vec3;

/// No triangle: what to skip in [`Raycaster::nearest_from`] if nothing is to be skipped.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// Most rays that [`Raycaster::nearest_many`] traces together: a packet's (Larson & Simmons 1999, §2.1).
pub const MAX_TOGETHER: usize = 21;

/// Most rays that [`Raycaster::nearest_tile`] traces together: 8 × 8 pixels.
pub const MAX_TILE: usize = 64;

/// A half line or segment, in coordinates relative to the scene's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where t is 0.
    pub origin: Vec3,
    /// Unit length for `t` to be a distance; other lengths scale `t`.
    pub direction: Vec3,
    /// Hits at `t <= t_min` do not count; values below 0 act as 0.
    pub t_min: f32,
    /// Hits at `t >= t_max` do not count; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// The half line from `origin` towards `direction` (unit).
    #[must_use]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
    }
}

/// Where a ray meets a triangle `a, b, c`: at `a + u (b - a) + v (c - a)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter: the distance for a unit direction.
    pub t: f32,
    /// Index into `scene.triangles`.
    pub triangle: u32,
    /// Barycentric weight of the triangle's second vertex, 0 to 1.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex, 0 to 1.
    pub v: f32,
}
