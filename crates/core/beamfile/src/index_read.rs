//! Finds the index of a file that is opened.
//!
//! Invariant: what is wrong in an index is left out, and its blocks are read instead.

use std::io;

use crate::block_table::{BlockTable, decode_table};
use crate::checksums::chunks_match;
use crate::format::{
    BLOCK_HEADER_BYTES, BlockHeader, BlockKind, FIRST_BLOCK, FileHeader, HEADER_COPY_BYTES,
    MAX_PAYLOAD_BYTES, MAX_TABLE_BYTES, POINTER_BYTES, POINTER_OFFSET, aligned,
};
use crate::index::{IndexPointer, Indexed, PointerState};
use crate::index_range::IndexRange;
use crate::storage::Storage;
use crate::types::{Damage, DamageKind};

/// Longest index block.
const MAX_BLOCK_BYTES: u64 = MAX_TABLE_BYTES as u64 + MAX_PAYLOAD_BYTES as u64 + 128;

/// The index of a file.
#[derive(Default)]
pub(crate) struct FoundIndex {
    /// Ranges in file order, without damaged ones.
    pub ranges: Vec<(IndexRange, Indexed)>,
    /// The ranges that a writer's next index goes on from: those before the first damaged one.
    pub kept: Vec<IndexRange>,
    pub damage: Vec<Damage>,
}

/// An index block whose header and table are intact.
struct IndexBlock {
    header: BlockHeader,
    ranges: Vec<IndexRange>,
    /// `None` if it does not match its checksums.
    payload: Option<Vec<u8>>,
}

/// Returns where a copy of the header has its pointer to the index.
pub(crate) fn pointer_offset(copy: u8) -> u64 {
    (usize::from(copy) * HEADER_COPY_BYTES + POINTER_OFFSET) as u64
}

/// Returns the pointers of both copies of the header.
pub(crate) fn pointers(storage: &dyn Storage) -> io::Result<[PointerState; 2]> {
    let pointer = |copy| {
        let mut bytes = [0; POINTER_BYTES];
        let mut state = PointerState::Damaged;
        // Twice, because a writer may have been half-way.
        for _ in 0..2 {
            storage.read_exact_at(&mut bytes, pointer_offset(copy))?;
            state = IndexPointer::decode(&bytes);
            if state != PointerState::Damaged {
                break;
            }
        }
        Ok::<_, io::Error>(state)
    };
    Ok([pointer(0)?, pointer(1)?])
}

/// Returns the damage of pointers to the index.
pub(crate) fn pointer_damage(pointers: &[PointerState; 2]) -> impl Iterator<Item = Damage> {
    let damaged =
        (0..).zip(pointers).filter(|(_, pointer)| matches!(pointer, PointerState::Damaged));
    damaged.map(|(copy, _)| Damage {
        offset: pointer_offset(copy),
        bytes: POINTER_BYTES as u64,
        what: DamageKind::Index,
    })
}

/// Returns the newest of the pointers.
pub(crate) fn newest(pointers: &[PointerState; 2]) -> Option<IndexPointer> {
    let intact = pointers.iter().filter_map(|pointer| match pointer {
        PointerState::Intact(pointer) => Some(*pointer),
        PointerState::Absent | PointerState::Damaged => None,
    });
    intact.max_by_key(|pointer| pointer.sequence)
}

/// Reads the index that the pointers name, if it is there.
///
/// A pointer beyond the file's end, or to another block, is no damage: the file was cut off, and
/// may have grown since. If the block itself is damaged, the scan of the file names it.
pub(crate) fn read(
    storage: &dyn Storage,
    header: &FileHeader,
    pointers: &[PointerState; 2],
) -> io::Result<FoundIndex> {
    let mut found =
        FoundIndex { damage: pointer_damage(pointers).collect(), ..FoundIndex::default() };
    let length = storage.length()?;
    let Some(pointer) = newest(pointers) else { return Ok(found) };
    let Some(root) = read_block(storage, header, length, pointer.offset, pointer.bytes)? else {
        return Ok(found);
    };
    if root.header.sequence != pointer.sequence {
        return Ok(found);
    }
    let mut all_intact = true;
    for range in &root.ranges {
        let is_own = range.offset == 0;
        let (offset, bytes) =
            if is_own { (pointer.offset, pointer.bytes) } else { (range.offset, range.bytes) };
        let other;
        let payload = if is_own {
            root.payload.as_deref()
        } else {
            other = read_block(storage, header, length, offset, bytes)?.and_then(|b| b.payload);
            other.as_deref()
        };
        let indexed = payload
            .filter(|_| range.end <= length)
            .and_then(|payload| Indexed::decode(payload, range, header));
        match indexed {
            Some(indexed) => {
                let range = IndexRange { offset, bytes, ..*range };
                all_intact.then(|| found.kept.push(range));
                found.ranges.push((range, indexed));
            }
            None => {
                all_intact = false;
                let what = DamageKind::Index;
                found.damage.push(Damage { offset, bytes: bytes.into(), what });
            }
        }
    }
    Ok(found)
}

/// Reads an index block in one piece; `None` if there is none with an intact header and table.
fn read_block(
    storage: &dyn Storage,
    file: &FileHeader,
    length: u64,
    offset: u64,
    bytes: u32,
) -> io::Result<Option<IndexBlock>> {
    let bytes = u64::from(bytes);
    let is_within = offset >= FIRST_BLOCK
        && offset == aligned(offset)
        && (BLOCK_HEADER_BYTES as u64..=MAX_BLOCK_BYTES).contains(&bytes)
        && offset.checked_add(bytes).is_some_and(|end| end <= length);
    if !is_within {
        return Ok(None);
    }
    let mut block = vec![0; bytes as usize];
    storage.read_exact_at(&mut block, offset)?;
    Ok(decode_block(&block, file))
}

fn decode_block(block: &[u8], file: &FileHeader) -> Option<IndexBlock> {
    let header = BlockHeader::decode(block.get(..BLOCK_HEADER_BYTES)?, file.file_id)?;
    if header.kind != BlockKind::Index || header.block_bytes() != block.len() as u64 {
        return None;
    }
    let table = block.get(BLOCK_HEADER_BYTES..)?.get(..header.table_bytes as usize)?;
    let (BlockTable::Index(ranges), crcs) = decode_table(&header, table, file)? else {
        return None;
    };
    let payload = block.get(header.payload_offset() as usize..)?;
    let payload = payload.get(..header.payload_bytes as usize)?;
    let payload = chunks_match(payload, &crcs).then(|| payload.to_vec());
    Some(IndexBlock { header, ranges, payload })
}
