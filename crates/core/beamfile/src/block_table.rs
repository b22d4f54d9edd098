//! Tables of blocks: what lies in the payload that follows.

use crate::format::{
    BlobPart, BlockHeader, BlockKind, Entry, FileHeader, RawEntry, SAMPLE_BYTES, u32_at,
};
use crate::index_range::IndexRange;
use crate::shares::ShareRun;

/// A block's table, checked.
#[derive(Debug)]
pub(crate) enum BlockTable {
    Samples(Vec<Entry>),
    Blob(BlobPart),
    Shares(Vec<ShareRun>),
    /// The ranges that have an index.
    Index(Vec<IndexRange>),
    /// The table of a kind that is skipped.
    Unknown,
}

/// Returns the table in `bytes` and the checksums of the payload's chunks; `None` if the table's
/// checksum or any value in it is wrong.
pub(crate) fn decode_table(
    block: &BlockHeader,
    bytes: &[u8],
    header: &FileHeader,
) -> Option<(BlockTable, Box<[u32]>)> {
    if crc32fast::hash(bytes) != block.table_crc {
        return None;
    }
    let (entries, crcs) = bytes.split_at_checked(bytes.len().checked_sub(4 * block.chunks())?)?;
    let table = decode_entries(block, entries, header)?;
    Some((table, crcs.chunks_exact(4).filter_map(|crc| u32_at(crc, 0)).collect()))
}

/// Returns the table whose entries are exactly these bytes; `None` if any value is wrong.
pub(crate) fn decode_entries(
    block: &BlockHeader,
    bytes: &[u8],
    header: &FileHeader,
) -> Option<BlockTable> {
    Some(match block.kind {
        BlockKind::Samples => {
            let entries: Vec<Entry> = layered_entries(block, bytes, header)?
                .into_iter()
                .map(|(entry, layer)| (layer == 0).then_some(entry))
                .collect::<Option<_>>()?;
            let samples: u64 = entries.iter().map(|e| u64::from(e.count)).sum();
            if samples * u64::from(SAMPLE_BYTES) != u64::from(block.payload_bytes) {
                return None;
            }
            BlockTable::Samples(entries)
        }
        BlockKind::Blob => BlockTable::Blob(BlobPart::decode(bytes)?),
        BlockKind::Shares => {
            BlockTable::Shares(ShareRun::list(layered_entries(block, bytes, header)?, block)?)
        }
        BlockKind::Index => BlockTable::Index(IndexRange::list(block.entries, bytes)?),
        BlockKind::Unknown(_) => BlockTable::Unknown,
    })
}

fn layered_entries(
    block: &BlockHeader,
    bytes: &[u8],
    header: &FileHeader,
) -> Option<Vec<(Entry, u16)>> {
    let raw: &[RawEntry] = bytemuck::try_cast_slice(bytes).ok()?;
    if raw.len() != block.entries as usize {
        return None;
    }
    raw.iter().map(|raw| Entry::decode(raw, header)).collect()
}
