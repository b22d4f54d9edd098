//! A driver: light, and a renderer that draws from it.

use crate::{Light, Renderer};

/// A part of a driver's method that people may switch off, to see what it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriverPart {
    /// Its name, as [`Renderer::switch`] takes it.
    pub name: &'static str,
    /// What it does, in a few words.
    pub meaning: &'static str,
    /// Whether it runs.
    pub is_on: bool,
}

/// A method that turns samples into pictures, in use.
pub struct Driver {
    /// Its name, as reports give it.
    pub name: &'static str,
    /// True if it knows the visible surfaces, and so all distances, before any sample has arrived.
    pub knows_surfaces: bool,
    /// True if pixels keep what they showed, so that frames of another size would begin anew.
    pub keeps_pixels: bool,
    /// True if samples that were requested for earlier views serve the present one, although the
    /// light has no room for them.
    pub takes_late: bool,
    /// The parts that can be switched.
    pub parts: Vec<DriverPart>,
    /// The light of the session.
    pub light: Box<dyn Light>,
    /// The renderer of the first view. [`Light::renderer`] makes others.
    pub renderer: Box<dyn Renderer>,
}

impl Driver {
    /// Returns a driver with one renderer of this light, that draws from samples alone.
    pub fn new(name: &'static str, mut light: impl Light + 'static) -> Driver {
        let renderer = light.renderer();
        let (knows_surfaces, keeps_pixels, takes_late) = (false, false, false);
        let (parts, light) = (Vec::new(), Box::new(light));
        Driver { name, knows_surfaces, keeps_pixels, takes_late, parts, light, renderer }
    }
}
