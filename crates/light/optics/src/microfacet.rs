//! The isotropic GGX distribution of microfacet normals (Walter et al. 2007, §5.2), sampled by
//! visible normals.
//!
//! Shadowing and masking follow Smith. They are height-correlated for light that stays on one side
//! (Heitz 2014, eq. 99). They are separable for transmitted light, because the heights on the two
//! sides are different (Walter et al. 2007, eq. 23).
//!
//! Invariant: directions are local, normals point up (z > 0), and a sampled normal is visible
//! from `wo`.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

/// Least roughness. Below it, f32 half vectors are coarser than the lobe.
const MIN_ALPHA: f32 = 1e-4;

/// A GGX distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    alpha: f32,
}

impl Ggx {
    /// Returns the distribution of this roughness, at least 1e-4: finer lobes are beyond f32.
    pub fn new(alpha: f32) -> Self {
        Self { alpha: alpha.max(MIN_ALPHA) }
    }

    /// Returns the roughness.
    pub fn alpha(self) -> f32 {
        self.alpha
    }

    /// Returns the density of normals; the integral of its projection is 1.
    #[inline]
    pub fn distribution(self, m: Vec3) -> f32 {
        if m.z <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        // 1 - z² instead of x² + y² would cancel at small alpha.
        let q = (m.x * m.x + m.y * m.y) / a2 + m.z * m.z;
        1.0 / (PI * a2 * q * q)
    }

    /// Returns Smith's Λ: the ratio of hidden to visible facets among those that face `v`, on
    /// either side.
    #[inline]
    fn lambda(self, v: Vec3) -> f32 {
        let tan2 = (v.x * v.x + v.y * v.y) / (v.z * v.z);
        0.5 * ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0)
    }

    /// Returns the visible share of the facets that face `v`, on either side.
    #[inline]
    pub fn masking(self, v: Vec3) -> f32 {
        1.0 / (1.0 + self.lambda(v))
    }

    /// Returns the share of the facets visible from `wo` that `wi`, on the same side, sees too.
    #[inline]
    pub fn shadowing(self, wo: Vec3, wi: Vec3) -> f32 {
        let seen = 1.0 + self.lambda(wo);
        seen / (seen + self.lambda(wi))
    }

    /// Samples a normal that `wo` (z > 0) sees (Dupuy and Benyoub 2023, "Sampling Visible GGX
    /// Normals with Spherical Caps", CGF 42(8)).
    #[inline]
    pub fn sample(self, wo: Vec3, [u, v]: [f32; 2]) -> Vec3 {
        let stretched = Vec3::new(self.alpha * wo.x, self.alpha * wo.y, wo.z).normalize();
        let z = (1.0 - v) * (1.0 + stretched.z) - stretched.z;
        let sine = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = (TAU * u).sin_cos();
        let h = Vec3::new(sine * cos, sine * sin, z) + stretched;
        // Rounding may leave z at 0 if the two are opposite.
        Vec3::new(self.alpha * h.x, self.alpha * h.y, h.z.max(1e-7)).normalize()
    }

    /// Returns the density of [`sample`](Self::sample) per solid angle of normals.
    #[inline]
    pub fn pdf(self, wo: Vec3, m: Vec3) -> f32 {
        self.distribution(m) * self.masking(wo) * wo.dot(m).max(0.0) / wo.z
    }
}
