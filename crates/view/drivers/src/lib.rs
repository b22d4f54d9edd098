//! The list of drivers: the only package that names them all, and their options.
//!
//! A new driver is a crate that makes a [`Driver`], an option in [`DriverArg`], and an arm of
//! [`DriverOptions::make`].
//!
//! Invariant: a driver depends on its options and on the scene alone, never on a front end.

mod denoised;
mod options;
mod render_cache;
mod stereo_options;
mod wall_options;

use std::{collections::BTreeMap, sync::Arc};

use holo_denoise::Quality;
use holo_display::{Driver, ObjectMotion, SkyView};
use holo_driver_mesh::mesh_driver;
use holo_driver_quadtree::{Filling, cells_driver, quadtree_driver};
use holo_driver_rendercache::{PointMemory, frameless_driver, pointimage_driver_with_memory};
use holo_driver_splats::splats_driver;
use holo_driver_surfaces::{StandIn, StandIns, stand_ins_driver, surfaces_driver};
use holo_proto::stand_ins::StandInKind;
use holo_section::Section;
use holo_session::{DriverArg, DriverChoice, HazeOption, LoadedScene, LoadedStandIn, SceneUse};
use holo_splats::SplatFile;
use holo_stereo::{stereo_driver, wall_driver};

pub use denoised::denoise;
pub use options::{CellsArg, DenoiseArg, DriverArgs, SplatShapeArg};
pub use render_cache::{EmptyArg, PointArgs, SmoothingArg};
pub use stereo_options::{StereoArg, StereoArgs};
pub use wall_options::{NamedScreen, WallArgs};

/// Parts of drivers that a script may switch, by name.
pub const SWITCHES: &[&str] = &holo_driver_rendercache::Stages::NAMES;

/// The driver that a person chose, with the options of all drivers.
#[derive(Clone, Debug, Default)]
pub struct DriverOptions {
    /// The driver and its filling.
    pub args: DriverArgs,
    /// Options of the render cache.
    pub points: PointArgs,
    /// The splats of the driver of that name.
    pub splats: Option<Arc<SplatFile>>,
    /// Points that one driver leaves to the next.
    pub memory: PointMemory,
}

impl DriverChoice for DriverOptions {
    fn scene_use(&self) -> SceneUse {
        match (self.args.driver, self.args.cells) {
            (DriverArg::Auto, None) => SceneUse::IfThere,
            (DriverArg::Surfaces, None) => SceneUse::Required,
            _ => SceneUse::None,
        }
    }

    /// Makes the chosen driver, for two eyes or a wall if they are wanted. Without a scene, `auto`
    /// draws cells from samples only.
    fn make(
        &self,
        sections: &Arc<[Section]>,
        sky: SkyView,
        unit: f64,
        scene: Option<&LoadedScene>,
    ) -> Driver {
        let driver = self.of_one_view(Arc::clone(sections), sky, scene);
        match (self.args.stereo.eyes(unit), self.args.wall.wall()) {
            (Some(eyes), _) => stereo_driver(driver, eyes, Arc::clone(sections)),
            (None, Some(wall)) => wall_driver(driver, wall, Arc::clone(sections)),
            (None, None) => driver,
        }
    }

    fn haze(&self) -> Option<HazeOption> {
        self.args.fog
    }

    fn choose(&mut self, driver: DriverArg) {
        self.args = DriverArgs { driver, cells: None, ..self.args.clone() };
    }

    fn switch(&mut self, part: &str, on: bool) {
        self.points.switch(part, on);
    }

    fn go_on(&self, motions: &[ObjectMotion]) {
        self.memory.go_on(motions);
    }

    fn forget(&self) {
        self.memory.forget();
    }

    fn to_boxed(&self) -> Box<dyn DriverChoice> {
        Box::new(self.clone())
    }
}

impl DriverOptions {
    fn of_one_view(
        &self,
        sections: Arc<[Section]>,
        sky: SkyView,
        scene: Option<&LoadedScene>,
    ) -> Driver {
        match self.args.driver {
            DriverArg::Quadtree => quadtree_driver(sections, sky),
            DriverArg::Mesh => mesh_driver(sections, sky),
            DriverArg::Pointimage => {
                let (params, memory) = (self.points.params(), self.memory.clone());
                pointimage_driver_with_memory(sections, sky, params, memory)
            }
            DriverArg::Frameless => frameless_driver(sections, sky),
            DriverArg::Splats => splats_driver(self.splats.clone(), self.args.splat_shape.shape()),
            DriverArg::Auto | DriverArg::Surfaces => match scene {
                Some(scene) => self.surfaces(sections, sky, scene),
                None => cells_driver(sections, sky, self.filling()),
            },
        }
    }

    /// Returns the options of a person, with the splats that they name.
    ///
    /// # Errors
    /// If the splats cannot be used, or none were named and the driver needs some.
    pub fn open(args: DriverArgs, points: PointArgs) -> anyhow::Result<DriverOptions> {
        let splats = args.open_splats().map_err(anyhow::Error::msg)?;
        Ok(DriverOptions { args, points, splats, memory: PointMemory::default() })
    }

    fn surfaces(&self, sections: Arc<[Section]>, sky: SkyView, scene: &LoadedScene) -> Driver {
        let raycaster = Arc::clone(&scene.raycaster);
        // `check` has already loaded a library that was named.
        let denoiser = self.args.denoise.load(Quality::Balanced).unwrap_or_default();
        if scene.stand_ins.is_empty() {
            return surfaces_driver(sections, raycaster, denoiser);
        }
        let of_beyond = Arc::clone(&sections);
        let make = move || quadtree_driver(Arc::clone(&of_beyond), sky.clone());
        let stand_ins = by_section(&scene.stand_ins);
        stand_ins_driver(sections, raycaster, stand_ins, denoiser, Arc::new(make))
    }

    fn filling(&self) -> Filling {
        match self.args.cells {
            Some(CellsArg::Constant) => Filling::Constant,
            Some(CellsArg::Smooth) | None => Filling::Smooth,
        }
    }
}

/// Sorts stand-ins by their sections.
fn by_section(loaded: &[LoadedStandIn]) -> StandIns {
    let mut stand_ins = BTreeMap::<u16, StandIn>::new();
    for part in loaded {
        let stand_in = stand_ins.entry(part.section).or_default();
        *match part.kind {
            StandInKind::Geometry => &mut stand_in.geometry,
            StandInKind::Portals => &mut stand_in.portals,
        } = Some(Arc::clone(&part.raycaster));
    }
    StandIns(stand_ins)
}
