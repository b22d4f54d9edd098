//! Smooth normals and textures of normals where a path meets a surface.
//!
//! Invariants:
//! - A smooth normal alone never lets a direction pass a surface. Light and paths stay on their
//!   side of the triangle.
//! - A smooth normal never makes a surface brighter than its material: [`terminator`] is at most 1.

use glam::Vec3;
use holo_raycast::{Hit, Raycaster};

use crate::bsdf::Scatter;
use crate::geometry::ShadingFrame;

/// Least cosine between a smooth normal and the direction to the eye. Beyond, the normal is bent to
/// the eye: a surface that is seen faces it.
const LEAST_COSINE: f32 = 0.02;

/// The direction and width of a path that reaches a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathArrival {
    /// The unit direction from the surface to the previous point of the path.
    pub towards_eye: Vec3,
    /// The width of the path, in scene units.
    pub width: f32,
}

/// Returns the normals that scatter light at a hit, on the side that is seen. The first is that of
/// the smooth surface, the second includes the texture of normals. Both are `facing` if the surface
/// is a plain facet or a pane.
#[inline]
pub(crate) fn normals(
    raycaster: &Raycaster,
    hit: &Hit,
    scatter: &Scatter,
    facing: Vec3,
    look: &PathArrival,
) -> (Vec3, Vec3) {
    if matches!(scatter, Scatter::Pane { .. } | Scatter::Clear { .. }) {
        return (facing, facing);
    }
    let (scene, at) = (raycaster.scene(), [hit.u, hit.v]);
    let seen = |normal: Vec3| {
        // A surface that is seen faces the eye.
        let cosine = normal.dot(look.towards_eye);
        if cosine >= LEAST_COSINE {
            return normal;
        }
        let bent = normal + look.towards_eye * (LEAST_COSINE - cosine);
        bent.try_normalize().unwrap_or(facing)
    };
    let smooth = scene.smooth_normal(hit.triangle, hit.u, hit.v);
    let smooth = smooth.map(|smooth| if smooth.dot(facing) < 0.0 { -smooth } else { smooth });
    let base = smooth.unwrap_or(facing);
    // Pictures are seen from the front; a bump there is a dent from behind.
    let side = if facing.dot(scene.normal(hit.triangle)) < 0.0 { -1.0 } else { 1.0 };
    let mapped = scene.mapped_normal(hit.triangle, at, look.width, base * side);
    let smooth = smooth.map_or(facing, seen);
    (smooth, mapped.map_or(smooth, |mapped| seen(mapped * side)))
}

/// Returns the factor to light from `direction`, whose cosine to the smooth normal is `z`.
///
/// It is 0 if the light is on different sides of the triangle and of its smooth normal. Otherwise,
/// for light that is scattered with a density (`is_smooth`), it fades the light towards the edge of
/// the facets' own shadows (Chiang, Li and Burley 2019, "Taming the Shadow Terminator").
#[inline]
pub(crate) fn terminator(
    frame: &ShadingFrame,
    geometric: Vec3,
    direction: Vec3,
    z: f32,
    is_smooth: bool,
) -> f32 {
    let between = frame.n.dot(geometric);
    // The common case is a facet, whose two normals are equal or opposite.
    if frame.n == geometric || frame.n == -geometric {
        return 1.0;
    }
    let cosine = direction.dot(geometric) * between.signum();
    if cosine * z <= 0.0 {
        return 0.0;
    }
    if z < 0.0 || !is_smooth {
        return 1.0;
    }
    let g = (cosine / (z * between.abs())).min(1.0);
    (g * g + g - g * g * g).min(1.0)
}
