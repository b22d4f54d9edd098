//! Cones of directions, for bounding the normals of emitters.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};

/// All directions within `angle` (radians, at most π) of the unit vector `axis`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cone {
    pub axis: Vec3,
    pub angle: f32,
}

impl Cone {
    /// Returns a cone that contains both (Pharr et al. 2023, §3.8.4).
    pub(crate) fn union(self, other: Self) -> Self {
        // The union of equal cones is exactly the same cone, so that flat groups stay flat.
        if self == other {
            return self;
        }
        let apart = between(self.axis, other.axis);
        if (apart + other.angle).min(PI) <= self.angle {
            return self;
        }
        if (apart + self.angle).min(PI) <= other.angle {
            return other;
        }
        // Wider by half a step of f32 angles, because these are rounded.
        let angle = 0.5 * (self.angle + apart + other.angle) + 1e-6;
        let across = self.axis.cross(other.axis);
        if across.length_squared() < 1e-8 {
            // No plane to turn in: the axes are nearly equal or opposite.
            return Self {
                axis: self.axis,
                angle: (apart + other.angle.max(self.angle) + 1e-6).min(PI),
            };
        }
        if angle >= PI {
            return Self { axis: self.axis, angle: PI };
        }
        let turn = Quat::from_axis_angle(across.normalize(), angle - self.angle);
        Self { axis: (turn * self.axis).normalize(), angle }
    }

    /// Returns the cosine-weighted solid angle into which emitters with these normals emit (Conty
    /// Estevez and Kulla 2018, eq. 1). Each normal has an emission of π/2 around it.
    pub(crate) fn measure(self) -> f32 {
        let (o, w) = (self.angle, (self.angle + FRAC_PI_2).min(PI));
        let (sin, cos) = o.sin_cos();
        2.0 * PI * (1.0 - cos)
            + FRAC_PI_2 * (2.0 * w * sin - (o - 2.0 * w).cos() - 2.0 * o * sin + cos)
    }
}

/// Returns the angle between unit vectors in radians. An arc cosine would lose small angles.
fn between(a: Vec3, b: Vec3) -> f32 {
    let (a, b) = (a.as_dvec3(), b.as_dvec3());
    a.cross(b).length().atan2(a.dot(b)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::Sampler;

    #[test]
    fn a_union_holds_both_cones() {
        let mut s = Sampler::new(4, 0);
        let direction = |s: &mut Sampler| {
            let v = Vec3::new(s.one() - 0.5, s.one() - 0.5, s.one() - 0.5);
            v.try_normalize().unwrap_or(Vec3::Z)
        };
        for i in 0..5_000 {
            let tiny = if i % 3 == 0 { 1e-5 } else { 1.0 };
            let a = Cone { axis: direction(&mut s), angle: s.one() * s.one() * PI * tiny };
            let axis = match i % 4 {
                0 => (a.axis + direction(&mut s) * 1e-4).normalize(),
                1 => -a.axis,
                _ => direction(&mut s),
            };
            let b = Cone { axis, angle: s.one() * s.one() * PI * tiny };
            let union = a.union(b);
            for cone in [a, b] {
                // The direction of the cone that is farthest from the union's axis.
                let across = union
                    .axis
                    .cross(cone.axis)
                    .try_normalize()
                    .unwrap_or(union.axis.any_orthonormal_vector());
                let rim = Quat::from_axis_angle(across, cone.angle) * cone.axis;
                let most = if between(union.axis, cone.axis) + cone.angle >= PI {
                    PI
                } else {
                    between(union.axis, rim)
                };
                // Rotations in f32.
                assert!(most <= union.angle + 2e-6, "{a:?} {b:?} {union:?} {most}");
            }
        }
    }

    #[test]
    fn the_measure_of_one_normal_is_pi_and_grows_to_the_sphere() {
        let of = |angle| Cone { axis: Vec3::Z, angle }.measure();
        assert!((of(0.0) - PI).abs() < 1e-5 && (of(PI) - 4.0 * PI).abs() < 1e-4);
        assert!((0..30).all(|i| of(i as f32 * 0.1) < of((i + 1) as f32 * 0.1)));
    }
}
