//! The materials of a scene, prepared for tracing.

use std::sync::Arc;

use glam::Vec3;
use holo_scene::{Bsdf, Luminaire, Scene};

use crate::bsdf::{Scatter, Tables};
use crate::roughness::{Varied, VariedTables};

/// A material, prepared for tracing.
#[derive(Clone, Debug)]
pub(crate) struct TracedMaterial {
    pub scatter: Scatter,
    /// Set if textures decide at each point; `scatter` is the mean then.
    pub varied: Option<Box<Varied>>,
    pub emission: Vec3,
    pub emits: bool,
    /// Whether the back emits too.
    pub two_sided: bool,
    /// Set if its light differs by direction.
    pub luminaire: Option<Arc<Luminaire>>,
    /// What glass is besides glass, for part of the rays.
    pub base: Option<Box<TracedMaterial>>,
}

impl TracedMaterial {
    /// Returns the radiance that it emits in a unit direction away from it, without its texture.
    #[inline]
    pub(crate) fn emission_towards(&self, away: Vec3) -> Vec3 {
        match &self.luminaire {
            None => self.emission,
            Some(luminaire) => self.emission * luminaire.share(away),
        }
    }
}

/// Returns the materials of a scene, in order.
pub(crate) fn surfaces(scene: &Scene) -> Vec<TracedMaterial> {
    let mut used = vec![false; scene.materials.len()];
    scene.material_ids().for_each(|m| used[m as usize] = true);
    let (mut tables, mut varied) = (Tables::default(), VariedTables::default());
    let finish = |id: usize| scene.shading.as_ref()?.maps.get(id)?.finish;
    scene
        .materials
        .iter()
        .zip(used)
        .enumerate()
        .map(|(id, (m, used))| {
            let whole = TracedMaterial {
                varied: Varied::new(&m.bsdf, finish(id), &mut varied).map(Box::new),
                scatter: match m.bsdf {
                    // The scattering of a solid depends on the media on both sides (`nesting`).
                    Bsdf::Dielectric { .. } => Scatter::Black,
                    _ if !used => Scatter::Black,
                    bsdf => Scatter::new(&bsdf, &mut tables),
                },
                emission: m.emission.into(),
                emits: m.emits(),
                two_sided: m.two_sided_emission,
                luminaire: scene.luminaire_of(id as u32).cloned().map(Arc::new),
                base: None,
            };
            let base = scene.base(id).filter(|_| used).map(|base| {
                let scatter = Scatter::new(&base.bsdf, &mut tables);
                Box::new(TracedMaterial { scatter, varied: None, ..whole.clone() })
            });
            TracedMaterial { base, ..whole }
        })
        .collect()
}
