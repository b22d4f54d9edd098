//! Finds the blocks of a file, also after damage.
//!
//! Invariant: a block that the scan passes on has an intact header, an intact table, and a payload
//! within the file. The scan does not read payloads.

use std::io;
use std::path::Path;

use crate::Result;
use crate::block_table::{BlockTable, decode_table};
use crate::directory::DiskBlock;
use crate::error::io_error;
use crate::format::{
    BLOCK_ALIGNMENT, BLOCK_HEADER_BYTES, BLOCK_MAGIC, BlockHeader, FIRST_BLOCK, FileHeader, aligned,
};
use crate::index::blob_name;
use crate::storage::Storage;
use crate::types::{Damage, DamageKind};

/// Bytes searched at a time for the next block after damage.
const SEARCH_BYTES: u64 = 1 << 20;

/// The state of the end of the file.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Tail {
    /// The file ends with a block.
    Clean,
    /// The file ends with a block that was never completed. Nothing in it can be used.
    Torn(Damage),
    /// The file ends with bytes that are no block. A rescuer may want them.
    Damaged(Damage),
}

/// The end of a scan.
#[derive(Debug)]
pub(crate) struct ScanEnd {
    /// The position where a later scan continues: the first byte after all blocks or, after damage,
    /// a position before a block.
    pub resume: u64,
    /// Sequence number of the last block.
    pub sequence: u64,
    /// The end of the stretch, or of the file.
    pub length: u64,
    pub tail: Tail,
}

/// A part of a file to scan.
pub(crate) struct ScanRange {
    /// Where it begins: at a block.
    pub from: u64,
    /// One past its last byte, unless the file ends before.
    pub to: u64,
    /// Sequence number of the last block before it.
    pub sequence: u64,
}

impl ScanRange {
    /// Everything that a file can hold.
    pub const WHOLE: ScanRange = ScanRange { from: FIRST_BLOCK, to: u64::MAX, sequence: 0 };
}

/// Calls `found` for every block of a stretch, in file order. Blocks whose sequence number is not
/// above that of the block before are damage.
pub(crate) fn scan(
    storage: &dyn Storage,
    path: &Path,
    file: &FileHeader,
    ScanRange { from, to, mut sequence }: ScanRange,
    damage: &mut Vec<Damage>,
    found: &mut dyn FnMut(DiskBlock, BlockTable) -> Result<()>,
) -> Result<ScanEnd> {
    let failed = io_error(path, "reading its blocks");
    let length = storage.length().map_err(&failed)?.min(to);
    let mut at = from;
    let tail = loop {
        let rest = length.saturating_sub(at);
        if rest == 0 {
            break Tail::Clean;
        }
        let torn = Damage { offset: at, bytes: rest, what: DamageKind::TornTail };
        if rest < BLOCK_HEADER_BYTES as u64 {
            break Tail::Torn(torn);
        }
        let mut bytes = [0; BLOCK_HEADER_BYTES];
        storage.read_exact_at(&mut bytes, at).map_err(&failed)?;
        let Some(header) = header_after(&bytes, file, sequence) else {
            let Some(next) = find_block(storage, file, sequence, at + BLOCK_ALIGNMENT, length)
                .map_err(&failed)?
            else {
                let unwritten = bytes == [0; BLOCK_HEADER_BYTES];
                break if unwritten {
                    Tail::Torn(torn)
                } else {
                    Tail::Damaged(Damage { what: DamageKind::BlockHeader, ..torn })
                };
            };
            damage.push(Damage { offset: at, bytes: next - at, what: DamageKind::BlockHeader });
            at = next;
            continue;
        };
        if header.block_bytes() > rest {
            break Tail::Torn(torn);
        }
        sequence = header.sequence;
        let mut table = vec![0; header.table_bytes as usize];
        storage.read_exact_at(&mut table, at + BLOCK_HEADER_BYTES as u64).map_err(&failed)?;
        match decode_table(&header, &table, file) {
            Some((table, crcs)) => {
                let blob = blob_name(Some(&table));
                found(DiskBlock { header, offset: at, crcs, blob }, table)?;
            }
            None => damage.push(Damage {
                offset: at,
                bytes: header.block_bytes(),
                what: DiskBlock::table_damage(&header),
            }),
        }
        at += header.block_bytes();
    };
    Ok(ScanEnd { resume: at, sequence, length, tail })
}

fn header_after(bytes: &[u8], file: &FileHeader, sequence: u64) -> Option<BlockHeader> {
    BlockHeader::decode(bytes, file.file_id).filter(|header| header.sequence > sequence)
}

/// Returns the first offset from `from` on that has an intact block header.
fn find_block(
    storage: &dyn Storage,
    file: &FileHeader,
    sequence: u64,
    from: u64,
    length: u64,
) -> io::Result<Option<u64>> {
    let header_bytes = BLOCK_HEADER_BYTES as u64;
    let mut window = Vec::new();
    let mut at = aligned(from);
    while at + header_bytes <= length {
        // Windows overlap, so that a header across a boundary is found.
        let bytes = (length - at).min(SEARCH_BYTES + header_bytes);
        window.resize(bytes as usize, 0);
        storage.read_exact_at(&mut window, at)?;
        for (offset, candidate) in (0..)
            .step_by(BLOCK_ALIGNMENT as usize)
            .zip(window.windows(BLOCK_HEADER_BYTES).step_by(BLOCK_ALIGNMENT as usize))
        {
            if candidate.first_chunk() == Some(&BLOCK_MAGIC)
                && header_after(candidate, file, sequence).is_some()
            {
                return Ok(Some(at + offset));
            }
        }
        at += SEARCH_BYTES;
    }
    Ok(None)
}
