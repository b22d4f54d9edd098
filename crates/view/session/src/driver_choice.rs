//! The interface to the list of drivers. A session makes its driver by it, and names none.

use std::sync::Arc;

use clap::ValueEnum;
use holo_display::{Driver, ObjectMotion, SkyView};
use holo_proto::control::Welcome;
use holo_proto::stand_ins::StandInKind;
use holo_raycast::Raycaster;
use holo_section::Section;

use super::haze::HazeOption;

/// The driver that a session draws with, and its options. A session keeps it to make the driver
/// again.
pub trait DriverChoice: Send + Sync {
    /// Returns whether the chosen driver draws from the scene.
    fn scene_use(&self) -> SceneUse;

    /// Makes the chosen driver for a holodeck with these sections. `sky` is what rays show that hit
    /// nothing, and `unit` the length of a scene unit in metres.
    fn make(
        &self,
        sections: &Arc<[Section]>,
        sky: SkyView,
        unit: f64,
        scene: Option<&LoadedScene>,
    ) -> Driver;

    /// Chooses another driver.
    fn choose(&mut self, driver: DriverArg);

    /// Returns the haze in which frames are shown, if any.
    fn haze(&self) -> Option<HazeOption>;

    /// Switches a part of drivers on or off, for drivers that are made from now on.
    fn switch(&mut self, part: &str, on: bool);

    /// Lets the next driver go on with what the last one remembers of the scene, in which objects
    /// have moved so. All copies of a choice share that.
    fn go_on(&self, motions: &[ObjectMotion]);

    /// Forgets what the last driver remembers: the next one begins with nothing.
    fn forget(&self);

    /// Returns a copy.
    fn to_boxed(&self) -> Box<dyn DriverChoice>;
}

impl Clone for Box<dyn DriverChoice> {
    fn clone(&self) -> Self {
        self.as_ref().to_boxed()
    }
}

/// The method that turns samples into a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum DriverArg {
    /// `surfaces`; if the scene cannot be read, cells of the samples (`--cells`)
    #[default]
    Auto,
    /// Keeps light on the scene's surfaces for the whole session; a new view shows all light known
    /// there at once
    Surfaces,
    /// Averages samples over the leaves of a quadtree, larger leaves for noisier samples; needs no
    /// scene
    Quadtree,
    /// Connects samples by triangles (Delaunay), with colours interpolated between them; needs no
    /// scene
    Mesh,
    /// The render cache: projects known samples into every view and fills the gaps; needs no scene
    Pointimage,
    /// Each pixel shows its newest rays; needs no scene
    Frameless,
    /// Draws the hierarchy that `holodeck splats` has made of all samples, however many; shows no
    /// new samples
    Splats,
}

impl DriverArg {
    /// Returns the drivers' names. `auto` is left out: it stands for one of the others.
    pub fn names() -> Vec<&'static str> {
        let named = DriverArg::value_variants().iter().filter(|driver| **driver != Self::Auto);
        named.map(|driver| driver.name()).collect()
    }

    /// Returns the driver's name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Surfaces => "surfaces",
            Self::Quadtree => "quadtree",
            Self::Mesh => "mesh",
            Self::Pointimage => "pointimage",
            Self::Frameless => "frameless",
            Self::Splats => "splats",
        }
    }
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
    pub stand_ins: Vec<LoadedStandIn>,
}

impl LoadedScene {
    /// Returns what rays show that hit nothing.
    pub fn sky(&self) -> SkyView {
        let scene = Arc::clone(self.raycaster.scene());
        match scene.sky.as_even().filter(|_| scene.sky.is_plain()) {
            Some(radiance) => SkyView::Even(radiance),
            None => SkyView::Varying(Arc::new(move |direction| scene.sky.seen(direction))),
        }
    }
}

/// Returns what rays show that hit nothing: by the scene, or else by the welcome.
pub(crate) fn sky_of(welcome: &Welcome, scene: Option<&LoadedScene>) -> SkyView {
    scene.map_or(SkyView::Even(welcome.sky), LoadedScene::sky)
}

/// What rays hit instead of the scene, for views of one section.
pub struct LoadedStandIn {
    /// The section's number.
    pub section: u16,
    /// Whether it replaces the scene, or marks where the replacement is incomplete.
    pub kind: StandInKind,
    /// Casts rays against it.
    pub raycaster: Arc<Raycaster>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drivers_have_the_names_of_the_command_line() {
        for name in DriverArg::names() {
            assert_eq!(DriverArg::from_str(name, false).map(DriverArg::name), Ok(name));
        }
        assert_eq!(DriverArg::names().len() + 1, DriverArg::value_variants().len());
    }
}
