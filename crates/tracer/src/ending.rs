//! What ends paths before light does, and how they go on until then.

use glam::Vec3;
use holo_raycast::{Raycaster, SurfacePoint};

use crate::bsdf::Scatter;
use crate::medium::Inside;
use crate::path::PathEngine;
use crate::sampler::Sampler;

/// A vertex at which a path may end.
pub(crate) struct Met<'a> {
    pub raycaster: &'a Raycaster,
    pub point: &'a SurfacePoint,
    /// On the side that the path has come to.
    pub normal: Vec3,
    pub scatter: &'a Scatter,
    pub inside: &'a Inside,
    /// Surfaces so far that are neither mirrors nor glass, this one included.
    pub scatterings: u32,
    /// Surfaces that the path has left.
    pub depth: u32,
}

/// What ends paths before light does.
pub(crate) trait Ending: Clone {
    /// Radiance that a vertex sends on of light that came by other surfaces, where that is known.
    fn indirect(&self, met: &Met, sampler: &mut Sampler) -> Option<Vec3>;

    /// At how many smooth surfaces a path with so many scatterings goes both ways.
    fn forks(&self, scatterings: u32) -> u32;

    /// Light that came from a lamp over mirrors or glass to a surface that scatters it, and that nothing else finds, as far as it counts.
    fn held(&self, light: Vec3) -> Vec3;

    /// Samples of the lights at a vertex, and whether the path ends there.
    fn light_samples(&self, engine: &PathEngine, scatterings: u32, ends: bool) -> u32;
}

/// Paths that only light, roulette or absorption end.
#[derive(Clone, Copy)]
pub(crate) struct Never;

impl Ending for Never {
    #[inline]
    fn indirect(&self, _: &Met, _: &mut Sampler) -> Option<Vec3> {
        None
    }

    #[inline]
    fn forks(&self, _: u32) -> u32 {
        0
    }

    #[inline]
    fn held(&self, light: Vec3) -> Vec3 {
        light
    }

    #[inline]
    fn light_samples(&self, engine: &PathEngine, scatterings: u32, _: bool) -> u32 {
        if scatterings == 1 { engine.light_samples } else { 1 }
    }
}
