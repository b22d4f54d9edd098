//! The store: records in a spatial hash, which many threads read while others add to it.
//!
//! Invariants:
//! - Readers never wait. Writers wait only for each other.
//! - A record is stored at most once. Merging the same records again, in any order, changes
//!   nothing.
//! - Radii only shrink. Light at a point comes only from records that see the point.
//! - Memory is bounded by [`MAX_RECORDS`].

use std::collections::HashSet;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use glam::{IVec3, Vec3};

use crate::blend::Blend;
use crate::record::Record;

/// Most records of a store: 150 MB.
pub const MAX_RECORDS: usize = 1 << 20;

/// Number of records in one allocation.
const CHUNK: usize = 1 << 12;
/// Number of entries of the hash table; a power of two.
const HEADS: usize = 1 << 18;
/// Number of list entries in one allocation.
const NODES: usize = 1 << 14;
/// Most cells that contain a record.
const CELLS: usize = 8;
/// Number of levels of the grid. The cells of each are twice as wide as those of the level before.
const LEVELS: usize = 24;
/// The end of a list.
const NONE: u32 = u32::MAX;
/// Least cosine between normals for which a record is used, about 12 degrees.
const LEAST_COSINE: f32 = 0.978;

/// Greatest distance of a point from a record's plane, relative to their distance, if both face the
/// same way.
const LEVEL: f32 = 0.02;

/// Distance within which nothing can stand between a point and a record, relative to the distance
/// of the nearest surface that the record's rays hit.
const CERTAINLY_SEEN: f32 = 0.5;

#[derive(Debug, Default)]
struct Slot {
    record: OnceLock<Record>,
    /// Bits of the current radius.
    radius: AtomicU32,
    /// True if another process made the record.
    received: AtomicBool,
}

#[derive(Debug, Default)]
struct Writer {
    ids: HashSet<u64>,
    nodes: u32,
}

/// Irradiance records of one scene.
#[derive(Debug)]
pub struct Store {
    slots: Box<[OnceLock<Box<[Slot]>>]>,
    count: AtomicU32,
    rays: AtomicU64,
    grade: AtomicU32,
    heads: Box<[AtomicU32]>,
    /// Index of a record in the low half, next entry in the high half.
    nodes: Box<[OnceLock<Box<[AtomicU64]>>]>,
    /// One bit per level that has records.
    levels: AtomicU32,
    /// Width of the cells of level 0.
    width: f32,
    writer: Mutex<Writer>,
}

/// The light that a store has for a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Irradiance by indirect light, W·m⁻² per channel.
    pub irradiance: Vec3,
    /// Sum of the weights of the records used. A weight is the record's
    /// [weight by grade](Record::grade_weight) at the record, and 0 from its radius on.
    pub weight: f32,
    /// Number of records used.
    pub records: u32,
}

impl Store {
    /// Returns an empty store for records whose radii are at least `least`.
    #[must_use]
    pub fn new(least: f32) -> Self {
        Self {
            slots: (0..MAX_RECORDS / CHUNK).map(|_| OnceLock::new()).collect(),
            count: AtomicU32::new(0),
            rays: AtomicU64::new(0),
            grade: AtomicU32::new(0),
            heads: (0..HEADS).map(|_| AtomicU32::new(NONE)).collect(),
            nodes: (0..MAX_RECORDS * CELLS / NODES).map(|_| OnceLock::new()).collect(),
            levels: AtomicU32::new(0),
            width: 2.0 * least,
            writer: Mutex::default(),
        }
    }

    /// Returns the number of records.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count.load(Ordering::Acquire) as usize
    }

    /// Returns the number of rays of all records.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Returns the greatest grade of a record.
    #[must_use]
    #[inline]
    pub fn grade(&self) -> u32 {
        self.grade.load(Ordering::Relaxed)
    }

    /// Returns true if there are no records.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns true if the store is full.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.len() == MAX_RECORDS
    }

    /// Returns record number `index` in order of arrival, with its current radius.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<Record> {
        let slot = self.slot(index)?;
        let radius = f32::from_bits(slot.radius.load(Ordering::Relaxed));
        slot.record.get().map(|record| Record { radius, ..*record })
    }

    /// Adds a record. Returns `false` if it is not valid, exists already, or the store is full.
    ///
    /// Its radius and those of its neighbours are first made consistent. No radius exceeds another
    /// by more than the distance between the two, so that a surface near one record also limits its
    /// neighbours (Křivánek et al. 2006, "Making Radiance and Irradiance Caching Practical"). If
    /// two records of one kind contradict each other, neither reaches far beyond the other.
    ///
    /// `hidden` returns true if something stands between the new record and another. Such records
    /// do not affect each other.
    pub fn insert(&self, record: Record, hidden: impl FnMut(&Record) -> bool) -> bool {
        self.add(record, false, hidden)
    }

    /// Adds a record that another process made, as [`insert`](Self::insert) does. Neighbours that
    /// may be hidden from it do not affect it.
    pub fn receive(&self, record: Record) -> bool {
        let point = Vec3::from(record.point);
        self.add(record, true, |other| {
            point.distance(other.point.into()) > CERTAINLY_SEEN * other.nearest
        })
    }

    /// Returns at most `most` records from number `from` on, without received ones, and the number
    /// to continue from.
    #[must_use]
    pub fn made_since(&self, from: usize, most: usize) -> (Vec<Record>, usize) {
        let mut made = Vec::new();
        let mut next = from;
        while next < self.len() && made.len() < most {
            if !self.slot(next).is_some_and(|slot| slot.received.load(Ordering::Relaxed)) {
                made.extend(self.get(next));
            }
            next += 1;
        }
        (made, next)
    }

    fn slot(&self, index: usize) -> Option<&Slot> {
        self.slots.get(index / CHUNK)?.get()?.get(index % CHUNK)
    }

    fn add(
        &self,
        mut record: Record,
        received: bool,
        mut hidden: impl FnMut(&Record) -> bool,
    ) -> bool {
        if !record.is_valid() {
            return false;
        }
        let mut writer = lock(&self.writer);
        let index = self.count.load(Ordering::Relaxed);
        if index as usize == MAX_RECORDS || !writer.ids.insert(record.id) {
            return false;
        }
        let (point, normal) = (Vec3::from(record.point), Vec3::from(record.normal));
        self.around(point, |slot, other, radius| {
            let distance = point.distance(Vec3::from(other.point));
            if normal.dot(Vec3::from(other.normal)) > LEAST_COSINE && distance < radius {
                record.radius = record.radius.min(radius + distance);
                let reach = distance * record.agreed_share(other);
                if reach < distance && other.kind() == record.kind() && !hidden(other) {
                    record.radius = record.radius.min(reach);
                    slot.radius.fetch_min(reach.max(0.5 * self.width).to_bits(), Ordering::Relaxed);
                }
                slot.radius.fetch_min((record.radius + distance).to_bits(), Ordering::Relaxed);
            }
            true
        });
        record.radius = record.radius.max(0.5 * self.width);
        let chunk = self.slots[index as usize / CHUNK]
            .get_or_init(|| (0..CHUNK).map(|_| Slot::default()).collect());
        let slot = &chunk[index as usize % CHUNK];
        slot.radius.store(record.radius.to_bits(), Ordering::Relaxed);
        slot.received.store(received, Ordering::Relaxed);
        let _ = slot.record.set(record);
        self.rays.fetch_add(record.rays.into(), Ordering::Relaxed);
        self.grade.fetch_max(record.grade(), Ordering::Relaxed);
        self.count.store(index + 1, Ordering::Release);
        let level = self.level(record.radius);
        let (low, high) =
            (self.cell(point - record.radius, level), self.cell(point + record.radius, level));
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    self.link(&mut writer, IVec3::new(x, y, z), level, index);
                }
            }
        }
        self.levels.fetch_or(1 << level, Ordering::Release);
        true
    }

    fn link(&self, writer: &mut Writer, cell: IVec3, level: usize, index: u32) {
        let node = writer.nodes;
        let Some(chunk) = self.nodes.get(node as usize / NODES) else { return };
        let chunk = chunk.get_or_init(|| (0..NODES).map(|_| AtomicU64::new(0)).collect());
        let head = &self.heads[hash(cell, level)];
        let next = head.load(Ordering::Relaxed);
        chunk[node as usize % NODES]
            .store(u64::from(next) << 32 | u64::from(index), Ordering::Release);
        head.store(node, Ordering::Release);
        writer.nodes += 1;
    }

    /// Returns the indirect light at a point, on the side of `normal`, from the records that may be
    /// used there. `None` without such records.
    ///
    /// The look-up stops once the weights of the records add up to `enough`. `hidden` returns true
    /// if something stands between the point and a record. It is called last, because it is
    /// expensive.
    #[must_use]
    pub fn irradiance(
        &self,
        point: Vec3,
        normal: Vec3,
        enough: f32,
        hidden: impl FnMut(&Record) -> bool,
    ) -> Option<Found> {
        self.irradiance_around(point, [normal; 2], enough, hidden)
    }

    /// Returns the same for a bumpy surface. Records are chosen by its mean normal, and their light
    /// is predicted for the second normal (Ward and Heckbert 1992, §4).
    #[must_use]
    pub fn irradiance_around(
        &self,
        point: Vec3,
        [normal, lit]: [Vec3; 2],
        enough: f32,
        mut hidden: impl FnMut(&Record) -> bool,
    ) -> Option<Found> {
        let mut blend = Blend::default();
        self.around(point, |_, record, radius| {
            let offset = point - Vec3::from(record.point);
            let distance = offset.length();
            let other = Vec3::from(record.normal);
            let cosine = normal.dot(other);
            if distance >= radius || cosine < LEAST_COSINE {
                return true;
            }
            // A point off the record's plane is on another surface, or beyond a step. The tolerance
            // grows with the angle between the normals.
            let bend = (LEVEL + (1.0 - cosine * cosine).max(0.0).sqrt()) * distance;
            if offset.dot(other).abs().max(offset.dot(normal).abs()) > bend.min(0.1 * radius) {
                return true;
            }
            let turned = ((1.0 - cosine).max(0.0) / (1.0 - LEAST_COSINE)).sqrt();
            let weight = (1.0 - (distance / radius).max(turned)) * record.grade_weight();
            if weight <= 0.0 || distance > CERTAINLY_SEEN * record.nearest && hidden(record) {
                return true;
            }
            blend.add(record, point, lit, weight);
            blend.weight < enough
        });
        let Blend { weight, records, .. } = blend;
        (weight > 0.0).then(|| Found { irradiance: blend.irradiance(), weight, records })
    }

    /// Calls `visit` with the records whose cells contain a point, by level and newest first, until
    /// it returns false.
    #[inline]
    fn around(&self, point: Vec3, mut visit: impl FnMut(&Slot, &Record, f32) -> bool) {
        let mut levels = self.levels.load(Ordering::Acquire);
        while levels != 0 {
            let level = levels.trailing_zeros() as usize;
            levels &= levels - 1;
            let mut node = self.heads[hash(self.cell(point, level), level)].load(Ordering::Acquire);
            while node != NONE {
                let Some(chunk) = self.nodes[node as usize / NODES].get() else { break };
                let entry = chunk[node as usize % NODES].load(Ordering::Acquire);
                let (index, next) = (entry as u32 as usize, (entry >> 32) as u32);
                let slot = self.slots[index / CHUNK].get().map(|chunk| &chunk[index % CHUNK]);
                if let Some((slot, record)) = slot.and_then(|slot| Some((slot, slot.record.get()?)))
                    && !visit(slot, record, f32::from_bits(slot.radius.load(Ordering::Relaxed)))
                {
                    return;
                }
                node = next;
            }
        }
    }

    /// Returns the least level whose cells are at least a diameter wide.
    fn level(&self, radius: f32) -> usize {
        let ratio = 2.0 * radius / self.width;
        (ratio.log2().ceil().max(0.0) as usize).min(LEVELS - 1)
    }

    #[inline]
    fn cell(&self, point: Vec3, level: usize) -> IVec3 {
        (point / (self.width * (1_u32 << level) as f32)).floor().as_ivec3()
    }
}

#[inline]
fn hash(cell: IVec3, level: usize) -> usize {
    let mut h = (cell.x as u32).wrapping_mul(0x8DA6_B343)
        ^ (cell.y as u32).wrapping_mul(0xD816_3841)
        ^ (cell.z as u32).wrapping_mul(0xCB1A_B31F)
        ^ (level as u32).wrapping_mul(0x9E37_79B9);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2C1B_3C6D);
    ((h ^ (h >> 13)) as usize) & (HEADS - 1)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
