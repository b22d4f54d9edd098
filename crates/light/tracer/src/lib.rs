//! Engines: they compute the radiance along a ray and the distance to the first surface. This crate
//! knows neither beams nor sockets.
//!
//! The engine `path` is an unbiased path tracer (module `path`). The paths of the engine `gather`
//! end in shared cells of surface light (module `gather`). [`holo_scene::Bsdf`] defines the
//! materials. They follow Mitsuba 3's `diffuse`, `conductor`, `roughconductor`, `thindielectric`,
//! `dielectric` and `roughdielectric`, with two differences. Light that meets several facets of a
//! rough surface is not lost. Indices of refraction apply between the solids that really touch:
//! bubbles in glass, water in a glass (module `medium`). A path tracer with cached reflections is
//! biased (module `reflections`).
//!
//! Invariants:
//! - The engine `path` gives a [`Traced`] that is a function of (scene, settings, ray, seed): not
//!   of threads, processor or order.
//! - Radiance is finite and not negative. A path whose estimate is not finite contributes 0 and is
//!   counted ([`Tracer::nonfinite_paths`]).
//! - Rays travel in f32 relative to the scene's origin. Rays from far away are moved near it in
//!   f64.
//! - Any number of threads may share a [`Tracer`].

mod aim;
mod albedo;
mod bsdf;
#[cfg(test)]
mod bsdf_tests;
mod caustics;
#[cfg(test)]
mod caustics_tests;
mod coat;
mod conductor;
#[cfg(test)]
mod details_tests;
mod direct;
#[cfg(test)]
mod direct_tests;
#[cfg(test)]
mod energy_tests;
mod engine;
mod gather;
mod geometry;
mod interface;
mod lights;
mod luminance;
mod medium;
mod panes;
mod path;
mod policy;
#[cfg(test)]
mod punctual_tests;
mod reflections;
#[cfg(test)]
mod reflections_tests;
mod roughness;
mod sampled;
mod sampler;
mod secondary;
#[cfg(test)]
mod secondary_tests;
mod shading;
#[cfg(test)]
mod shading_tests;
mod sky;
mod suns;
mod surface;
mod textured;
mod virtual_distance;
mod weighting;

pub use gather::{SharedCell, Verdict};
pub use reflections::{ReflectionReport, ReflectionSettings};
pub use sampler::Sampler;

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, Vec3};
use holo_raycast::{BuildError, Raycaster};
use holo_scene::Scene;
use serde::{Deserialize, Serialize};

use engine::PathEngine;
use gather::Gather;
use path::Start;
use reflections::CachedReflections;
use virtual_distance::VirtualDistance;
use weighting::Direct;

/// Most paths per sample. More would make one call take seconds, and a worker could not be stopped.
pub const MAX_PATHS: u32 = 1 << 16;

/// Light samples of a path at its first surface that is neither a mirror nor glass. Scenes whose
/// light comes from one quad take 1 instead (docs/notes/path-tracing.md).
const LIGHT_SAMPLES: u32 = 2;

/// Continuations of a path from that surface, if all light comes from one quad and indirect light
/// counts. Other scenes take 1 (docs/notes/path-tracing.md).
const BRANCHES: u32 = 4;

/// The settings of a tracer, besides the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// Limit of indirect light: the most scatterings after the first, by surfaces other than
    /// mirrors and glass. `None`: no limit. `Some(0)`: direct light only. Mirror reflection and
    /// smooth transmission do not count.
    pub bounces: Option<u32>,
    /// Paths averaged into one [`Traced`]: 1 to [`MAX_PATHS`]. A path may branch at its first
    /// surface that is neither a mirror nor glass.
    pub paths: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { bounces: None, paths: 1 }
    }
}

/// The reason why a tracer cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum TracerError {
    /// [`Settings::paths`] is 0 or above [`MAX_PATHS`].
    #[error("`paths` must be 1 to {MAX_PATHS}, found {0}")]
    Paths(u32),
    /// The scene cannot be traced.
    #[error("the scene cannot be traced: {0}")]
    Scene(#[from] BuildError),
}

/// One traced ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traced {
    /// Radiance towards the ray's origin, linear RGB, W·sr⁻¹·m⁻².
    pub radiance: [f32; 3],
    /// World distance to the first surface, including glass; infinity if the ray hits nothing. A
    /// virtual distance after [`Tracer::with_virtual_distance`].
    pub distance: f64,
}

/// Most independent means that [`Tracer::trace_with_variance`] makes. Its variance then has a
/// relative error of √(2/3) if the paths' error is normal. More means would lower that error, and
/// stratify less.
const REPLICATES: u32 = 4;

/// Traces rays through one scene.
#[derive(Debug)]
pub struct Tracer {
    raycaster: Arc<Raycaster>,
    /// The same caster, for rays of light.
    light: Arc<Raycaster>,
    engine: PathEngine,
    gather: Option<Gather>,
    virtual_distance: Option<VirtualDistance>,
    reflections: Option<CachedReflections>,
    settings: Settings,
    nonfinite: AtomicU64,
}

impl Tracer {
    /// Prepares a scene: builds its hierarchy and its table of lights.
    ///
    /// # Errors
    /// Settings out of range, or a scene that cannot be traced.
    pub fn new(scene: Arc<Scene>, settings: Settings) -> Result<Self, TracerError> {
        Self::with_raycaster(Arc::new(Raycaster::build(scene)?), settings)
    }

    /// Prepares a scene whose hierarchy exists already.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn with_raycaster(
        raycaster: Arc<Raycaster>,
        settings: Settings,
    ) -> Result<Self, TracerError> {
        let mut tracer = Self::with_direct(raycaster, settings, Direct::Both, LIGHT_SAMPLES)?;
        if tracer.engine.lights.is_one() {
            tracer.engine.light_samples = 1;
            tracer.engine.branches = if settings.bounces == Some(0) { 1 } else { BRANCHES };
        }
        Ok(tracer)
    }

    fn with_direct(
        raycaster: Arc<Raycaster>,
        settings: Settings,
        direct: Direct,
        light_samples: u32,
    ) -> Result<Self, TracerError> {
        if !(1..=MAX_PATHS).contains(&settings.paths) {
            return Err(TracerError::Paths(settings.paths));
        }
        let light = match raycaster.has_covers() {
            true => Arc::new(raycaster.by_chance()),
            false => raycaster.clone(),
        };
        let engine = PathEngine::new(&light, settings.bounces, direct, light_samples);
        Ok(Self {
            raycaster,
            light,
            engine,
            gather: None,
            virtual_distance: None,
            reflections: None,
            settings,
            nonfinite: AtomicU64::new(0),
        })
    }

    /// Switches to the engine `gather`: paths end in cells of surface light that all threads share.
    #[must_use]
    pub fn with_gather(mut self) -> Self {
        self.gather = Some(Gather::new(&self.engine, &self.raycaster));
        self
    }

    /// Switches to virtual distances (Larson & Simmons 1999, §2.3, `VDISTANCE`).
    ///
    /// The distance is measured along the straightened ray to the surface that flat mirrors show
    /// and flat glass lets through. Without this setting, it is the distance to the mirror or
    /// glass. It is infinite if that is the sky. Curved mirrors and glass have their own distance.
    #[must_use]
    pub fn with_virtual_distance(mut self) -> Self {
        self.virtual_distance = VirtualDistance::new(self.raycaster.scene());
        self
    }

    /// Switches to cached reflections: rays that leave curved mirrors and smooth glass end in a
    /// cube of texels around the object, once these are filled. Pictures have a bias. They depend
    /// on earlier rays of all threads. The engine `gather` does not use the cubes.
    #[must_use]
    pub fn with_cached_reflections(mut self, settings: ReflectionSettings) -> Self {
        self.reflections = CachedReflections::new(self.raycaster.scene(), settings);
        self
    }

    /// Returns how much the cubes of cached reflections know.
    #[must_use]
    pub fn reflection_report(&self) -> ReflectionReport {
        self.reflections.as_ref().map_or_else(Default::default, CachedReflections::report)
    }

    /// Lets eyes see the disc of the sky's sun, directly and over mirrors and glass. Without this
    /// setting, it only lights surfaces: beams would spread its disc.
    #[must_use]
    pub fn with_visible_sun(mut self) -> Self {
        self.engine.visible_sun = self.raycaster.scene().sky.sun().copied();
        self
    }

    /// Returns the number of cells of surface light, if the engine is `gather`.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        self.gather.as_ref().map_or(0, Gather::cell_count)
    }

    /// Returns the estimates of cells of surface light that this process made and that were not
    /// returned before, of at most `most` cells. None unless the engine is `gather`.
    #[must_use]
    pub fn new_cells(&self, most: usize) -> Vec<SharedCell> {
        self.gather.as_ref().map_or_else(Vec::new, |gather| gather.new_cells(most))
    }

    /// Takes cells of surface light that another process made, if the engine is `gather`. They
    /// count once the maker's light agrees with own estimates
    /// ([`review_cells`](Self::review_cells)) and the caller has said that they may
    /// ([`trust_cells`](Self::trust_cells)). If it no longer agrees, all cells are forgotten, and
    /// that verdict is returned.
    pub fn receive_cells(&self, maker: u16, cells: &[SharedCell]) -> Option<Verdict> {
        self.gather.as_ref()?.receive(&self.raycaster, maker, cells)
    }

    /// Compares received cells with own estimates. Returns the makers about whom that decides.
    #[must_use]
    pub fn review_cells(&self) -> Vec<(u16, Verdict)> {
        self.gather.as_ref().map_or_else(Vec::new, |gather| gather.review(&self.raycaster))
    }

    /// Lets the cells of a maker count that [`review_cells`](Self::review_cells) found to agree.
    pub fn trust_cells(&self, maker: u16) {
        if let Some(gather) = &self.gather {
            gather.trust(&self.raycaster, maker);
        }
    }

    /// Returns the makers whose cells count.
    #[must_use]
    pub fn trusted_makers(&self) -> Vec<u16> {
        self.gather.as_ref().map_or_else(Vec::new, Gather::trusted)
    }

    /// Returns the hierarchy, for other uses of the same scene.
    #[must_use]
    pub fn raycaster(&self) -> &Arc<Raycaster> {
        &self.raycaster
    }

    /// Estimates the radiance that arrives at `origin` against `direction` (world coordinates) as
    /// the mean of `settings.paths` paths.
    ///
    /// Seeds of different samples should differ; any values will do. The result is black if the ray
    /// is not finite or has no direction.
    #[must_use]
    pub fn trace(&self, origin: DVec3, direction: DVec3, seed: u64) -> Traced {
        self.trace_paths(origin, direction, seed, 0..u64::from(self.settings.paths))
    }

    /// Returns the estimate of one path of a sample. [`trace`](Self::trace) returns the mean of
    /// paths 0 to `paths - 1`.
    #[must_use]
    pub fn trace_path(&self, origin: DVec3, direction: DVec3, seed: u64, path: u64) -> Traced {
        self.trace_paths(origin, direction, seed, path..path.saturating_add(1))
    }

    /// Returns the mean of a range of path numbers of a sample, so that more paths can be added to
    /// earlier ones.
    #[must_use]
    pub fn trace_paths(
        &self,
        origin: DVec3,
        direction: DVec3,
        seed: u64,
        paths: Range<u64>,
    ) -> Traced {
        match self.first_surface(origin, direction) {
            Ok((start, distance)) => {
                Traced { radiance: self.mean(start, seed, paths).to_array(), distance }
            }
            Err(traced) => traced,
        }
    }

    /// Estimates radiance as [`trace`](Self::trace) does, from other random numbers, together with
    /// the variance of the result by channel.
    ///
    /// The variance is estimated without bias from the paths themselves, which are dealt to up to 4
    /// independent means. It is `None` for one path. It leaves out the error of cells (engine
    /// `gather`).
    ///
    /// [`trace`](Self::trace) stratifies all paths together. This lowers the error but leaves its
    /// size unknown. Here each mean has fewer strata, so the result varies more: 1.4 to 1.6 times
    /// for 2 to 16 paths in a diffuse room.
    #[must_use]
    pub fn trace_with_variance(
        &self,
        origin: DVec3,
        direction: DVec3,
        seed: u64,
    ) -> (Traced, Option<[f64; 3]>) {
        let count = self.settings.paths.min(REPLICATES);
        let (start, distance) = match self.first_surface(origin, direction) {
            Ok(found) => found,
            Err(traced) => return (traced, (count > 1).then_some([0.0; 3])),
        };
        // Means of unequal numbers of paths are fine. They have the same expectation, and the
        // estimated variance of a plain mean of independent values is unbiased whatever their own
        // variances are.
        let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
        for replicate in 0..count {
            let share = |i: u32| u64::from(self.settings.paths) * u64::from(i) / u64::from(count);
            let paths = 0..share(replicate + 1) - share(replicate);
            let seed = holo_sobol::mix(seed.wrapping_add(holo_sobol::mix(u64::from(replicate))));
            let mean = self.mean(start, seed, paths).as_dvec3();
            sum += mean;
            squares += mean * mean;
        }
        let n = f64::from(count);
        let mean = sum / n;
        let traced = Traced { radiance: mean.as_vec3().to_array(), distance };
        let variance = (squares / n - mean * mean).max(DVec3::ZERO) / (n - 1.0);
        (traced, (count > 1).then(|| variance.to_array()))
    }

    /// Finds the first surface of a ray and the distance to report. `Err` is the result for a ray
    /// that meets nothing.
    fn first_surface(&self, origin: DVec3, direction: DVec3) -> Result<(Start, f64), Traced> {
        let direction = direction.normalize_or_zero();
        if !origin.is_finite() || direction == DVec3::ZERO {
            return Err(Traced { radiance: [0.0; 3], distance: f64::INFINITY });
        }
        let (hit, distance) = path::first_hit(&self.light, origin, direction);
        if hit.is_none() {
            return Err(Traced {
                radiance: (self.engine.sky.along_exactly(direction)
                    + self.engine.seen_disc(direction))
                .to_array(),
                distance,
            });
        }
        let inside = self.engine.inside(&self.light, origin);
        let start = Start::eye(hit, direction.as_vec3(), inside);
        let distance = match &self.virtual_distance {
            None => distance,
            Some(virtual_distance) => {
                virtual_distance.along(&self.engine, &self.light, start, distance)
            }
        };
        Ok((start, distance))
    }

    /// Returns the mean of a range of path numbers.
    fn mean(&self, start: Start, seed: u64, paths: Range<u64>) -> Vec3 {
        let count = paths.end.saturating_sub(paths.start).max(1);
        let mut sum = Vec3::ZERO;
        for path in paths {
            let mut sampler = Sampler::new(seed, path);
            let (engine, raycaster) = (&self.engine, &*self.light);
            let radiance = match (&self.gather, &self.reflections) {
                (Some(gather), _) => gather.radiance(engine, raycaster, start, &mut sampler),
                (None, Some(cached)) => cached.radiance(engine, raycaster, start, &mut sampler),
                (None, None) => engine.radiance(raycaster, start, &mut sampler),
            };
            if radiance.is_finite() {
                sum += radiance;
            } else {
                self.nonfinite.fetch_add(1, Ordering::Relaxed);
            }
        }
        (sum / count as f32).min(Vec3::MAX)
    }

    /// Returns how many paths so far were dropped because their estimate was not finite. Any value
    /// other than 0 hints at a problem with the scene.
    #[must_use]
    pub fn nonfinite_paths(&self) -> u64 {
        self.nonfinite.load(Ordering::Relaxed)
    }
}
