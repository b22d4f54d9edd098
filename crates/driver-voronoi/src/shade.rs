//! What is kept of a surface's samples, and how it becomes light again.
//!
//! Of diffuse surfaces the light that falls on them is kept: radiance over albedo, the same in all directions. Of others the
//! radiance itself, by samples that look along the eye's ray, as exactly as the surface is polished.
//!
//! Invariant: what is divided by is what is multiplied by, and never near 0.

use super::surfaces::SMOOTH_METAL;
use holo_scene::{Bsdf, Material, Rgb, Scene};

/// Albedos below this are taken as this: a black surface shows nothing of the light on it.
const LEAST_ALBEDO: f32 = 0.02;

/// Weight of a sample along the eye's ray.
pub(crate) const FULL_WEIGHT: u64 = 4096;

/// How samples of a material are used.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shading {
    /// Kept value times this is radiance.
    pub scale: Rgb,
    /// Tangent of the angle to the eye's ray at which a sample has half the weight; 0 if all have the same.
    pub spread: f32,
    /// Radiance that the surface emits towards the eye on its front: shown where there are no samples.
    pub emission: Rgb,
    pub emits: bool,
    /// Lit the same from everywhere, and not a lamp.
    pub is_diffuse: bool,
    /// Mean albedo over what `scale` takes it to be: 1 unless it is nearly black.
    pub albedo_share: f32,
    /// A smooth metal: nearly a mirror.
    pub reflects: bool,
}

impl Shading {
    pub fn new(material: &Material) -> Shading {
        let alike = |spread| ([1.0; 3], spread);
        let (scale, spread) = match material.bsdf {
            // What a lamp reflects is lost in the rounding of its own light: its radiance is kept as it is.
            _ if material.emits() => alike(0.0),
            Bsdf::Diffuse { kd } => (kd.map(|albedo| albedo.max(LEAST_ALBEDO)), 0.0),
            Bsdf::Conductor { alpha, .. } => alike(0.02 + 0.2 * alpha),
            Bsdf::Coated { alpha, .. } => alike(0.05 + 0.3 * alpha),
            Bsdf::Dielectric { alpha, .. } => alike(0.02 + 0.2 * alpha),
            Bsdf::Mirror { .. } | Bsdf::ThinGlass { .. } => alike(0.02),
        };
        let is_smooth =
            matches!(material.bsdf, Bsdf::Conductor { alpha, .. } if alpha <= SMOOTH_METAL);
        let is_diffuse = matches!(material.bsdf, Bsdf::Diffuse { .. }) && !material.emits();
        let albedo_share = match material.bsdf {
            Bsdf::Diffuse { kd } if is_diffuse => {
                (kd.iter().sum::<f32>() / scale.iter().sum::<f32>()).min(1.0)
            }
            _ => 1.0,
        };
        Shading {
            is_diffuse,
            albedo_share,
            scale,
            spread,
            emission: material.emission,
            emits: material.emits(),
            reflects: is_smooth && !material.emits(),
        }
    }

    /// Weight of a sample that looks along `direction` (any length) where the eye looks along `eye`.
    #[inline]
    pub fn weight(&self, direction: glam::Vec3, eye: glam::Vec3) -> u64 {
        if self.spread == 0.0 {
            return FULL_WEIGHT;
        }
        let along = direction.dot(eye);
        if along <= 0.0 {
            return 0;
        }
        let tangent = direction.cross(eye).length() / along / self.spread;
        (FULL_WEIGHT as f32 / (1.0 + tangent * tangent * tangent)) as u64
    }
}

/// All materials of a scene, and the unit of fixed-point light.
pub(crate) struct Shadings {
    pub materials: Vec<Shading>,
    pub sky: Rgb,
    /// What a ray of the view itself shows that meets nothing: the sky, black if that is clipped.
    pub nothing: Rgb,
    /// Radiance of one step.
    pub unit: f32,
}

/// Steps of the brightest light in the scene.
const STEPS: f32 = (1_u64 << 26) as f32;

impl Shadings {
    /// `clips_sky`: whether the view shows black instead of the sky.
    pub fn new(scene: &Scene, clips_sky: bool) -> Shadings {
        let brightest = scene
            .materials
            .iter()
            .flat_map(|material| material.emission)
            .chain(scene.sky)
            .chain(scene.suns.iter().flat_map(|sun| sun.irradiance))
            .fold(0.0, f32::max);
        // A power of two: it scales without rounding.
        let unit =
            if brightest > 0.0 { brightest.log2().ceil().exp2() / STEPS } else { STEPS.recip() };
        let nothing = if clips_sky { [0.0; 3] } else { scene.sky };
        Shadings {
            materials: scene
                .materials
                .iter()
                .enumerate()
                .map(|(id, material)| {
                    let shading = Shading::new(material);
                    let reflects = shading.reflects && scene.has_even_finish(id);
                    Shading { reflects, ..shading }
                })
                .collect(),
            sky: scene.sky,
            nothing,
            unit,
        }
    }

    /// Radiance of a material in this light.
    #[inline]
    pub fn lit(&self, material: u32, light: [f32; 3]) -> Rgb {
        let scale = self.materials[material as usize].scale;
        [0, 1, 2].map(|channel| light[channel] * self.unit * scale[channel])
    }

    /// Whether a material is a smooth metal.
    pub fn reflects(&self, material: u32) -> bool {
        self.materials.get(material as usize).is_some_and(|shading| shading.reflects)
    }
}
