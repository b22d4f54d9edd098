//! What rays show that meet nothing.

use std::fmt;
use std::sync::Arc;

use glam::DVec3;

/// What a person sees along rays that meet nothing. Drivers know no more of a sky than this.
#[derive(Clone)]
pub enum SkyView {
    /// The same radiance in every direction.
    Even([f32; 3]),
    /// The radiance from each unit direction.
    Varying(Arc<dyn Fn(DVec3) -> [f32; 3] + Send + Sync>),
}

impl SkyView {
    /// Returns the radiance from a unit direction, W·sr⁻¹·m⁻².
    #[inline]
    pub fn along(&self, direction: DVec3) -> [f32; 3] {
        match self {
            Self::Even(radiance) => *radiance,
            Self::Varying(sky) => sky(direction),
        }
    }
}

impl Default for SkyView {
    /// Returns a black sky.
    fn default() -> Self {
        Self::Even([0.0; 3])
    }
}

impl From<[f32; 3]> for SkyView {
    fn from(radiance: [f32; 3]) -> Self {
        Self::Even(radiance)
    }
}

impl fmt::Debug for SkyView {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Even(radiance) => f.debug_tuple("Even").field(radiance).finish(),
            Self::Varying(_) => f.write_str("Varying"),
        }
    }
}
