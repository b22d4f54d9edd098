//! Watertight ray/triangle test (Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection",
//! JCGT 2(1)), for four triangles at a time.
//!
//! Invariants: the sign of an edge function is exact for the (rounded) sheared vertices. A product
//! of two f32 rounds monotonically, so the f32 difference has the right sign or is 0. For 0 the f64
//! products are exact. Two triangles that share an edge get edge functions that are exact
//! negatives, so no ray passes between them. Fused multiply-add would break that; Rust never
//! contracts on its own.

use glam::{DVec3, Vec3};

use crate::node::{ROW, TriangleBlock};
use crate::prepared::Prepared;
use crate::simd::Simd;
use crate::{Hit, NO_TRIANGLE};

/// The nearest hit so far. Without a hit, it has no triangle, and `t` is the end of the ray.
pub(crate) type Nearest = Hit;

/// Replaces `best` by the nearest triangle of the block that the ray meets at `t_min < t < best.t`,
/// except triangles to skip.
///
/// If distances are equal, the triangle of least index wins, so that the order of traversal does
/// not matter.
#[inline(always)]
pub(crate) fn intersect<S: Simd>(
    simd: S,
    block: &TriangleBlock,
    ray: &Prepared,
    t_min: f32,
    skip: [u32; 2],
    best: &mut Nearest,
) {
    let signs = simd.edge_signs(block, ray);
    let mut candidates = signs.inside | signs.on_edge;
    while candidates != 0 {
        let lane = candidates.trailing_zeros() as usize;
        candidates &= candidates - 1;
        // The common case first: a ray passes through the triangle that it leaves.
        if !skip.contains(&block.id(lane)) {
            let on_edge = signs.on_edge >> lane & 1 != 0;
            consider(block.triangle(lane), block.id(lane), on_edge, ray, t_min, best);
        }
    }
}

/// The same for one triangle. Its edge functions have one sign, or some are 0 (`on_edge`).
#[inline(always)]
pub(crate) fn consider(
    vertices: [[f32; 3]; 3],
    triangle: u32,
    on_edge: bool,
    ray: &Prepared,
    t_min: f32,
    best: &mut Nearest,
) {
    if !on_edge || inside_exactly(vertices, ray) {
        replace(best, Hit { triangle, ..locate(vertices, ray) }, t_min);
    }
}

/// Replaces `best` by a hit that is nearer, and beyond `t_min`.
#[inline(always)]
pub(crate) fn replace(best: &mut Nearest, hit: Hit, t_min: f32) {
    let nearer = hit.t < best.t
        || (hit.t == best.t && best.triangle != NO_TRIANGLE && hit.triangle < best.triangle);
    if nearer && hit.t > t_min {
        *best = hit;
    }
}

/// Returns true if the ray passes inside the triangle. Computes in f64, where products of f32 are
/// exact. A triangle seen edge-on is not hit.
#[cold]
pub(crate) fn inside_exactly(vertices: [[f32; 3]; 3], ray: &Prepared) -> bool {
    let [kx, ky, kz] = ray.axes;
    let [ox, oy, oz] = ray.sheared_origin;
    let [a, b, c] = vertices.map(|vertex| {
        let z = vertex[kz % 3] - oz;
        let x = (vertex[kx % 3] - ox) - ray.shear[0] * z;
        let y = (vertex[ky % 3] - oy) - ray.shear[1] * z;
        [f64::from(x), f64::from(y)]
    });
    let u = c[0] * b[1] - c[1] * b[0];
    let v = a[0] * c[1] - a[1] * c[0];
    let w = b[0] * a[1] - b[1] * a[0];
    let negative = u < 0.0 || v < 0.0 || w < 0.0;
    let positive = u > 0.0 || v > 0.0 || w > 0.0;
    negative != positive
}

/// Returns the point at which the ray meets a triangle that it is known to meet, in f64.
///
/// In f32, the hit on a sliver seen at a grazing angle is off by whole units along the ray. When
/// 300,000 rays left a wall of slivers at 0.06 to 45 degrees, 124 met the neighbour of their own
/// triangle. Because of rounding in the inside test, the ray may meet the plane outside the
/// triangle, so weights and distance are clamped to the triangle.
#[inline(always)]
fn locate(vertices: [[f32; 3]; 3], ray: &Prepared) -> Hit {
    let direction = Vec3::from_array(ray.direction).as_dvec3();
    let [t, u, v] = Facing::new(vertices, ray.origin).along(direction, direction.length_squared());
    Hit { t, triangle: NO_TRIANGLE, u, v }
}

/// A triangle as seen by rays from one origin.
struct Facing {
    corners: [DVec3; 3],
    /// Edges from the first corner, and the first edge's cross product with that corner.
    e1: DVec3,
    e2: DVec3,
    q: DVec3,
}

impl Facing {
    #[inline(always)]
    fn new(vertices: [[f32; 3]; 3], origin: [f32; 3]) -> Self {
        let origin = Vec3::from_array(origin).as_dvec3();
        let corners @ [a, b, c] = vertices.map(|v| Vec3::from_array(v).as_dvec3() - origin);
        let (e1, e2) = (b - a, c - a);
        Self { corners, e1, e2, q: e1.cross(a) }
    }

    /// Returns `t`, `u` and `v` of a ray.
    #[inline(always)]
    #[allow(clippy::manual_clamp, reason = "clamp keeps a NaN")]
    fn along(&self, direction: DVec3, length_squared: f64) -> [f32; 3] {
        let Self { corners: [a, b, c], e1, e2, q } = *self;
        let p = direction.cross(e2);
        let scale = 1.0 / e1.dot(p);
        // An infinite or NaN scale gives some point of the triangle too: `max` and `min` drop a
        // NaN.
        let u = (-a.dot(p) * scale).max(0.0).min(1.0);
        let v = (direction.dot(q) * scale).max(0.0).min(1.0 - u);
        let (ta, tb, tc) = (a.dot(direction), b.dot(direction), c.dot(direction));
        let t = (e2.dot(q) * scale)
            .max(ta.min(tb).min(tc) / length_squared)
            .min(ta.max(tb).max(tc) / length_squared);
        [t, u, v].map(|x| x as f32)
    }
}

/// The directions of a row of rays from one origin, as [`locate`] uses them.
#[derive(Clone, Copy)]
pub(crate) struct Directions {
    axes: [[f64; ROW]; 3],
    length_squared: [f64; ROW],
}

impl Directions {
    /// A placeholder that fills arrays.
    pub(crate) const NONE: Self = Self { axes: [[0.0; ROW]; 3], length_squared: [0.0; ROW] };

    #[inline(always)]
    pub(crate) fn new(x: &[f32; ROW], y: &[f32; ROW], z: &[f32; ROW]) -> Self {
        let axes @ [x, y, z] = [x, y, z].map(|axis| axis.map(f64::from));
        let mut length_squared = [0.0; ROW];
        for i in 0..ROW {
            length_squared[i] = DVec3::new(x[i], y[i], z[i]).length_squared();
        }
        Self { axes, length_squared }
    }
}

/// The points at which a row of rays meets one triangle.
pub(crate) struct Located {
    pub t: [f32; ROW],
    pub u: [f32; ROW],
    pub v: [f32; ROW],
}

/// Returns the same bits as [`locate`] for each ray. A loop of fixed length, which the compiler
/// vectorises.
#[inline(always)]
pub(crate) fn locate_row(vertices: [[f32; 3]; 3], origin: [f32; 3], rays: &Directions) -> Located {
    let seen = Facing::new(vertices, origin);
    let [x, y, z] = &rays.axes;
    let mut located = Located { t: [0.0; ROW], u: [0.0; ROW], v: [0.0; ROW] };
    for i in 0..ROW {
        let direction = DVec3::new(x[i], y[i], z[i]);
        [located.t[i], located.u[i], located.v[i]] = seen.along(direction, rays.length_squared[i]);
    }
    located
}
