//! The engine `cached`: direct light sampled, light chains of mirrors, glass and gloss traced, and indirect light on diffuse surfaces
//! interpolated from records that all threads and all workers share ([`holo_light`]).
//!
//! A record's rays end in records too, where these are; before there are any, they go on as paths. So first samples are as good
//! as later ones, but dearer.
//!
//! Always true: what is traced does not depend on the cache but within the engine's accuracy; without records, an estimate's
//! expectation is that of the path engine.

mod walk;

use std::hash::{BuildHasher, RandomState};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;
use holo_light::{Arrival, Found, Hemisphere, Record, Store};
use holo_raycast::{Ray, Raycaster, SurfacePoint, spawn};

use crate::geometry::Frame;
use crate::medium::Inside;
use crate::path::{PathEngine, Start};
use crate::sampler::{Purpose, Sampler, mix};
use walk::{Arrived, Role, Step};

/// Relative error of indirect light that is aimed at unless said otherwise.
pub const DEFAULT_ACCURACY: f32 = 0.03;

/// Least and greatest accuracy that can be asked for.
pub const ACCURACIES: std::ops::RangeInclusive<f32> = 0.002..=0.5;

/// Samples of the lights at a first diffuse surface: with clean indirect light, direct light is what is left of the noise.
const LIGHT_SAMPLES: u32 = 8;

/// Rays that tell how many a record needs.
const PILOT_RAYS: u32 = 64;

/// Rays of a record at most.
const MOST_RAYS: u32 = 1 << 12;

/// Standard error of a record over the accuracy: what is seen is the mean of several, and their strata make them better than
/// they know.
const ERROR: f32 = 2.0;

/// Radius of a record over the harmonic mean distance, over the root of the accuracy: what gradients leave grows with the square
/// of the distance.
const REACH: f32 = 2.0;

/// Greatest radius over the scene's size, over the same.
const GREATEST: f32 = 0.3;

/// Greatest radius over the least: along edges, where radii shrink to nothing, records would be without number.
const SPREAD: f32 = 16.0;

/// A record is made where the weights of those there add up to less.
const LEAST_WEIGHT: f32 = 0.3;

/// How much farther records reach for the rays of other records: what they see is averaged over a hemisphere.
const RECORDS_REACH: f32 = 2.0;

/// What follows from the accuracy.
#[derive(Clone, Copy, Debug)]
struct Quality {
    /// Relative standard error of a record.
    error: f32,
    /// Radius of a record over the harmonic mean distance of what it sees.
    reach: f32,
    /// Radius at most.
    greatest: f32,
}

/// The cache of one scene, and what makes its records.
#[derive(Debug)]
pub(crate) struct Cached {
    store: Arc<Store>,
    quality: Quality,
    /// Records' names: this engine's own, and how many it has made.
    salt: u64,
    made: AtomicU64,
}

impl Cached {
    pub(crate) fn new(raycaster: &Raycaster, accuracy: f32) -> Self {
        let accuracy = accuracy.clamp(*ACCURACIES.start(), *ACCURACIES.end());
        let size = extent(raycaster);
        let reach = REACH * accuracy.sqrt();
        let quality = Quality { error: ERROR * accuracy, reach, greatest: size * GREATEST * reach };
        let store = Arc::new(Store::new(quality.greatest / SPREAD));
        Self { store, quality, salt: RandomState::new().hash_one(0), made: AtomicU64::new(0) }
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
        let Start { hit, direction, inside } = start;
        let step = Step { hit, direction, inside, arrived: Arrived::Alone };
        self.walk(engine, raycaster, Role::Eye, step, 0, sampler)
    }

    /// Irradiance by indirect light at a point that an eye sees; a record is made if there is none near enough.
    fn irradiance(
        &self,
        engine: &PathEngine,
        raycaster: &Raycaster,
        point: &SurfacePoint,
        normal: Vec3,
        inside: &Inside,
    ) -> Vec3 {
        let found = self.known(raycaster, point, normal, 1.0);
        if let Some(found) = found.filter(|found| found.weight >= LEAST_WEIGHT) {
            return found.irradiance;
        }
        // What decides how many rays there are must not be part of the record: where the first ones miss the light, they agree.
        let pilot = self.gather(engine, raycaster, point, normal, inside, PILOT_RAYS);
        let wanted = (pilot.error / self.quality.error).powi(2) * pilot.rays as f32;
        let rays = (wanted as u32).clamp(PILOT_RAYS, MOST_RAYS);
        let mut record = self.gather(engine, raycaster, point, normal, inside, rays);
        // What is noisy still is averaged with more neighbours.
        record.radius *= (self.quality.error / record.error).clamp(0.25, 1.0);
        self.store.insert(record);
        let made = Vec3::from(record.irradiance);
        // The new record has weight 1.
        found.map_or(made, |found| (found.irradiance * found.weight + made) / (found.weight + 1.0))
    }

    /// Irradiance by indirect light, as far as there are records in sight whose radii times `reach` go to the point.
    fn known(&self, raycaster: &Raycaster, point: &SurfacePoint, normal: Vec3, reach: f32) -> Option<Found> {
        self.store.irradiance(point.point, normal, reach, |record| {
            raycaster.parted(point, normal, record.point.into(), record.normal.into())
        })
    }

    /// Traces a record's rays.
    #[cold]
    fn gather(
        &self,
        engine: &PathEngine,
        raycaster: &Raycaster,
        point: &SurfacePoint,
        normal: Vec3,
        inside: &Inside,
        rays: u32,
    ) -> Record {
        let number = self.made.fetch_add(1, Ordering::Relaxed);
        let id = mix(self.salt.wrapping_add(mix(number)));
        let frame = Frame::new(normal);
        let hemisphere = Hemisphere::new(rays);
        let arrivals: Vec<Arrival> = (0..hemisphere.rays())
            .map(|index| {
                let mut sampler = Sampler::new(id, u64::from(index));
                sampler.turn(0, Purpose::Scatter);
                let direction = frame.to_world(hemisphere.direction(index, sampler.two()));
                let ray = Ray::new(spawn(point.point, point.error, point.normal, direction), direction);
                let hit = raycaster.nearest_from(&ray, point.triangle);
                let distance = hit.map_or(f32::INFINITY, |hit| hit.t.max(f32::MIN_POSITIVE));
                let step = Step { hit, direction, inside: *inside, arrived: Arrived::Excluded };
                let radiance = self.walk(engine, raycaster, Role::Record, step, 1, &mut sampler);
                Arrival { radiance: if radiance.is_finite() { radiance } else { Vec3::ZERO }, distance }
            })
            .collect();
        let mut record = hemisphere.record(&arrivals, [frame.s, frame.t, normal]);
        record.point = point.point.to_array();
        record.id = id;
        record.radius = (record.radius * self.quality.reach).min(gradient_limit(&record)).min(self.quality.greatest);
        record
    }
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
