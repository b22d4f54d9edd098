//! Materials as the store sees them: what radiance is divided by before it is kept, and multiplied
//! by before it is shown.
//!
//! Invariant: both are the same number, and it is never near 0.

use holo_scene::{Bsdf, Material, Rgb, Scene};

/// The least reflectance. A black surface shows nothing of the light on it.
const LEAST_REFLECTANCE: f32 = 0.02;

/// The greatest GGX roughness of a metal that is shown as a mirror.
const SMOOTH_METAL: f32 = 0.05;

/// The brightest light of the scene, in fixed-point steps.
const STEPS: f32 = (1_u64 << 26) as f32;

/// How a surface shows light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    /// It keeps light, the same for all directions.
    Diffuse,
    /// It keeps light for each range of directions.
    Glossy,
    /// It mirrors rays, and this share of their light.
    Mirror(Rgb),
    /// It is a thin pane: rays go straight on, and are mirrored too.
    Pane {
        /// Index of refraction.
        ior: f32,
        /// The share of light that goes through.
        transmittance: Rgb,
    },
}

/// A material as the store sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Finish {
    pub kind: Kind,
    /// 0 if stored light is all light that reaches a surface. Otherwise it depends on the material,
    /// and this is one more than the material's number.
    pub light: u32,
    /// The ratio of radiance to stored light.
    pub reflectance: Rgb,
    /// Radiance that the front emits. If `emits_back`, the back emits it too.
    pub emission: Rgb,
    pub emits: bool,
    pub emits_back: bool,
    /// The GGX roughness of metal that is no mirror.
    pub rough: Option<f32>,
}

/// The materials of a scene, and the unit of light.
#[derive(Debug)]
pub struct Materials {
    pub(crate) finishes: Vec<Finish>,
    pub(crate) sky: Rgb,
    /// The light of one fixed-point step, a power of two.
    pub(crate) unit: f32,
}

impl Finish {
    /// `is_even`: whether what the material reflects looks the same everywhere. Otherwise it is no
    /// mirror to follow rays through.
    fn new(material: &Material, is_even: bool) -> Finish {
        let at_least = |colour: Rgb| colour.map(|c| c.max(LEAST_REFLECTANCE));
        let (kind, reflectance) = match material.bsdf {
            Bsdf::Mirror { ks } | Bsdf::Conductor { ks, .. } if !is_even => {
                (Kind::Glossy, at_least(ks))
            }
            Bsdf::Diffuse { kd } => (Kind::Diffuse, at_least(kd)),
            Bsdf::Mirror { ks } => (Kind::Mirror(ks), [1.0; 3]),
            Bsdf::Conductor { ks, alpha } if alpha <= SMOOTH_METAL => (Kind::Mirror(ks), [1.0; 3]),
            Bsdf::Conductor { ks, .. } => (Kind::Glossy, at_least(ks)),
            Bsdf::ThinGlass { ior, transmittance } => (Kind::Pane { ior, transmittance }, [1.0; 3]),
            Bsdf::Dielectric { .. } | Bsdf::Coated { .. } => (Kind::Glossy, [1.0; 3]),
        };
        Finish {
            kind,
            light: 0,
            reflectance,
            emission: material.emission,
            emits: material.emits(),
            emits_back: material.two_sided_emission,
            rough: match (kind, material.bsdf) {
                (Kind::Glossy, Bsdf::Conductor { alpha, .. }) => Some(alpha),
                (Kind::Glossy, Bsdf::Mirror { .. }) => Some(SMOOTH_METAL),
                _ => None,
            },
        }
    }

    /// Returns the ratio of radiance to stored light where a texture has this factor.
    pub fn reflectance_by(&self, texture: Rgb) -> Rgb {
        std::array::from_fn(|c| (self.reflectance[c] * texture[c]).max(LEAST_REFLECTANCE))
    }

    /// Returns whether this side emits light.
    pub fn shines(&self, front: bool) -> bool {
        self.emits && (front || self.emits_back)
    }
}

impl Materials {
    /// Returns the materials of a scene.
    #[must_use]
    pub fn new(scene: &Scene) -> Materials {
        let suns = scene.suns.iter().flat_map(|sun| sun.irradiance);
        let lights = scene.materials.iter().flat_map(|m| m.emission).chain(scene.sky).chain(suns);
        let brightest = lights.fold(0.0, f32::max);
        // A power of two scales without rounding.
        let unit =
            if brightest > 0.0 { brightest.log2().ceil().exp2() / STEPS } else { 1.0 / STEPS };
        let finish = |(id, material)| {
            let finish = Finish::new(material, scene.has_even_finish(id));
            let light = if finish.kind == Kind::Glossy { id as u32 + 1 } else { 0 };
            Finish { light, ..finish }
        };
        let finishes = scene.materials.iter().enumerate().map(finish).collect();
        Materials { finishes, sky: scene.sky, unit }
    }
}

/// Returns the share of unpolarised light that a thin pane reflects at this cosine, over all passes
/// between its faces.
pub(crate) fn pane_reflectance(cosine: f32, ior: f32) -> f32 {
    let inside = (1.0 - (1.0 - cosine * cosine) / (ior * ior)).max(0.0).sqrt();
    let parallel = (ior * cosine - inside) / (ior * cosine + inside);
    let across = (cosine - ior * inside) / (cosine + ior * inside);
    let once = 0.5 * (parallel * parallel + across * across);
    2.0 * once / (1.0 + once)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_with_bumps_is_no_mirror_to_follow_rays_through() {
        let ks = [0.9, 0.5, 0.01];
        for bsdf in [Bsdf::Mirror { ks }, Bsdf::Conductor { ks, alpha: 0.01 }] {
            let mirror = Material { bsdf, ..Material::grey("mirror") };
            assert_eq!(Finish::new(&mirror, true).kind, Kind::Mirror(ks));
            let bumpy = Finish::new(&mirror, false);
            assert_eq!((bumpy.kind, bumpy.reflectance), (Kind::Glossy, [0.9, 0.5, 0.02]));
        }
    }
}
