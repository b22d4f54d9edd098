//! Points on surfaces with a bound on their rounding error, and rays that start there without
//! meeting their own surface.
//!
//! Invariants: the exact point on the triangle lies within `error` of the stated point in every
//! axis. A spawned origin lies on the side of the plane that its direction goes to (Pharr, Jakob,
//! Humphreys 2023, §6.8.5 and §6.8.6). No distance here is tuned to a scene's size.

use glam::Vec3;

/// Returns a bound on the relative error of n roundings (Higham 2002, §3.1).
const fn gamma(n: f32) -> f32 {
    let unit = 0.5 * f32::EPSILON;
    n * unit / (1.0 - n * unit)
}

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Relative to the scene's origin.
    pub point: Vec3,
    /// Bound on the rounding of `point`, by axis.
    pub error: Vec3,
    /// Unit geometric normal on the counter-clockwise side.
    pub normal: Vec3,
    /// Number of the scene's triangle.
    pub triangle: u32,
}

/// Returns `a + u (b - a) + v (c - a)` and a bound on its error.
#[inline]
pub(crate) fn interpolate([a, b, c]: [Vec3; 3], u: f32, v: f32) -> (Vec3, Vec3) {
    // Rounding of u and v stays in the plane. Unlike (1-u-v) a + u b + v c, this form has no
    // weights that must sum to 1, so only its own arithmetic counts.
    let (p, q) = ((b - a) * u, (c - a) * v);
    let point = a + (p + q);
    let error = (p.abs() + q.abs()) * gamma(5.0) + a.abs() * gamma(2.0);
    (point, error)
}

/// Distance of a point from its triangle's edges, in units of its rounding. A ray's origin between
/// two faces that meet at 7° is then still within both.
const OFF_EDGES: f32 = 16.0;

/// Returns the least barycentric coordinate of points that are [`OFF_EDGES`] roundings off this
/// triangle's edges. At most 1/8, for slivers narrower than that.
pub(crate) fn edge_margin([a, b, c]: [Vec3; 3]) -> f32 {
    let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
    // The error of `interpolate`. A small triangle far from the origin has only the rounding of its
    // position.
    let extent = (b - a).abs().max((c - a).abs()).max_element();
    let rounding =
        (a.abs().max_element() * gamma(2.0) + extent * gamma(5.0)).min(gamma(8.0) * reach);
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    // The least height is the one over the longest edge.
    let height = (b - a).as_dvec3().cross((c - a).as_dvec3()).length() / f64::from(longest);
    let margin = f64::from(OFF_EDGES * rounding) / height;
    if margin < 0.125 { margin as f32 } else { 0.125 }
}

/// Returns barycentrics that are moved off the edges if they are nearer to one than `margin`.
#[inline]
pub(crate) fn keep_off_edges(u: f32, v: f32, margin: f32) -> (f32, f32) {
    let w = 1.0 - u - v;
    if u.min(v).min(w) >= margin {
        return (u, v);
    }
    let (u, v, w) = (u.max(margin), v.max(margin), w.max(margin));
    let sum = u + v + w;
    (u / sum, v / sum)
}

/// Returns the origin of a ray that leaves `point` towards `direction`, on the correct side of the
/// point's plane (Pharr et al. 2023, §6.8.6). `error` bounds the error of `point`.
///
/// All are relative to the scene's origin. `normal` has unit length and may be that of either side.
#[must_use]
#[inline]
pub fn spawn(point: Vec3, error: Vec3, normal: Vec3, direction: Vec3) -> Vec3 {
    let distance = normal.abs().dot(error);
    let offset = if direction.dot(normal) < 0.0 { normal * -distance } else { normal * distance };
    let moved = point + offset;
    // The sum was rounded, so take one more step outwards. `next_up` has branches that took 9 % of
    // a path's time.
    moved + (moved.abs() * f32::EPSILON).copysign(offset)
}
