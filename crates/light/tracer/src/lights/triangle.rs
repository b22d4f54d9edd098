//! Points on one emitting triangle as seen from a point: sampled by solid angle if that is large,
//! and by area if it is small.
//!
//! Sampling by solid angle follows Arvo 1995, "Stratified Sampling of Spherical Triangles", in the
//! form of Peters 2021, "BRDF Importance Sampling for Polygonal Lights", §4.1. Apart from the solid
//! angle, that form computes no angles.
//!
//! Invariant: the choice and the density depend only on the point and the triangle. f32 suffices
//! for both, because the solid angle is used only if its triple product has not cancelled.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

/// Solid angle, in steradians, above which points are sampled by solid angle. Below, areas are
/// nearly as even, and cheaper (docs/notes/path-tracing.md).
const LEAST: f32 = 0.03;
/// Largest solid angle at which points are sampled by solid angle. At larger ones, close to 2π, the
/// point lies in the triangle within the precision of f32.
const MOST: f32 = 6.22;

/// Cosine between two corners below which the point is close to the edge between them. If the
/// distance to the edge is 1e-4 of its length, 1 plus that cosine is only rounding. Light was then
/// a tenth too dim along every corner of a room.
const NEARLY_OPPOSITE: f32 = -0.9;

/// The way that a triangle is sampled from a point.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TriangleSampling {
    Area,
    SolidAngle,
}

/// A triangle as seen from a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aim {
    pub way: TriangleSampling,
    /// Steradians or area, depending on `way`.
    pub size: f32,
    /// Corners relative to the point.
    corners: [Vec3; 3],
    /// Unit directions to the corners, in cyclic order.
    directions: [Vec3; 3],
    /// Sum of the first and third direction.
    across: Vec3,
    /// The triple product of the directions; 1 plus their three dot products; 1 plus the dot
    /// product of the first two.
    parameters: [f32; 3],
}

impl Aim {
    /// Prepares sampling of a triangle from `point`.
    #[inline]
    pub(crate) fn new(point: Vec3, corners: [Vec3; 3]) -> Self {
        // Subtracting the point would round off much of a small triangle's area.
        let original = corners;
        let doubled = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
        let (a, b, c) = (corners[0] - point, corners[1] - point, corners[2] - point);
        let corners = [a, b, c];
        let lengths2 = [a.length_squared(), b.length_squared(), c.length_squared()];
        let mut aim = Self {
            way: TriangleSampling::Area,
            size: 0.5 * doubled,
            corners,
            directions: corners,
            across: Vec3::ZERO,
            parameters: [0.0; 3],
        };
        // If the corners are far away at similar distances, the solid angle is surely small. The
        // test saves a square root for each corner.
        let farthest = lengths2[0].max(lengths2[1]).max(lengths2[2]);
        if doubled < 0.25 * LEAST * farthest
            && lengths2[0].min(lengths2[1]).min(lengths2[2]) > 0.5 * farthest
        {
            return aim;
        }
        let directions = [a / lengths2[0].sqrt(), b / lengths2[1].sqrt(), c / lengths2[2].sqrt()];
        // Triangles fan around the second corner, as in Peters's form. The first and third corner
        // are the two that are farthest apart.
        let dots = [
            directions[0].dot(directions[2]),
            directions[1].dot(directions[0]),
            directions[2].dot(directions[1]),
        ];
        let turn =
            if dots[0] <= dots[1].min(dots[2]) { 0 } else { 1 + usize::from(dots[2] < dots[1]) };
        let at = |k: usize| (k + turn) % 3;
        let directions = [directions[at(0)], directions[at(1)], directions[at(2)]];
        let [v0, v1, v2] = directions;
        let apart = dots[turn];
        let one = 1.0 + v0.dot(v1);
        let (volume, total, across) = if apart > NEARLY_OPPOSITE {
            ((v1 - v0).cross(v2 - v0).dot(v0).abs(), one + v2.dot(v0) + v2.dot(v1), v0 + v2)
        } else {
            // Close to the edge between them, all three quantities would be differences of ones.
            // The edge's moment is exact.
            let (from, to) = (at(0), at(2));
            let moment = corners[from].cross(original[to] - original[from])
                / (lengths2[from] * lengths2[to]).sqrt();
            let left = moment.length_squared() / (1.0 - apart);
            let across = v0 * left + moment.cross(v0);
            (moment.dot(v1).abs(), left + v1.dot(across), across)
        };
        let mut angle = 2.0 * (volume / total).atan();
        if angle < 0.0 {
            angle += TAU;
        }
        if angle > LEAST && angle < MOST {
            aim = Self {
                way: TriangleSampling::SolidAngle,
                size: angle,
                directions,
                across,
                parameters: [volume, total, one],
                ..aim
            };
        }
        aim
    }

    /// Returns a point of the triangle by two uniform numbers: the weights of the second and third
    /// corner.
    #[inline]
    pub(crate) fn sample(&self, [x, y]: [f32; 2]) -> (f32, f32) {
        match self.way {
            TriangleSampling::Area => crate::geometry::triangle([x, y]),
            TriangleSampling::SolidAngle => self.project(self.direction(x, y)),
        }
    }

    #[inline]
    fn direction(&self, x: f32, y: f32) -> Vec3 {
        let [v0, v1, _] = self.directions;
        let [volume, total, one] = self.parameters;
        // Replaces the third corner so that the triangle has share x of the solid angle.
        let (sin, cos) = (0.5 * self.size * x).sin_cos();
        let offset = v0 * (volume * cos - total * sin) + self.across * (one * sin);
        let third = offset * (2.0 * v0.dot(offset) / offset.length_squared()) - v0;
        // A direction on the arc from the second corner to that one.
        let end = v1.dot(third);
        let along = 1.0 + (end - 1.0) * y;
        let across = 1.0 - end * end;
        let share = if across > 0.0 { ((1.0 - along * along).max(0.0) / across).sqrt() } else { y };
        v1 * (along - share * end) + third * share
    }

    /// Returns where a direction meets the triangle's plane, clamped to the triangle.
    #[inline]
    #[allow(clippy::manual_clamp, reason = "clamp keeps a NaN")]
    fn project(&self, direction: Vec3) -> (f32, f32) {
        let [a, b, c] = self.corners;
        let (e1, e2) = (b - a, c - a);
        let p = direction.cross(e2);
        let q = e1.cross(a);
        let scale = 1.0 / e1.dot(p);
        let u = (-a.dot(p) * scale).max(0.0).min(1.0);
        let v = (direction.dot(q) * scale).max(0.0).min(1.0 - u);
        (u, v)
    }

    /// Returns the density, per solid angle, of a point on the triangle at squared distance
    /// `distance2` and absolute cosine `cosine` at the triangle.
    #[inline]
    pub(crate) fn density(&self, distance2: f32, cosine: f32) -> f32 {
        match self.way {
            TriangleSampling::Area => distance2 / (cosine * self.size),
            TriangleSampling::SolidAngle => 1.0 / self.size,
        }
    }
}

const _: () = assert!(MOST < 2.0 * PI);

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::sampler::Sampler;

    /// Returns the solid angle in f64 (Van Oosterom and Strackee 1983).
    fn solid_angle(corners: [DVec3; 3]) -> f64 {
        let [a, b, c] = corners;
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        2.0 * a
            .cross(b)
            .dot(c)
            .abs()
            .atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
    }

    /// Returns triangles seen from 0: tiny, medium, slivers, at grazing angles, and up to nearly
    /// half of all directions.
    fn triangles() -> Vec<[DVec3; 3]> {
        let at = |z: f64, x: f64, size: f64| {
            [[x - size, -size, z], [x + size, -0.7 * size, z], [x, size, z]].map(DVec3::from_array)
        };
        vec![
            at(1.0, 0.0, 1e-4),
            at(1.0, 0.3, 0.05),
            at(1.0, 0.0, 0.2),
            at(1.0, 0.5, 1.0),
            at(1.0, -2.0, 3.0),
            at(0.05, 0.0, 1.0),
            at(0.003, 0.0, 1.0),
            at(1e-5, 0.0, 1.0),
            at(0.02, 4.0, 3.0),
            [[1.0, -3.0, 0.2], [1.0, 3.0, 0.2], [1.0, 3.0, 0.25]].map(DVec3::from_array),
            at(1e6, 0.0, 2e6),
        ]
        .into_iter()
        .chain([1e-3, 1e-5, 1e-6].into_iter().flat_map(beside))
        .collect()
    }

    /// Returns walls that meet the wall of point 0 in an edge at distance `d`; each corner comes
    /// first once.
    fn beside(d: f64) -> Vec<[DVec3; 3]> {
        let half = [[0.0, d, -1.1], [0.0, d, 0.9], [2.0, d, 0.9]].map(DVec3::from_array);
        let other = [[0.3 * d, d, -1.1], [1.6, d, -0.2], [-0.9 * d, d, 1.3]].map(DVec3::from_array);
        [half, other].into_iter().flat_map(|[a, b, c]| [[a, b, c], [b, c, a], [c, b, a]]).collect()
    }

    #[test]
    fn points_are_spread_by_solid_angle_or_by_area() {
        let mut ways = [0; 2];
        for corners in triangles() {
            let aim = Aim::new(Vec3::ZERO, corners.map(|c| c.as_vec3()));
            ways[aim.way as usize] += 1;
            let whole = solid_angle(corners);
            if let TriangleSampling::SolidAngle = aim.way {
                assert!(
                    (f64::from(aim.size) / whole - 1.0).abs() < 1e-3,
                    "{corners:?}: {} {whole}",
                    aim.size
                );
            }
            let [a, b, c] = corners;
            let n = 100_000;
            let mut counts = [0_u32; 16];
            let mut s = Sampler::new(11, 0);
            for _ in 0..n {
                let (u, v) = aim.sample(s.two());
                assert!(u >= 0.0 && v >= 0.0 && u + v <= 1.0 + 1e-6, "{u} {v}");
                // The 4-by-4 subdivision: row j has 7 - 2j triangles.
                let (i, j) = (((u * 4.0) as usize).min(3), ((v * 4.0) as usize).min(3));
                let i = i.min(3 - j);
                let upper = usize::from(u * 4.0 - i as f32 + v * 4.0 - j as f32 > 1.0 && i + j < 3);
                counts[(0..j).map(|r| 7 - 2 * r).sum::<usize>() + 2 * i + upper] += 1;
            }
            let mut chi2 = 0.0;
            for j in 0..4 {
                for k in 0..7 - 2 * j {
                    let (i, upper) = (k / 2, k % 2);
                    let corner = |x: usize, y: usize| {
                        a + (b - a) * (x as f64 / 4.0) + (c - a) * (y as f64 / 4.0)
                    };
                    let part = if upper == 1 {
                        [corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]
                    } else {
                        [corner(i, j), corner(i + 1, j), corner(i, j + 1)]
                    };
                    let share = match aim.way {
                        TriangleSampling::Area => 1.0 / 16.0,
                        TriangleSampling::SolidAngle => solid_angle(part) / whole,
                    };
                    let expected = share * f64::from(n);
                    let count = counts[(0..j).map(|r| 7 - 2 * r).sum::<usize>() + k];
                    // Parts that almost no sample hits say nothing.
                    if expected > 5.0 {
                        chi2 += (f64::from(count) - expected).powi(2) / expected;
                    }
                }
            }
            // At most 15 degrees: 44.3 is exceeded with probability 1e-4; 29 triangles.
            assert!(chi2 < 44.3, "{corners:?} {:?}: {chi2} {counts:?}", aim.way);
        }
        assert!(ways[0] >= 2 && ways[1] >= 6, "{ways:?}");
    }

    #[test]
    fn the_density_s_inverse_has_the_solid_angle_as_its_mean() {
        for corners in triangles() {
            let aim = Aim::new(Vec3::ZERO, corners.map(|c| c.as_vec3()));
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalize();
            let (mut sum, mut squares, n) = (0.0, 0.0, 100_000);
            let mut s = Sampler::new(12, 0);
            for _ in 0..n {
                let (u, v) = aim.sample(s.two());
                let p = a + (b - a) * f64::from(u) + (c - a) * f64::from(v);
                let x = 1.0
                    / f64::from(aim.density(
                        p.length_squared() as f32,
                        p.normalize().dot(normal).abs() as f32,
                    ));
                sum += x;
                squares += x * x;
            }
            let mean = sum / f64::from(n);
            let error = ((squares / f64::from(n) - mean * mean).max(0.0) / f64::from(n)).sqrt();
            let whole = solid_angle(corners);
            // From close above the triangle, the variance of sampling by area is unbounded.
            if whole < f64::from(MOST) {
                assert!(
                    (mean - whole).abs() < 4.5 * error + 1e-3 * whole,
                    "{corners:?} {:?}: {mean} ± {error}, {whole}",
                    aim.way
                );
            }
        }
    }
}
