//! The engine `cached`. It samples direct light, traces mirrors, glass and gloss, and interpolates
//! indirect light on diffuse surfaces from irradiance records ([`holo_light`]). All threads and
//! workers share the records.
//!
//! - The rays of a record end in other records. A ray that finds none continues as a path; one in
//!   [`COARSE_PATIENCE`] makes a coarse record there instead, whose rays continue as paths.
//! - Records leave out sunlight over mirrors and glass. Each sample aims a ray at it
//!   ([`sun_caustics`](crate::sun_caustics)).
//! - Some rays are aimed: at small bright surfaces near lamps ([`secondary`](crate::secondary)),
//!   and at lamps that flat mirrors show ([`images`](crate::images)).
//! - A record costs as much as hundreds of paths. Someone may wait for samples, so their cost is
//!   bounded ([`Cached::set_effort`]). A sample that may not make a record uses few records nearby
//!   or continues as a path. So useful samples arrive from the first moment.
//! - The error of a record stays in all samples around it. Once records cover what samples see, a
//!   long fill makes others with half the error ([`Record::grade`]).
//!
//! Invariants:
//! - Results depend on the records only within the engine's accuracy, with one exception. Paths
//!   that replace records bring only limited light from lamps over mirrors and glass
//!   ([`MAX_LAMP_OVER_MEAN`]). Such samples stay until better ones replace them.
//! - A record's number of rays and radius do not depend on the light that these rays bring, unless
//!   it contradicts nearby records. Contradicting records all get a smaller radius.
//! - So the expectation of interpolated light is that of paths, except for two errors. One is what
//!   gradients miss within a radius. The other is the limit on single rays. In a cabin with bottles
//!   and mirrors, it removes 0.2 % of the light of exact records and 1.5 % of that of coarse ones.

mod effort;
mod gather;
mod settings;

pub use settings::{ACCURACIES, DEFAULT_ACCURACY};

use std::cell::Cell;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use glam::Vec3;
use holo_light::{Found, Record, Store, grade_weight};
use holo_raycast::Raycaster;

use crate::bsdf::Scatter;
use crate::deviations::Deviations;
use crate::engine::PathEngine;
use crate::luminance::luminance;
use crate::mean_irradiance::MeanIrradiance;
use crate::mirrors::Mirrors;
use crate::path::Start;
use crate::policy::{PathPolicy, ShadingPoint};
use crate::sampler::{Purpose, Sampler, mix};
use effort::Effort;
use settings::*;

/// Quantities that follow from the accuracy.
#[derive(Clone, Copy, Debug)]
struct Quality {
    /// Requested relative error.
    accuracy: f32,
    /// Radius of a record over the harmonic mean distance of what it sees.
    reach: f32,
    /// Greatest radius of a record.
    max_radius: f32,
}

impl Quality {
    /// Returns the quality of records of a grade: half the error of the grade before.
    fn of_grade(&self, grade: u32) -> Quality {
        let halved = 0.5_f32.powi(grade as i32);
        Quality {
            accuracy: self.accuracy * halved,
            reach: self.reach * halved.sqrt(),
            max_radius: self.max_radius * halved.sqrt(),
        }
    }

    /// Returns the relative standard error to make a record with, from the radius that its
    /// surroundings allow.
    fn error(&self, kind: Kind, radius: f32) -> f32 {
        let (least, most) = (ERROR[kind as usize], MAX_ERROR[kind as usize]);
        self.accuracy * (least * self.max_radius / radius).min(most)
    }
}

/// The records of one scene, and what is needed to make more.
#[derive(Debug)]
pub(crate) struct Cached {
    store: Arc<Store>,
    quality: Quality,
    mirrors: Mirrors,
    /// True if mirrors or glass may focus light on surfaces.
    has_caustics: bool,
    effort: Effort,
    deviations: Deviations,
    mean_irradiance: MeanIrradiance,
    /// Makes the ids of this engine's records differ from those of other engines.
    salt: u64,
    /// Number of records made, for their ids.
    made: AtomicU64,
}

impl Cached {
    pub(crate) fn new(
        engine: &PathEngine,
        raycaster: &Raycaster,
        accuracy: f32,
        name: u64,
    ) -> Self {
        let accuracy = accuracy.clamp(*ACCURACIES.start(), *ACCURACIES.end());
        let reach = REACH * accuracy.sqrt();
        let max_radius = scene_size(raycaster) * MAX_RADIUS * reach;
        let has_caustics =
            engine.nesting.is_some() || engine.surfaces.iter().any(|s| s.scatter.is_delta());
        Self {
            store: Arc::new(Store::new(max_radius / RADIUS_RATIO)),
            quality: Quality { accuracy, reach, max_radius },
            mirrors: Mirrors::find(raycaster.scene(), &engine.surfaces),
            has_caustics,
            effort: Effort::unlimited(),
            deviations: Deviations::default(),
            mean_irradiance: MeanIrradiance::new(),
            salt: mix(name),
            made: AtomicU64::default(),
        }
    }

    pub(crate) fn store(&self) -> &Arc<Store> {
        &self.store
    }

    /// Implements [`Tracer::set_effort`](crate::Tracer::set_effort).
    pub(crate) fn set_effort(&self, limit: u32) {
        self.effort.set(limit);
    }

    /// Implements [`Tracer::set_measured_effort`](crate::Tracer::set_measured_effort).
    pub(crate) fn set_measured_effort(&self) {
        self.effort.set(MEASURED);
    }

    /// Returns one estimate of the radiance that arrives against `start.direction`.
    pub(crate) fn radiance(
        &self,
        engine: &PathEngine,
        raycaster: &Raycaster,
        start: Start,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let role = Cell::new(Role::Eye);
        engine.follow(raycaster, start, &CachePolicy { cached: self, engine, role }, sampler)
    }

    /// Returns the irradiance by indirect light at a point that an eye sees. Makes a record if
    /// there are too few. `None` if that would exceed the effort.
    fn irradiance(&self, engine: &PathEngine, at: &ShadingPoint) -> Option<Vec3> {
        let store = &self.store;
        let found = self.look_up(at, Kind::Exact);
        let weight = found.map_or(0.0, |found| found.weight);
        // Grades come one after the other, also in a room that is new to an old file.
        let lacking =
            (0..=self.effort.grade(store)).find(|&grade| weight < MIN_WEIGHT * grade_weight(grade));
        let Some(grade) = lacking else {
            self.effort.add_served(store);
            return found.map(|found| found.irradiance);
        };
        let begun = if store.is_full() { None } else { self.effort.begin_record(store) };
        let Some(_begun) = begun else {
            return found
                .filter(|found| found.weight >= MIN_WEIGHT_WITHOUT_RECORD)
                .map(|found| found.irradiance);
        };
        let made = self.make_record(engine, at, Kind::Exact, grade);
        let weight = grade_weight(grade);
        Some(found.map_or(made, |found| {
            (found.irradiance * found.weight + made * weight) / (found.weight + weight)
        }))
    }

    /// Interpolates the irradiance by indirect light between records that reach the point and see
    /// it. An exact look-up ignores coarse records.
    fn look_up(&self, at: &ShadingPoint, kind: Kind) -> Option<Found> {
        let &ShadingPoint { raycaster, point, normal, lit, .. } = at;
        let normals = [normal, lit];
        let enough = match kind {
            Kind::Exact => grade_weight(self.store.grade()),
            Kind::Coarse => 1.0,
        };
        let enough = enough * ENOUGH_WEIGHT[kind as usize];
        self.store.irradiance_around(point.point, normals, enough, |record| {
            record.kind() > kind as u32
                || raycaster.parted(point, normal, record.point.into(), record.normal.into())
        })
    }

    fn insert(&self, record: Record, at: &ShadingPoint) {
        let &ShadingPoint { raycaster, point, normal, .. } = at;
        self.store.insert(record, |other| {
            raycaster.parted(point, normal, other.point.into(), other.normal.into())
        });
    }

    /// Makes a record of the light that arrives at a point, and returns its irradiance.
    #[cold]
    fn make_record(&self, engine: &PathEngine, at: &ShadingPoint, kind: Kind, grade: u32) -> Vec3 {
        let quality = self.quality.of_grade(grade);
        // The pilot is thrown away. If it were part of the record, a pilot that missed the light
        // would agree with itself and ask for few rays.
        let pilot_rays =
            pilot_rays(ERROR[kind as usize] * quality.accuracy, PILOT_RAYS[kind as usize]);
        let pilot = self.gather(engine, at, &quality, pilot_rays, kind, f32::INFINITY);
        let error = quality.error(kind, pilot.radius);
        let deviation = self.deviations.add(&pilot);
        let rays = ((deviation / error).powi(2) as u32).clamp(MIN_RAYS, MAX_RAYS << (2 * grade));
        let mut record = self.gather(engine, at, &quality, rays, kind, error);
        record.flags = grade << 8 | kind as u32;
        if kind == Kind::Exact {
            // The radius must not depend on the record's own light. Otherwise records that are too
            // bright would serve less of the surface than those that are too dark. Noisy records
            // get a smaller radius, so that more neighbours take part.
            let reached = deviation / (record.rays as f32).sqrt();
            record.radius =
                record.radius.min(gradient_limit(&pilot)) * (error / reached).clamp(0.25, 1.0);
        }
        self.insert(record, at);
        // Without a texture of normals, this is the record's own irradiance.
        if at.lit == at.normal {
            record.irradiance.into()
        } else {
            record.extrapolate(at.point.point, at.lit)
        }
    }
}

/// The purpose of a path of this engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// A sample for an eye.
    Eye,
    /// The same, after a surface without a record.
    Path,
    /// An exact record.
    Record,
    /// A coarse record.
    Coarse,
}

/// The policy of this engine: paths end where irradiance is known.
#[derive(Clone)]
struct CachePolicy<'a> {
    cached: &'a Cached,
    engine: &'a PathEngine,
    /// Changes from `Eye` to `Path` along the way.
    role: Cell<Role>,
}

impl PathPolicy for CachePolicy<'_> {
    type Lessons = ();

    #[inline]
    fn indirect(&self, at: &ShadingPoint, sampler: &mut Sampler) -> Option<Vec3> {
        let Scatter::Diffuse(kd) = at.scatter else { return None };
        let bounces = self.engine.bounces;
        let irradiance = if at.scatterings > bounces {
            if self.cached.has_caustics {
                return None;
            }
            return Some(Vec3::ZERO);
        } else if bounces != u32::MAX && at.scatterings > 1 {
            // A record contains light of all bounces; here only some may count.
            return None;
        } else if self.role.get() == Role::Eye {
            let Some(irradiance) = self.cached.irradiance(self.engine, at) else {
                self.role.set(Role::Path);
                return None;
            };
            irradiance
        } else {
            match self.cached.look_up(at, Kind::Coarse) {
                Some(found) => found.irradiance,
                None if self.role.get() == Role::Record
                    && at.scatterings == 2
                    && coarse_is_due(at, sampler) =>
                {
                    self.cached.make_record(self.engine, at, Kind::Coarse, 0)
                }
                None => return None,
            }
        };
        let over_mirrors = self.engine.sun_caustic(at, sampler);
        Some(*kd * (irradiance + over_mirrors) * FRAC_1_PI)
    }

    #[inline]
    fn forks(&self, scatterings: u32) -> u32 {
        let first = match self.role.get() {
            Role::Eye => 0,
            Role::Path | Role::Record | Role::Coarse => 1,
        };
        if scatterings == first { FORKS } else { 0 }
    }

    fn clamped(&self, light: Vec3) -> Vec3 {
        // If the store is full, paths are not temporary and must not be biased.
        if self.role.get() != Role::Path || self.cached.store.is_full() {
            return light;
        }
        let mean = self.cached.mean_irradiance.luminance(&self.cached.store) * FRAC_1_PI;
        let (most, found) = (MAX_LAMP_OVER_MEAN * mean, luminance(light.into()));
        if found > most { light * (most / found) } else { light }
    }

    #[inline]
    fn finds_suns(&self, scatterings: u32) -> bool {
        // A record's rays have one scattering before them, that of the record's surface.
        match self.role.get() {
            Role::Eye | Role::Path => true,
            Role::Record | Role::Coarse => scatterings > 1,
        }
    }

    #[inline]
    fn light_samples(&self, engine: &PathEngine, scatterings: u32, ends: bool) -> u32 {
        match self.role.get() {
            Role::Eye if ends || scatterings > engine.bounces => {
                engine.light_samples.max(LIGHT_SAMPLES)
            }
            Role::Eye | Role::Path if scatterings == 1 => engine.light_samples,
            _ => 1,
        }
    }
}

/// Returns the number of pilot rays for a record of this error.
fn pilot_rays(error: f32, [least, most]: [u32; 2]) -> u32 {
    ((PILOT_SHARE / (error * error)) as u32).clamp(least, most)
}

/// Returns whether this ray is the one in [`COARSE_PATIENCE`] that makes a record.
fn coarse_is_due(at: &ShadingPoint, sampler: &mut Sampler) -> bool {
    sampler.turn(at.depth, Purpose::Record);
    sampler.one() * (COARSE_PATIENCE as f32) < 1.0
}

/// Returns half the distance over which the steepest gradient changes the light by its own size.
fn gradient_limit(record: &Record) -> f32 {
    let steepest = record.shift.iter().map(|g| Vec3::from(*g).length()).fold(0.0, f32::max);
    let light = record.irradiance.iter().copied().fold(0.0, f32::max);
    if steepest > 0.0 { 0.5 * light / steepest } else { f32::INFINITY }
}

/// Returns the longest side of the scene's bounds.
fn scene_size(raycaster: &Raycaster) -> f32 {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for vertex in raycaster.scene().points() {
        (low, high) = (low.min(vertex), high.max(vertex));
    }
    (high - low).max_element().max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grade_halves_the_error_and_the_area_of_records() {
        let first = Quality { accuracy: 0.04, reach: 0.4, max_radius: 1.0 };
        for grade in 1..=3 {
            let (before, after) = (first.of_grade(grade - 1), first.of_grade(grade));
            let area = |quality: Quality| quality.max_radius.powi(2);
            assert!((area(after) / area(before) - 0.5).abs() < 1e-5);
            for (kind, share) in [(Kind::Exact, 1.0), (Kind::Exact, 0.7), (Kind::Coarse, 0.2)] {
                let error = |quality: Quality| quality.error(kind, share * quality.max_radius);
                assert!((error(after) / error(before) - 0.5).abs() < 1e-5, "{grade} {kind:?}");
            }
        }
        assert_eq!(first.of_grade(0).error(Kind::Exact, 1.0), 0.02);
    }
}
