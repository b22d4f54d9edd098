//! The ranges of blocks that indexes describe.

use crate::format::{FIRST_BLOCK, aligned, u32_at, u64_at};

/// Bytes of a range in the table of an index block.
const RANGE_BYTES: usize = 48;

/// Consecutive blocks that an index block describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct IndexRange {
    /// First byte of the first block.
    pub begin: u64,
    /// One past the last byte of the last block.
    pub end: u64,
    /// Sequence number of the last block.
    pub sequence: u64,
    /// First byte of the index block; 0 for the block whose table this is.
    pub offset: u64,
    /// Length of the index block; 0 for the block whose table this is.
    pub bytes: u32,
    pub blocks: u32,
    pub extents: u32,
}

impl IndexRange {
    pub fn encode(&self, table: &mut Vec<u8>) {
        for word in [self.begin, self.end, self.sequence, self.offset] {
            table.extend_from_slice(&word.to_le_bytes());
        }
        for word in [self.bytes, self.blocks, self.extents, 0] {
            table.extend_from_slice(&word.to_le_bytes());
        }
    }

    /// Returns the ranges of a table; `None` unless they are in file order and do not overlap. The
    /// last one is the block's own.
    pub fn list(entries: u32, table: &[u8]) -> Option<Vec<IndexRange>> {
        if Some(table.len()) != (entries as usize).checked_mul(RANGE_BYTES) || entries == 0 {
            return None;
        }
        let ranges = table.chunks_exact(RANGE_BYTES).map(|bytes| {
            Some(IndexRange {
                begin: u64_at(bytes, 0)?,
                end: u64_at(bytes, 8)?,
                sequence: u64_at(bytes, 16)?,
                offset: u64_at(bytes, 24)?,
                bytes: u32_at(bytes, 32)?,
                blocks: u32_at(bytes, 36)?,
                extents: u32_at(bytes, 40)?,
            })
        });
        let ranges: Vec<IndexRange> = ranges.collect::<Option<_>>()?;
        let mut at = FIRST_BLOCK;
        for range in &ranges {
            if range.begin < at || range.end <= range.begin || range.begin != aligned(range.begin) {
                return None;
            }
            at = range.end;
        }
        Some(ranges)
    }
}
