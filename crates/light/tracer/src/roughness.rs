//! Surfaces whose roughness and metalness change from point to point.
//!
//! Tables conserve energy for each roughness. So roughness is rounded to one of [`STEPS`] values,
//! and a table is made when a path first needs it.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use glam::Vec3;
use holo_scene::{Bsdf, FinishMap};

use crate::albedo::AlbedoTable;
use crate::bsdf::Scatter;
use crate::coat::{Coat, CoatTables};
use crate::conductor::Conductor;
use holo_optics::Ggx;

/// Number of different values of roughness. Neighbouring ones look alike.
const STEPS: usize = 64;

/// Least metalness of a metal point, roughness below which metal is a mirror, and least roughness
/// of diffuse surfaces. Readers of files use the same limits for whole materials.
const METAL: f32 = 0.5;
const MIRROR: f32 = 0.03;
const DIFFUSE: f32 = 0.75;

/// The tables of metals and coats, by step of roughness.
#[derive(Debug, Default)]
struct RoughnessTables<T>(Vec<OnceLock<Arc<T>>>);

impl<T> RoughnessTables<T> {
    fn new() -> Self {
        Self((0..STEPS).map(|_| OnceLock::new()).collect())
    }

    /// Returns the table of the step of a roughness in [0, 1], made by `make` if it is the first.
    fn at(&self, roughness: f32, make: impl FnOnce(Ggx) -> T) -> Arc<T> {
        let last = STEPS - 1;
        let step = ((roughness * last as f32).round() as usize).min(last);
        let rounded = step as f32 / last as f32;
        self.0[step].get_or_init(|| Arc::new(make(Ggx::new(rounded * rounded)))).clone()
    }
}

/// A conductor's table, with its distribution.
#[derive(Debug)]
struct Metal {
    ggx: Ggx,
    loss: Arc<AlbedoTable>,
}

/// A material with textures of roughness or metalness.
#[derive(Clone, Debug)]
pub(crate) struct Varied {
    colour: Vec3,
    /// Colour and index of refraction of the coat where the surface is no metal.
    coat: Vec3,
    ior: f32,
    metals: Arc<RoughnessTables<Metal>>,
    layers: Arc<RoughnessTables<CoatTables>>,
}

/// The tables that such materials share.
#[derive(Debug, Default)]
pub(crate) struct VariedTables {
    metals: Option<Arc<RoughnessTables<Metal>>>,
    /// By the bits of the index of refraction.
    layers: HashMap<u32, Arc<RoughnessTables<CoatTables>>>,
}

impl Varied {
    /// Prepares a material. `None` if it has no such texture, or is glass.
    pub(crate) fn new(
        bsdf: &Bsdf,
        finish: Option<FinishMap>,
        tables: &mut VariedTables,
    ) -> Option<Self> {
        finish?;
        let (colour, coat, ior) = match *bsdf {
            Bsdf::Diffuse { kd } => (kd, [1.0; 3], 1.5),
            Bsdf::Coated { kd, ks, ior, .. } => (kd, ks, ior),
            Bsdf::Mirror { ks } | Bsdf::Conductor { ks, .. } => (ks, [1.0; 3], 1.5),
            Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. } => return None,
        };
        Some(Self {
            colour: colour.into(),
            coat: coat.into(),
            ior,
            metals: tables.metals.get_or_insert_with(|| Arc::new(RoughnessTables::new())).clone(),
            layers: tables
                .layers
                .entry(ior.to_bits())
                .or_insert_with(|| Arc::new(RoughnessTables::new()))
                .clone(),
        })
    }

    /// Returns the scattering of a point of this roughness and metalness, with its colour
    /// multiplied by a texture's.
    pub(crate) fn at(&self, [roughness, metalness]: [f32; 2], texture: Vec3) -> Scatter {
        let colour = self.colour * texture;
        if metalness >= METAL {
            if roughness < MIRROR {
                return Scatter::Mirror(colour);
            }
            let metal = self
                .metals
                .at(roughness, |ggx| Metal { ggx, loss: Arc::new(Conductor::loss(ggx)) });
            return Scatter::Conductor(Box::new(Conductor::new(
                colour,
                metal.ggx,
                metal.loss.clone(),
            )));
        }
        if roughness >= DIFFUSE {
            return Scatter::Diffuse(colour);
        }
        let layer = self.layers.at(roughness, |ggx| CoatTables::new(self.ior, ggx));
        Scatter::Coated(Box::new(Coat::new(colour, self.coat, layer)))
    }
}
