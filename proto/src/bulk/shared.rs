//! Data that all processes share: records of indirect light, and the packed scene in pieces.

pub use holo_light::Record;

use super::{Head, Reader, put};
use crate::ProtoError;

/// Records of indirect light. A receiver may merge them twice or in another order; it changes
/// nothing.
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
        let mut reader = Reader(bytes);
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
    /// Returns the payload: offset `u64`, bytes.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = self.offset.to_le_bytes().to_vec();
        out.extend_from_slice(&self.bytes);
        out
    }

    /// Parses a payload.
    ///
    /// # Errors
    /// [`ProtoError::Truncated`] if there is no offset.
    pub fn decode(bytes: &[u8]) -> Result<BlobChunk, ProtoError> {
        let (offset, bytes) = bytes.split_first_chunk::<8>().ok_or(ProtoError::Truncated {
            what: "blob chunk",
            needed: 8,
            found: bytes.len() as u64,
        })?;
        Ok(BlobChunk { offset: u64::from_le_bytes(*offset), bytes: bytes.to_vec() })
    }
}
