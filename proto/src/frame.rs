//! Frames: the 8-byte header in front of every payload.

use crate::ProtoError;
pub use crate::kind::{
    FrameKind, MAX_BULK_BYTES, MAX_CONTROL_BYTES, MAX_HELLO_BYTES, MAX_LIVE_WANTED_BYTES,
};

/// Bytes of a frame header: `u32` payload length, `u8` kind, three zero bytes.
pub const HEADER_BYTES: usize = 8;

/// A frame's header, with a length within its kind's limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameHeader {
    /// The kind of the payload.
    pub kind: FrameKind,
    /// The length of the payload, bytes: at most `kind.max_bytes()`.
    pub length: u32,
}

impl FrameHeader {
    /// Parses the 8 bytes in front of a payload.
    ///
    /// # Errors
    /// [`ProtoError::Kind`], [`ProtoError::TooLong`], or [`ProtoError::Trailing`] for non-zero
    /// reserved bytes.
    pub fn parse(bytes: [u8; HEADER_BYTES]) -> Result<FrameHeader, ProtoError> {
        let [l0, l1, l2, l3, kind, reserved @ ..] = bytes;
        let kind = FrameKind::from_byte(kind).ok_or(ProtoError::Kind(kind))?;
        let length = u32::from_le_bytes([l0, l1, l2, l3]);
        if u64::from(length) > kind.max_bytes() {
            return Err(ProtoError::TooLong {
                kind,
                length: u64::from(length),
                limit: kind.max_bytes(),
            });
        }
        if reserved != [0; 3] {
            return Err(ProtoError::Trailing(3));
        }
        Ok(FrameHeader { kind, length })
    }

    /// Returns the header's bytes.
    pub fn to_bytes(self) -> [u8; HEADER_BYTES] {
        let [l0, l1, l2, l3] = self.length.to_le_bytes();
        [l0, l1, l2, l3, self.kind as u8, 0, 0, 0]
    }
}

/// Returns a whole frame: header and payload in one buffer, ready to write.
///
/// # Errors
/// [`ProtoError::TooLong`] if the payload is longer than its kind allows. The sender must split it.
pub fn encode(kind: FrameKind, payload: &[u8]) -> Result<Vec<u8>, ProtoError> {
    let too_long =
        ProtoError::TooLong { kind, length: payload.len() as u64, limit: kind.max_bytes() };
    if payload.len() as u64 > kind.max_bytes() {
        return Err(too_long);
    }
    let length = u32::try_from(payload.len()).map_err(|_| too_long)?;
    let mut frame = Vec::with_capacity(HEADER_BYTES + payload.len());
    frame.extend_from_slice(&FrameHeader { kind, length }.to_bytes());
    frame.extend_from_slice(payload);
    Ok(frame)
}
