//! The bytes of the index: what opening a file needs of its blocks, in few places.
//!
//! An index block describes one *range* of consecutive blocks in its payload. Its table lists this
//! range and all that other index blocks describe. Both copies of the header have a pointer to the
//! newest index block. `proto/SPEC.md`, section 8, draws the bytes.
//!
//! Invariants:
//!
//! - The index repeats headers and tables of blocks, and nothing else. Counts, gaps and the samples
//!   that count are computed from it as from the tables. So an index cannot contradict itself.
//! - Without an index, or with a damaged one, opening reads the blocks instead. An index costs no
//!   sample.

use std::collections::HashMap;

use holo_section::{BeamId, BeamKey};

use crate::block_table::{BlockTable, decode_entries};
use crate::directory::{DiskBlock, Extent, NONE};
use crate::format::{
    BlockHeader, BlockKind, Class, Entry, FileHeader, POINTER_BYTES, SAMPLE_BYTES, u32_at, u64_at,
};
use crate::index_range::IndexRange;
use crate::types::Maker;

/// Bytes of a class of extents.
const CLASS_BYTES: usize = 12;

/// The place of the newest index block, as both copies of the header have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct IndexPointer {
    /// Its first byte in the file.
    pub offset: u64,
    /// Its sequence number.
    pub sequence: u64,
    /// Its length.
    pub bytes: u32,
}

/// The state of a pointer in a copy of the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PointerState {
    /// The file has no index.
    Absent,
    Intact(IndexPointer),
    Damaged,
}

impl IndexPointer {
    pub fn encode(&self) -> [u8; POINTER_BYTES] {
        let mut bytes = [0; POINTER_BYTES];
        bytes[..8].copy_from_slice(&self.offset.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[16..20].copy_from_slice(&self.bytes.to_le_bytes());
        let crc = crc32fast::hash(&bytes[..28]);
        bytes[28..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    pub fn decode(bytes: &[u8]) -> PointerState {
        if bytes.iter().all(|&byte| byte == 0) {
            return PointerState::Absent;
        }
        Self::try_decode(bytes).map_or(PointerState::Damaged, PointerState::Intact)
    }

    fn try_decode(bytes: &[u8]) -> Option<Self> {
        if u32_at(bytes, 28)? != crc32fast::hash(bytes.get(..28)?) {
            return None;
        }
        Some(Self {
            offset: u64_at(bytes, 0)?,
            sequence: u64_at(bytes, 8)?,
            bytes: u32_at(bytes, 16)?,
        })
    }
}

/// Appends a number in groups of seven bits, the lowest first. All but the last have bit 7 set.
fn push_number(bytes: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Reads a payload from front to back.
struct PayloadCursor<'a>(&'a [u8]);

impl<'a> PayloadCursor<'a> {
    fn take(&mut self, bytes: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(bytes)?;
        self.0 = rest;
        Some(taken)
    }

    fn word(&mut self) -> Option<u32> {
        u32_at(self.take(4)?, 0)
    }

    #[inline]
    fn number(&mut self) -> Option<u64> {
        let (&byte, rest) = self.0.split_first()?;
        self.0 = rest;
        // Most numbers of an index take one byte.
        if byte < 0x80 { Some(byte.into()) } else { self.longer(u64::from(byte & 0x7f)) }
    }

    /// Reads the rest of a number whose first seven bits are `number`.
    fn longer(&mut self, mut number: u64) -> Option<u64> {
        for shift in (7..64).step_by(7) {
            let (&byte, rest) = self.0.split_first()?;
            self.0 = rest;
            let bits = u64::from(byte & 0x7f);
            if bits << shift >> shift != bits {
                return None;
            }
            number |= bits << shift;
            if byte < 0x80 {
                return Some(number);
            }
        }
        None
    }

    #[inline]
    fn small(&mut self) -> Option<u32> {
        self.number()?.try_into().ok()
    }
}

/// A difference of two sample numbers as a number: 0, -1, 1, -2 become 0, 1, 2, 3.
fn folded(difference: i64) -> u64 {
    ((difference << 1) ^ (difference >> 63)) as u64
}

fn unfolded(number: u64) -> i64 {
    (number >> 1) as i64 ^ -((number & 1) as i64)
}

/// Collects the description of one range.
#[derive(Default)]
pub(crate) struct RangeBuilder {
    blocks: Vec<u8>,
    count: u32,
    sequence: u64,
    /// Classes of extents and their generations, with their numbers.
    classes: HashMap<(Class, u32), u32>,
    generation: u32,
    extents: Vec<RangeExtent>,
}

/// An extent of a range.
struct RangeExtent {
    key: BeamKey,
    /// Number of the block within the range.
    block: u32,
    /// Where it begins in the block's payload, in samples.
    at: u32,
    /// Number of the class.
    class: u32,
    first: u32,
    count: u32,
}

impl RangeBuilder {
    /// Adds the next block. `entries` is its table without the checksums of chunks.
    pub fn push(&mut self, block: &DiskBlock, table: &BlockTable, entries: &[u8]) {
        let BlockHeader { sequence, kind, entries: count, table_bytes, payload_bytes, .. } =
            block.header;
        for number in [
            u64::from(kind.code()),
            sequence.wrapping_sub(self.sequence),
            u64::from(count),
            u64::from(table_bytes),
            u64::from(payload_bytes),
        ] {
            push_number(&mut self.blocks, number);
        }
        self.sequence = sequence;
        self.blocks.extend_from_slice(&block.header.table_crc.to_le_bytes());
        for crc in &block.crcs {
            self.blocks.extend_from_slice(&crc.to_le_bytes());
        }
        if matches!(kind, BlockKind::Blob | BlockKind::Shares) {
            self.blocks.extend_from_slice(entries);
        }
        if let BlockTable::Samples(entries) = table {
            let mut at = 0;
            for entry in entries {
                // No writer goes back to an earlier generation.
                if entry.generation >= self.generation {
                    self.generation = entry.generation;
                    let new = self.classes.len() as u32;
                    let class = (entry.class, entry.generation);
                    let class = *self.classes.entry(class).or_insert(new);
                    let Entry { key, first, count, .. } = *entry;
                    let block = self.count;
                    self.extents.push(RangeExtent { key, block, at, class, first, count });
                }
                at += entry.count;
            }
        }
        self.count += 1;
    }

    pub fn extents(&self) -> u32 {
        self.extents.len() as u32
    }

    /// Returns the payload of the range's index block.
    pub fn payload(mut self) -> Vec<u8> {
        // Stable: extents of a beam stay in file order.
        self.extents.sort_by_key(|extent| extent.key);
        let mut bytes = Vec::with_capacity(self.blocks.len() + 14 * self.extents.len());
        push_number(&mut bytes, self.classes.len() as u64);
        let mut classes: Vec<_> = self.classes.into_iter().collect();
        classes.sort_unstable_by_key(|(_, number)| *number);
        for ((class, generation), _) in &classes {
            bytes.extend_from_slice(&[class.kind, u8::from(class.supersedes)]);
            bytes.extend_from_slice(&class.paths.to_le_bytes());
            bytes.extend_from_slice(&class.maker.0.to_le_bytes());
            bytes.extend_from_slice(&[0; 2]);
            bytes.extend_from_slice(&generation.to_le_bytes());
        }
        push_number(&mut bytes, self.count.into());
        bytes.extend_from_slice(&self.blocks);
        let mut last: Option<BeamKey> = None;
        for beam in self.extents.chunk_by(|a, b| a.key == b.key) {
            let key = beam[0].key;
            let (section, from) = match last {
                Some(last) if last.section == key.section => (0, last.beam.0),
                Some(last) => (u64::from(key.section - last.section), 0),
                None => (u64::from(key.section), 0),
            };
            last = Some(key);
            for number in [section, key.beam.0 - from, beam.len() as u64] {
                push_number(&mut bytes, number);
            }
            let (mut last_block, mut next) = (0, 0);
            for &RangeExtent { block, at, class, first, count, .. } in beam {
                for number in [
                    u64::from(block - last_block),
                    u64::from(at),
                    u64::from(class),
                    folded(i64::from(first) - i64::from(next)),
                    u64::from(count),
                ] {
                    push_number(&mut bytes, number);
                }
                (last_block, next) = (block, first + count);
            }
        }
        bytes
    }
}

/// Consecutive extents of one beam and one generation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BeamExtents {
    pub key: BeamKey,
    pub generation: u32,
    pub count: u32,
}

/// A range as opening needs it.
#[derive(Debug, Default)]
pub(crate) struct Indexed {
    pub blocks: Vec<(DiskBlock, Option<BlockTable>)>,
    /// In the order of beams; those of one beam in file order.
    pub beams: Vec<BeamExtents>,
    /// The extents of all `beams`, one after the other. Blocks are numbers within `blocks`.
    pub extents: Vec<Extent>,
}

impl Indexed {
    /// Returns blocks that were read one by one, in file order, as a range.
    pub fn of_blocks(found: Vec<(DiskBlock, BlockTable)>) -> Indexed {
        let mut indexed = Indexed::default();
        let mut sorted = Vec::new();
        let mut newest = 0;
        for (number, (block, table)) in (0..).zip(found) {
            if let BlockTable::Samples(entries) = &table {
                let mut at = 0;
                for &Entry { key, class, first, count, generation } in entries {
                    let extent = Extent { block: number, at, first, count, class, next: NONE };
                    at += count;
                    if generation >= newest {
                        newest = generation;
                        sorted.push((BeamExtents { key, generation, count: 1 }, extent));
                    }
                }
            }
            indexed.blocks.push((block, Some(table)));
        }
        sorted.sort_by_key(|(beam, _)| beam.key);
        indexed.beams = sorted.iter().map(|(beam, _)| *beam).collect();
        indexed.extents = sorted.into_iter().map(|(_, extent)| extent).collect();
        indexed
    }

    /// Returns the description of a range; `None` if any value in it is wrong.
    pub fn decode(payload: &[u8], range: &IndexRange, header: &FileHeader) -> Option<Indexed> {
        let mut reader = PayloadCursor(payload);
        let classes = classes(&mut reader)?;
        let count = reader.small()?;
        // Each block takes at least nine bytes, and each extent at least five.
        if count != range.blocks || count as usize > payload.len() / 9 {
            return None;
        }
        let mut indexed = Indexed::default();
        let mut samples = Vec::with_capacity(count as usize);
        let (mut offset, mut sequence) = (range.begin, 0);
        for _ in 0..count {
            let (block, table) = block(&mut reader, header, offset, sequence)?;
            offset = offset.checked_add(block.header.block_bytes())?;
            sequence = block.header.sequence;
            let has_samples = block.header.kind == BlockKind::Samples;
            samples.push(if has_samples { block.header.payload_bytes / SAMPLE_BYTES } else { 0 });
            indexed.blocks.push((block, table));
        }
        if offset != range.end || sequence != range.sequence {
            return None;
        }
        if range.extents as usize > reader.0.len() / 5 {
            return None;
        }
        indexed.extents.reserve_exact(range.extents as usize);
        let mut key = BeamKey { section: 0, beam: BeamId(0) };
        let mut is_first = true;
        while !reader.0.is_empty() {
            let section: u16 = reader.small()?.try_into().ok()?;
            let beam = reader.number()?;
            if section > 0 || is_first {
                key = BeamKey { section: key.section.checked_add(section)?, beam: BeamId(beam) };
            } else if beam > 0 {
                key.beam = BeamId(key.beam.0.checked_add(beam)?);
            } else {
                return None;
            }
            is_first = false;
            if !header.has(key) {
                return None;
            }
            indexed.beam(&mut reader, key, &classes, &samples)?;
        }
        (indexed.extents.len() == range.extents as usize).then_some(indexed)
    }

    /// Reads the extents of one beam. `samples` has the number of samples in each block.
    fn beam(
        &mut self,
        reader: &mut PayloadCursor,
        key: BeamKey,
        classes: &[(Class, u32)],
        samples: &[u32],
    ) -> Option<()> {
        let (mut block, mut next) = (0u32, 0i64);
        let mut last: Option<BeamExtents> = None;
        for _ in 0..reader.small()? {
            block = block.checked_add(reader.small()?)?;
            let at = reader.small()?;
            let &(class, generation) = classes.get(reader.small()? as usize)?;
            let first = u32::try_from(next.checked_add(unfolded(reader.number()?))?).ok()?;
            let count = reader.small()?;
            let end = first.checked_add(count)?;
            if count == 0 || at.checked_add(count)? > *samples.get(block as usize)? {
                return None;
            }
            next = i64::from(end);
            self.extents.push(Extent { block, at, first, count, class, next: NONE });
            match &mut last {
                Some(last) if last.generation == generation => last.count += 1,
                last => {
                    self.beams.extend(last.take());
                    *last = Some(BeamExtents { key, generation, count: 1 });
                }
            }
        }
        self.beams.extend(last);
        Some(())
    }
}

fn classes(reader: &mut PayloadCursor) -> Option<Vec<(Class, u32)>> {
    let count = reader.small()? as usize;
    let bytes = reader.take(count.checked_mul(CLASS_BYTES)?)?;
    let class = |raw: &[u8]| {
        let class = Class {
            kind: raw[0],
            supersedes: raw[1] == 1,
            paths: u16::from_le_bytes([raw[2], raw[3]]),
            maker: Maker(u16::from_le_bytes([raw[4], raw[5]])),
        };
        (raw[0] <= 2 && raw[1] <= 1).then_some((class, u32_at(raw, 8)?))
    };
    bytes.chunks_exact(CLASS_BYTES).map(class).collect()
}

fn block(
    reader: &mut PayloadCursor,
    file: &FileHeader,
    offset: u64,
    sequence: u64,
) -> Option<(DiskBlock, Option<BlockTable>)> {
    let kind = BlockKind::from_code(reader.small()?);
    let step = reader.number()?;
    let header = BlockHeader {
        file_id: file.file_id,
        sequence: sequence.checked_add(step)?,
        kind,
        entries: reader.small()?,
        table_bytes: reader.small()?,
        payload_bytes: reader.small()?,
        table_crc: reader.word()?,
    };
    if step == 0 || !header.is_bounded() {
        return None;
    }
    let crcs = reader.take(4 * header.chunks())?;
    let crcs = crcs.chunks_exact(4).filter_map(|crc| u32_at(crc, 0)).collect();
    let table = match kind {
        BlockKind::Blob | BlockKind::Shares => {
            let entries = reader.take(header.table_bytes as usize - 4 * header.chunks())?;
            Some(decode_entries(&header, entries, file)?)
        }
        BlockKind::Samples | BlockKind::Index | BlockKind::Unknown(_) => None,
    };
    Some((DiskBlock { header, offset, crcs, blob: blob_name(table.as_ref()) }, table))
}

/// Returns the name of the blob that a block is a part of.
pub(crate) fn blob_name(table: Option<&BlockTable>) -> Option<Box<str>> {
    match table {
        Some(BlockTable::Blob(part)) => Some(part.name.as_str().into()),
        _ => None,
    }
}
