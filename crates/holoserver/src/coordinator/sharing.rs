//! Records of indirect light: taken from workers, kept, and handed to whoever wants them.

use std::sync::Arc;

use anyhow::{Result, ensure};
use holo_proto::{bulk::Light, control::Engine, frame::Kind};

use super::Coordinator;
use crate::events::ConnectionId;

/// Records in one message: a megabyte, so that other messages come in between.
const MESSAGE_RECORDS: usize = 1 << 13;

/// Bytes that may wait for somebody. Above, no more records are sent until they are read.
const QUEUE_BYTES: usize = 4 << 20;

impl Coordinator {
    /// Keeps a worker's records.
    pub(super) fn light(&mut self, id: ConnectionId, light: &Light) -> Result<()> {
        let engine = self.holodeck.about.settings.engine;
        ensure!(
            engine == Engine::Cached,
            "it sent records of indirect light, which this holodeck does not use"
        );
        self.holodeck.plausible.records(&light.records)?;
        let new = self.holodeck.light_mut().merge(Some(id), &light.records);
        let maker = self.maker(id);
        self.holodeck.makers_mut().change(maker, |made| made.light_records += new);
        Ok(())
    }

    /// Sends all records to somebody, and from now on those that come.
    pub(super) fn light_wanted(&mut self, id: ConnectionId) {
        self.listeners.entry(id).or_insert(0);
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.wait_for_light(true);
        }
        self.hand_light();
    }

    /// Sends records to those who want them and do not have them yet. A worker that has all of them
    /// may trace.
    pub(super) fn hand_light(&mut self) {
        let holodeck = Arc::clone(&self.holodeck);
        let records = holodeck.light();
        for (&id, next) in &mut self.listeners {
            let worker = self.workers.get_mut(&id);
            let display = self.displays.get(&id).map(|display| &display.outbox);
            let Some(outbox) = worker.as_ref().map(|worker| &worker.outbox).or(display) else {
                continue;
            };
            while *next < records.len() && outbox.queued_bytes() < QUEUE_BYTES {
                let (found, after) = records.since(*next, MESSAGE_RECORDS, id);
                *next = after;
                // The records of a message are far below a frame's limit.
                if !found.is_empty()
                    && outbox.send(Kind::Light, &Light { records: found }.encode()).is_err()
                {
                    break;
                }
            }
            if let Some(worker) = worker.filter(|_| *next == records.len()) {
                worker.wait_for_light(false);
            }
        }
    }
}
