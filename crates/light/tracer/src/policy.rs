//! What differs between the engines: where a path ends early, and what it teaches.

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint};

use crate::bsdf::Scatter;
use crate::engine::{PathEngine, Spread};
use crate::sampler::Sampler;

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

/// A ray that leaves a surface.
pub(crate) struct LeavingRay<'a> {
    pub ray: &'a Ray,
    pub triangle: u32,
    /// The surface's geometric normal, on its front.
    pub normal: Vec3,
    /// True if the surface bounds a solid.
    pub is_solid: bool,
}

/// What a path carries on its way.
pub(crate) struct Carried<'a> {
    /// The radiance that it has brought so far.
    pub radiance: &'a mut Vec3,
    pub throughput: &'a mut Vec3,
    /// Factor of the throughput with which light counts in the end.
    pub worth: &'a mut Vec3,
}

/// Brightness (the sum of the channels) at a path's first surface, and its variance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstSurface {
    pub direct: f32,
    /// Variance of one light sample; 0 if there was only one.
    pub direct_variance: f32,
    pub indirect: f32,
    /// Variance of one continuation.
    pub indirect_variance: f32,
}

/// The decisions of one engine about a path.
pub(crate) trait PathPolicy {
    /// What a path has to teach once it ends.
    type Lessons: Default;

    /// Returns whether the path ends at a vertex after the first. If so, the light that this vertex
    /// reflects was known, and was added to what the path carries. May begin a lesson.
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

    /// Returns whether the path ends with a ray that leaves a mirror or smooth glass. If so, the
    /// light along it was known, and was added to what the path carries. May begin a lesson.
    #[inline]
    fn leaves(&self, _: &mut Self::Lessons, _: &LeavingRay, _: &mut Carried) -> bool {
        false
    }

    /// Takes note of what such a ray of a triangle met.
    #[inline]
    fn met(&self, _: &mut Self::Lessons, _triangle: u32, _: Option<&Hit>) {}

    /// Returns the numbers for a path whose first surface is at `point`.
    #[inline]
    fn spread(&self, engine: &PathEngine, _point: Vec3) -> Spread {
        engine.spread()
    }

    /// Learns from a path that had several continuations.
    #[inline]
    fn branched(&self, _point: Vec3, _seen: &FirstSurface) {}

    /// Ends the lessons of a path that has brought `radiance` since the last one began. Returns the
    /// radiance of the whole path.
    #[inline]
    fn learn(&self, _: &Raycaster, _: Self::Lessons, radiance: Vec3) -> Vec3 {
        radiance
    }
}

/// The policy of the engine `path`: no bias.
#[derive(Clone, Copy)]
pub(crate) struct Unbiased;

impl PathPolicy for Unbiased {
    type Lessons = ();
}
