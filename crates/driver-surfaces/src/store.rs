//! All cells, in a hash that is divided into shards, so that all cores add samples at once.
//!
//! What always holds:
//! - What a cell holds does not depend on the order in which samples came.
//! - Cells are at most as many as was asked for. When there are more, those that no view looked at longest go first.

use crate::cell::{LEVELS, Place, Sums};
use crate::place::Placed;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Parts of the store, each filled by one thread at a time.
const SHARDS: usize = 64;

/// Cells of a shard at the least.
const FEWEST: usize = 64;

/// Samples that are shared out to shards together.
const CHUNK: usize = 8192;

/// Cells that are fetched from memory together: one after another, each would wait for it.
const TOGETHER: usize = 16;

/// A cell in the table; its key is 0 if there is none.
#[derive(Debug, Default)]
struct Slot {
    key: u64,
    sums: Sums,
    /// The round in which it was last looked at, or made.
    round: AtomicU32,
}

/// An open hash table of cells.
#[derive(Debug)]
struct Shard {
    slots: Vec<Slot>,
    used: usize,
}

/// Light on surfaces.
#[derive(Debug)]
pub struct Store {
    shards: Vec<Shard>,
    /// Width of the finest cells, scene units.
    finest: f32,
    most_cells: usize,
    round: u32,
    samples: u64,
}

/// Where a key's cell is looked for.
#[inline]
fn shard_of(key: u64) -> usize {
    (key >> 58) as usize % SHARDS
}

impl Shard {
    fn new() -> Shard {
        Shard { slots: empty(FEWEST), used: 0 }
    }

    /// The slot of a key, or the empty one where it belongs.
    #[inline]
    fn find(&self, key: u64) -> usize {
        let mask = self.slots.len() - 1;
        let mut at = key as usize & mask;
        while self.slots[at].key != key && self.slots[at].key != 0 {
            at = (at + 1) & mask;
        }
        at
    }

    /// Reads the first slots of some keys, so that they are at hand.
    #[inline]
    fn fetch(&self, keys: &[(u64, u32)]) {
        let mask = self.slots.len() - 1;
        let read =
            keys.iter().fold(0, |read, (key, _)| read ^ self.slots[*key as usize & mask].key);
        std::hint::black_box(read);
    }

    #[inline]
    fn add(&mut self, key: u64, sums: &Sums, round: u32) {
        let mut at = self.find(key);
        if self.slots[at].key == 0 {
            if self.used * 4 >= self.slots.len() * 3 {
                self.rebuild(self.slots.len() * 2, (0, 0));
                at = self.find(key);
            }
            self.used += 1;
            self.slots[at].key = key;
            self.slots[at].round = AtomicU32::new(round);
        }
        self.slots[at].sums.add(sums);
    }

    /// Moves the cells from this (round, key) on to a table of another size.
    fn rebuild(&mut self, size: usize, oldest: (u32, u64)) {
        let old = std::mem::replace(&mut self.slots, empty(size));
        self.used = 0;
        for slot in old {
            if slot.key != 0 && slot.age() >= oldest {
                let at = self.find(slot.key);
                self.slots[at] = slot;
                self.used += 1;
            }
        }
    }

    /// Leaves at most so many cells: those looked at last, and of one round those with the greatest keys.
    fn shrink(&mut self, most: usize) {
        if self.used <= most {
            return;
        }
        let mut ages: Vec<(u32, u64)> =
            self.slots.iter().filter(|slot| slot.key != 0).map(Slot::age).collect();
        let first = ages.len() - most;
        let (_, &mut oldest, _) = ages.select_nth_unstable(first);
        self.rebuild(self.slots.len(), oldest);
    }
}

impl Slot {
    /// What comes first goes first.
    fn age(&self) -> (u32, u64) {
        (self.round.load(Ordering::Relaxed), self.key)
    }
}

fn empty(size: usize) -> Vec<Slot> {
    (0..size).map(|_| Slot::default()).collect()
}

impl Store {
    /// An empty store of cells from this width on, in scene units, and at most so many of them (96 bytes each).
    #[must_use]
    pub fn new(finest: f32, most_cells: usize) -> Store {
        let shards = (0..SHARDS).map(|_| Shard::new()).collect();
        Store { shards, finest, most_cells, round: 1, samples: 0 }
    }

    /// Width of the finest cells, scene units.
    #[must_use]
    pub fn finest(&self) -> f32 {
        self.finest
    }

    /// Samples added.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Cells that there are.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.shards.iter().map(|shard| shard.used).sum()
    }

    /// Adds placed samples, on all levels.
    pub fn add(&mut self, placed: &[Placed]) {
        let finest = self.finest;
        let dealt: Vec<Vec<Vec<(u64, u32)>>> = placed
            .par_chunks(CHUNK)
            .map(|chunk| {
                let room = || Vec::with_capacity(2 * CHUNK * LEVELS / SHARDS);
                let mut lists: Vec<Vec<(u64, u32)>> = (0..SHARDS).map(|_| room()).collect();
                for (number, sample) in (0..).zip(chunk) {
                    let place = Place::new(sample.point, finest);
                    for level in 0..LEVELS {
                        let key = sample.face.key(place, level);
                        lists[shard_of(key)].push((key, number));
                    }
                }
                lists
            })
            .collect();
        let (round, most) = (self.round, self.most_cells / SHARDS);
        self.shards.par_iter_mut().enumerate().for_each(|(number, shard)| {
            for (lists, chunk) in dealt.iter().zip(placed.chunks(CHUNK)) {
                for some in lists[number].chunks(TOGETHER) {
                    shard.fetch(some);
                    for &(key, sample) in some {
                        shard.add(key, &Sums::of(chunk[sample as usize].light), round);
                    }
                }
            }
            shard.shrink(most);
        });
        self.samples += placed.len() as u64;
    }

    /// Begins a round of looks: a cell looked at in it is kept longer than those looked at before only.
    pub fn begin_round(&mut self) {
        self.round += 1;
    }

    /// What is known of a cell.
    #[inline]
    pub(crate) fn get(&self, key: u64) -> Option<&Sums> {
        let shard = &self.shards[shard_of(key)];
        let slot = &shard.slots[shard.find(key)];
        if slot.key == 0 {
            return None;
        }
        if slot.round.load(Ordering::Relaxed) != self.round {
            slot.round.store(self.round, Ordering::Relaxed);
        }
        Some(&slot.sums)
    }
}
