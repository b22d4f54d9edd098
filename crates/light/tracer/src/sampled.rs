//! The result of sampling a material.

use glam::Vec3;

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampled {
    pub wi: Vec3,
    /// Value over density.
    pub weight: Vec3,
    /// Density per solid angle. `None` for a direction without a density (mirror, smooth glass).
    pub pdf: Option<f32>,
    /// Squared index of refraction beyond the surface over the one before it; 1 unless the
    /// direction refracts into or out of a solid.
    pub eta2: f32,
}

impl Sampled {
    /// Returns a direction without a density.
    #[inline]
    pub(crate) fn delta(wi: Vec3, weight: Vec3) -> Option<Self> {
        Some(Self { wi, weight, pdf: None, eta2: 1.0 })
    }
}
