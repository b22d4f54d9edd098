//! The engine `cached`: direct light sampled, light chains of mirrors, glass and gloss traced, and indirect light on diffuse surfaces
//! interpolated from records that all threads and all workers share ([`holo_light`]).
//!
//! A record's rays end in records too; where there are none, they go on as paths, and one in [`COARSE_PATIENCE`] makes a coarse record
//! there, whose own rays go on as paths. Where small surfaces beside lamps send on much light (`secondary`), or flat mirrors
//! show lamps (`images`), some rays are aimed at them. A record takes as long as hundreds of paths: samples that somebody waits for
//! take those that are near, or go on as paths, too, where there are none, and for each of them so many rays of records are traced
//! ([`Cached::set_effort`]), so that there are useful samples from the first moment on.
//!
//! Always true:
//! - what is traced does not depend on the cache but within the engine's accuracy, and in what paths that stand in for records, while not all
//!   that are wanted may be made, have of lamps by way of mirrors and glass ([`MOST_ALONE`]): such samples stay until better ones take their place;
//! - how many rays a record has, and how far it reaches, do not depend on the light that these rays bring, unless it contradicts
//!   records around, which then reach less far, too: its expectation, and that of what is interpolated, is that of paths, but for what
//!   gradients leave over a radius, and for what single rays bring beyond the accuracy, in a cabin with bottles and mirrors 0.2 % of
//!   exact records' light and 1.5 % of coarse ones'.

use std::cell::Cell;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use glam::Vec3;
use holo_light::{Arrival, Found, Hemisphere, Record, Source, Store, hold};
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};

use crate::bsdf::Scatter;
use crate::deviations::Deviations;
use crate::direct::power_heuristic;
use crate::ending::{Ending, Met};
use crate::geometry::Frame;
use crate::images::{Aims, Images};
use crate::lights::luminance;
use crate::medium::Inside;
use crate::mirrors::Mirrors;
use crate::path::{Arrived, PathEngine, Start};
use crate::sampler::{Purpose, Sampler, mix};
use crate::secondary::Aimed;
use crate::usual::Usual;

/// Smooth surfaces at which the light that comes straight to an eye, a record or a path in its place is followed both ways: of what a
/// pane reflects, one ray in ten would have the weight of ten.
const FORKS: u32 = 2;

/// Relative error of indirect light that is aimed at unless said otherwise.
pub const DEFAULT_ACCURACY: f32 = 0.03;

/// Least and greatest accuracy that can be asked for.
pub const ACCURACIES: std::ops::RangeInclusive<f32> = 0.002..=0.5;

/// Samples of the lights at a first diffuse surface: with clean indirect light, direct light is what is left of the noise.
const LIGHT_SAMPLES: u32 = 10;

/// [`Record::flags`]: for what is looked at, or for the rays of other records only. What depends on it is a pair, in this order.
const EXACT: u32 = 0;
const COARSE: u32 = 1;

/// Rays that tell how many a record needs, at least and at most, and over those that it would need if they differed by their mean: with fewer,
/// many pilots do not meet what is bright.
const PILOT_RAYS: [[u32; 2]; 2] = [[64, 256], [32, 128]];
const PILOT_SHARE: f32 = 0.3;

/// Rays of a record at least.
const LEAST_RAYS: u32 = 64;

/// Rays of a record at most.
const MOST_RAYS: u32 = 1 << 13;

/// Standard error over the accuracy of a record that reaches as far as any may. Those that reach less far serve less of the surface, by
/// the square of their radius, and of what is seen many of them share: the same error of the whole costs least if rays grow like that, too (Neyman
/// 1934, "On the Two Different Aspects of the Representative Method"). A coarse one is seen by thousands of rays and by none that is
/// looked at, but large ones are part of what every record around sees, and where light comes through a door, the few behind the door
/// decide how bright all is on this side.
const ERROR: [f32; 2] = [0.5, 1.0];

/// The same of any record at most: however small, an exact one may fill what somebody looks at.
const MOST_ERROR: [f32; 2] = [1.0, 8.0];

/// Radius of a record over the harmonic mean distance, over the root of the accuracy: what gradients leave grows with the square
/// of the distance.
const REACH: f32 = 2.0;

/// Greatest radius over the scene's size, over the same.
const GREATEST: f32 = 0.3;

/// Greatest radius over the least: along edges, where radii shrink to nothing, records would be without number.
const SPREAD: f32 = 16.0;

/// Rays aimed at sources of indirect light, and at images of lamps, over those over the hemisphere.
const AIMED: f32 = 0.2;

/// Rays of records that end where there is no record, for each that makes one.
const COARSE_PATIENCE: u32 = 8;

/// A record is made where the weights of those there add up to less: with 0.3, there are parts of surfaces that one alone decides about, and its
/// error is theirs.
const LEAST_WEIGHT: f32 = 0.6;

/// The same for a sample that must not make one: a path is noisier than what there is.
const WEIGHT_FOR_NOW: f32 = 0.3;

/// Radiance that a path in the place of a record brings from a lamp over mirrors or glass at most, over that of the scene's records: one
/// path in ten thousand has hundreds of times as much as what is around, and shows for as long as hundreds of samples take to come. Of
/// records' rays none may bring more than a few times the mean either. Of all light in samples for a display this takes 0.03 ± 0.01 % in a
/// cabin, and in a small room with a large mirror 1.4 ± 0.2 % of the first four a pixel and 0.09 ± 0.01 % from the 64th on.
const MOST_ALONE: f32 = 8.0;

/// Where the weights of records add up to so much, no more are looked for: what is looked at is the smoother for more, what is
/// averaged over a hemisphere is not.
const ENOUGH: [f32; 2] = [4.0, 1.0];

/// An effort without bounds.
const WHATEVER_IT_TAKES: u32 = u32::MAX;

/// What follows from the accuracy.
#[derive(Clone, Copy, Debug)]
struct Quality {
    /// Relative error that is wanted.
    accuracy: f32,
    /// Radius of a record over the harmonic mean distance of what it sees.
    reach: f32,
    /// Radius at most.
    greatest: f32,
}

impl Quality {
    /// Relative standard error that a record is made with, by how far what it sees lets it reach: `least` and `most` are over the accuracy.
    fn error(&self, least: f32, radius: f32, most: f32) -> f32 {
        self.accuracy * (least * self.greatest / radius).min(most)
    }
}

/// The cache of one scene, and what makes its records.
#[derive(Debug)]
pub(crate) struct Cached {
    store: Arc<Store>,
    quality: Quality,
    mirrors: Mirrors,
    /// Whether mirrors or glass may throw light on surfaces.
    has_caustics: bool,
    /// Rays for records for each sample that comes where there is none: with fewer, it is a path. [`WHATEVER_IT_TAKES`]: every such sample makes a
    /// record.
    effort: AtomicU32,
    /// Rays for records that such samples have brought.
    allowed: AtomicU64,
    /// Rays for records so far.
    rays: AtomicU64,
    deviations: Deviations,
    usual: Usual,
    /// Records' names: this engine's own, and how many it has made.
    salt: u64,
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
        let size = extent(raycaster);
        let reach = REACH * accuracy.sqrt();
        let quality = Quality { accuracy, reach, greatest: size * GREATEST * reach };
        let store = Arc::new(Store::new(quality.greatest / SPREAD));
        let [allowed, rays, made] = Default::default();
        let (deviations, usual) = (Deviations::default(), Usual::new());
        let effort = AtomicU32::new(WHATEVER_IT_TAKES);
        let mirrors = Mirrors::find(raycaster.scene(), &engine.surfaces);
        let has_caustics =
            engine.nesting.is_some() || engine.surfaces.iter().any(|s| s.scatter.is_delta());
        Self {
            store,
            quality,
            mirrors,
            has_caustics,
            effort,
            allowed,
            rays,
            deviations,
            usual,
            salt: mix(name),
            made,
        }
    }

    pub(crate) fn store(&self) -> &Arc<Store> {
        &self.store
    }

    /// One estimate of the radiance that arrives against a first hit.
    pub(crate) fn radiance(
        &self,
        engine: &PathEngine,
        raycaster: &Raycaster,
        start: Start,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let role = Cell::new(Role::Eye);
        engine.follow(raycaster, start, &Light { cached: self, engine, role }, sampler)
    }

    /// Irradiance by indirect light at a point that an eye sees; if there is no record near enough, one is made or `None` given.
    fn irradiance(&self, engine: &PathEngine, met: &Met) -> Option<Vec3> {
        let found = self.known(met, EXACT);
        if let Some(found) = found.filter(|found| found.weight >= LEAST_WEIGHT) {
            return Some(found.irradiance);
        }
        if self.store.is_full() || !self.affords_record() {
            return found
                .filter(|found| found.weight >= WEIGHT_FOR_NOW)
                .map(|found| found.irradiance);
        }
        let made = self.make(engine, met, EXACT);
        // The new record has weight 1.
        Some(
            found.map_or(made, |found| {
                (found.irradiance * found.weight + made) / (found.weight + 1.0)
            }),
        )
    }

    /// See [`Tracer::set_effort`](crate::Tracer::set_effort).
    pub(crate) fn set_effort(&self, effort: u32) {
        self.effort.store(effort, Ordering::Relaxed);
    }

    /// Whether one more sample that lacks a record is enough for the next.
    fn affords_record(&self) -> bool {
        let effort = self.effort.load(Ordering::Relaxed);
        if effort == WHATEVER_IT_TAKES {
            return true;
        }
        let allowed = self.allowed.fetch_add(u64::from(effort), Ordering::Relaxed);
        self.rays.load(Ordering::Relaxed) <= allowed
    }

    /// Irradiance by indirect light, as far as there are records in sight that go to the point: exact ones, or for the rays of records
    /// any.
    fn known(&self, met: &Met, coarse: u32) -> Option<Found> {
        let &Met { raycaster, point, normal, .. } = met;
        self.store.irradiance(point.point, normal, ENOUGH[coarse as usize], |record| {
            record.flags > coarse
                || raycaster.parted(point, normal, record.point.into(), record.normal.into())
        })
    }

    fn insert(&self, record: Record, met: &Met) {
        let &Met { raycaster, point, normal, .. } = met;
        self.store.insert(record, |other| {
            raycaster.parted(point, normal, other.point.into(), other.normal.into())
        });
    }

    /// Makes a record of what arrives at a point; its irradiance.
    fn make(&self, engine: &PathEngine, met: &Met, coarse: u32) -> Vec3 {
        let kind = coarse as usize;
        // What decides how many rays there are must not be part of the record: where the first ones miss the light, they agree.
        let pilot_rays = pilot_rays(ERROR[kind] * self.quality.accuracy, PILOT_RAYS[kind]);
        let pilot = self.gather(engine, met, pilot_rays, coarse, f32::INFINITY);
        let error = self.quality.error(ERROR[kind], pilot.radius, MOST_ERROR[kind]);
        let deviation = self.deviations.take_in(&pilot);
        let rays = ((deviation / error).powi(2) as u32).clamp(LEAST_RAYS, MOST_RAYS);
        let mut record = self.gather(engine, met, rays, coarse, error);
        if coarse == EXACT {
            // Nor must its radius know its light: records that are too bright would count for less of the surface than those that are
            // too dark. What is noisy still is averaged with more neighbours.
            let reached = deviation / (record.rays as f32).sqrt();
            record.radius =
                record.radius.min(gradient_limit(&pilot)) * (error / reached).clamp(0.25, 1.0);
        }
        self.insert(record, met);
        record.irradiance.into()
    }

    /// Traces a record's rays: over the hemisphere, and at the sources of indirect light that there are (one sample of both kinds
    /// together, Veach 1997, §9.2.4, balance heuristic). Of those over the hemisphere none brings more than a share `most` of what all bring.
    #[cold]
    fn gather(&self, engine: &PathEngine, met: &Met, rays: u32, coarse: u32, most: f32) -> Record {
        let &Met { raycaster, point, normal, inside, .. } = met;
        let number = self.made.fetch_add(1, Ordering::Relaxed);
        let id = mix(self.salt.wrapping_add(mix(number)));
        let frame = Frame::new(normal);
        let hemisphere = Hemisphere::new(rays);
        let aimed = engine.secondary.as_ref().map(|sources| sources.aimed_from(point, normal));
        let targets = if aimed.is_some() { (hemisphere.rays() as f32 * AIMED) as u32 } else { 0 };
        let images = Images::seen(
            raycaster,
            &engine.lights,
            &engine.panes,
            &self.mirrors,
            [point.point, normal],
        );
        let shown = if images.is_some() { (hemisphere.rays() as f32 * AIMED) as u32 } else { 0 };
        let role = if coarse == EXACT { Role::Record } else { Role::Coarse };
        let light = Light { cached: self, engine, role: Cell::new(role) };
        let gathering = Gathering {
            light,
            raycaster,
            point,
            normal,
            inside,
            aimed,
            images,
            counts: [hemisphere.rays(), targets, shown],
        };
        let mut arrivals: Vec<Arrival> = (0..hemisphere.rays())
            .map(|index| {
                let mut sampler = Sampler::new(id, u64::from(index));
                sampler.turn(0, Purpose::Scatter);
                let direction = frame.to_world(hemisphere.direction(index, sampler.two()));
                gathering.arrival(direction, &mut sampler)
            })
            .collect();
        hold(&mut arrivals, most);
        self.rays.fetch_add(u64::from(hemisphere.rays() + targets + shown), Ordering::Relaxed);
        let mut record = hemisphere.record(&arrivals, [frame.s, frame.t, normal]);
        record.point = point.point.to_array();
        record.id = id;
        record.flags = coarse;
        let sources: Vec<Source> = (0..targets)
            .map(|index| {
                let mut sampler = Sampler::new(id, u64::from(hemisphere.rays() + index));
                gathering.source(index, &mut sampler).unwrap_or_default()
            })
            .collect();
        record.add(&sources);
        let shown: Vec<Source> = (0..shown)
            .map(|index| {
                let mut sampler = Sampler::new(id, u64::from(hemisphere.rays() + targets + index));
                gathering.image(index, &mut sampler).unwrap_or_default()
            })
            .collect();
        record.add(&shown);
        record.radius = (record.radius * self.quality.reach).min(self.quality.greatest);
        record
    }
}

/// For whom light is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// A sample that someone looks at.
    Eye,
    /// The same, gone on from a surface where there was no record.
    Path,
    /// A record.
    Record,
    /// A coarse record.
    Coarse,
}

/// Paths that end in the cache.
#[derive(Clone)]
struct Light<'a> {
    cached: &'a Cached,
    engine: &'a PathEngine,
    /// Changes on the way.
    role: Cell<Role>,
}

impl Ending for Light<'_> {
    #[inline]
    fn indirect(&self, met: &Met, sampler: &mut Sampler) -> Option<Vec3> {
        let Scatter::Diffuse(kd) = met.scatter else { return None };
        let bounces = self.engine.bounces;
        let irradiance = if met.scatterings > bounces {
            if self.cached.has_caustics {
                return None;
            }
            Vec3::ZERO
        } else if bounces != u32::MAX && met.scatterings > 1 {
            // Records hold all light but what comes straight: of no use where only some more of it may be counted.
            return None;
        } else if self.role.get() == Role::Eye {
            let Some(irradiance) = self.cached.irradiance(self.engine, met) else {
                self.role.set(Role::Path);
                return None;
            };
            irradiance
        } else {
            match self.cached.known(met, COARSE) {
                Some(found) => found.irradiance,
                None if self.role.get() == Role::Record
                    && met.scatterings == 2
                    && coarse_is_due(met, sampler) =>
                {
                    self.cached.make(self.engine, met, COARSE)
                }
                None => return None,
            }
        };
        Some(*kd * irradiance * FRAC_1_PI)
    }

    #[inline]
    fn forks(&self, scatterings: u32) -> u32 {
        let first = match self.role.get() {
            Role::Eye => 0,
            Role::Path | Role::Record | Role::Coarse => 1,
        };
        if scatterings == first { FORKS } else { 0 }
    }

    fn held(&self, light: Vec3) -> Vec3 {
        // Where no more records can be made, paths are not for a while.
        if self.role.get() != Role::Path || self.cached.store.is_full() {
            return light;
        }
        let (most, shown) = (
            MOST_ALONE * FRAC_1_PI * self.cached.usual.irradiance(&self.cached.store),
            luminance(light.into()),
        );
        if shown > most { light * (most / shown) } else { light }
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

/// A record's rays.
struct Gathering<'a> {
    light: Light<'a>,
    raycaster: &'a Raycaster,
    point: &'a SurfacePoint,
    normal: Vec3,
    inside: &'a Inside,
    aimed: Option<Aimed<'a>>,
    images: Option<Images<'a>>,
    /// Rays over the hemisphere, rays aimed at sources, and at images of lamps.
    counts: [u32; 3],
}

impl Gathering<'_> {
    fn nearest(&self, direction: Vec3) -> Option<Hit> {
        let ray = Ray::new(
            spawn(self.point.point, self.point.error, self.point.normal, direction),
            direction,
        );
        self.raycaster.nearest_from(&ray, self.point.triangle)
    }

    /// Radiance along a ray, without what comes straight from lamps and sky.
    fn radiance(&self, hit: Option<Hit>, direction: Vec3, sampler: &mut Sampler) -> Vec3 {
        let aims = self.images.as_ref().map(|images| {
            let (count, others) = (self.counts[2], self.unaimed(direction));
            Aims { images, count, others }
        });
        let start = Start {
            hit,
            direction,
            inside: *self.inside,
            arrived: Arrived::Excluded,
            aims,
            depth: 1,
        };
        let radiance = self.light.engine.follow(self.raycaster, start, &self.light, sampler);
        if radiance.is_finite() { radiance } else { Vec3::ZERO }
    }

    /// Expected number of rays over the hemisphere per solid angle.
    fn unaimed(&self, direction: Vec3) -> f32 {
        self.counts[0] as f32 * direction.dot(self.normal).max(0.0) * FRAC_1_PI
    }

    /// Expected number of rays per solid angle towards a point, over the hemisphere and at sources.
    fn density(&self, hit: Option<&Hit>, cosine: f32) -> f32 {
        let aimed = self
            .aimed
            .as_ref()
            .zip(hit)
            .map_or(0.0, |(aimed, hit)| aimed.density(self.raycaster, hit));
        self.counts[0] as f32 * cosine * FRAC_1_PI + self.counts[1] as f32 * aimed
    }

    fn arrival(&self, direction: Vec3, sampler: &mut Sampler) -> Arrival {
        let hit = self.nearest(direction);
        let distance = hit.map_or(f32::INFINITY, |hit| hit.t.max(f32::MIN_POSITIVE));
        let cosine = direction.dot(self.normal).max(0.0);
        let share = self.counts[0] as f32 * cosine * FRAC_1_PI / self.density(hit.as_ref(), cosine);
        let radiance = self.radiance(hit, direction, sampler);
        Arrival {
            radiance: if share.is_finite() { radiance * share } else { Vec3::ZERO },
            distance,
        }
    }

    fn source(&self, index: u32, sampler: &mut Sampler) -> Option<Source> {
        sampler.turn(0, Purpose::Aim);
        let (first, second) = sampler.pairs(1).at(0);
        let stratified = (f64::from(index) + first) / f64::from(self.counts[1]);
        let target = self.aimed.as_ref()?.target(self.raycaster, stratified, second)?;
        let towards = target.point - self.point.point;
        let direction = towards.try_normalize()?;
        let cosine = direction.dot(self.normal);
        let hit = self
            .nearest(direction)
            .filter(|hit| cosine > 0.0 && hit.triangle == target.triangle)?;
        let radiance = self.radiance(Some(hit), direction, sampler);
        let irradiance = radiance * (cosine / self.density(Some(&hit), cosine));
        let material = self.raycaster.scene().material_ids[target.triangle as usize] as usize;
        let diffuse = self.light.engine.surfaces[material].scatter.is_wide();
        let normal = diffuse.then_some(target.normal);
        irradiance.is_finite().then_some(Source { irradiance, towards, normal })
    }

    /// What one image of a lamp brings, weighed with what rays over the hemisphere find of it.
    fn image(&self, index: u32, sampler: &mut Sampler) -> Option<Source> {
        let images = self.images.as_ref()?;
        sampler.turn(0, Purpose::Image);
        let (first, second) = sampler.pairs(1).at(0);
        let stratified = (f64::from(index) + first) / f64::from(self.counts[2]);
        let image = images.choose(stratified, second)?;
        let direction = image.towards.try_normalize()?;
        let cosine = direction.dot(self.normal);
        if cosine <= 0.0 {
            return None;
        }
        let material = self.raycaster.scene().material_ids[image.triangle as usize] as usize;
        let radiance =
            self.light.engine.surfaces[material].emission * images.arriving(self.point, &image);
        let density = self.counts[2] as f32 * image.density;
        let irradiance =
            radiance * (cosine * power_heuristic(density, self.unaimed(direction)) / density);
        let (towards, normal) = (image.towards, image.normal);
        irradiance.is_finite().then_some(Source { irradiance, towards, normal: Some(normal) })
    }
}

/// How many rays tell how many a record of this error needs.
fn pilot_rays(error: f32, [least, most]: [u32; 2]) -> u32 {
    ((PILOT_SHARE / (error * error)) as u32).clamp(least, most)
}

/// Whether this ray is the one of [`COARSE_PATIENCE`].
fn coarse_is_due(met: &Met, sampler: &mut Sampler) -> bool {
    sampler.turn(met.depth, Purpose::Record);
    sampler.one() * (COARSE_PATIENCE as f32) < 1.0
}

/// As far as the light changes by its own size.
fn gradient_limit(record: &Record) -> f32 {
    let steepest = record.shift.iter().map(|g| Vec3::from(*g).length()).fold(0.0, f32::max);
    let light = record.irradiance.iter().copied().fold(0.0, f32::max);
    if steepest > 0.0 { 0.5 * light / steepest } else { f32::INFINITY }
}

/// The longest side of the scene's bounds.
fn extent(raycaster: &Raycaster) -> f32 {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &vertex in &raycaster.scene().positions {
        (low, high) = (low.min(vertex.into()), high.max(vertex.into()));
    }
    (high - low).max_element().max(f32::MIN_POSITIVE)
}
