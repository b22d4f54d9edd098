//! Fetching the packed scene: in pieces, bounded by what was announced.

use holo_proto::{bulk::BlobChunk, control::SceneInfo};

use crate::NetError;

/// Bytes of scene in one message: small enough that other messages slip in between.
pub const SCENE_CHUNK_BYTES: usize = 1 << 20;

/// Largest scene taken from a server: 1.6 · 10⁸ triangles.
const MAX_SCENE_BYTES: u64 = 4 << 30;

/// Collects the pieces of a scene as they arrive, in order.
#[derive(Debug)]
pub struct SceneReceiver {
    bytes: Vec<u8>,
    expected: u64,
}

impl SceneReceiver {
    /// Ready for the scene announced.
    ///
    /// # Errors
    /// [`NetError::Scene`] if it is larger than any scene may be, or empty: no piece of it would ever come.
    pub fn new(info: &SceneInfo) -> Result<SceneReceiver, NetError> {
        if info.bytes > MAX_SCENE_BYTES {
            return Err(NetError::Scene("size: it is too large"));
        }
        if info.bytes == 0 {
            return Err(NetError::Scene("size: it is empty"));
        }
        Ok(SceneReceiver { bytes: Vec::new(), expected: info.bytes })
    }

    /// Takes the next piece; true once all is there.
    ///
    /// # Errors
    /// [`NetError::Scene`] for a piece that is empty, out of order, or past the announced size.
    pub fn take(&mut self, chunk: &BlobChunk) -> Result<bool, NetError> {
        let have = self.bytes.len() as u64;
        if chunk.bytes.is_empty()
            || chunk.offset != have
            || have + chunk.bytes.len() as u64 > self.expected
        {
            return Err(NetError::Scene("order and size"));
        }
        self.bytes.extend_from_slice(&chunk.bytes);
        Ok(self.bytes.len() as u64 == self.expected)
    }

    /// The scene's bytes. Whoever uses them checks their hash.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}
