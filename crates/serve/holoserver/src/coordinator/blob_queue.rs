//! The blobs that a peer has asked for.

use std::collections::BTreeSet;

use crate::recall::Blob;

/// What one peer asked for.
#[derive(Default)]
pub struct BlobQueue {
    /// True while one is being sent.
    pub is_sending: bool,
    /// The blobs to send next, the scene first.
    pub waiting: BTreeSet<Blob>,
}
