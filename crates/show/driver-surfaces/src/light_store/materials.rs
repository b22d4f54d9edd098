//! Materials as the store needs them: radiance is divided by a factor before it is stored, and
//! multiplied by it before it is shown.
//!
//! Invariant: both factors are the same number, which is never near 0.

use super::cell::luminance;
use glam::Vec3;
use holo_scene::{Bsdf, Material, Rgb, Scene, Sky};
use std::sync::OnceLock;

/// Least reflectance. Samples of a black surface show nothing of the light on it.
pub(crate) const LEAST_REFLECTANCE: f32 = 0.02;

/// Greatest GGX roughness of a metal that counts as a mirror.
const SMOOTH_METAL: f32 = 0.05;

/// Share of the light of sky and suns that is expected on a surface of which nothing is known.
const DAYLIGHT: f32 = 0.2;

/// Least share of light that surfaces are expected to absorb.
const LEAST_ABSORBED: f64 = 0.05;

/// Brightest light of the scene, in fixed-point steps.
const STEPS: f32 = (1_u64 << 26) as f32;

/// Relative difference of the sky in two directions that is an edge in a picture: that of the sun
/// or the horizon.
const SKY_STEP: f32 = 0.2;

/// How a surface shows light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum MaterialClass {
    /// Stores light that is the same in all directions.
    Diffuse,
    /// Stores light for each range of directions.
    Glossy,
    /// Mirrors rays and this share of their light. It stores no light.
    Mirror(Rgb),
    /// A thin pane: rays go straight on, and are also reflected.
    Pane {
        /// Index of refraction.
        ior: f32,
        /// The share of light that passes.
        transmittance: Rgb,
    },
    /// The smooth boundary of solid glass: rays are bent, and are also reflected.
    Solid {
        /// Index of refraction.
        ior: f32,
        /// The share of light that passes each surface.
        transmittance: Rgb,
    },
}

/// A material as the store needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Finish {
    pub kind: MaterialClass,
    /// Surfaces share light only if this number is the same. It is 0 if the stored light does not
    /// depend on the material, and otherwise the material's number plus one.
    pub light: u32,
    /// The ratio of radiance to stored light.
    pub reflectance: Rgb,
    /// Radiance that the front emits, and also the back if `emits_back`.
    pub emission: Rgb,
    pub emits: bool,
    pub emits_back: bool,
    /// The GGX roughness of a metal that is too rough for a mirror.
    pub rough: Option<f32>,
    /// True if a clear coat covers a diffuse surface.
    pub is_coated: bool,
    /// The share of light that passes each surface of rough solid glass.
    pub clear: Option<Rgb>,
}

/// The materials of a scene, and the unit of light.
#[derive(Debug)]
pub struct Materials {
    pub(crate) finishes: Vec<Finish>,
    sky: Sky,
    /// Light of one fixed-point step; a power of two.
    pub(crate) unit: f32,
    /// See [`expected_light`](Self::expected_light).
    expected: OnceLock<Rgb>,
}

impl Finish {
    /// Returns the finish of a material. If `is_even` is false, what it reflects varies from place
    /// to place, or it is glass in part, and rays are not followed through it.
    fn new(material: &Material, is_even: bool) -> Finish {
        let at_least = |colour: Rgb| colour.map(|c| c.max(LEAST_REFLECTANCE));
        let (kind, reflectance) = match material.bsdf {
            Bsdf::Mirror { ks } | Bsdf::Conductor { ks, .. } if !is_even => {
                (MaterialClass::Glossy, at_least(ks))
            }
            Bsdf::Diffuse { kd } => (MaterialClass::Diffuse, at_least(kd)),
            Bsdf::Mirror { ks } => (MaterialClass::Mirror(ks), [1.0; 3]),
            Bsdf::Conductor { ks, alpha } if alpha <= SMOOTH_METAL => {
                (MaterialClass::Mirror(ks), [1.0; 3])
            }
            Bsdf::Conductor { ks, .. } => (MaterialClass::Glossy, at_least(ks)),
            Bsdf::ThinGlass { .. } if !is_even => (MaterialClass::Glossy, [1.0; 3]),
            Bsdf::ThinGlass { ior, transmittance } => {
                (MaterialClass::Pane { ior, transmittance }, [1.0; 3])
            }
            Bsdf::Dielectric { ior, transmittance, alpha: 0.0 } if is_even => {
                (MaterialClass::Solid { ior, transmittance }, [1.0; 3])
            }
            Bsdf::Dielectric { .. } => (MaterialClass::Glossy, [1.0; 3]),
            Bsdf::Coated { kd, ks, ior, .. } => {
                let coat = ((ior - 1.0) / (ior + 1.0)).powi(2);
                let both = |c: usize| kd[c] + coat * (ks[c] - kd[c]);
                (MaterialClass::Glossy, at_least([0, 1, 2].map(both)))
            }
        };
        Finish {
            kind,
            light: 0,
            reflectance,
            emission: material.emission,
            emits: material.emits(),
            emits_back: material.two_sided_emission,
            rough: match (kind, material.bsdf) {
                (MaterialClass::Glossy, Bsdf::Conductor { alpha, .. }) => Some(alpha),
                (MaterialClass::Glossy, Bsdf::Mirror { .. }) => Some(SMOOTH_METAL),
                _ => None,
            },
            is_coated: matches!(material.bsdf, Bsdf::Coated { .. }),
            clear: match (kind, material.bsdf) {
                (MaterialClass::Glossy, Bsdf::Dielectric { transmittance, .. }) => {
                    Some(transmittance)
                }
                _ => None,
            },
        }
    }

    /// Returns the ratio of radiance to stored light if the texture has this factor.
    pub fn reflectance_by(&self, texture: Rgb) -> Rgb {
        std::array::from_fn(|c| (self.reflectance[c] * texture[c]).max(LEAST_REFLECTANCE))
    }

    /// Returns true if this side emits light.
    pub fn shines(&self, front: bool) -> bool {
        self.emits && (front || self.emits_back)
    }
}

/// Returns the greatest light that surfaces can show by a sky. A bright spot of a sky that differs
/// by direction lights a surface by its share only: its irradiance is at most 4π times the mean.
fn most_of_sky(sky: &Sky) -> Rgb {
    sky.as_even().unwrap_or_else(|| sky.mean().map(|channel| 4.0 * channel))
}

impl Materials {
    /// Returns the materials of a scene.
    #[must_use]
    pub fn new(scene: &Scene) -> Materials {
        let suns = scene.all_suns().flat_map(|sun| sun.irradiance);
        let sky = most_of_sky(&scene.sky);
        let lights = scene.materials.iter().flat_map(|m| m.emission).chain(sky).chain(suns);
        let brightest = lights.fold(0.0, f32::max);
        // Scaling by a power of two does not round.
        let unit =
            if brightest > 0.0 { brightest.log2().ceil().exp2() / STEPS } else { 1.0 / STEPS };
        let finish = |(id, material)| {
            let is_even = scene.has_even_finish(id) && scene.base(id).is_none();
            let finish = Finish::new(material, is_even);
            let light = if finish.kind == MaterialClass::Glossy { id as u32 + 1 } else { 0 };
            Finish { light, ..finish }
        };
        let finishes = scene.materials.iter().enumerate().map(finish).collect();
        Materials { finishes, sky: scene.sky.clone(), unit, expected: OnceLock::new() }
    }

    /// Returns the light that surfaces of `scene` have on average, radiance of a white surface. It
    /// is that in a closed box with the same lamps, areas and reflectances (an integrating sphere),
    /// and a share of the sky's and the suns' light. `scene` must be that of [`new`](Self::new).
    ///
    /// It is computed once, and only if a view is drawn before any light is known.
    pub(crate) fn expected_light(&self, scene: &Scene) -> Rgb {
        *self.expected.get_or_init(|| {
            let (mut area, mut reflected, mut power) = (0.0, [0.0; 3], [0.0; 3]);
            for triangle in scene.triangles() {
                let here = scene.area(triangle);
                let finish = &self.finishes[scene.material_id(triangle) as usize];
                let sides = if finish.emits_back { 2.0 } else { 1.0 };
                area += here;
                for c in 0..3 {
                    reflected[c] += here * f64::from(finish.reflectance[c].min(1.0));
                    power[c] += sides * here * f64::from(finish.emission[c]);
                }
            }
            for light in &scene.punctual_lights {
                // A sphere of this radiant intensity has 4π of it as power, and a face π of its
                // radiance and area.
                (0..3).for_each(|c| power[c] += 4.0 * f64::from(light.intensity[c]));
            }
            let sky = scene.sky.mean();
            let light = [0, 1, 2].map(|c| {
                let suns: f32 = scene.suns.iter().map(|sun| sun.irradiance[c]).sum();
                let outside = DAYLIGHT * (sky[c] + suns / std::f32::consts::PI);
                let absorbed = (area - reflected[c]).max(LEAST_ABSORBED * area);
                let lamps = if absorbed > 0.0 { power[c] / absorbed } else { 0.0 };
                outside + lamps as f32
            });
            // How the colours of sky and lamps mix is unknown.
            [luminance(light); 3]
        })
    }

    /// Returns what a person sees of the sky in a unit direction, the disc of its sun included.
    pub(crate) fn sky_seen(&self, direction: Vec3) -> Rgb {
        self.sky.seen(direction.as_dvec3().normalize_or_zero())
    }

    /// Returns the light of the sky from a unit direction without its sun.
    pub(crate) fn sky_light(&self, direction: Vec3) -> Vec3 {
        self.sky.radiance(direction.as_dvec3().normalize_or_zero()).into()
    }

    /// Returns whether the sky looks alike in two directions.
    pub(crate) fn is_sky_alike(&self, a: Vec3, b: Vec3) -> bool {
        if self.sky.is_plain() {
            return true;
        }
        let (a, b) = (self.sky_seen(a), self.sky_seen(b));
        (0..3).all(|k| (a[k] - b[k]).abs() <= SKY_STEP * a[k].max(b[k]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_with_bumps_is_no_mirror_to_follow_rays_through() {
        let ks = [0.9, 0.5, 0.01];
        for bsdf in [Bsdf::Mirror { ks }, Bsdf::Conductor { ks, alpha: 0.01 }] {
            let mirror = Material { bsdf, ..Material::grey("mirror") };
            assert_eq!(Finish::new(&mirror, true).kind, MaterialClass::Mirror(ks));
            let bumpy = Finish::new(&mirror, false);
            assert_eq!((bumpy.kind, bumpy.reflectance), (MaterialClass::Glossy, [0.9, 0.5, 0.02]));
        }
    }
}
