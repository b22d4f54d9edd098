//! Engines: a ray in, its radiance and the distance to the first surface out. Knows no beams and no sockets.
//!
//! The engine `path` is an unbiased path tracer ("The Rendering Equation", Kajiya 1986) with next-event estimation. What
//! materials mean is said at [`holo_scene::Bsdf`]; the conventions are those of Mitsuba 3's `diffuse`, `conductor`,
//! `roughconductor`, `thindielectric`, `dielectric` and `roughdielectric`, but that light which meets
//! several facets of a rough surface is not lost, and that indices of refraction hold between the solids that really meet:
//! bubbles in glass, water in a glass (module `medium`).
//!
//! Always true:
//! - A [`Traced`] is a function of (scene, settings, ray, seed): not of threads, processor or order.
//! - Radiance is finite and not negative. A path whose estimate is not finite counts as 0 and is counted
//!   ([`Tracer::nonfinite_paths`]).
//! - Rays travel in f32 relative to the scene's origin; rays from far away are brought near it in f64 first.
//! - A [`Tracer`] may be shared by any number of threads.

mod albedo;
mod bsdf;
#[cfg(test)]
mod bsdf_tests;
mod cached;
mod coat;
mod conductor;
mod deviations;
mod direct;
#[cfg(test)]
mod direct_tests;
mod ending;
#[cfg(test)]
mod energy_tests;
mod fresnel;
mod geometry;
mod images;
#[cfg(test)]
mod images_tests;
mod interface;
mod lights;
mod medium;
mod microfacet;
mod mirrors;
mod panes;
mod path;
mod sampler;
mod secondary;
#[cfg(test)]
mod secondary_tests;
mod straight;
mod usual;

pub use cached::{ACCURACIES, DEFAULT_ACCURACY};
pub use sampler::Sampler;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, Vec3};
use holo_light::Store;
use holo_raycast::{BuildError, Raycaster};
use holo_scene::Scene;
use serde::{Deserialize, Serialize};

use cached::Cached;
use path::{Direct, PathEngine, Start};
use straight::Straight;

/// Most paths per sample: beyond, one call would take seconds, and a worker could not be stopped.
pub const MAX_PATHS: u32 = 1 << 16;

/// Samples of the lights of a path, at its first surface that is not a mirror or glass, unless said otherwise.
///
/// Error squared times processor time with 1, 2 and 4 of them: cabin's living room 0.097, 0.081, 0.088; its bedroom 0.30, 0.28,
/// 0.34. Where all light comes from one quad it is one sample: the Cornell box, whose error is of indirect light, is as noisy and takes 10 %
/// less time.
pub const DEFAULT_LIGHT_SAMPLES: u32 = 2;

/// Ways on from that surface where all light comes from one quad, if any is indirect. Error squared times time on the Cornell box, for 64 of
/// them in each pixel, with 1, 2 and 4: 0.029, 0.026, 0.025; with 4 samples are half as many as with 2. Where direct light makes most of
/// the error there is one: with 1, 2 and 4 cabin's living room 0.131, 0.130, 0.184.
const BRANCHES: u32 = 2;

/// Most light samples of a path.
pub const MAX_LIGHT_SAMPLES: u32 = 256;

/// What a tracer is to do, beside the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// Limit of indirect light: how often light may be scattered by surfaces other than mirrors and glass after the first
    /// such surface. `None`: without limit; `Some(0)`: direct light only. Mirror reflection and smooth transmission do not count.
    pub bounces: Option<u32>,
    /// Paths averaged into one [`Traced`]: 1 to [`MAX_PATHS`]. A path may fork at its first surface that is not a mirror or glass.
    pub paths: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { bounces: None, paths: 1 }
    }
}

/// Why a tracer cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum TracerError {
    /// [`Settings::paths`] is 0 or above [`MAX_PATHS`].
    #[error("`paths` must be 1 to {MAX_PATHS}, found {0}")]
    Paths(u32),
    /// The scene cannot be traced.
    #[error("the scene cannot be traced: {0}")]
    Scene(#[from] BuildError),
}

/// One sample: what a ray carries back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traced {
    /// Radiance towards the ray's origin, linear RGB, W·sr⁻¹·m⁻².
    pub radiance: [f32; 3],
    /// World distance to the first surface, glass included; infinity if there is none. Or virtual distance:
    /// [`Tracer::with_virtual_distance`].
    pub distance: f64,
}

/// Independent means at most that [`Tracer::trace_with_variance`] makes: its estimate has a relative error of √(2/3) then, for paths
/// whose error is normal; more would tell more, and stratify less.
pub const REPLICATES: u32 = 4;

/// Traces rays through one scene.
#[derive(Debug)]
pub struct Tracer {
    raycaster: Arc<Raycaster>,
    engine: PathEngine,
    cached: Option<Cached>,
    straight: Option<Straight>,
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

    /// As [`new`](Self::new) with a hierarchy that exists already.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn with_raycaster(
        raycaster: Arc<Raycaster>,
        settings: Settings,
    ) -> Result<Self, TracerError> {
        let mut tracer =
            Self::with_direct(raycaster, settings, Direct::Both, DEFAULT_LIGHT_SAMPLES)?;
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
        let engine = PathEngine::new(&raycaster, settings.bounces, direct, light_samples);
        Ok(Self {
            raycaster,
            engine,
            cached: None,
            straight: None,
            settings,
            nonfinite: AtomicU64::new(0),
        })
    }

    /// As this one, with this many samples of the lights at a path's first surface that is not a mirror or glass, at least
    /// 1 and at most [`MAX_LIGHT_SAMPLES`]. Powers of two are stratified best.
    #[must_use]
    pub fn with_light_samples(mut self, samples: u32) -> Self {
        self.engine.light_samples = samples.clamp(1, MAX_LIGHT_SAMPLES);
        self
    }

    /// As this one, with the engine `cached`: indirect light within a relative error of `accuracy`, which is brought within
    /// [`ACCURACIES`].
    ///
    /// `name` seeds the records' numbers: tracers that share their records must have different ones, or they would trace the same
    /// rays. With one thread, the same name gives the same picture.
    #[must_use]
    pub fn with_cache(mut self, accuracy: f32, name: u64) -> Self {
        self.cached = Some(Cached::new(&self.engine, &self.raycaster, accuracy, name));
        self
    }

    /// As this one, with distances to what flat mirrors show and flat glass lets through, along the straightened ray, in place of those
    /// to mirror and glass (Larson & Simmons 1999, §2.3, `VDISTANCE`); infinity if that is the sky. Curved ones are themselves
    /// what is seen.
    #[must_use]
    pub fn with_virtual_distance(mut self) -> Self {
        self.straight = Straight::new(self.raycaster.scene());
        self
    }

    /// From now on, if the engine is `cached`: a sample that comes where there is no record of indirect light yet is a path, nearly as
    /// noisy as those of the engine `path`, until `effort` rays for each such sample make the next record. Unless this is called, every such sample
    /// makes a record, whatever it takes, and none is noisy.
    pub fn set_effort(&self, effort: u32) {
        if let Some(cached) = &self.cached {
            cached.set_effort(effort);
        }
    }

    /// The indirect light found so far, if the engine is `cached`.
    #[must_use]
    pub fn light(&self) -> Option<&Arc<Store>> {
        self.cached.as_ref().map(Cached::store)
    }

    /// The scene that is traced.
    #[must_use]
    pub fn scene(&self) -> &Arc<Scene> {
        self.raycaster.scene()
    }

    /// The hierarchy, for other uses of the same scene.
    #[must_use]
    pub fn raycaster(&self) -> &Arc<Raycaster> {
        &self.raycaster
    }

    /// What was asked for.
    #[must_use]
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Estimates the radiance that arrives at `origin` against `direction` (world, unit length), as the mean of
    /// `settings.paths` paths.
    ///
    /// Seeds of samples should differ; any will do. A ray that is not finite or has no direction sees black.
    #[must_use]
    pub fn trace(&self, origin: DVec3, direction: DVec3, seed: u64) -> Traced {
        self.trace_paths(origin, direction, seed, 0..u64::from(self.settings.paths))
    }

    /// The estimate of path number `path` of a sample alone: [`trace`](Self::trace) is the mean of paths 0 to `paths - 1`.
    #[must_use]
    pub fn trace_path(&self, origin: DVec3, direction: DVec3, seed: u64, path: u64) -> Traced {
        self.trace_paths(origin, direction, seed, path..path.saturating_add(1))
    }

    /// The mean of a range of path numbers of a sample, so that more paths can be added to earlier ones.
    #[must_use]
    pub fn trace_paths(
        &self,
        origin: DVec3,
        direction: DVec3,
        seed: u64,
        paths: std::ops::Range<u64>,
    ) -> Traced {
        match self.meet(origin, direction) {
            Ok((start, distance)) => {
                Traced { radiance: self.mean(start, seed, paths).to_array(), distance }
            }
            Err(traced) => traced,
        }
    }

    /// As [`trace`](Self::trace), of other random numbers, with the variance of the result by channel, estimated from its own
    /// paths: without bias, since they are dealt to [`REPLICATES`] means that are independent. `None` for one path, which
    /// tells nothing. Of the engine `cached`, what its records err by is not in it.
    ///
    /// The paths of [`trace`](Self::trace) are stratified together, so that nothing can be said of their mean but that it errs less
    /// than that of independent ones; here there are fewer in each stratification, and the mean varies more (in a diffuse room 1.4 to 1.6 times, for 2 to 16 paths).
    #[must_use]
    pub fn trace_with_variance(
        &self,
        origin: DVec3,
        direction: DVec3,
        seed: u64,
    ) -> (Traced, Option<[f64; 3]>) {
        let count = self.settings.paths.min(REPLICATES);
        let (start, distance) = match self.meet(origin, direction) {
            Ok(met) => met,
            Err(traced) => return (traced, (count > 1).then_some([0.0; 3])),
        };
        // Unequal numbers of paths do no harm: expectations are equal, and the variance of a plain mean of independent values is estimated
        // without bias whatever theirs are.
        let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
        for replicate in 0..count {
            let share = |i: u32| u64::from(self.settings.paths) * u64::from(i) / u64::from(count);
            let paths = 0..share(replicate + 1) - share(replicate);
            let mean = self
                .mean(
                    start,
                    sampler::mix(seed.wrapping_add(sampler::mix(u64::from(replicate)))),
                    paths,
                )
                .as_dvec3();
            sum += mean;
            squares += mean * mean;
        }
        let n = f64::from(count);
        let mean = sum / n;
        let traced = Traced { radiance: mean.as_vec3().to_array(), distance };
        let variance = (squares / n - mean * mean).max(DVec3::ZERO) / (n - 1.0);
        (traced, (count > 1).then(|| variance.to_array()))
    }

    /// The first surface of a ray and the distance to tell, or what the ray carries if there is none.
    fn meet(&self, origin: DVec3, direction: DVec3) -> Result<(Start<'static>, f64), Traced> {
        let direction = direction.normalize_or_zero();
        if !origin.is_finite() || direction == DVec3::ZERO {
            return Err(Traced { radiance: [0.0; 3], distance: f64::INFINITY });
        }
        let (hit, distance) = path::first_hit(&self.raycaster, origin, direction);
        if hit.is_none() {
            return Err(Traced { radiance: self.engine.sky().to_array(), distance });
        }
        let inside = self.engine.inside(&self.raycaster, origin);
        let start = Start::eye(hit, direction.as_vec3(), inside);
        let distance = match &self.straight {
            None => distance,
            Some(straight) => straight.distance(&self.engine, &self.raycaster, start, distance),
        };
        Ok((start, distance))
    }

    /// The mean of a range of path numbers.
    fn mean(&self, start: Start, seed: u64, paths: std::ops::Range<u64>) -> Vec3 {
        let count = paths.end.saturating_sub(paths.start).max(1);
        let mut sum = Vec3::ZERO;
        for path in paths {
            let mut sampler = Sampler::new(seed, path);
            let radiance = match &self.cached {
                None => self.engine.radiance(&self.raycaster, start, &mut sampler),
                Some(cached) => cached.radiance(&self.engine, &self.raycaster, start, &mut sampler),
            };
            if radiance.is_finite() {
                sum += radiance;
            } else {
                self.nonfinite.fetch_add(1, Ordering::Relaxed);
            }
        }
        (sum / count as f32).min(Vec3::MAX)
    }

    /// How many paths so far were dropped because their estimate was not finite. Anything but 0 deserves a look at the scene.
    #[must_use]
    pub fn nonfinite_paths(&self) -> u64 {
        self.nonfinite.load(Ordering::Relaxed)
    }
}
