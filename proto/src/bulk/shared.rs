//! Data that all processes share: records of indirect light, and the packed scene in pieces.

use std::cmp::Ordering;

pub use holo_light::Record;

use super::{Head, RecordReader, put};
use crate::{ProtoError, frame::MAX_BULK_BYTES};

/// Most bytes that one compressed byte can stand for, in blocks of LZ4.
const MOST_EXPANSION: usize = 255;

/// Records of indirect light. A receiver may merge them twice or in another order without effect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Light {
    /// The records, all valid.
    pub records: Vec<Record>,
}

impl Light {
    /// Returns the payload: number and length of the records, records.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + size_of_val(self.records.as_slice()));
        put(
            &mut out,
            &Head { first: self.records.len() as u32, second: size_of::<Record>() as u32 },
        );
        out.extend_from_slice(bytemuck::cast_slice(&self.records));
        out
    }

    /// Parses a payload.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts; [`ProtoError::Number`] for an impossible record.
    pub fn decode(bytes: &[u8]) -> Result<Light, ProtoError> {
        let mut reader = RecordReader(bytes);
        let head: Head = reader.one("light message")?;
        if head.second != size_of::<Record>() as u32 {
            return Err(ProtoError::Number("the length of a light record"));
        }
        let records = reader.many::<Record>("light record list", u64::from(head.first))?;
        reader.end()?;
        if !records.iter().all(Record::is_valid) {
            return Err(ProtoError::Number("a record of indirect light"));
        }
        Ok(Light { records })
    }
}

/// A piece of the packed scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlobChunk {
    /// Its offset in the packed scene.
    pub offset: u64,
    /// The bytes.
    pub bytes: Vec<u8>,
}

impl BlobChunk {
    /// Returns the payload: offset `u64`, number of bytes `u32`, bytes.
    pub fn encode(&self) -> Vec<u8> {
        self.payload(&self.bytes)
    }

    /// Returns the payload as [`BlobChunk::encode`] does, with compressed bytes if they are
    /// shorter.
    pub fn encode_compressed(&self) -> Vec<u8> {
        let compressed = lz4_flex::block::compress(&planes(&self.bytes));
        let is_shorter = compressed.len() < self.bytes.len();
        self.payload(if is_shorter { &compressed } else { &self.bytes })
    }

    fn payload(&self, bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::with_capacity(12 + bytes.len());
        out.extend_from_slice(&self.offset.to_le_bytes());
        // A payload is far shorter than 2^32.
        out.extend_from_slice(&(self.bytes.len() as u32).to_le_bytes());
        out.extend_from_slice(bytes);
        out
    }

    /// Parses a payload.
    ///
    /// # Errors
    /// - [`ProtoError::Truncated`] if the head is incomplete.
    /// - [`ProtoError::Compressed`] if the bytes are damaged, or if their number differs from the
    ///   head.
    pub fn decode(payload: &[u8]) -> Result<BlobChunk, ProtoError> {
        let (head, bytes) = payload.split_first_chunk::<12>().ok_or(ProtoError::Truncated {
            what: "blob chunk",
            needed: 12,
            found: payload.len() as u64,
        })?;
        let (offset, length) = head.split_at(8);
        let word = |bytes: &[u8]| bytes.iter().rev().fold(0, |word, &b| word << 8 | u64::from(b));
        let (offset, length) = (word(offset), word(length) as usize);
        let bytes = match length.cmp(&bytes.len()) {
            Ordering::Equal => bytes.to_vec(),
            Ordering::Less => return Err(ProtoError::Compressed),
            Ordering::Greater => decompressed(bytes, length)?,
        };
        Ok(BlobChunk { offset, bytes })
    }
}

/// Returns the bytes of a compressed block. It takes no more memory than the block can fill.
fn decompressed(block: &[u8], length: usize) -> Result<Vec<u8>, ProtoError> {
    let most = block.len().saturating_mul(MOST_EXPANSION).min(MAX_BULK_BYTES as usize);
    if length > most {
        return Err(ProtoError::Compressed);
    }
    let mut planes = vec![0; length];
    match lz4_flex::block::decompress_into(block, &mut planes) {
        Ok(written) if written == length => Ok(words(&planes)),
        _ => Err(ProtoError::Compressed),
    }
}

/// Returns the bytes in another order: the first of each four, then the second, the third and the
/// fourth. The remainder comes last.
///
/// Neighbouring numbers differ in their low bytes and share their high ones. Packed scenes
/// therefore get shorter by factors of 2.3 to 4.3, compared with 1.3 to 2.3 without this.
fn planes(bytes: &[u8]) -> Vec<u8> {
    let (words, rest) = bytes.as_chunks::<4>();
    let mut planes = Vec::with_capacity(bytes.len());
    for at in 0..4 {
        planes.extend(words.iter().map(|word| word[at]));
    }
    planes.extend_from_slice(rest);
    planes
}

/// Undoes [`planes`].
fn words(planes: &[u8]) -> Vec<u8> {
    let count = planes.len() / 4;
    let (planes, rest) = planes.split_at(4 * count);
    let mut words = Vec::with_capacity(planes.len() + rest.len());
    for at in 0..count {
        words.extend([0, 1, 2, 3].map(|plane| planes[plane * count + at]));
    }
    words.extend_from_slice(rest);
    words
}
