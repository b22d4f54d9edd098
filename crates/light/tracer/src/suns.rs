//! Suns: discs in the sky that light samples find, and sharp reflections too.
//!
//! Invariant: a sun counts only after a path has been scattered with a density. Eyes see the sky
//! in its place, directly and in mirrors. Displays draw the disc of the sky's own sun. A scene
//! without suns pays nothing.

use glam::Vec3;
use holo_scene::{SUN_RADIUS, Scene, Sun};

use crate::geometry::{ShadingFrame, disc};
use crate::luminance::luminance;

/// A sun, prepared for sampling.
#[derive(Clone, Copy, Debug)]
struct Disc {
    /// Its third axis points to the middle.
    frame: ShadingFrame,
    radiance: Vec3,
    /// Probability of choosing it.
    share: f32,
}

/// The suns of a scene.
#[derive(Debug)]
pub(crate) struct Suns {
    discs: Vec<Disc>,
    /// Sine of the angle from the middle of a disc to its edge.
    radius: f32,
    /// Inverse of the solid angle of a disc.
    density: f32,
}

/// A point of a sun.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SunPoint {
    pub direction: Vec3,
    pub radiance: Vec3,
    /// Density per solid angle with which it was chosen.
    pub density: f32,
}

impl Suns {
    pub(crate) fn new(scene: &Scene) -> Self {
        let power = |sun: &Sun| luminance(sun.irradiance);
        let all: f32 = scene.all_suns().map(power).sum();
        let density = (1.0 / Sun::projected_solid_angle()) as f32;
        let disc = |sun: &Sun| Disc {
            frame: ShadingFrame::new(Vec3::from(sun.towards).normalize_or_zero()),
            radiance: Vec3::from(sun.irradiance) * density,
            share: power(sun) / all,
        };
        let discs = scene.all_suns().map(disc).collect();
        Self { discs, radius: SUN_RADIUS.sin() as f32, density }
    }

    pub(crate) fn any(&self) -> bool {
        !self.discs.is_empty()
    }

    /// Returns a point of a sun, chosen by three uniform numbers in proportion to its irradiance.
    #[inline]
    pub(crate) fn choose(&self, mut which: f32, at: [f32; 2]) -> Option<SunPoint> {
        let last = self.discs.last()?;
        let chosen = self.discs.iter().find(|disc| {
            which -= disc.share;
            which < 0.0
        });
        let sun = chosen.unwrap_or(last);
        let [x, y] = disc(at).map(|c| c * self.radius);
        let local = Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt());
        let direction = sun.frame.to_world(local);
        Some(SunPoint { direction, radiance: sun.radiance, density: sun.share * self.density })
    }

    /// Returns the direction to the middle of a sun, chosen by a uniform number in proportion to
    /// its irradiance, and that irradiance over the probability.
    pub(crate) fn choose_middle(&self, mut which: f32) -> Option<(Vec3, Vec3)> {
        let last = self.discs.last()?;
        let chosen = self.discs.iter().find(|disc| {
            which -= disc.share;
            which < 0.0
        });
        let sun = chosen.unwrap_or(last);
        Some((sun.frame.n, sun.radiance / (self.density * sun.share)))
    }

    /// Returns the light of suns that a ray hits. `weight` returns the weight of a sun from the
    /// density with which [`choose`](Self::choose) returns its points.
    #[inline]
    pub(crate) fn along(&self, direction: Vec3, weight: impl Fn(f32) -> f32) -> Vec3 {
        let met = self.discs.iter().filter(|disc| {
            // The sine is exact where the cosine has no digits left.
            let middle = disc.frame.n;
            direction.dot(middle) > 0.0
                && direction.cross(middle).length_squared() < self.radius * self.radius
        });
        met.map(|disc| disc.radiance * weight(disc.share * self.density)).sum()
    }
}
