//! A piece of surface with its light.

use glam::Vec3;

/// A piece of a surface: a disc with the light that leaves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surfel {
    /// Its centre, relative to the origin of the file.
    pub position: Vec3,
    /// Its unit normal, on the lit side.
    pub normal: Vec3,
    /// Its radius.
    pub radius: f32,
    /// The radiance that leaves it, a mean over directions. It is divided by `colour`.
    pub light: [f32; 3],
    /// Colour of the surface that is left out of the light, because it is drawn from the scene; 1
    /// otherwise.
    pub colour: [f32; 3],
    /// Standard error of the light's luminance, as a share of it.
    pub error: f32,
    /// True if the light depends on the direction: mirrors, glass, gloss.
    pub is_directional: bool,
}
