//! Local frames and the elementary distributions of directions and points.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

/// A right-handed orthonormal frame whose third axis is a given normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadingFrame {
    pub s: Vec3,
    pub t: Vec3,
    pub n: Vec3,
}

impl ShadingFrame {
    /// Builds a frame without the cancellation near n.z = -1 (Duff et al. 2017, "Building an
    /// Orthonormal Basis, Revisited", JCGT 6(1)).
    #[inline]
    pub(crate) fn new(n: Vec3) -> Self {
        let sign = 1.0_f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    #[inline]
    pub(crate) fn to_local(self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    #[inline]
    pub(crate) fn to_world(self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

/// Maps the unit square to the unit disc, continuously and preserving area (Shirley and Chiu 1997).
#[inline]
pub(crate) fn disc([u, v]: [f32; 2]) -> [f32; 2] {
    let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let wide = x.abs() > y.abs();
    let (radius, other) = if wide { (x, y) } else { (y, x) };
    if radius == 0.0 {
        return [0.0, 0.0];
    }
    let (sin, cos) = sin_cos_eighth(PI / 4.0 * (other / radius));
    if wide { [radius * cos, radius * sin] } else { [radius * sin, radius * cos] }
}

/// Returns sine and cosine of an angle of at most π/4, within 1e-7. Polynomials of Cephes's `sinf`
/// and `cosf`; calling the library instead took 3 % of a path's time.
#[inline]
fn sin_cos_eighth(angle: f32) -> (f32, f32) {
    let z = angle * angle;
    let sin = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * angle + angle;
    let cos = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
    (sin, cos)
}

/// Returns a cosine-weighted direction of the hemisphere around +z, with density [`cosine_pdf`].
#[inline]
pub(crate) fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let [x, y] = disc(u);
    Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// Returns the density of [`cosine_hemisphere`] per solid angle.
#[inline]
pub(crate) fn cosine_pdf(cosine: f32) -> f32 {
    cosine.max(0.0) * FRAC_1_PI
}

/// Returns a uniform point of a triangle: the weights of its second and third vertex.
#[inline]
pub(crate) fn triangle([u, v]: [f32; 2]) -> (f32, f32) {
    let root = u.sqrt();
    (root * (1.0 - v), root * v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::Sampler;

    #[test]
    fn frames_are_orthonormal_for_every_normal() {
        let mut s = Sampler::new(1, 0);
        for i in 0..10_000 {
            let n = match i {
                0 => Vec3::Z,
                1 => -Vec3::Z,
                _ => {
                    let v = Vec3::new(s.one() - 0.5, s.one() - 0.5, s.one() - 0.5);
                    // Half of them close to an axis, where frames from cross products are inexact.
                    (if i % 2 == 0 { v * Vec3::new(1e-5, 1e-4, 1.0) } else { v }).normalize()
                }
            };
            let f = ShadingFrame::new(n);
            let near = |a: f32, b: f32| (a - b).abs() < 4e-7;
            assert!(near(f.s.length(), 1.0) && near(f.t.length(), 1.0), "{n}");
            assert!(
                near(f.s.dot(f.t), 0.0) && near(f.s.dot(n), 0.0) && near(f.t.dot(n), 0.0),
                "{n}"
            );
            assert!(f.s.cross(f.t).dot(n) > 0.99);
        }
    }

    #[test]
    fn sines_and_cosines_are_right_to_the_last_bits() {
        for i in -100_000..=100_000 {
            let angle = PI / 4.0 * (i as f32 / 100_000.0);
            let (sin, cos) = sin_cos_eighth(angle);
            assert!((f64::from(sin) - f64::from(angle).sin()).abs() < 1e-7, "{angle}");
            assert!((f64::from(cos) - f64::from(angle).cos()).abs() < 1e-7, "{angle}");
        }
    }

    #[test]
    fn points_on_a_triangle_are_uniform() {
        // Each sub-triangle of the 4-by-4 subdivision has 1/16 of the area. Chi² with 15 degrees:
        // 44.3 is exceeded with probability 1e-4.
        let mut counts = [0_u32; 16];
        let n = 160_000;
        let mut s = Sampler::new(2, 0);
        for _ in 0..n {
            let (u, v) = triangle(s.two());
            let (i, j) = ((u * 4.0) as usize, (v * 4.0) as usize);
            let upper = usize::from(u * 4.0 - i as f32 + v * 4.0 - j as f32 > 1.0);
            // Row j has 7 - 2j sub-triangles.
            counts[(0..j).map(|r| 7 - 2 * r).sum::<usize>() + 2 * i + upper] += 1;
        }
        let expected = f64::from(n) / 16.0;
        let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
        assert!(chi2 < 44.3, "{chi2} {counts:?}");
    }
}
