//! Divides direct light between samples of the lights and samples of the material.
//!
//! Invariant: the weights are those of the power heuristic (Veach 1997, §9.2.2 and §9.2.4), for n
//! samples of the lights and one of the material.

/// How direct light is found. Tests compare the three: each is unbiased if no material is specular.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direct {
    /// By samples of the lights and of the material, combined.
    Both,
    /// By samples of the lights alone.
    Lights,
    /// By samples of the material alone.
    #[cfg_attr(not(test), allow(dead_code, reason = "only for comparison"))]
    Materials,
}

impl Direct {
    /// Returns the weight of light that the material found, from the expected numbers of samples
    /// per solid angle of the material and of the lights.
    #[inline]
    pub(crate) fn material_weight(self, pdf: f32, lights: f32) -> f32 {
        match self {
            Self::Both => power_heuristic(pdf, lights),
            Self::Lights => 0.0,
            Self::Materials => 1.0,
        }
    }

    /// Returns the weight of light that a sample of the lights found, from the same numbers.
    #[inline]
    pub(crate) fn light_weight(self, lights: f32, pdf: f32) -> f32 {
        if self == Self::Lights { 1.0 } else { power_heuristic(lights, pdf) }
    }
}

/// Returns Veach's power heuristic with exponent 2; densities may be so large that squares
/// overflow.
#[inline]
pub(crate) fn power_heuristic(chosen: f32, other: f32) -> f32 {
    let ratio = other / chosen;
    1.0 / (1.0 + ratio * ratio)
}
