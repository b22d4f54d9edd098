//! The store: records by where they are, read by many threads while others add to it.
//!
//! Always true:
//! - Readers never wait. Writers wait for each other only.
//! - A record is in at most once: merging the same records again, in whatever order, changes nothing.
//! - Radii only ever shrink. What is given for a point comes from records in sight of it.
//! - Memory is bounded by [`MAX_RECORDS`].

use std::collections::HashSet;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use glam::{IVec3, Vec3};

use crate::record::Record;

/// Most records of a store: 150 MB.
pub const MAX_RECORDS: usize = 1 << 20;

/// Records in one allocation.
const CHUNK: usize = 1 << 12;
/// Entries of the table of cells: a power of two.
const HEADS: usize = 1 << 18;
/// Entries of cells' lists in one allocation.
const NODES: usize = 1 << 14;
/// A record lies in at most so many cells.
const CELLS: usize = 8;
/// Levels of the grid: each has cells twice as wide as the one before.
const LEVELS: usize = 24;
/// No entry.
const NONE: u32 = u32::MAX;
/// Cosine between normals beyond which a record is of no use: about 12 degrees.
const LEAST_COSINE: f32 = 0.978;

/// How far a point may be out of a record's plane, over their distance, where both face the same way.
const LEVEL: f32 = 0.02;

/// Over the distance to the nearest surface that a record's rays met: nothing stands between it and a point so near.
const CERTAINLY_SEEN: f32 = 0.5;

#[derive(Debug, Default)]
struct Slot {
    record: OnceLock<Record>,
    /// Bits of the radius as it is now.
    radius: AtomicU32,
    /// Whether somebody else made it.
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
    heads: Box<[AtomicU32]>,
    /// Record in the low half, next entry in the high.
    nodes: Box<[OnceLock<Box<[AtomicU64]>>]>,
    /// Which levels have records.
    levels: AtomicU32,
    /// Width of the cells of level 0.
    width: f32,
    writer: Mutex<Writer>,
}

/// What a store knows about a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Irradiance by indirect light, W·m⁻² per channel.
    pub irradiance: Vec3,
    /// Sum of the weights of the records used: each counts for 1 where it was made and 0 from its radius on.
    pub weight: f32,
    /// How many records were used.
    pub records: u32,
}

impl Store {
    /// An empty store for records whose radii are at least `least`.
    #[must_use]
    pub fn new(least: f32) -> Self {
        Self {
            slots: (0..MAX_RECORDS / CHUNK).map(|_| OnceLock::new()).collect(),
            count: AtomicU32::new(0),
            heads: (0..HEADS).map(|_| AtomicU32::new(NONE)).collect(),
            nodes: (0..MAX_RECORDS * CELLS / NODES).map(|_| OnceLock::new()).collect(),
            levels: AtomicU32::new(0),
            width: 2.0 * least,
            writer: Mutex::default(),
        }
    }

    /// How many records there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count.load(Ordering::Acquire) as usize
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether no more can be added.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.len() == MAX_RECORDS
    }

    /// Record number `index` in the order in which they came, with its radius as it is now.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<Record> {
        let slot = self.slot(index)?;
        let radius = f32::from_bits(slot.radius.load(Ordering::Relaxed));
        slot.record.get().map(|record| Record { radius, ..*record })
    }

    /// Adds a record, after its radius and those of its neighbours were made to agree: no radius is greater than another's by
    /// more than the distance between the two, so that what one record saw nearby is known to those around it (Křivánek et al. 2006,
    /// "Making Radiance and Irradiance Caching Practical"); and where two records of one kind contradict each other, neither reaches
    /// far beyond the other. `false` if it is not valid, there already, or the store is full.
    ///
    /// `hidden` tells whether something stands between the new record and another, which then says nothing of it.
    pub fn insert(&self, record: Record, hidden: impl FnMut(&Record) -> bool) -> bool {
        self.add(record, false, hidden)
    }

    /// As [`insert`](Self::insert), for a record that somebody else made: others that may be hidden from it say nothing of it.
    pub fn receive(&self, record: Record) -> bool {
        let point = Vec3::from(record.point);
        self.add(record, true, |other| {
            point.distance(other.point.into()) > CERTAINLY_SEEN * other.nearest
        })
    }

    /// At most `most` of the records from number `from` on, without those received, and the number to go on from.
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
                if reach < distance && other.flags == record.flags && !hidden(other) {
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

    /// Indirect light at a point, on the side of `normal`, from the records that may be used there: `None` without any.
    ///
    /// No more records are looked for once the weights of those found add up to `enough`. `hidden` tells whether something stands
    /// between the point and a record; it is asked last.
    #[must_use]
    pub fn irradiance(
        &self,
        point: Vec3,
        normal: Vec3,
        enough: f32,
        mut hidden: impl FnMut(&Record) -> bool,
    ) -> Option<Found> {
        let mut found = Found::default();
        self.around(point, |_, record, radius| {
            let offset = point - Vec3::from(record.point);
            let distance = offset.length();
            let other = Vec3::from(record.normal);
            let cosine = normal.dot(other);
            if distance >= radius || cosine < LEAST_COSINE {
                return true;
            }
            // Before or behind the record's plane is another surface, or a step, but as far as the surface turns on the way.
            let bend = (LEVEL + (1.0 - cosine * cosine).max(0.0).sqrt()) * distance;
            if offset.dot(other).abs().max(offset.dot(normal).abs()) > bend.min(0.1 * radius) {
                return true;
            }
            let turned = ((1.0 - cosine).max(0.0) / (1.0 - LEAST_COSINE)).sqrt();
            let weight = 1.0 - (distance / radius).max(turned);
            if weight <= 0.0 || distance > CERTAINLY_SEEN * record.nearest && hidden(record) {
                return true;
            }
            found.irradiance += record.extrapolate(point, normal) * weight;
            found.weight += weight;
            found.records += 1;
            found.weight < enough
        });
        (found.weight > 0.0).then(|| Found { irradiance: found.irradiance / found.weight, ..found })
    }

    /// Calls `visit` with the records in whose cells a point lies, the newest of a size first, until it says that it has seen enough.
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

    /// The least level whose cells are at least a diameter wide.
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
