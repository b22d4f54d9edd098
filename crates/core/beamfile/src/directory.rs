//! The directory: where each beam's samples lie in the file, and how many there are.
//!
//! Invariant: an extent is listed only after its block is on disk. Counts also include samples that
//! are still in memory. The directory takes 28 bytes per extent, about 70 per beam, and about 50
//! per gap in the numbers of a beam.
//!
//! Samples belong to a *generation*: the scene as it was when they were traced. Only those of the
//! present generation are counted and have numbers. Of the others, a beam lists those of its newest
//! earlier generation.

use std::collections::hash_map::Entry as MapEntry;
use std::sync::Arc;

use holo_section::BeamKey;

use crate::format::{BlockHeader, BlockKind, CHUNK_BYTES, Class, Entry};
use crate::gaps::Gaps;
use crate::hash::BeamMap;
use crate::types::{DamageKind, Maker, SectionStats};
use crate::{Error, Result};

/// Stands for "no next one" in lists of extents and appends.
pub(crate) const NONE: u32 = u32::MAX;

/// A block on disk.
#[derive(Debug)]
pub(crate) struct DiskBlock {
    pub header: BlockHeader,
    /// Its first byte in the file.
    pub offset: u64,
    /// Checksums of its payload's chunks.
    pub crcs: Box<[u32]>,
    /// The name of the blob that it is a part of.
    pub blob: Option<Box<str>>,
}

impl DiskBlock {
    /// Returns the bytes of the file that a chunk takes: the first, and one past the last.
    pub fn chunk_range(&self, chunk: u32) -> (u64, u64) {
        let payload = self.offset + self.header.payload_offset();
        let begin =
            (u64::from(chunk) * u64::from(CHUNK_BYTES)).min(u64::from(self.header.payload_bytes));
        let end = (begin + u64::from(CHUNK_BYTES)).min(u64::from(self.header.payload_bytes));
        (payload + begin, payload + end)
    }

    /// Returns the kind of damage that a wrong checksum of the payload is.
    pub fn payload_damage(&self) -> DamageKind {
        match (self.header.kind, self.blob.as_deref()) {
            (_, Some(name)) => DamageKind::Blob(name.into()),
            (BlockKind::Shares, _) => DamageKind::Shares,
            (BlockKind::Index, _) => DamageKind::Index,
            (BlockKind::Unknown(kind), _) => DamageKind::Skipped(kind),
            (BlockKind::Samples | BlockKind::Blob, None) => DamageKind::Samples,
        }
    }

    /// Returns the kind of damage that a wrong table is.
    pub fn table_damage(header: &BlockHeader) -> DamageKind {
        match header.kind {
            BlockKind::Index => DamageKind::Index,
            _ => DamageKind::BlockTable(header.sequence),
        }
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
    pub next: u32,
}

const _: () = assert!(size_of::<Extent>() == 28);

/// A beam that has samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BeamEntry {
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

impl BeamEntry {
    pub fn empty(generation: u32) -> Self {
        // Far from the versions of other generations, of which there may be copies.
        let version = generation.wrapping_mul(0x9e37_79b9);
        Self { head: NONE, tail: NONE, version, next: [0; 3], samples: 0 }
    }

    /// Counts appended samples, and returns how many of their numbers are new.
    pub fn count(
        &mut self,
        gaps: &mut Gaps,
        key: BeamKey,
        kind: u8,
        first: u32,
        count: u32,
    ) -> u32 {
        let (next, end) = (&mut self.next[usize::from(kind)], first + count);
        let new = if first < *next {
            let in_gaps = gaps.close(key, kind, first, end.min(*next));
            in_gaps + end.saturating_sub(*next)
        } else {
            if first > *next {
                gaps.open(key, kind, *next, first);
            }
            count
        };
        *next = end.max(*next);
        self.version = self.version.wrapping_add(1);
        self.samples += u64::from(new);
        new
    }

    /// Lists an extent as the beam's last one.
    pub fn link(&mut self, extents: &mut Vec<Extent>, extent: Extent) {
        let new = extents.len() as u32;
        extents.push(extent);
        match extents.get_mut(self.tail as usize) {
            Some(last) => last.next = new,
            None => self.head = new,
        }
        self.tail = new;
    }
}

#[derive(Debug, Default)]
pub(crate) struct Directory {
    /// By beam, what the present generation has.
    pub beams: BeamMap<BeamEntry>,
    /// By beam, what its newest earlier generation has.
    pub earlier: BeamMap<BeamEntry>,
    /// Number of samples of these.
    pub earlier_samples: u64,
    /// The present generation.
    pub generation: u32,
    pub blocks: Vec<Arc<DiskBlock>>,
    pub sections: Vec<SectionStats>,
    /// Samples whose numbers existed already when they were counted.
    pub superseded: u64,
    /// The maker with the greatest number.
    pub last_maker: Maker,
    pub extents: Vec<Extent>,
    /// Missing numbers of the present generation.
    pub gaps: Gaps,
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
        self.gaps.clear();
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

    fn listed(&self, beam: Option<&BeamEntry>) -> impl Iterator<Item = &Extent> {
        let mut at = beam.map_or(NONE, |beam| beam.head);
        std::iter::from_fn(move || {
            let extent = self.extents.get(at as usize)?;
            at = extent.next;
            Some(extent)
        })
    }

    /// Counts samples that were appended: numbers from `first` on.
    pub fn account(&mut self, key: BeamKey, kind: u8, first: u32, count: u32) {
        let section = &mut self.sections[usize::from(key.section)];
        let beam = match self.beams.entry(key) {
            MapEntry::Occupied(entry) => entry.into_mut(),
            MapEntry::Vacant(entry) => {
                section.nonempty_beams += 1;
                entry.insert(BeamEntry::empty(self.generation))
            }
        };
        let new = beam.count(&mut self.gaps, key, kind, first, count);
        section.samples += u64::from(new);
        self.superseded += u64::from(count - new);
    }

    /// Lists a block that is on disk, and returns its number.
    pub fn add_block(&mut self, block: Arc<DiskBlock>) -> Result<u32> {
        let id = self.blocks.len() as u32;
        if id == NONE {
            return Err(Error::DirectoryFull);
        }
        self.blocks.push(block);
        Ok(id)
    }

    /// Makes room for extents.
    pub fn reserve_extents(&mut self, extents: u64) -> Result<()> {
        if self.extents() + extents >= u64::from(NONE) {
            return Err(Error::DirectoryFull);
        }
        self.extents.reserve(extents as usize);
        Ok(())
    }

    /// Lists an extent that begins `at` samples into the payload of `block`. Its samples must have
    /// been counted.
    pub fn add_extent(&mut self, block: u32, at: u32, entry: &Entry) -> Result<()> {
        if self.extents.len() as u32 == NONE {
            return Err(Error::DirectoryFull);
        }
        let Entry { first, count, class, .. } = *entry;
        let extent = Extent { block, at, first, count, class, next: NONE };
        self.last_maker = self.last_maker.max(class.maker);
        match self.beams.get_mut(&entry.key) {
            Some(beam) => beam.link(&mut self.extents, extent),
            None => self.extents.push(extent),
        }
        Ok(())
    }
}
