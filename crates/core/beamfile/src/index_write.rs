//! Writes the index, while the file grows and when it is closed.
//!
//! Invariant: a pointer to an index block is written only once the block is on the disk itself, and
//! one copy of the header after the other. So a crash leaves a whole index, or an older one.

use std::io;
use std::sync::Arc;

use crate::Result;
use crate::batch::BlockBytes;
use crate::block_table::decode_table;
use crate::directory::DiskBlock;
use crate::format::{
    BLOCK_HEADER_BYTES, BlockKind, FIRST_BLOCK, MAX_PAYLOAD_BYTES, push_chunk_crcs,
};
use crate::index::{IndexPointer, RangeBuilder};
use crate::index_range::IndexRange;
use crate::index_read::pointer_offset;
use crate::shared::OpenFile;
use crate::storage::Storage;

/// Blocks without an index after which one is written: five minutes of filling, which writes two
/// blocks a second. To read their headers takes about two milliseconds.
pub(crate) const BLOCKS_TOGETHER: usize = 600;
/// Extents without an index after which one is written, and most extents of a range. They take
/// about 14 bytes each, so that a range is well below the limit of a payload, and less than half a
/// second to write.
pub(crate) const EXTENTS_TOGETHER: u64 = 1 << 20;
/// Most checksums of chunks in a range, for the same reason.
const CHUNKS_TOGETHER: u64 = 1 << 21;
/// Most ranges written when a file is closed, so that closing a large file of an older version
/// takes seconds. The rest is written with later blocks.
pub(crate) const CLOSING_RANGES: usize = 16;

/// The writer's knowledge of the index.
pub(crate) struct IndexWriter {
    ranges: Vec<IndexRange>,
    /// First byte of the blocks that no range has.
    from: u64,
    /// Numbers of blocks and extents in the directory at the last attempt.
    blocks: usize,
    extents: u64,
    /// Number of blocks when the file was opened.
    opened: usize,
}

impl IndexWriter {
    /// Goes on from the ranges of a file with `opened` blocks.
    pub fn new(ranges: Vec<IndexRange>, opened: usize) -> Self {
        let from = ranges.last().map_or(FIRST_BLOCK, |last| last.end);
        let blocks = ranges.iter().map(|range| range.blocks as usize).sum();
        let extents = ranges.iter().map(|range| u64::from(range.extents)).sum();
        Self { ranges, from, blocks, extents, opened }
    }

    /// Returns whether enough blocks have come since the last attempt.
    pub fn is_due(&self, shared: &OpenFile) -> bool {
        let state = shared.state();
        state.directory.blocks.len() >= self.blocks + BLOCKS_TOGETHER
            || state.directory.extents() >= self.extents + EXTENTS_TOGETHER
    }

    /// Returns whether a file that is closed needs another index block.
    pub fn is_due_at_close(&self, shared: &OpenFile) -> bool {
        shared.state().directory.blocks.len() > self.opened || self.is_due(shared)
    }

    /// Writes one index block, and returns whether there are blocks for another one.
    ///
    /// # Errors
    /// If the disk cannot be read or written. The index is then as before, or has no pointer.
    pub fn write(&mut self, shared: &OpenFile) -> Result<bool> {
        {
            let state = shared.state();
            self.blocks = state.directory.blocks.len();
            self.extents = state.directory.extents();
        }
        let mut blocks = blocks_from(shared, self.from);
        if blocks.iter().all(|block| block.header.kind == BlockKind::Index) {
            return Ok(false);
        }
        let (kept, begin) = self.join(&blocks);
        if begin < self.from {
            blocks = blocks_from(shared, begin);
        }
        let run = first_run(&blocks);
        let failed = |error| shared.io("reading blocks for the index", error);
        let (builder, mut range) = describe(shared, run).map_err(failed)?;
        let read = range.blocks as usize;
        // A block whose table was damaged since it was written gets no index.
        let next = blocks.get(read.max(1));
        self.from = if read == run.len() {
            range.end
        } else {
            run[read].offset + run[read].header.block_bytes()
        };
        let payload = builder.payload();
        if read > 0 && payload.len() <= MAX_PAYLOAD_BYTES as usize {
            let mut table = Vec::new();
            let listed = self.ranges[..kept].iter().chain([&range]);
            listed.for_each(|range| range.encode(&mut table));
            push_chunk_crcs(&payload, &mut table);
            let entries = kept as u32 + 1;
            let body = BlockBytes { kind: BlockKind::Index, entries, table, payload };
            let block = Arc::new(shared.write_block(&body, "writing the index")?);
            range.offset = block.offset;
            range.bytes = block.header.block_bytes() as u32;
            let sequence = block.header.sequence;
            shared.state().list_block(block, None)?;
            self.ranges.truncate(kept);
            self.ranges.push(range);
            let pointer = IndexPointer { offset: range.offset, sequence, bytes: range.bytes };
            write_pointer(&*shared.storage, &pointer)
                .map_err(|error| shared.io("writing the place of the index", error))?;
        }
        Ok(next.is_some())
    }

    /// Returns how many ranges stay, and where the new one begins.
    ///
    /// Like a binary counter, it takes in the ranges directly before it that have no more blocks.
    /// So a file that is continued a thousand times has few ranges, and each block enters few.
    fn join(&self, blocks: &[Arc<DiskBlock>]) -> (usize, u64) {
        let mut begin = self.from;
        let mut kept = self.ranges.len();
        let mut count = blocks.len();
        let mut extents: u64 = blocks.iter().map(|block| extents_of(block)).sum();
        while let Some(last) = self.ranges[..kept].last()
            && last.end == begin
            && last.blocks as usize <= count
            && extents + u64::from(last.extents) <= EXTENTS_TOGETHER
        {
            begin = last.begin;
            count += last.blocks as usize;
            extents += u64::from(last.extents);
            kept -= 1;
        }
        (kept, begin)
    }
}

fn extents_of(block: &DiskBlock) -> u64 {
    if block.header.kind == BlockKind::Samples { block.header.entries.into() } else { 0 }
}

/// Returns the listed blocks from an offset on, in file order.
fn blocks_from(shared: &OpenFile, from: u64) -> Vec<Arc<DiskBlock>> {
    let state = shared.state();
    // Parts of blobs and samples may be listed in another order than they were written.
    let mut blocks: Vec<Arc<DiskBlock>> =
        state.directory.blocks.iter().filter(|block| block.offset >= from).cloned().collect();
    drop(state);
    blocks.sort_unstable_by_key(|block| block.offset);
    blocks
}

/// Returns the first blocks that follow each other without a gap, within the limits of a range. The
/// first one is among them.
fn first_run(blocks: &[Arc<DiskBlock>]) -> &[Arc<DiskBlock>] {
    let (mut extents, mut chunks) = (0, 0);
    let mut end = None;
    let run = blocks.iter().take_while(|block| {
        let is_next = end.is_none_or(|end| block.offset == end);
        extents += extents_of(block);
        chunks += block.header.chunks() as u64;
        let fits = end.is_none() || extents <= EXTENTS_TOGETHER && chunks <= CHUNKS_TOGETHER;
        end = Some(block.offset + block.header.block_bytes());
        is_next && fits
    });
    let length = run.count();
    &blocks[..length]
}

/// Reads the tables of blocks, up to the first damaged one.
fn describe(shared: &OpenFile, run: &[Arc<DiskBlock>]) -> io::Result<(RangeBuilder, IndexRange)> {
    let begin = run.first().map_or(FIRST_BLOCK, |block| block.offset);
    let mut builder = RangeBuilder::default();
    let mut range =
        IndexRange { begin, end: begin, sequence: 0, offset: 0, bytes: 0, blocks: 0, extents: 0 };
    for block in run {
        let mut table = vec![0; block.header.table_bytes as usize];
        shared.storage.read_exact_at(&mut table, block.offset + BLOCK_HEADER_BYTES as u64)?;
        let Some((content, crcs)) = decode_table(&block.header, &table, &shared.header) else {
            break;
        };
        builder.push(block, &content, &table[..table.len() - 4 * crcs.len()]);
        range.end = block.offset + block.header.block_bytes();
        range.sequence = block.header.sequence;
        range.blocks += 1;
    }
    range.extents = builder.extents();
    Ok((builder, range))
}

/// Writes a pointer into both copies of the header, one after the other.
pub(crate) fn write_pointer(storage: &dyn Storage, pointer: &IndexPointer) -> io::Result<()> {
    (0..2).try_for_each(|copy| {
        storage.write_all_at(&pointer.encode(), pointer_offset(copy))?;
        storage.sync_data()
    })
}
