//! Materials: how a surface scatters light, and what it emits.
//!
//! A material of a [`crate::Scene`] is plausible. Colours and roughness lie in [0, 1], the index of
//! refraction lies in [`MIN_IOR`]..=[`MAX_IOR`], and radiance is finite and not negative.

use crate::SceneError;
use crate::limits::{MAX_IOR, MAX_NAME_BYTES, MAX_RADIANCE, MIN_IOR};
use serde::Serialize;

/// A linear RGB triple: reflectance or transmittance in [0, 1], or radiance in W·sr⁻¹·m⁻².
pub type Rgb = [f32; 3];

/// One material of a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Material {
    /// Its name in the MTL file.
    pub name: String,
    /// Its scattering.
    pub bsdf: Bsdf,
    /// Radiance that it emits, in W·sr⁻¹·m⁻², on the side from which the corners appear
    /// counter-clockwise.
    pub emission: Rgb,
    /// True if it emits on the other side too.
    pub two_sided_emission: bool,
}

/// The scattering of light by a surface. Both sides of opaque kinds are the same.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Bsdf {
    /// Lambertian reflection.
    Diffuse {
        /// Albedo.
        kd: Rgb,
    },
    /// A perfect mirror.
    Mirror {
        /// Reflectance, the same at all angles.
        ks: Rgb,
    },
    /// A rough metal: GGX without Fresnel.
    Conductor {
        /// Reflectance, the same at all angles.
        ks: Rgb,
        /// GGX roughness, in (0, 1].
        alpha: f32,
    },
    /// A thin pane with two parallel faces. Light passes it straight or is reflected.
    ThinGlass {
        /// Index of refraction.
        ior: f32,
        /// Colour of transmitted light; reflection is uncoloured.
        transmittance: Rgb,
    },
    /// The boundary of a solid, whose inside is on the clockwise side.
    Dielectric {
        /// Index of refraction inside, relative to air. If below 1, relative to the surroundings of
        /// the solid.
        ior: f32,
        /// Colour of transmitted light; reflection is uncoloured.
        transmittance: Rgb,
        /// GGX roughness in [0, 1]; 0 is smooth.
        alpha: f32,
    },
    /// A diffuse base below a rough dielectric coat.
    Coated {
        /// Albedo of the base.
        kd: Rgb,
        /// Colour of the coat's reflection, a factor to Fresnel's.
        ks: Rgb,
        /// Index of refraction of the coat.
        ior: f32,
        /// GGX roughness of the coat, in (0, 1].
        alpha: f32,
    },
}

impl Material {
    /// Returns a grey diffuse material of albedo 0.5 without emission, for files that name no
    /// existing material.
    pub fn grey(name: impl Into<String>) -> Material {
        Material {
            name: name.into(),
            bsdf: Bsdf::Diffuse { kd: [0.5; 3] },
            emission: [0.0; 3],
            two_sided_emission: false,
        }
    }

    /// Returns whether it emits any light.
    pub fn emits(&self) -> bool {
        self.emission.iter().any(|&e| e > 0.0)
    }

    /// Checks that the material is plausible.
    ///
    /// # Errors
    /// [`SceneError::Material`] names the material and the value that is not plausible.
    pub fn validate(&self) -> Result<(), SceneError> {
        match self.problem() {
            None => Ok(()),
            Some(problem) => {
                let name = self.name.chars().take(64).collect();
                Err(SceneError::Material { name, problem })
            }
        }
    }

    fn problem(&self) -> Option<&'static str> {
        if self.name.len() > MAX_NAME_BYTES {
            return Some("its name is too long");
        }
        if !is_radiance(self.emission) {
            return Some("its emission is negative, not finite or too large");
        }
        let (colours, ior, alpha) = match self.bsdf {
            Bsdf::Diffuse { kd } => ([kd, kd], 1.0, (0.0, 0.0)),
            Bsdf::Mirror { ks } => ([ks, ks], 1.0, (0.0, 0.0)),
            Bsdf::Conductor { ks, alpha } => ([ks, ks], 1.0, (alpha, f32::MIN_POSITIVE)),
            Bsdf::ThinGlass { ior, transmittance } => ([transmittance; 2], ior, (0.0, 0.0)),
            Bsdf::Dielectric { ior, transmittance, alpha } => {
                ([transmittance; 2], ior, (alpha, 0.0))
            }
            Bsdf::Coated { kd, ks, ior, alpha } => ([kd, ks], ior, (alpha, f32::MIN_POSITIVE)),
        };
        if !colours.iter().flatten().all(|c| (0.0..=1.0).contains(c)) {
            return Some("a colour is outside [0, 1]");
        }
        if !(MIN_IOR..=MAX_IOR).contains(&ior) {
            return Some("its index of refraction is impossible");
        }
        let (alpha, least) = alpha;
        if !(least..=1.0).contains(&alpha) {
            return Some("its roughness is outside [0, 1], or 0 where it must be positive");
        }
        None
    }
}

/// Returns whether all channels are finite and from 0 to [`MAX_RADIANCE`].
pub(crate) fn is_radiance(colour: Rgb) -> bool {
    colour.iter().all(|c| (0.0..=MAX_RADIANCE).contains(c))
}
