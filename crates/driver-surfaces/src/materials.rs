//! What a surface's light is divided by before it is stored, and multiplied by before it is shown.
//!
//! Invariant: what is divided by is what is multiplied by, and is never near 0.

use holo_scene::{Bsdf, Material, Rgb, Scene};

/// Reflectances below this are taken as this: a black surface shows nothing of the light on it.
const LEAST_REFLECTANCE: f32 = 0.02;

/// Rough metals up to this GGX roughness are shown as mirrors.
const SMOOTH_METAL: f32 = 0.05;

/// Fixed-point steps of the brightest light of the scene.
const STEPS: f32 = (1_u64 << 26) as f32;

/// What becomes of a ray that meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    /// Light is kept on it, the same towards all directions.
    Diffuse,
    /// Light is kept on it, apart for each range of directions.
    Glossy,
    /// The ray goes on, mirrored, and this share of it comes back.
    Mirror(Rgb),
    /// The ray goes on straight and mirrored: a thin pane.
    Pane {
        /// Index of refraction.
        ior: f32,
        /// Colour of what goes through.
        transmittance: Rgb,
    },
}

/// One material, as the store needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Finish {
    pub kind: Kind,
    /// Stored light times this is radiance.
    pub reflectance: Rgb,
    /// Radiance that the front emits; the back emits it too if `emits_back`.
    pub emission: Rgb,
    pub emits: bool,
    pub emits_back: bool,
}

/// The materials of a scene, and the unit of light.
#[derive(Debug)]
pub struct Materials {
    pub(crate) finishes: Vec<Finish>,
    pub(crate) sky: Rgb,
    /// Light of one fixed-point step: a power of two.
    pub(crate) unit: f32,
}

impl Finish {
    fn new(material: &Material) -> Finish {
        let at_least = |colour: Rgb| colour.map(|c| c.max(LEAST_REFLECTANCE));
        let (kind, reflectance) = match material.bsdf {
            Bsdf::Diffuse { kd } => (Kind::Diffuse, at_least(kd)),
            Bsdf::Mirror { ks } => (Kind::Mirror(ks), [1.0; 3]),
            Bsdf::Conductor { ks, alpha } if alpha <= SMOOTH_METAL => (Kind::Mirror(ks), [1.0; 3]),
            Bsdf::Conductor { ks, .. } => (Kind::Glossy, at_least(ks)),
            Bsdf::ThinGlass { ior, transmittance } => (Kind::Pane { ior, transmittance }, [1.0; 3]),
            Bsdf::Dielectric { .. } | Bsdf::Coated { .. } => (Kind::Glossy, [1.0; 3]),
        };
        Finish {
            kind,
            reflectance,
            emission: material.emission,
            emits: material.emits(),
            emits_back: material.two_sided_emission,
        }
    }

    /// Whether this side shines.
    pub fn shines(&self, front: bool) -> bool {
        self.emits && (front || self.emits_back)
    }
}

impl Materials {
    /// Reads a scene's materials.
    #[must_use]
    pub fn new(scene: &Scene) -> Materials {
        let lights = scene.materials.iter().flat_map(|m| m.emission).chain(scene.sky);
        let brightest = lights.fold(0.0, f32::max);
        // A power of two scales without rounding.
        let unit =
            if brightest > 0.0 { brightest.log2().ceil().exp2() / STEPS } else { 1.0 / STEPS };
        let finishes = scene.materials.iter().map(Finish::new).collect();
        Materials { finishes, sky: scene.sky, unit }
    }
}

/// The share of unpolarised light that a thin pane reflects at this cosine, all passes between its faces together.
pub(crate) fn pane_reflectance(cosine: f32, ior: f32) -> f32 {
    let inside = (1.0 - (1.0 - cosine * cosine) / (ior * ior)).max(0.0).sqrt();
    let parallel = (ior * cosine - inside) / (ior * cosine + inside);
    let across = (cosine - ior * inside) / (cosine + ior * inside);
    let once = 0.5 * (parallel * parallel + across * across);
    2.0 * once / (1.0 + once)
}
