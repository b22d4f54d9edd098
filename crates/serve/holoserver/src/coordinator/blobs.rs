//! Blobs that peers ask for: the scene, and its stand-ins.
//!
//! Invariant: each peer has at most one thread that sends it a blob. A blob that it asks for again
//! meanwhile is sent once more.

use std::sync::Arc;

use super::Coordinator;
use crate::{
    events::{ConnectionId, ServerEvent},
    recall::{Blob, send_blob},
};

impl Coordinator {
    /// Sends a blob to a peer, after those that it has asked for before.
    pub(super) fn blob_wanted(&mut self, id: ConnectionId, blob: Blob) {
        self.blobs.entry(id).or_default().waiting.insert(blob);
        self.send_next_blob(id);
    }

    /// Goes on after a blob was sent.
    pub(super) fn blob_sent(&mut self, id: ConnectionId) {
        if let Some(queue) = self.blobs.get_mut(&id) {
            queue.is_sending = false;
        }
        self.send_next_blob(id);
    }

    fn send_next_blob(&mut self, id: ConnectionId) {
        let Some(outbox) = self.outbox(id).cloned() else {
            self.blobs.remove(&id);
            return;
        };
        let Some(queue) = self.blobs.get_mut(&id).filter(|queue| !queue.is_sending) else { return };
        let Some(blob) = queue.waiting.pop_first() else {
            self.blobs.remove(&id);
            return;
        };
        queue.is_sending = true;
        let (holodeck, events) = (Arc::clone(&self.holodeck), self.events.clone());
        let started = send_blob(holodeck, outbox, blob, move || {
            // If the coordinator is gone, so is the process.
            let _ = events.send(ServerEvent::BlobSent { id });
        });
        if let Err(error) = started {
            self.expel(id, format!("the server cannot send it the scene: {error}"));
        }
    }
}
