//! Casts rays: finds the nearest hit along a ray, tests whether anything is in the way, and
//! computes the surface at a hit.
//!
//! A [`Raycaster`] holds an 8-wide bounding volume hierarchy over the triangles of a
//! [`Scene`](holo_scene::Scene). Shared meshes have hierarchies of their own, and their instances
//! another one (module `instances`). It traces rays one at a time, or the rays of a beam or of
//! neighbouring pixels together. In scenes of at most 64 triangles, a single ray is tested against
//! all of them. Coordinates are the scene's f32 coordinates, relative to `scene.origin`.
//!
//! Invariants:
//! - A closed mesh does not leak. Adjacent triangles are tested with exactly opposite edge
//!   functions (Woop, Benthin, Wald 2013), and boxes are padded for every rounding in that test.
//! - Results do not depend on the processor, or on whether rays are traced alone or together.
//!   Triangles are tested with the same roundings everywhere, boxes are conservative, and the
//!   triangle of least index wins if distances are equal.
//! - Any bit pattern is an acceptable ray. A ray with a NaN, an infinite or zero direction, or an
//!   infinite origin hits nothing.
//! - If several faces lie at one place, a ray meets the one that faces it. Of several, it meets one
//!   that emits light, and then the one of least index. Rounding of distances changes nothing.
//! - Both sides of a triangle are hit.
//! - Rays pass cut-out parts. They meet a surface that is partly covered, unless the caster is
//!   [by chance](Raycaster::by_chance): then they meet it with the probability of its opacity.
//! - A query does not allocate and does not panic. It visits each node of a hierarchy at most once,
//!   or once for each instance.

mod build;
mod bundle;
mod chance;
mod coincident;
mod cut;
mod dispatch;
mod facet;
mod instances;
mod kernel;
mod node;
mod packet;
mod prepared;
mod raycaster;
mod search;
mod shaft;
mod simd;
mod stored_geometry;
mod stored_scenes;
mod stored_surfaces;
mod surface;
mod tile;
mod tree;
mod triangle;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use chance::is_in_share;
pub use cut::CutLine;
pub use facet::{BuildError, MAX_COORDINATE, MAX_TRIANGLES};
pub use raycaster::Raycaster;
pub use shaft::Shaft;
pub use stored_scenes::{StoredScenes, UnusableFile};
pub use surface::{SurfacePoint, spawn};

use glam::Vec3;

/// No triangle: the argument of [`Raycaster::nearest_from`] that skips nothing.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// Most rays that [`Raycaster::nearest_many`] traces together: those of a packet (Larson & Simmons
/// 1999, §2.1).
pub const MAX_TOGETHER: usize = 21;

/// Most rays that [`Raycaster::nearest_tile`] traces together: 8 × 8 pixels.
pub const MAX_TILE: usize = 64;

/// A half line or segment, relative to the scene's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// The point at which t is 0.
    pub origin: Vec3,
    /// Direction; `t` is a distance if its length is 1, and a multiple of the length otherwise.
    pub direction: Vec3,
    /// Hits at `t <= t_min` do not count; values below 0 count as 0.
    pub t_min: f32,
    /// Hits at `t >= t_max` do not count; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// Returns the half line from `origin` towards `direction` (unit length).
    #[must_use]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
    }
}

/// A point at which a ray meets a triangle `a, b, c`: `a + u (b - a) + v (c - a)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter; the distance if the direction has unit length.
    pub t: f32,
    /// Number of the scene's triangle.
    pub triangle: u32,
    /// Barycentric weight of the triangle's second vertex, 0 to 1.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex, 0 to 1.
    pub v: f32,
}
