//! Frames: the 8-byte header in front of every payload, and the longest payload of each kind.

use crate::ProtoError;

/// Bytes of a frame header: `u32` payload length, `u8` kind, three zero bytes.
pub const HEADER_BYTES: usize = 8;

/// Longest control message. A welcome with 1024 sections and their texts fits many times over.
pub const MAX_CONTROL_BYTES: u64 = 1 << 20;
/// Longest bulk message: a million wanted beams, or 1.6 million samples.
pub const MAX_BULK_BYTES: u64 = 16 << 20;
/// Longest message of live rays: [`crate::bulk::MAX_LIVE_RAYS`] of them.
pub const MAX_LIVE_WANTED_BYTES: u64 = 1 << 20;
/// Longest hello or answer. It is small, because strangers send it.
pub const MAX_HELLO_BYTES: u64 = 4096;

/// What a frame carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Kind {
    /// [`crate::hello::Hello`], the first frame from whoever connects.
    Hello = 1,
    /// [`crate::hello::Answer`], the first frame back.
    Answer = 2,
    /// [`crate::control::Control`], either way.
    Control = 3,
    /// [`crate::bulk::Work`], server to worker.
    Work = 4,
    /// [`crate::bulk::Results`], worker to server.
    Results = 5,
    /// [`crate::bulk::ViewRequest`], display to server.
    View = 6,
    /// [`crate::bulk::Samples`], server to display.
    Samples = 7,
    /// [`crate::bulk::BlobChunk`], server to worker or display: a piece of the packed scene.
    BlobChunk = 8,
    /// [`crate::bulk::Unseen`], server to display.
    Unseen = 9,
    /// [`crate::bulk::Light`], worker to server, and server to whoever asked for light.
    Light = 10,
    /// [`crate::bulk::RaysWanted`], display to server.
    Rays = 11,
    /// [`crate::bulk::LiveWanted`], display to server.
    LiveWanted = 12,
    /// [`crate::bulk::LiveWork`], server to worker.
    LiveWork = 13,
    /// [`crate::bulk::LiveResults`], worker to server.
    LiveResults = 14,
    /// [`crate::bulk::LiveSamples`], server to display.
    LiveSamples = 15,
}

impl Kind {
    /// Returns the kind with this number.
    ///
    /// # Errors
    /// [`ProtoError::Kind`] if there is none.
    pub fn from_byte(byte: u8) -> Result<Kind, ProtoError> {
        [
            Kind::Hello,
            Kind::Answer,
            Kind::Control,
            Kind::Work,
            Kind::Results,
            Kind::View,
            Kind::Samples,
            Kind::BlobChunk,
            Kind::Unseen,
            Kind::Light,
            Kind::Rays,
            Kind::LiveWanted,
            Kind::LiveWork,
            Kind::LiveResults,
            Kind::LiveSamples,
        ]
        .into_iter()
        .find(|&kind| kind as u8 == byte)
        .ok_or(ProtoError::Kind(byte))
    }

    /// Returns the longest payload of this kind, bytes.
    pub fn max_bytes(self) -> u64 {
        match self {
            Kind::Hello | Kind::Answer => MAX_HELLO_BYTES,
            Kind::Control => MAX_CONTROL_BYTES,
            Kind::Work
            | Kind::Results
            | Kind::View
            | Kind::Samples
            | Kind::BlobChunk
            | Kind::Unseen
            | Kind::Light
            | Kind::Rays
            | Kind::LiveWork
            | Kind::LiveResults
            | Kind::LiveSamples => MAX_BULK_BYTES,
            Kind::LiveWanted => MAX_LIVE_WANTED_BYTES,
        }
    }
}

/// A frame's header, with a length within its kind's limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// The kind of the payload.
    pub kind: Kind,
    /// The length of the payload, bytes: at most `kind.max_bytes()`.
    pub length: u32,
}

impl Header {
    /// Parses the 8 bytes in front of a payload.
    ///
    /// # Errors
    /// [`ProtoError::Kind`], [`ProtoError::TooLong`], or [`ProtoError::Trailing`] for non-zero
    /// reserved bytes.
    pub fn parse(bytes: [u8; HEADER_BYTES]) -> Result<Header, ProtoError> {
        let [l0, l1, l2, l3, kind, reserved @ ..] = bytes;
        let kind = Kind::from_byte(kind)?;
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
        Ok(Header { kind, length })
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
pub fn encode(kind: Kind, payload: &[u8]) -> Result<Vec<u8>, ProtoError> {
    let too_long =
        ProtoError::TooLong { kind, length: payload.len() as u64, limit: kind.max_bytes() };
    if payload.len() as u64 > kind.max_bytes() {
        return Err(too_long);
    }
    let length = u32::try_from(payload.len()).map_err(|_| too_long)?;
    let mut frame = Vec::with_capacity(HEADER_BYTES + payload.len());
    frame.extend_from_slice(&Header { kind, length }.to_bytes());
    frame.extend_from_slice(payload);
    Ok(frame)
}
