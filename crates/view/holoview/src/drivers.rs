//! The list of drivers: the only place that names them all.
//!
//! A new driver is a crate that makes a [`Driver`], an option in [`DriverArg`], and an arm here.

use std::sync::Arc;

use holo_denoise::Quality;
use holo_display::Driver;
use holo_driver_quadtree::{Filling, cells_driver, quadtree_driver};
use holo_driver_rendercache::{frameless_driver, pointimage_driver};
use holo_driver_surfaces::{StandIns, stand_ins_driver, surfaces_driver};
use holo_raycast::Raycaster;
use holo_section::Section;

use crate::args::{CellsArg, DriverArg, DriverArgs, PointArgs};

/// Parts of drivers that a script may switch, by name.
pub const SWITCHES: &[&str] = &holo_driver_rendercache::Stages::NAMES;

/// The driver that a session asks for, and what all drivers need.
pub struct DriverChoice {
    /// The driver and its filling.
    pub args: DriverArgs,
    /// Options of the render cache.
    pub points: PointArgs,
    /// The holodeck's sections.
    pub sections: Arc<[Section]>,
    /// Radiance of rays that hit nothing.
    pub sky: [f32; 3],
}

/// A driver's use of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneUse {
    /// The driver never draws from it.
    None,
    /// The driver draws from the scene if the scene arrives.
    IfThere,
    /// The driver cannot draw without the scene.
    Required,
}

/// A scene ready to be drawn from.
pub struct LoadedScene {
    /// Casts rays against the scene.
    pub raycaster: Arc<Raycaster>,
    /// Boxes that rays hit instead of the scene, for views of some sections.
    pub stand_ins: StandIns,
}

impl DriverChoice {
    /// Returns whether the chosen driver draws from the scene.
    pub fn scene_use(&self) -> SceneUse {
        match (self.args.driver, self.args.cells) {
            (DriverArg::Auto, None) => SceneUse::IfThere,
            (DriverArg::Surfaces, None) => SceneUse::Required,
            _ => SceneUse::None,
        }
    }

    /// Makes the chosen driver. Without a scene, `auto` draws cells from samples only.
    pub fn make(&self, scene: Option<&LoadedScene>) -> Driver {
        let sections = Arc::clone(&self.sections);
        let sky = self.sky;
        match self.args.driver {
            DriverArg::Quadtree => quadtree_driver(sections, sky),
            DriverArg::Pointimage => pointimage_driver(sections, sky, self.points.params()),
            DriverArg::Frameless => frameless_driver(sections, sky),
            DriverArg::Auto | DriverArg::Surfaces => match scene {
                Some(scene) => self.surfaces(scene),
                None => cells_driver(sections, sky, self.filling()),
            },
        }
    }

    fn surfaces(&self, scene: &LoadedScene) -> Driver {
        let (sections, raycaster) = (Arc::clone(&self.sections), Arc::clone(&scene.raycaster));
        // `check` has already loaded a library that was named.
        let denoiser = self.args.denoise.load(Quality::Balanced).unwrap_or_default();
        if scene.stand_ins.0.is_empty() {
            return surfaces_driver(sections, raycaster, denoiser);
        }
        let (of_beyond, sky) = (Arc::clone(&sections), self.sky);
        let make = move || quadtree_driver(Arc::clone(&of_beyond), sky);
        stand_ins_driver(sections, raycaster, scene.stand_ins.clone(), denoiser, Arc::new(make))
    }

    fn filling(&self) -> Filling {
        match self.args.cells {
            Some(CellsArg::Constant) => Filling::Constant,
            Some(CellsArg::Smooth) | None => Filling::Smooth,
        }
    }
}
