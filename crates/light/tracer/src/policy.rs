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

/// A vertex after the first, on a surface that is neither a mirror nor glass.
pub(crate) struct LaterVertex<'a> {
    pub raycaster: &'a Raycaster,
    pub point: &'a SurfacePoint,
    /// Geometric normal on the side of the incoming path.
    pub normal: Vec3,
    pub material: u32,
    pub scatter: &'a Scatter,
    /// Direction towards the previous vertex, in the frame of the normal that scatters.
    pub wo: Vec3,
    /// Width of the path's footprint.
    pub footprint: f32,
    /// Number of surfaces so far that are neither mirrors nor glass, with this one.
    pub scatterings: u32,
    /// Number of surfaces that the path has left.
    pub depth: u32,
}

/// What a path carries on its way.
pub(crate) struct Carried<'a> {
    /// The radiance that it has brought so far.
    pub radiance: &'a mut Vec3,
    pub throughput: &'a mut Vec3,
    /// Factor of the throughput with which light counts in the end.
    pub worth: &'a mut Vec3,
}

/// The decisions of one engine about a path.
pub(crate) trait PathPolicy: Clone {
    /// What a path has to teach once it ends.
    type Lessons: Default;

    /// Returns whether the path ends at a vertex after the first, because the light that this
    /// vertex reflects is known and has been added to what the path carries. May begin a lesson.
    #[inline]
    fn ends(
        &self,
        _: &mut Self::Lessons,
        _: &LaterVertex,
        _: &mut Carried,
        _: &mut Sampler,
    ) -> bool {
        false
    }

    /// Ends the lessons of a path that has brought `radiance` since the last one began. Returns the
    /// radiance of the whole path.
    #[inline]
    fn learn(&self, _: &Raycaster, _: Self::Lessons, radiance: Vec3) -> Vec3 {
        radiance
    }

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
    type Lessons = ();

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
