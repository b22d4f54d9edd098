//! The directory: where each beam's samples lie in the file, and how many there are.
//!
//! Invariant: an extent is listed only after its block is on disk. Counts also include samples that
//! are still in memory. The directory takes 28 bytes per extent and about 70 per beam.
//!
//! Samples belong to a *generation*: the scene as it was when they were traced. Only those of the
//! present generation are counted and have numbers. Of the others, a beam lists those of its newest
//! earlier generation.

use std::collections::hash_map::Entry as MapEntry;
use std::sync::Arc;

use holo_section::BeamKey;

use crate::format::{BlockHeader, CHUNK_BYTES, Class, Entry};
use crate::hash::BeamMap;
use crate::types::{Maker, SectionStats};
use crate::{Error, Result};

/// Stands for "no next one" in lists of extents and appends.
pub(crate) const NONE: u32 = u32::MAX;

/// A block on disk.
#[derive(Debug)]
pub(crate) struct Block {
    pub header: BlockHeader,
    /// Its first byte in the file.
    pub offset: u64,
    /// Checksums of its payload's chunks.
    pub crcs: Box<[u32]>,
    /// The name of the blob that it is a part of.
    pub blob: Option<Box<str>>,
}

impl Block {
    /// Returns the bytes of the file that a chunk takes: the first, and one past the last.
    pub fn chunk_range(&self, chunk: u32) -> (u64, u64) {
        let payload = self.offset + self.header.payload_offset();
        let begin =
            (u64::from(chunk) * u64::from(CHUNK_BYTES)).min(u64::from(self.header.payload_bytes));
        let end = (begin + u64::from(CHUNK_BYTES)).min(u64::from(self.header.payload_bytes));
        (payload + begin, payload + end)
    }

    /// Returns whether `bytes` match the checksum of chunk `chunk`.
    pub fn matches(&self, chunk: u32, bytes: &[u8]) -> bool {
        self.crcs.get(chunk as usize) == Some(&crc32fast::hash(bytes))
    }
}

/// One run of samples in one block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// Number of the block in the directory.
    pub block: u32,
    /// Where it begins in the block's payload, in samples.
    pub at: u32,
    /// Number of its first sample.
    pub first: u32,
    /// Number of samples.
    pub count: u32,
    pub class: Class,
    /// The beam's next extent in file order.
    next: u32,
}

const _: () = assert!(size_of::<Extent>() == 28);

/// A beam that has samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam {
    /// First and last extent.
    head: u32,
    tail: u32,
    /// Changes with every append, so that outdated copies are recognised.
    pub version: u32,
    /// The next free sample number of each kind.
    pub next: [u32; 3],
    /// Number of distinct sample numbers.
    pub samples: u64,
}

impl Beam {
    /// Returns true if every number below the next free ones is taken. Better samples of such a
    /// beam are counted without a look at its extents, which took two thirds of opening a file.
    fn has_all_numbers(&self) -> bool {
        self.next.iter().map(|&next| u64::from(next)).sum::<u64>() == self.samples
    }
}

#[derive(Debug, Default)]
pub(crate) struct Directory {
    /// By beam, what the present generation has.
    pub beams: BeamMap<Beam>,
    /// By beam, what its newest earlier generation has.
    earlier: BeamMap<Beam>,
    /// Number of samples of these.
    pub earlier_samples: u64,
    /// The present generation.
    pub generation: u32,
    pub blocks: Vec<Arc<Block>>,
    pub sections: Vec<SectionStats>,
    /// Samples whose numbers existed already when they were counted.
    pub superseded: u64,
    /// The maker with the greatest number.
    pub last_maker: Maker,
    extents: Vec<Extent>,
}

impl Directory {
    pub fn new(sections: usize) -> Self {
        Self { sections: vec![SectionStats::default(); sections], ..Self::default() }
    }

    pub fn extents(&self) -> u64 {
        self.extents.len() as u64
    }

    /// Begins a generation, if it is later than the present one. The samples that there are belong
    /// to an earlier one from now on.
    pub fn begin(&mut self, generation: u32) {
        if generation <= self.generation {
            return;
        }
        self.generation = generation;
        self.earlier.extend(self.beams.drain());
        self.earlier_samples = self.earlier.values().map(|beam| beam.samples).sum();
        self.sections.fill(SectionStats::default());
    }

    /// Returns the number of a beam's samples of its newest earlier generation.
    pub fn earlier_of(&self, key: BeamKey) -> u64 {
        self.earlier.get(&key).map_or(0, |beam| beam.samples)
    }

    /// Returns the beam's extents of the present generation on disk, in file order.
    pub fn extents_of(&self, key: BeamKey) -> impl Iterator<Item = &Extent> {
        self.listed(self.beams.get(&key))
    }

    /// Returns the beam's extents of its newest earlier generation, in file order.
    pub fn earlier_extents_of(&self, key: BeamKey) -> impl Iterator<Item = &Extent> {
        self.listed(self.earlier.get(&key))
    }

    fn listed(&self, beam: Option<&Beam>) -> impl Iterator<Item = &Extent> {
        let mut at = beam.map_or(NONE, |beam| beam.head);
        std::iter::from_fn(move || {
            let extent = self.extents.get(at as usize)?;
            at = extent.next;
            Some(extent)
        })
    }

    /// Counts samples that were appended.
    ///
    /// `older` returns the numbers that the beam has already. It is called only if the new numbers
    /// may be among them.
    pub fn account(
        &mut self,
        key: BeamKey,
        kind: u8,
        first: u32,
        count: u32,
        older: impl FnOnce(&Self) -> Vec<(u32, u32)>,
    ) {
        let known = match self.beams.get_mut(&key) {
            // New numbers, as almost always, take one look-up.
            Some(beam) if first >= beam.next[usize::from(kind)] => {
                beam.samples += u64::from(count);
                beam.version = beam.version.wrapping_add(1);
                beam.next[usize::from(kind)] = first + count;
                self.sections[usize::from(key.section)].samples += u64::from(count);
                return;
            }
            Some(beam) if beam.has_all_numbers() => {
                (first + count).min(beam.next[usize::from(kind)]) - first
            }
            Some(_) => covered(older(self), first, first + count),
            None => 0,
        };
        self.superseded += u64::from(known);
        let section = &mut self.sections[usize::from(key.section)];
        let beam = match self.beams.entry(key) {
            MapEntry::Occupied(entry) => entry.into_mut(),
            MapEntry::Vacant(entry) => {
                section.nonempty_beams += 1;
                // Far from the versions of other generations, of which there may be copies.
                let version = self.generation.wrapping_mul(0x9e37_79b9);
                entry.insert(Beam { head: NONE, tail: NONE, version, next: [0; 3], samples: 0 })
            }
        };
        let new = u64::from(count - known);
        section.samples += new;
        beam.samples += new;
        beam.version = beam.version.wrapping_add(1);
        let next = &mut beam.next[usize::from(kind)];
        *next = (*next).max(first + count);
    }

    /// Returns the sample numbers of `kind` in the beam's extents on disk: of each extent the
    /// first, and one past the last.
    pub fn numbers_of(&self, key: BeamKey, kind: u8) -> impl Iterator<Item = (u32, u32)> {
        self.extents_of(key)
            .filter(move |e| e.class.kind == kind)
            .map(|e| (e.first, e.first + e.count))
    }

    /// Lists a block that is on disk, and returns its number.
    pub fn add_block(&mut self, block: Arc<Block>) -> Result<u32> {
        let id = self.blocks.len() as u32;
        if id == NONE {
            return Err(Error::DirectoryFull);
        }
        self.blocks.push(block);
        Ok(id)
    }

    /// Lists an extent that begins `at` samples into the payload of `block`. Its samples must have
    /// been counted.
    pub fn add_extent(&mut self, block: u32, at: u32, entry: &Entry) -> Result<()> {
        let new = self.extents.len() as u32;
        if new == NONE {
            return Err(Error::DirectoryFull);
        }
        self.last_maker = self.last_maker.max(entry.class.maker);
        self.extents.push(Extent {
            block,
            at,
            first: entry.first,
            count: entry.count,
            class: entry.class,
            next: NONE,
        });
        if let Some(beam) = self.beams.get_mut(&entry.key) {
            match self.extents.get_mut(beam.tail as usize) {
                Some(last) => last.next = new,
                None => beam.head = new,
            }
            beam.tail = new;
        }
        Ok(())
    }
}

/// Returns the number of integers from `begin` to before `end` that lie in at least one of
/// `ranges`.
fn covered(mut ranges: Vec<(u32, u32)>, begin: u32, end: u32) -> u32 {
    ranges.sort_unstable();
    let (mut at, mut total) = (begin, 0);
    for (from, to) in ranges {
        let (from, to) = (from.max(at), to.min(end));
        if from < to {
            total += to - from;
            at = to;
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn covered_numbers_are_counted_once(
            ranges in prop::collection::vec((0u32..60, 1u32..20), 0..12),
            begin in 0u32..60,
            length in 1u32..30,
        ) {
            let ranges: Vec<_> =
                ranges.into_iter().map(|(first, count)| (first, first + count)).collect();
            let is_covered = |n: &u32| ranges.iter().any(|range| (range.0..range.1).contains(n));
            let model = (begin..begin + length).filter(is_covered).count();
            prop_assert_eq!(covered(ranges, begin, begin + length) as usize, model);
        }
    }
}
