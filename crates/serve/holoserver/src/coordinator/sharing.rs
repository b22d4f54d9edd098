//! Records of indirect light, and cells of surface light: taken from workers, kept, and handed to
//! whoever wants them.

use std::sync::Arc;

use anyhow::{Result, ensure};
use holo_proto::{
    bulk::{CellBatch, Light, WireCell},
    control::Engine,
    frame::FrameKind,
};

use super::Coordinator;
use crate::events::ConnectionId;

/// Records in one message: a megabyte, so that other messages come in between.
const MESSAGE_RECORDS: usize = 1 << 13;

/// Cells in one message: half a megabyte.
const MESSAGE_CELLS: usize = 1 << 13;

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

    /// Keeps a worker's cells of surface light, and hands them to the others.
    pub(super) fn cells(&mut self, id: ConnectionId, new: CellBatch) -> Result<()> {
        let engine = self.holodeck.about.settings.engine;
        ensure!(
            engine == Engine::Gather,
            "it sent cells of surface light, which this holodeck does not use"
        );
        self.holodeck.plausible.cells(&new.cells)?;
        let maker = self.maker(id);
        let numbers = self.holodeck.cells_mut().add(maker, Some(id), &new.cells);
        for (&to, &sent) in self.listeners.iter().filter(|(to, _)| **to != id) {
            // Cells that a listener was not sent yet go to it whole, with these estimates.
            let is_known = |number: &Option<usize>| number.is_some_and(|number| number < sent);
            let known = new.cells.iter().zip(&numbers).filter(|(_, number)| is_known(number));
            let cells: Vec<WireCell> =
                known.map(|(cell, _)| WireCell { maker: maker.0, ..*cell }).collect();
            let Some(outbox) = self.outbox(to).filter(|_| !cells.is_empty()) else { continue };
            // A listener that reads slowly does without these estimates.
            if outbox.queued_bytes() < QUEUE_BYTES {
                let _ = outbox.send(FrameKind::Cells, &CellBatch { cells }.encode());
            }
        }
        self.hand_light();
        Ok(())
    }

    /// Sends cells to those who want them and do not have them yet.
    fn hand_cells(&mut self) {
        let holodeck = Arc::clone(&self.holodeck);
        let cells = holodeck.cells();
        for (&id, next) in &mut self.listeners {
            let worker = self.workers.get_mut(&id);
            let Some(worker) = worker else { continue };
            while *next < cells.len() && worker.outbox.queued_bytes() < QUEUE_BYTES {
                let (found, after) = cells.since(*next, MESSAGE_CELLS, id);
                *next = after;
                if !found.is_empty()
                    && worker
                        .outbox
                        .send(FrameKind::Cells, &CellBatch { cells: found }.encode())
                        .is_err()
                {
                    break;
                }
            }
            // It may trace meanwhile: cells only make its rays better.
            worker.wait_for_light(false);
        }
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
        if self.holodeck.about.settings.engine == Engine::Gather {
            self.hand_cells();
            return;
        }
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
                    && outbox.send(FrameKind::Light, &Light { records: found }.encode()).is_err()
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
