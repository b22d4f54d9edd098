//! The isotropic GGX distribution of microfacet normals (Walter et al. 2007, §5.2), sampled by visible normals.
//!
//! Shadowing and masking are Smith's, separable (G = G₁G₁) and not height-correlated, since the pictures that this engine
//! is judged against are made so (Mitsuba 3, `microfacet.h`). Directions are local, normals point up (z > 0).

use std::f32::consts::PI;

use glam::Vec3;

use crate::geometry::disc;

/// Least roughness: below it f32 half vectors are coarser than the lobe.
const MIN_ALPHA: f32 = 1e-4;

/// A GGX distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ggx {
    alpha: f32,
}

impl Ggx {
    pub(crate) fn new(alpha: f32) -> Self {
        Self { alpha: alpha.max(MIN_ALPHA) }
    }

    /// Density of normals: its projection integrates to 1.
    #[inline]
    pub(crate) fn distribution(self, m: Vec3) -> f32 {
        if m.z <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        // Without 1 - z²: at small alpha that cancels.
        let q = (m.x * m.x + m.y * m.y) / a2 + m.z * m.z;
        1.0 / (PI * a2 * q * q)
    }

    /// Share of the facets of normal `m` that `v` sees, either side.
    #[inline]
    pub(crate) fn masking(self, v: Vec3, m: Vec3) -> f32 {
        if v.dot(m) * v.z <= 0.0 {
            return 0.0;
        }
        let tan2 = (v.x * v.x + v.y * v.y) / (v.z * v.z);
        2.0 / (1.0 + (1.0 + self.alpha * self.alpha * tan2).sqrt())
    }

    /// A normal that `wo` (z > 0) sees (Heitz 2018, "Sampling the GGX Distribution of Visible Normals", JCGT 7(4)).
    #[inline]
    pub(crate) fn sample(self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        let v = Vec3::new(self.alpha * wo.x, self.alpha * wo.y, wo.z).normalize();
        let length2 = v.x * v.x + v.y * v.y;
        let t1 = if length2 > 0.0 { Vec3::new(-v.y, v.x, 0.0) / length2.sqrt() } else { Vec3::X };
        let t2 = v.cross(t1);
        let [p1, p2] = disc(u);
        let s = 0.5 * (1.0 + v.z);
        let p2 = (1.0 - s) * (1.0 - p1 * p1).max(0.0).sqrt() + s * p2;
        let n = t1 * p1 + t2 * p2 + v * (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt();
        Vec3::new(self.alpha * n.x, self.alpha * n.y, n.z.max(1e-6)).normalize()
    }

    /// Density of [`sample`](Self::sample) per solid angle of normals.
    #[inline]
    pub(crate) fn pdf(self, wo: Vec3, m: Vec3) -> f32 {
        self.distribution(m) * self.masking(wo, m) * wo.dot(m).max(0.0) / wo.z
    }
}
