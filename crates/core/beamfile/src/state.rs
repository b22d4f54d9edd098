//! State that the threads of one open file share under a lock.
//!
//! Invariant: every appended sample is in the active batch, a frozen batch, or the directory. While
//! a batch's extents are being listed, its samples are in both. This changes no read, because
//! either of two equal extents may count.

use std::collections::{BTreeMap, HashSet, VecDeque};
use std::sync::Arc;
use std::time::Instant;

use holo_section::{BeamKey, Sample};

use crate::batch::WriteBatch;
use crate::blob_list::BlobList;
use crate::block_table::BlockTable;
use crate::directory::{Directory, DiskBlock};
use crate::format::{BlockKind, Class, Entry};
use crate::types::{Damage, Skipped};
use crate::{FileLoss, Result};

#[derive(Default)]
pub(crate) struct FileState {
    pub directory: Directory,
    pub blobs: BlobList,
    /// Number of shares of each layer.
    pub layers: BTreeMap<u16, u64>,
    /// Blocks of kinds that this program does not know, by kind.
    pub skipped: BTreeMap<u32, Skipped>,
    /// The batch that receives samples now.
    pub active: WriteBatch,
    /// Time of the first append to the active batch.
    pub active_since: Option<Instant>,
    /// Memory for the next batch.
    pub spare: Option<WriteBatch>,
    /// Batches that wait to be written, oldest first.
    pub frozen: VecDeque<Arc<WriteBatch>>,
    frozen_bytes: u64,
    /// All batches with smaller ids are on disk.
    pub written: u64,
    /// Failed attempts to write so far.
    pub failures: u64,
    /// The reason why the last attempt failed; `None` once one succeeds.
    pub last_error: Option<String>,
    /// True if beams lie in blocks in the order of their appends, not of their numbers.
    pub keeps_order: bool,
    /// True if a caller waits, so that the writer must write at once.
    pub hurry: bool,
    /// True if the writer must end once nothing is left to write.
    pub stop: bool,
    pub writer_gone: bool,
    /// The kind of loss, if the path no longer names the file.
    pub lost: Option<FileLoss>,
    /// Damaged parts found so far.
    pub damage: Vec<Damage>,
    /// Chunks that do not match their checksums: (block, chunk).
    pub bad: HashSet<(u32, u32)>,
}

impl FileState {
    pub fn new(sections: usize) -> Self {
        Self { directory: Directory::new(sections), ..Self::default() }
    }

    /// Returns the memory of samples that are not yet on disk, in bytes.
    pub fn pending_bytes(&self) -> u64 {
        self.frozen_bytes + self.active.bytes()
    }

    /// Closes the active batch, if it has samples, so that it can be written.
    pub fn freeze(&mut self) {
        if self.active.is_empty() {
            return;
        }
        let id = self.active.id + 1;
        let next = self.spare.take().unwrap_or_default().with_id(id);
        let batch = std::mem::replace(&mut self.active, next);
        self.active_since = None;
        self.frozen_bytes += batch.bytes();
        self.frozen.push_back(Arc::new(batch));
    }

    /// Adds samples to memory and counts them.
    pub fn append(&mut self, key: BeamKey, class: Class, first: u32, samples: &[Sample]) {
        self.directory.account(key, class.kind, first, samples.len() as u32);
        self.active.push(key, class, first, samples);
    }

    /// Removes the oldest frozen batch, whose extents are all in the directory.
    pub fn batch_written(&mut self) -> Option<Arc<WriteBatch>> {
        let batch = self.frozen.pop_front()?;
        self.frozen_bytes -= batch.bytes();
        self.written = batch.id + 1;
        Some(batch)
    }

    /// Lists a block that was found in the file.
    pub fn found(&mut self, block: DiskBlock, table: BlockTable) -> Result<()> {
        let BlockTable::Samples(entries) = table else {
            self.list_block(Arc::new(block), Some(table))?;
            return Ok(());
        };
        let id = self.list_block(Arc::new(block), None)?;
        let mut at = 0;
        for entry in &entries {
            let Entry { key, class, first, count, generation } = *entry;
            self.directory.begin(generation);
            // No writer goes back to an earlier generation.
            if generation == self.directory.generation {
                self.directory.account(key, class.kind, first, count);
                self.directory.add_extent(id, at, entry)?;
            }
            at += count;
        }
        Ok(())
    }

    /// Lists a block, and what it holds except samples. Returns its number.
    pub fn list_block(&mut self, block: Arc<DiskBlock>, table: Option<BlockTable>) -> Result<u32> {
        let id = self.directory.add_block(Arc::clone(&block))?;
        match (table, block.header.kind) {
            (Some(BlockTable::Blob(part)), _) => self.blobs.add(part, id, block),
            (Some(BlockTable::Shares(runs)), _) => {
                for run in runs.iter().filter(|run| run.layer > 0) {
                    *self.layers.entry(run.layer).or_default() += u64::from(run.entry.count);
                }
            }
            (_, BlockKind::Unknown(kind)) => {
                let skipped =
                    self.skipped.entry(kind).or_insert(Skipped { kind, blocks: 0, bytes: 0 });
                skipped.blocks += 1;
                skipped.bytes += block.header.block_bytes();
            }
            _ => {}
        }
        Ok(id)
    }

    /// Marks chunks that do not match their checksums. From now on plans leave them out.
    pub fn mark_bad(&mut self, chunks: &[(u32, u32)]) {
        for &(id, chunk) in chunks {
            let Some(block) = self.directory.blocks.get(id as usize) else { continue };
            if self.bad.insert((id, chunk)) {
                let (begin, end) = block.chunk_range(chunk);
                let what = block.payload_damage();
                self.damage.push(Damage { offset: begin, bytes: end - begin, what });
            }
        }
    }
}
