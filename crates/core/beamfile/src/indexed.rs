//! The state of a file from its index.
//!
//! Extents come sorted by beam, so each beam's counts are computed at once and each beam is looked
//! up once. The result is the same as listing the blocks one after the other: a test compares them.

use std::sync::Arc;

use crate::Result;
use crate::directory::{BeamEntry, Directory, Extent};
use crate::gaps::Gaps;
use crate::index::{BeamExtents, Indexed};
use crate::state::FileState;

/// Extents of one beam and one generation in one range.
struct ExtentRun {
    beam: BeamExtents,
    /// The range, and the part's first extent in it.
    range: u32,
    from: usize,
}

impl FileState {
    /// Lists the blocks and extents of all ranges, which are in file order. The state must be new.
    pub fn list_ranges(&mut self, mut ranges: Vec<Indexed>) -> Result<()> {
        let mut parts = Vec::new();
        let mut generation = 0;
        for (range, indexed) in (0..).zip(&mut ranges) {
            let begin = self.directory.blocks.len() as u32;
            for (block, table) in indexed.blocks.drain(..) {
                self.list_block(Arc::new(block), table)?;
            }
            // No writer goes back to the generation of an earlier range.
            let (earliest, mut from) = (generation, 0);
            for &beam in &indexed.beams {
                if beam.generation >= earliest {
                    generation = generation.max(beam.generation);
                    parts.push(ExtentRun { beam, range, from });
                }
                from += beam.count as usize;
            }
            indexed.extents.iter_mut().for_each(|extent| extent.block += begin);
        }
        // Stable: parts of a beam stay in file order. Each range is sorted already.
        parts.sort_by_key(|part| part.beam.key);
        self.directory.list_sorted(&parts, &ranges, generation)
    }
}

impl Directory {
    fn list_sorted(
        &mut self,
        parts: &[ExtentRun],
        ranges: &[Indexed],
        generation: u32,
    ) -> Result<()> {
        self.generation = generation;
        let extents: u64 = parts.iter().map(|part| u64::from(part.beam.count)).sum();
        self.reserve_extents(extents)?;
        let is_same = |a: &ExtentRun, b: &ExtentRun| {
            (a.beam.key, a.beam.generation) == (b.beam.key, b.beam.generation)
        };
        self.beams.reserve(parts.chunk_by(is_same).count());
        let mut earlier_gaps = Gaps::default();
        for same in parts.chunk_by(is_same) {
            let Some(BeamExtents { key, generation: its, .. }) = same.first().map(|s| s.beam)
            else {
                continue;
            };
            let mut beam = BeamEntry::empty(its);
            for part in same {
                let extents = &ranges[part.range as usize].extents[part.from..];
                for extent in &extents[..part.beam.count as usize] {
                    let &Extent { first, count, class, .. } = extent;
                    let gaps = if its == generation { &mut self.gaps } else { &mut earlier_gaps };
                    let new = beam.count(gaps, key, class.kind, first, count);
                    self.superseded += u64::from(count - new);
                    self.last_maker = self.last_maker.max(class.maker);
                    beam.link(&mut self.extents, *extent);
                }
            }
            if its == generation {
                let section = &mut self.sections[usize::from(key.section)];
                section.nonempty_beams += 1;
                section.samples += beam.samples;
                self.beams.insert(key, beam);
            } else {
                earlier_gaps.clear();
                // Generations of a beam come in order: the newest one stays.
                self.earlier.insert(key, beam);
            }
        }
        self.earlier_samples = self.earlier.values().map(|beam| beam.samples).sum();
        Ok(())
    }
}
