//! Cells of surface light: taken from workers, kept, and handed to other workers.

use std::sync::Arc;

use anyhow::{Result, ensure};
use holo_beamfile::Maker;
use holo_proto::{
    bulk::{CellBatch, WireCell},
    control::Engine,
    frame::FrameKind,
};

use super::Coordinator;
use crate::events::ConnectionId;

/// Cells in one message: half a megabyte, so that other messages come in between.
const MESSAGE_CELLS: usize = 1 << 13;

/// Bytes that may wait for somebody. Above, no more cells are sent until they are read.
const QUEUE_BYTES: usize = 4 << 20;

impl Coordinator {
    /// Keeps a worker's cells of surface light, and hands them to the others.
    pub(super) fn cells(&mut self, id: ConnectionId, new: CellBatch) -> Result<()> {
        let engine = self.holodeck.about.settings.engine;
        ensure!(
            engine == Engine::Gather,
            "it sent cells of surface light, which this holodeck does not use"
        );
        self.holodeck.plausible.cells(&new.cells)?;
        let Some(worker) = self.workers.get(&id) else { return Ok(()) };
        let maker = worker.stored_as;
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
        self.hand_cells();
        Ok(())
    }

    /// Notes that a worker's further samples and cells have surface light of a maker in them.
    pub(super) fn cells_used(&mut self, id: ConnectionId, used: Maker) -> Result<()> {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.stored_as = self.holodeck.makers_mut().using(worker.stored_as, used)?;
        }
        Ok(())
    }

    /// Sends cells to those who want them and do not have them yet.
    pub(super) fn hand_cells(&mut self) {
        let holodeck = Arc::clone(&self.holodeck);
        let cells = holodeck.cells();
        for (&id, next) in &mut self.listeners {
            let Some(worker) = self.workers.get(&id) else { continue };
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
        }
    }
}
