//! The bytes of a holodeck file, format 1.
//!
//! All numbers are little-endian and unsigned; offsets are 64 bits wide. CRC is CRC-32 as in zlib and PNG (IEEE
//! 802.3, reflected polynomial 0xEDB88320). "Zero" bytes are written as zero; a reader ignores them, so that later
//! formats may use them.
//!
//! ```text
//! 0            header, copy 0
//! 16384        header, copy 1 (the same bytes)
//! 32768        block, block, block, ...            each begins at a multiple of 16
//! ```
//!
//! **Header copy** (16384 bytes, written once, when the file is made):
//!
//! | offset | bytes | what |
//! | --- | --- | --- |
//! | 0 | 8 | `HOLOBEAM` |
//! | 8 | 4 | format: 1 |
//! | 12 | 4 | *n*, number of sections, 1 to 2040 |
//! | 16 | 8 | file id: a random number, repeated in every block |
//! | 24 | 4 | zero |
//! | 28 | 4 | CRC of bytes 0 to 27 and 32 to 32 + 8*n* - 1 |
//! | 32 | 8*n* | number of beams in each section |
//! | 32 + 8*n* | | zero, up to 16384 |
//!
//! **Block**: header, table, zeros up to a multiple of 16, payload, zeros up to a multiple of 16. The header is written
//! after all the rest.
//!
//! | offset | bytes | what |
//! | --- | --- | --- |
//! | 0 | 8 | `HOLOBLK1` |
//! | 8 | 8 | file id |
//! | 16 | 8 | sequence number, greater than that of every block before it |
//! | 24 | 4 | kind: 1 samples, 2 part of a blob |
//! | 28 | 4 | number of table entries (of a blob's part: 1) |
//! | 32 | 4 | *t*, bytes of the table, without padding, at most 2²⁶ |
//! | 36 | 4 | CRC of the table |
//! | 40 | 4 | *p*, bytes of payload, without padding, at most 2²⁶ |
//! | 44 | 16 | zero |
//! | 60 | 4 | CRC of bytes 0 to 59 |
//! | 64 | *t* | the table |
//! | 64 + *t*, up to a multiple of 16 | *p* | the payload |
//!
//! The table ends with one CRC (4 bytes) for each *chunk* of 4090 bytes of payload (409 samples), the last one shorter.
//!
//! **Table of a block of samples**: one entry of 32 bytes for each extent, in the order of (section, beam); the extents of
//! one beam are in the order in which they were appended for each kind. The payload is their samples, one after the other,
//! 10 bytes each.
//!
//! | offset | bytes | what |
//! | --- | --- | --- |
//! | 0 | 8 | beam |
//! | 8 | 2 | section |
//! | 10 | 1 | kind: 0 uniform, 1 limited to a viewpoint, 2 single ray |
//! | 11 | 1 | 1: supersedes older samples of the same numbers; 0: does not |
//! | 12 | 4 | sample number of the first sample |
//! | 16 | 4 | number of samples, at least 1 |
//! | 20 | 2 | paths per sample |
//! | 22 | 10 | zero |
//!
//! **Which sample counts**, where several have the same beam, kind and number: take the extents in file order; one that
//! supersedes replaces what was there before, one that does not fills only the numbers that are still free.
//!
//! **Table of a part of a blob**: a blob is there when its parts are all there, each beginning where the one before
//! ended; of several blobs with one name the last whole one counts.
//!
//! | offset | bytes | what |
//! | --- | --- | --- |
//! | 0 | 8 | blob id: the sequence number that its first part's block has or would have had |
//! | 8 | 8 | bytes of the whole blob |
//! | 16 | 8 | offset of this part in the blob; the payload is its bytes |
//! | 24 | 2 | *m*, bytes of the name, 1 to 255 |
//! | 26 | 6 | zero |
//! | 32 | *m* | the name, UTF-8, then zeros up to a multiple of 4 |
//!
//! **Reading after damage**: where no block header with the right file id and CRC is found, the next one is looked for
//! at every following multiple of 16. A block that the file ends within, or a tail that begins with 64 zero bytes, was
//! never completed: a writer cuts it off.

use bytemuck::{Pod, Zeroable};
use holo_section::{BeamId, BeamKey, Sample, SampleKind};

/// Bytes of one copy of the file's header; there are two.
pub const HEADER_COPY_BYTES: usize = 16384;
/// Where the first block begins.
pub const FIRST_BLOCK: u64 = 2 * HEADER_COPY_BYTES as u64;
/// As many beam counts as a header copy has room for.
pub const MAX_SECTIONS: usize = 2040;
/// Bytes of a block's header.
pub const BLOCK_HEADER_BYTES: usize = 64;
/// Blocks begin at multiples of this, so that they can be found after damage.
pub const BLOCK_ALIGNMENT: u64 = 16;
/// A table longer than this is no table: bounds the memory that a damaged or hostile file can ask for.
pub const MAX_TABLE_BYTES: u32 = 1 << 26;
/// The same for a payload.
pub const MAX_PAYLOAD_BYTES: u32 = 1 << 26;
/// Samples in a chunk: about one page, so that reading one scattered extent checks little more than it wants.
pub const CHUNK_SAMPLES: u32 = 409;
/// Bytes of payload under one checksum.
pub const CHUNK_BYTES: u32 = CHUNK_SAMPLES * SAMPLE_BYTES;
/// Bytes of a sample.
pub const SAMPLE_BYTES: u32 = 10;
/// Longest blob: a packed scene.
pub const MAX_BLOB_BYTES: u64 = 1 << 32;
/// Longest name of a blob.
pub const MAX_BLOB_NAME: usize = 255;
/// Blobs are written in parts of this size, so that samples need not wait for a whole scene.
pub const BLOB_PART_BYTES: usize = 16 << 20;

/// The format that this crate writes.
pub const FORMAT: u32 = 1;
const FILE_MAGIC: [u8; 8] = *b"HOLOBEAM";
/// The first bytes of every block.
pub const BLOCK_MAGIC: [u8; 8] = *b"HOLOBLK1";

const KIND_SAMPLES: u32 = 1;
const KIND_BLOB: u32 = 2;

const _: () = assert!(size_of::<Sample>() == SAMPLE_BYTES as usize && align_of::<Sample>() == 1);
const _: () = assert!(size_of::<RawEntry>() == 32);
const _: () = assert!(32 + 8 * MAX_SECTIONS <= HEADER_COPY_BYTES);

/// `bytes` rounded up to where a block or payload may begin.
pub(crate) fn aligned(bytes: u64) -> u64 {
    bytes.next_multiple_of(BLOCK_ALIGNMENT)
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

/// What the header says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FileHeader {
    pub file_id: u64,
    /// Beams in each section.
    pub layout: Vec<u64>,
}

/// What a header copy turned out to be.
pub(crate) enum HeaderCopy {
    Intact(FileHeader),
    OtherFormat(u32),
    Damaged,
}

impl FileHeader {
    /// One copy, `HEADER_COPY_BYTES` long. The layout has at most `MAX_SECTIONS` sections.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER_COPY_BYTES);
        bytes.extend_from_slice(&FILE_MAGIC);
        bytes.extend_from_slice(&FORMAT.to_le_bytes());
        bytes.extend_from_slice(&(self.layout.len() as u32).to_le_bytes());
        bytes.extend_from_slice(&self.file_id.to_le_bytes());
        bytes.extend_from_slice(&[0; 8]);
        for beams in &self.layout {
            bytes.extend_from_slice(&beams.to_le_bytes());
        }
        let crc = header_crc(&bytes);
        bytes[28..32].copy_from_slice(&crc.to_le_bytes());
        bytes.resize(HEADER_COPY_BYTES, 0);
        bytes
    }

    pub fn decode(bytes: &[u8]) -> HeaderCopy {
        Self::try_decode(bytes).unwrap_or(HeaderCopy::Damaged)
    }

    fn try_decode(bytes: &[u8]) -> Option<HeaderCopy> {
        let sections = u32_at(bytes, 12)? as usize;
        if bytes.first_chunk() != Some(&FILE_MAGIC) || !(1..=MAX_SECTIONS).contains(&sections) {
            return None;
        }
        let used = bytes.get(..32 + 8 * sections)?;
        if u32_at(used, 28)? != header_crc(used) {
            return None;
        }
        let format = u32_at(used, 8)?;
        if format != FORMAT {
            return Some(HeaderCopy::OtherFormat(format));
        }
        let layout = (0..sections).map(|s| u64_at(used, 32 + 8 * s)).collect::<Option<Vec<_>>>()?;
        Some(HeaderCopy::Intact(FileHeader { file_id: u64_at(used, 16)?, layout }))
    }

    /// Whether the file has such a beam.
    pub fn has(&self, key: BeamKey) -> bool {
        self.layout.get(usize::from(key.section)).is_some_and(|&beams| key.beam.0 < beams)
    }
}

fn header_crc(used: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&used[..28]);
    crc.update(&used[32..]);
    crc.finalize()
}

/// What a block holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BlockKind {
    Samples,
    Blob,
}

/// A block's header, lengths already bounded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BlockHeader {
    pub file_id: u64,
    pub sequence: u64,
    pub kind: BlockKind,
    pub entries: u32,
    pub table_bytes: u32,
    pub table_crc: u32,
    pub payload_bytes: u32,
}

impl BlockHeader {
    pub fn encode(&self) -> [u8; BLOCK_HEADER_BYTES] {
        let kind = match self.kind {
            BlockKind::Samples => KIND_SAMPLES,
            BlockKind::Blob => KIND_BLOB,
        };
        let mut bytes = [0; BLOCK_HEADER_BYTES];
        bytes[..8].copy_from_slice(&BLOCK_MAGIC);
        bytes[8..16].copy_from_slice(&self.file_id.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.sequence.to_le_bytes());
        for (at, word) in (24..).step_by(4).zip([
            kind,
            self.entries,
            self.table_bytes,
            self.table_crc,
            self.payload_bytes,
        ]) {
            bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
        }
        let crc = crc32fast::hash(&bytes[..60]);
        bytes[60..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// `None` unless the bytes are a block header of this file, intact, with lengths within bounds.
    pub fn decode(bytes: &[u8], file_id: u64) -> Option<Self> {
        if bytes.first_chunk() != Some(&BLOCK_MAGIC)
            || u32_at(bytes, 60)? != crc32fast::hash(&bytes[..60])
        {
            return None;
        }
        let kind = match u32_at(bytes, 24)? {
            KIND_SAMPLES => BlockKind::Samples,
            KIND_BLOB => BlockKind::Blob,
            _ => return None,
        };
        let header = Self {
            file_id: u64_at(bytes, 8)?,
            sequence: u64_at(bytes, 16)?,
            kind,
            entries: u32_at(bytes, 28)?,
            table_bytes: u32_at(bytes, 32)?,
            table_crc: u32_at(bytes, 36)?,
            payload_bytes: u32_at(bytes, 40)?,
        };
        let bounded =
            header.table_bytes <= MAX_TABLE_BYTES && header.payload_bytes <= MAX_PAYLOAD_BYTES;
        (bounded && header.file_id == file_id).then_some(header)
    }

    /// Offset of the payload from the beginning of the block.
    pub fn payload_offset(&self) -> u64 {
        aligned(BLOCK_HEADER_BYTES as u64 + u64::from(self.table_bytes))
    }

    /// Length of the whole block, padding included.
    pub fn block_bytes(&self) -> u64 {
        aligned(self.payload_offset() + u64::from(self.payload_bytes))
    }

    fn chunks(&self) -> usize {
        self.payload_bytes.div_ceil(CHUNK_BYTES) as usize
    }
}

/// What an extent says of all its samples, apart from beam and numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Class {
    pub kind: u8,
    pub supersedes: bool,
    pub paths: u16,
}
const _: () = assert!(size_of::<Class>() == 4);

impl Class {
    pub fn sample_kind(&self) -> SampleKind {
        match self.kind {
            0 => SampleKind::Uniform,
            1 => SampleKind::ViewpointLimited,
            _ => SampleKind::SingleRay,
        }
    }
}

/// One extent as its table entry says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry {
    pub key: BeamKey,
    pub class: Class,
    pub first: u32,
    pub count: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct RawEntry {
    beam: [u8; 8],
    section: [u8; 2],
    kind: u8,
    supersedes: u8,
    first: [u8; 4],
    count: [u8; 4],
    paths: [u8; 2],
    zero: [u8; 10],
}

impl Entry {
    pub fn encode(&self, table: &mut Vec<u8>) {
        let raw = RawEntry {
            beam: self.key.beam.0.to_le_bytes(),
            section: self.key.section.to_le_bytes(),
            kind: self.class.kind,
            supersedes: u8::from(self.class.supersedes),
            first: self.first.to_le_bytes(),
            count: self.count.to_le_bytes(),
            paths: self.class.paths.to_le_bytes(),
            zero: [0; 10],
        };
        table.extend_from_slice(bytemuck::bytes_of(&raw));
    }

    fn decode(raw: &RawEntry, header: &FileHeader) -> Option<Self> {
        let entry = Self {
            key: BeamKey {
                section: u16::from_le_bytes(raw.section),
                beam: BeamId(u64::from_le_bytes(raw.beam)),
            },
            class: Class {
                kind: raw.kind,
                supersedes: raw.supersedes == 1,
                paths: u16::from_le_bytes(raw.paths),
            },
            first: u32::from_le_bytes(raw.first),
            count: u32::from_le_bytes(raw.count),
        };
        let sound = entry.count > 0
            && entry.first.checked_add(entry.count).is_some()
            && entry.class.kind <= 2
            && raw.supersedes <= 1
            && header.has(entry.key);
        sound.then_some(entry)
    }
}

/// Which part of which blob a block holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct BlobPart {
    pub blob_id: u64,
    pub total: u64,
    pub offset: u64,
    pub name: String,
}

impl BlobPart {
    pub fn encode(&self, table: &mut Vec<u8>) {
        for word in [self.blob_id, self.total, self.offset, self.name.len() as u64] {
            table.extend_from_slice(&word.to_le_bytes());
        }
        table.extend_from_slice(self.name.as_bytes());
        table.resize(table.len().next_multiple_of(4), 0);
    }

    fn decode(table: &[u8]) -> Option<(Self, usize)> {
        let name_bytes = usize::from(u16::from_le_bytes(*table.get(24..)?.first_chunk()?));
        let name = str::from_utf8(table.get(32..32 + name_bytes)?).ok()?.to_owned();
        let part = Self {
            blob_id: u64_at(table, 0)?,
            total: u64_at(table, 8)?,
            offset: u64_at(table, 16)?,
            name,
        };
        let sound = (1..=MAX_BLOB_NAME).contains(&name_bytes) && part.total <= MAX_BLOB_BYTES;
        sound.then_some((part, (32 + name_bytes).next_multiple_of(4)))
    }
}

/// A block's table, read and found sound.
pub(crate) enum Table {
    Samples(Vec<Entry>),
    Blob(BlobPart),
}

/// The checksums of a payload, as they stand at the end of a table.
pub(crate) fn push_chunk_crcs(payload: &[u8], table: &mut Vec<u8>) {
    for chunk in payload.chunks(CHUNK_BYTES as usize) {
        table.extend_from_slice(&crc32fast::hash(chunk).to_le_bytes());
    }
}

/// The table and the chunk checksums in `bytes`; `None` where the checksum, or anything in it, is wrong.
pub(crate) fn decode_table(
    block: &BlockHeader,
    bytes: &[u8],
    header: &FileHeader,
) -> Option<(Table, Box<[u32]>)> {
    if crc32fast::hash(bytes) != block.table_crc {
        return None;
    }
    let (table, used) = match block.kind {
        BlockKind::Samples => {
            let used = (block.entries as usize).checked_mul(size_of::<RawEntry>())?;
            let raw: &[RawEntry] = bytemuck::try_cast_slice(bytes.get(..used)?).ok()?;
            let entries =
                raw.iter().map(|raw| Entry::decode(raw, header)).collect::<Option<Vec<_>>>()?;
            let samples: u64 = entries.iter().map(|e| u64::from(e.count)).sum();
            if samples * u64::from(SAMPLE_BYTES) != u64::from(block.payload_bytes) {
                return None;
            }
            (Table::Samples(entries), used)
        }
        BlockKind::Blob => {
            let (part, used) = BlobPart::decode(bytes)?;
            (Table::Blob(part), used)
        }
    };
    let crcs = bytes.get(used..)?;
    if crcs.len() != 4 * block.chunks() {
        return None;
    }
    Some((table, crcs.chunks_exact(4).filter_map(|crc| u32_at(crc, 0)).collect()))
}
