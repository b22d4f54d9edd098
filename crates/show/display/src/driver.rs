//! A driver: light, and a renderer that draws from it.

use crate::{Light, Renderer};

/// A method that turns samples into pictures, in use.
pub struct Driver {
    /// Its name, as reports give it.
    pub name: &'static str,
    /// True if it knows the visible surfaces, and so all distances, before any sample has arrived.
    pub knows_surfaces: bool,
    /// True if pixels keep what they showed, so that frames of another size would begin anew.
    pub keeps_pixels: bool,
    /// The light of the session.
    pub light: Box<dyn Light>,
    /// The renderer of the first view. [`Light::renderer`] makes others.
    pub renderer: Box<dyn Renderer>,
}

impl Driver {
    /// Returns a driver with one renderer of this light, that draws from samples alone.
    pub fn new(name: &'static str, mut light: impl Light + 'static) -> Driver {
        let renderer = light.renderer();
        let (knows_surfaces, keeps_pixels) = (false, false);
        Driver { name, knows_surfaces, keeps_pixels, light: Box::new(light), renderer }
    }
}
