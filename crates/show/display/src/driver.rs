//! A driver: light, and a renderer that draws from it.

use crate::{Light, Renderer};

/// A method that turns samples into pictures, in use.
pub struct Driver {
    /// Its name, as reports give it.
    pub name: &'static str,
    /// True if it knows the visible surfaces, and so all distances, before any sample has arrived.
    pub knows_surfaces: bool,
    /// The light of the session.
    pub light: Box<dyn Light>,
    /// The renderer of the first view. [`Light::renderer`] makes others.
    pub renderer: Box<dyn Renderer>,
}

impl Driver {
    /// Returns a driver with one renderer of this light.
    pub fn new(
        name: &'static str,
        knows_surfaces: bool,
        mut light: impl Light + 'static,
    ) -> Driver {
        let renderer = light.renderer();
        Driver { name, knows_surfaces, light: Box::new(light), renderer }
    }
}
