//! The path tracer of one scene: its materials, lights and settings.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Scene};

use crate::bsdf::{Scatter, Tables};
use crate::lights::Lights;
use crate::medium::{Inside, Nesting};
use crate::panes::Panes;
use crate::secondary::SecondarySources;

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

/// A material, prepared for tracing.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    pub scatter: Scatter,
    pub emission: Vec3,
    pub emits: bool,
    /// Whether the back emits too.
    pub two_sided: bool,
}

/// The path tracer of one scene.
#[derive(Debug)]
pub(crate) struct PathEngine {
    /// Indexed by material.
    pub surfaces: Vec<Surface>,
    pub lights: Lights,
    pub panes: Arc<Panes>,
    pub secondary: Option<SecondarySources>,
    /// `None` if the scene has no solid glass.
    pub nesting: Option<Nesting>,
    /// Radiance of the sky.
    pub sky: Vec3,
    /// Most scatterings after the first.
    pub bounces: u32,
    /// How direct light is found.
    pub direct: Direct,
    /// Light samples at the first surface that is neither a mirror nor glass.
    pub light_samples: u32,
    /// Number of continuations from that surface. They share the part of the path before it.
    pub branches: u32,
}

impl PathEngine {
    pub(crate) fn new(
        raycaster: &Arc<Raycaster>,
        bounces: Option<u32>,
        direct: Direct,
        light_samples: u32,
    ) -> Self {
        let scene: &Scene = raycaster.scene();
        let mut used = vec![false; scene.materials.len()];
        scene.material_ids.iter().for_each(|&m| used[m as usize] = true);
        let mut tables = Tables::default();
        let surfaces: Vec<Surface> = scene
            .materials
            .iter()
            .zip(used)
            .map(|(m, used)| Surface {
                scatter: match m.bsdf {
                    // What a solid does depends on the media on both sides (`nesting`).
                    Bsdf::Dielectric { .. } => Scatter::Black,
                    _ if !used => Scatter::Black,
                    bsdf => Scatter::new(&bsdf, &mut tables),
                },
                emission: m.emission.into(),
                emits: m.emits(),
                two_sided: m.two_sided_emission,
            })
            .collect();
        let panes = Arc::new(Panes::new(scene));
        let lights = Lights::new(scene).with_cells(raycaster, &panes);
        Self {
            secondary: SecondarySources::find(raycaster, &surfaces, &lights),
            surfaces,
            lights,
            panes,
            nesting: Nesting::new(scene),
            sky: scene.sky.into(),
            bounces: bounces.unwrap_or(u32::MAX),
            direct,
            light_samples,
            branches: 1,
        }
    }

    /// Returns the solids that contain `eye` (world coordinates).
    pub(crate) fn inside(&self, raycaster: &Raycaster, eye: DVec3) -> Inside {
        self.nesting.as_ref().map_or_else(Inside::default, |nesting| nesting.at(raycaster, eye))
    }
}
