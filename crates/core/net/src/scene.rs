//! Receives a blob, such as the packed scene, in pieces, within the announced size.

use holo_proto::{bulk::BlobChunk, control::SceneInfo};

use crate::NetError;

/// Bytes of a blob in one message, so few that other messages can be sent in between.
pub const SCENE_CHUNK_BYTES: usize = 1 << 20;

/// Largest blob that a peer accepts: a scene of 1.6 · 10⁸ triangles.
const MAX_SCENE_BYTES: u64 = 4 << 30;

/// Returns the piece that a server sends in place of a blob that it does not have.
///
/// The piece is empty. The receiver then need not guess from a delay that the blob will not come.
pub fn absent() -> BlobChunk {
    BlobChunk { offset: 0, bytes: Vec::new() }
}

/// Collects the pieces of a blob as they arrive, in order.
#[derive(Debug)]
pub struct SceneReceiver {
    bytes: Vec<u8>,
    expected: u64,
}

impl SceneReceiver {
    /// Returns a receiver for the blob announced. It allocates no memory before pieces arrive.
    ///
    /// # Errors
    /// [`NetError::Scene`] for a blob that is too large, or empty, because no piece of it would
    /// ever come.
    pub fn new(info: &SceneInfo) -> Result<SceneReceiver, NetError> {
        if info.bytes > MAX_SCENE_BYTES {
            return Err(NetError::Scene("size: it is too large"));
        }
        if info.bytes == 0 {
            return Err(NetError::Scene("size: it is empty"));
        }
        Ok(SceneReceiver { bytes: Vec::new(), expected: info.bytes })
    }

    /// Adds the next piece. Returns true once the blob is complete.
    ///
    /// # Errors
    /// [`NetError::Absent`] if the server does not have the blob; [`NetError::Scene`] for a piece
    /// that is empty, out of order, or past the announced size.
    pub fn take(&mut self, chunk: &BlobChunk) -> Result<bool, NetError> {
        let have = self.bytes.len() as u64;
        if have == 0 && *chunk == absent() {
            return Err(NetError::Absent);
        }
        if chunk.bytes.is_empty()
            || chunk.offset != have
            || have + chunk.bytes.len() as u64 > self.expected
        {
            return Err(NetError::Scene("order and size"));
        }
        self.bytes.extend_from_slice(&chunk.bytes);
        Ok(self.bytes.len() as u64 == self.expected)
    }

    /// Returns the number of bytes received so far.
    pub fn received(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Returns the blob's bytes. The caller must check their hash.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}
