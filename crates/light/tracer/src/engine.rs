//! The path tracer of one scene: its materials, lights and settings.

use std::panic::resume_unwind;
use std::sync::Arc;
use std::thread;

use glam::DVec3;
use holo_raycast::Raycaster;
use holo_scene::{Scene, Sun};

use crate::caustics::{Caustics, LightSources};
use crate::lights::{GRIDS, Lights};
use crate::medium::{Inside, Nesting};
use crate::panes::Panes;
use crate::secondary::SecondarySources;
use crate::sky::PreparedSky;
use crate::suns::Suns;
use crate::surface::{TracedMaterial, surfaces};
use crate::weighting::Direct;

/// The numbers of light samples and of continuations at a path's first surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    pub lights: u32,
    pub branches: u32,
    /// True if the path measures, with other numbers than its neighbours. Its continuations then
    /// have random numbers of their own, because the usual ones are other paths' too.
    pub is_probe: bool,
}

/// The path tracer of one scene.
#[derive(Debug)]
pub(crate) struct PathEngine {
    /// Indexed by material.
    pub surfaces: Vec<TracedMaterial>,
    pub lights: Lights,
    pub panes: Arc<Panes>,
    pub secondary: Option<SecondarySources>,
    pub caustics: Option<Caustics>,
    /// `None` if the scene has no solid glass.
    pub nesting: Option<Nesting>,
    pub sky: Arc<PreparedSky>,
    pub suns: Suns,
    /// The sky's sun, if eyes see its disc.
    pub visible_sun: Option<Sun>,
    /// True if paths may find punctual lights over mirrors and glass.
    pub finds_points: bool,
    /// Most scatterings after the first.
    pub bounces: u32,
    /// How direct light is found.
    pub direct: Direct,
    /// Light samples at the first surface that is neither a mirror nor glass.
    pub light_samples: u32,
    /// Number of continuations from that surface. They share the part of the path before it.
    pub branches: u32,
    /// True if samples of the lights find all direct light of diffuse surfaces without samples of
    /// the material. This holds for one lamp without mirrors and glass.
    pub lights_find_all: bool,
    /// True if any surface has a texture or a smooth normal.
    pub is_shaded: bool,
}

impl PathEngine {
    pub(crate) fn new(
        raycaster: &Arc<Raycaster>,
        bounces: Option<u32>,
        direct: Direct,
        light_samples: u32,
    ) -> Self {
        let scene: &Scene = raycaster.scene();
        let surfaces = surfaces(scene);
        let panes = Arc::new(Panes::new(raycaster));
        let sky = Arc::new(PreparedSky::new(scene));
        let lights = Lights::new(scene, &sky).with_cells(&GRIDS, raycaster, &panes);
        let nesting = Nesting::new(scene);
        let is_specular = nesting.is_some() || surfaces.iter().any(|s| s.scatter.is_delta());
        let finds_points =
            !lights.points().is_empty() && (is_specular || direct == Direct::Materials);
        let lights_find_all = direct == Direct::Both && lights.is_one() && !is_specular;
        let suns = Suns::new(scene);
        let sources = LightSources { lights: &lights, suns: &suns, sky: &sky, panes: &panes };
        // Each takes 0.1 s or more, and somebody may be waiting for the first picture.
        let (secondary, caustics) = thread::scope(|scope| {
            let caustics = scope.spawn(|| Caustics::find(raycaster, &surfaces, &sources));
            let secondary = SecondarySources::find(raycaster, &surfaces, &lights);
            (secondary, caustics.join().unwrap_or_else(|panic| resume_unwind(panic)))
        });
        Self {
            secondary,
            caustics,
            surfaces,
            lights,
            panes,
            nesting,
            lights_find_all,
            sky,
            suns,
            visible_sun: None,
            finds_points,
            bounces: bounces.unwrap_or(u32::MAX),
            direct,
            light_samples,
            branches: 1,
            is_shaded: scene.shading.is_some(),
        }
    }

    /// Returns the numbers of light samples and continuations that hold everywhere.
    pub(crate) fn spread(&self) -> Spread {
        Spread { lights: self.light_samples, branches: self.branches, is_probe: false }
    }

    /// Returns the solids that contain `eye` (world coordinates).
    pub(crate) fn inside(&self, raycaster: &Raycaster, eye: DVec3) -> Inside {
        self.nesting.as_ref().map_or_else(Inside::default, |nesting| nesting.at(raycaster, eye))
    }
}
