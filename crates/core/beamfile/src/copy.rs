//! Copies a file's samples to another file, except those of some makers or generations.

use holo_section::{NumberRun, Sample};

use crate::block_table::BlockTable;
use crate::directory::DiskBlock;
use crate::file::BeamFile;
use crate::format::{CHUNK_BYTES, CHUNK_SAMPLES, Entry};
use crate::scan::{ScanRange, scan};
use crate::{Maker, Result};

/// Counts of copied samples and of samples left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Copied {
    /// Copied samples, including superseded ones.
    pub samples: u64,
    /// Samples left out, including superseded ones.
    pub left_out: u64,
}

impl BeamFile {
    /// Appends all samples on this file's disk to another file, in their order, except those that
    /// `keep` refuses by their maker and generation.
    ///
    /// They keep their generations. Samples that a refused one had superseded count again. Damaged
    /// samples are left out. Blobs and shares of layers are not copied.
    ///
    /// # Errors
    /// If this file cannot be read, or the other one cannot be written or lacks a beam.
    pub fn copy_samples(&self, to: &BeamFile, keep: &dyn Fn(Maker, u32) -> bool) -> Result<Copied> {
        let mut copied = Copied::default();
        let (storage, path) = (&*self.shared.storage, &self.shared.path);
        // Opening the file has reported this damage already.
        let mut damage = Vec::new();
        scan(
            storage,
            path,
            &self.shared.header,
            ScanRange::WHOLE,
            &mut damage,
            &mut |block, table| match table {
                BlockTable::Samples(entries) => {
                    self.copy_block(to, &block, &entries, keep, &mut copied)
                }
                BlockTable::Blob(_)
                | BlockTable::Shares(_)
                | BlockTable::Index(_)
                | BlockTable::Unknown => Ok(()),
            },
        )?;
        Ok(copied)
    }

    fn copy_block(
        &self,
        to: &BeamFile,
        block: &DiskBlock,
        entries: &[Entry],
        keep: &dyn Fn(Maker, u32) -> bool,
        copied: &mut Copied,
    ) -> Result<()> {
        let mut payload = vec![0; block.header.payload_bytes as usize];
        let read = self.shared.storage.read_exact_at(&mut payload, block.chunk_range(0).0);
        read.map_err(|error| self.shared.io("reading samples", error))?;
        let chunks = (0..).zip(payload.chunks(CHUNK_BYTES as usize));
        let intact: Vec<bool> = chunks.map(|(chunk, bytes)| block.matches(chunk, bytes)).collect();
        let samples: &[Sample] = bytemuck::cast_slice(&payload);
        let mut at = 0;
        for entry in entries {
            let (begin, end) = (at, at + entry.count);
            at = end;
            if !keep(entry.class.maker, entry.generation) {
                copied.left_out += u64::from(entry.count);
                continue;
            }
            to.begin_generation(entry.generation)?;
            if to.generation() != entry.generation {
                // A file never goes back to an earlier generation.
                copied.left_out += u64::from(entry.count);
                continue;
            }
            let mut from = begin;
            while from < end {
                let chunk = from / CHUNK_SAMPLES;
                let to_sample = ((chunk + 1) * CHUNK_SAMPLES).min(end);
                if intact.get(chunk as usize) == Some(&true) {
                    let run = NumberRun {
                        key: entry.key,
                        kind: entry.class.sample_kind(),
                        first: entry.first + (from - begin),
                        count: to_sample - from,
                        paths: entry.class.paths,
                    };
                    let part = &samples[from as usize..to_sample as usize];
                    to.put(run, entry.class.maker, part, entry.class.supersedes)?;
                    copied.samples += part.len() as u64;
                }
                from = to_sample;
            }
        }
        Ok(())
    }
}
