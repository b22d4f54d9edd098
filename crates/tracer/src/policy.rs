//! Decisions that differ between the engines: where a path ends early, and how it gets there.

use glam::Vec3;
use holo_raycast::{Raycaster, SurfacePoint};

use crate::bsdf::Scatter;
use crate::engine::PathEngine;
use crate::medium::Inside;
use crate::sampler::Sampler;

/// A vertex at which a path may end.
pub(crate) struct ShadingPoint<'a> {
    pub raycaster: &'a Raycaster,
    pub point: &'a SurfacePoint,
    /// Normal on the side of the incoming path, without the texture of normals.
    pub normal: Vec3,
    /// The same normal with that texture; light arrives around it.
    pub lit: Vec3,
    pub scatter: &'a Scatter,
    /// The solids on that side.
    pub inside: &'a Inside,
    /// Number of surfaces so far that are neither mirrors nor glass, with this one.
    pub scatterings: u32,
    /// Number of surfaces that the path has left.
    pub depth: u32,
}

/// The decisions of one engine about a path.
pub(crate) trait PathPolicy: Clone {
    /// Returns the indirect light that a vertex reflects, if it is known. The path then ends there.
    fn indirect(&self, point: &ShadingPoint, sampler: &mut Sampler) -> Option<Vec3>;

    /// Returns at how many smooth surfaces a path with `scatterings` scatterings follows both
    /// reflection and transmission.
    fn forks(&self, scatterings: u32) -> u32;

    /// Limits light that reached a surface from a lamp over mirrors or glass and that nothing but
    /// this path could find.
    fn clamped(&self, light: Vec3) -> Vec3;

    /// Returns whether a path counts the light of suns that it finds over mirrors and glass after
    /// this many scatterings. If not, it is counted elsewhere.
    fn finds_suns(&self, scatterings: u32) -> bool;

    /// Returns the number of light samples at a vertex. `ends`: the path ends there.
    fn light_samples(&self, engine: &PathEngine, scatterings: u32, ends: bool) -> u32;
}

/// The policy of the engine `path`: no bias.
#[derive(Clone, Copy)]
pub(crate) struct Unbiased;

impl PathPolicy for Unbiased {
    #[inline]
    fn indirect(&self, _: &ShadingPoint, _: &mut Sampler) -> Option<Vec3> {
        None
    }

    #[inline]
    fn forks(&self, _: u32) -> u32 {
        0
    }

    #[inline]
    fn clamped(&self, light: Vec3) -> Vec3 {
        light
    }

    #[inline]
    fn finds_suns(&self, _: u32) -> bool {
        true
    }

    #[inline]
    fn light_samples(&self, engine: &PathEngine, scatterings: u32, _: bool) -> u32 {
        if scatterings == 1 { engine.light_samples } else { 1 }
    }
}
