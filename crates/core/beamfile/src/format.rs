//! The bytes of a holodeck file, format 1: encoding, and decoding into types with sound values.
//!
//! `proto/SPEC.md`, section 8, draws the layout. All numbers are little-endian and unsigned. CRC is
//! CRC-32 as in zlib and PNG (IEEE 802.3, reflected polynomial 0xEDB88320). Zero bytes are written
//! as zero, and readers ignore them, so that later formats may use them.

use bytemuck::{Pod, Zeroable};
use holo_section::{BeamId, BeamKey, Sample, SampleKind};

use crate::types::Maker;

/// Bytes of one copy of the file's header. There are two.
pub const HEADER_COPY_BYTES: usize = 16384;
/// Where the first block begins.
pub const FIRST_BLOCK: u64 = 2 * HEADER_COPY_BYTES as u64;
/// Most sections in a file: a header copy has room for no more beam counts.
pub const MAX_SECTIONS: usize = 2040;
/// Bytes of a block's header.
pub const BLOCK_HEADER_BYTES: usize = 64;
/// Blocks begin at multiples of this, so that a reader finds the next one after damage.
pub const BLOCK_ALIGNMENT: u64 = 16;
/// Longest table. It bounds the memory that a damaged or hostile file can ask for.
pub const MAX_TABLE_BYTES: u32 = 1 << 26;
/// Longest payload, for the same reason.
pub const MAX_PAYLOAD_BYTES: u32 = 1 << 26;
/// Samples in a chunk. A chunk is about one page, so that the check of a short extent reads little
/// more than the extent.
pub const CHUNK_SAMPLES: u32 = 409;
/// Bytes of a chunk: payload under one checksum.
pub const CHUNK_BYTES: u32 = CHUNK_SAMPLES * SAMPLE_BYTES;
/// Bytes of a sample.
pub const SAMPLE_BYTES: u32 = 10;
/// Longest blob. Packed scenes are the longest.
pub const MAX_BLOB_BYTES: u64 = 1 << 32;
/// Longest name of a blob.
pub const MAX_BLOB_NAME: usize = 255;
/// Bytes of one part of a blob. Samples wait for one part, not for a whole scene.
pub const BLOB_PART_BYTES: usize = 16 << 20;

/// The format that this crate writes.
pub const FORMAT: u32 = 1;
const FILE_MAGIC: [u8; 8] = *b"HOLOBEAM";
/// The first bytes of every block.
pub const BLOCK_MAGIC: [u8; 8] = *b"HOLOBLK1";

/// Bytes of a layer's share of a sample: RGBE.
pub const SHARE_BYTES: u32 = 4;
/// Where each header copy has the place of the index: behind the last beam count that fits.
pub const POINTER_OFFSET: usize = HEADER_COPY_BYTES - POINTER_BYTES;
/// Bytes of the place of the index.
pub const POINTER_BYTES: usize = 32;

const _: () = assert!(size_of::<Sample>() == SAMPLE_BYTES as usize && align_of::<Sample>() == 1);
const _: () = assert!(size_of::<RawEntry>() == 32);
const _: () = assert!(32 + 8 * MAX_SECTIONS <= POINTER_OFFSET);

/// Rounds `bytes` up to the next position where a block or a payload may begin.
pub(crate) fn aligned(bytes: u64) -> u64 {
    bytes.next_multiple_of(BLOCK_ALIGNMENT)
}

pub(crate) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

pub(crate) fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

/// The file's header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FileHeader {
    /// A random number, repeated in every block.
    pub file_id: u64,
    /// Beams in each section.
    pub layout: Vec<u64>,
}

/// The state of a header copy.
pub(crate) enum HeaderCopy {
    Intact(FileHeader),
    OtherFormat(u32),
    Damaged,
}

impl FileHeader {
    /// Returns one copy, `HEADER_COPY_BYTES` long. The layout has at most `MAX_SECTIONS` sections.
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

    /// Returns whether the file has such a beam.
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

/// The content of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BlockKind {
    Samples,
    Blob,
    /// Shares of samples in layers.
    Shares,
    Index,
    /// A kind of a later format. Its block is checked and skipped.
    Unknown(u32),
}

impl BlockKind {
    pub fn code(self) -> u32 {
        match self {
            BlockKind::Samples => 1,
            BlockKind::Blob => 2,
            BlockKind::Shares => 3,
            BlockKind::Index => 4,
            BlockKind::Unknown(code) => code,
        }
    }

    pub fn from_code(code: u32) -> Self {
        match code {
            1 => BlockKind::Samples,
            2 => BlockKind::Blob,
            3 => BlockKind::Shares,
            4 => BlockKind::Index,
            code => BlockKind::Unknown(code),
        }
    }
}

/// A block's header, with lengths within their bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BlockHeader {
    pub file_id: u64,
    /// Greater than that of every block before it in the file.
    pub sequence: u64,
    pub kind: BlockKind,
    /// Entries in the table; 1 for a part of a blob.
    pub entries: u32,
    /// Length of the table, without padding.
    pub table_bytes: u32,
    pub table_crc: u32,
    /// Length of the payload, without padding.
    pub payload_bytes: u32,
}

impl BlockHeader {
    pub fn encode(&self) -> [u8; BLOCK_HEADER_BYTES] {
        let mut bytes = [0; BLOCK_HEADER_BYTES];
        bytes[..8].copy_from_slice(&BLOCK_MAGIC);
        bytes[8..16].copy_from_slice(&self.file_id.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.sequence.to_le_bytes());
        for (at, word) in (24..).step_by(4).zip([
            self.kind.code(),
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

    /// Returns `None` unless the bytes are an intact header of this file, with lengths within
    /// their bounds.
    pub fn decode(bytes: &[u8], file_id: u64) -> Option<Self> {
        if bytes.first_chunk() != Some(&BLOCK_MAGIC)
            || u32_at(bytes, 60)? != crc32fast::hash(&bytes[..60])
        {
            return None;
        }
        let header = Self {
            file_id: u64_at(bytes, 8)?,
            sequence: u64_at(bytes, 16)?,
            kind: BlockKind::from_code(u32_at(bytes, 24)?),
            entries: u32_at(bytes, 28)?,
            table_bytes: u32_at(bytes, 32)?,
            table_crc: u32_at(bytes, 36)?,
            payload_bytes: u32_at(bytes, 40)?,
        };
        (header.is_bounded() && header.file_id == file_id).then_some(header)
    }

    /// Returns whether the lengths are within their bounds, the table has room for the checksums of
    /// the payload's chunks, and another block can follow.
    pub fn is_bounded(&self) -> bool {
        self.sequence < u64::MAX
            && self.table_bytes <= MAX_TABLE_BYTES
            && self.payload_bytes <= MAX_PAYLOAD_BYTES
            && self.chunks() <= self.table_bytes as usize / 4
    }

    /// Returns the offset of the payload from the beginning of the block.
    pub fn payload_offset(&self) -> u64 {
        aligned(BLOCK_HEADER_BYTES as u64 + u64::from(self.table_bytes))
    }

    /// Returns the length of the whole block, with padding.
    pub fn block_bytes(&self) -> u64 {
        aligned(self.payload_offset() + u64::from(self.payload_bytes))
    }

    /// Returns the number of chunks of the payload.
    pub fn chunks(&self) -> usize {
        self.payload_bytes.div_ceil(CHUNK_BYTES) as usize
    }
}

/// Properties that an extent states for all its samples, besides their beam and numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Class {
    /// The code of a [`SampleKind`].
    pub kind: u8,
    /// True if the samples replace older ones of the same numbers.
    pub supersedes: bool,
    /// Paths averaged into each sample.
    pub paths: u16,
    /// The maker of the samples.
    pub maker: Maker,
}
const _: () = assert!(size_of::<Class>() == 6);

impl Class {
    pub fn sample_kind(&self) -> SampleKind {
        match self.kind {
            0 => SampleKind::Uniform,
            1 => SampleKind::ViewpointLimited,
            _ => SampleKind::SingleRay,
        }
    }
}

/// An extent's entry in the table of its block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Entry {
    pub key: BeamKey,
    pub class: Class,
    pub first: u32,
    pub count: u32,
    /// The generation of the scene that the samples were traced in.
    pub generation: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct RawEntry {
    beam: [u8; 8],
    section: [u8; 2],
    kind: u8,
    supersedes: u8,
    first: [u8; 4],
    count: [u8; 4],
    paths: [u8; 2],
    maker: [u8; 2],
    generation: [u8; 4],
    layer: [u8; 2],
    zero: [u8; 2],
}

impl Entry {
    /// Appends the entry, as one of a layer. Layer 0 is all light.
    pub fn encode(&self, layer: u16, table: &mut Vec<u8>) {
        let raw = RawEntry {
            beam: self.key.beam.0.to_le_bytes(),
            section: self.key.section.to_le_bytes(),
            kind: self.class.kind,
            supersedes: u8::from(self.class.supersedes),
            first: self.first.to_le_bytes(),
            count: self.count.to_le_bytes(),
            paths: self.class.paths.to_le_bytes(),
            maker: self.class.maker.0.to_le_bytes(),
            generation: self.generation.to_le_bytes(),
            layer: layer.to_le_bytes(),
            zero: [0; 2],
        };
        table.extend_from_slice(bytemuck::bytes_of(&raw));
    }

    /// Returns the entry and its layer.
    pub fn decode(raw: &RawEntry, header: &FileHeader) -> Option<(Self, u16)> {
        let entry = Self {
            key: BeamKey {
                section: u16::from_le_bytes(raw.section),
                beam: BeamId(u64::from_le_bytes(raw.beam)),
            },
            class: Class {
                kind: raw.kind,
                supersedes: raw.supersedes == 1,
                paths: u16::from_le_bytes(raw.paths),
                maker: Maker(u16::from_le_bytes(raw.maker)),
            },
            first: u32::from_le_bytes(raw.first),
            count: u32::from_le_bytes(raw.count),
            generation: u32::from_le_bytes(raw.generation),
        };
        let sound = entry.count > 0
            && entry.first.checked_add(entry.count).is_some()
            && entry.class.kind <= 2
            && raw.supersedes <= 1
            && header.has(entry.key);
        sound.then_some((entry, u16::from_le_bytes(raw.layer)))
    }
}

/// The entry of a part of a blob.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct BlobPart {
    /// The same in all parts of one copy, and in no other copy's.
    pub blob_id: u64,
    /// Bytes of the whole blob.
    pub total: u64,
    /// Where this part begins in the blob.
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

    /// Returns the part whose entry is exactly these bytes.
    pub fn decode(table: &[u8]) -> Option<Self> {
        let name_bytes = usize::from(u16::from_le_bytes(*table.get(24..)?.first_chunk()?));
        let name = str::from_utf8(table.get(32..32 + name_bytes)?).ok()?.to_owned();
        let part = Self {
            blob_id: u64_at(table, 0)?,
            total: u64_at(table, 8)?,
            offset: u64_at(table, 16)?,
            name,
        };
        let sound = (1..=MAX_BLOB_NAME).contains(&name_bytes)
            && part.total <= MAX_BLOB_BYTES
            && (32 + name_bytes).next_multiple_of(4) == table.len();
        sound.then_some(part)
    }
}

/// Appends the checksums of a payload's chunks to its table.
pub(crate) fn push_chunk_crcs(payload: &[u8], table: &mut Vec<u8>) {
    for chunk in payload.chunks(CHUNK_BYTES as usize) {
        table.extend_from_slice(&crc32fast::hash(chunk).to_le_bytes());
    }
}
