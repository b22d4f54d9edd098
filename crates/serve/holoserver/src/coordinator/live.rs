//! Live rays: traced for one display and not stored.

use std::collections::BTreeMap;

use anyhow::{Result, ensure};
use holo_proto::{
    bulk::{LiveResult, LiveResults, LiveSamples, LiveWanted, MAX_LIVE_RAYS_HELD},
    frame::FrameKind,
};
use tokio::time::Instant;

use super::{Coordinator, display::ConnectedDisplay};
use crate::{assignment::PacketState, events::ConnectionId, live::LiveAssignment};

impl ConnectedDisplay {
    /// Returns whether live rays of this view are still of use.
    fn wants_live(&self, view: u32) -> bool {
        self.settling.is_none() && self.wishes.is_some() && self.live.view() == view
    }
}

impl Coordinator {
    /// Queues the live rays that a display asks for.
    pub(super) fn live_wanted(&mut self, id: ConnectionId, request: &LiveWanted) -> Result<()> {
        let shows = |display: &&mut ConnectedDisplay| {
            display.settling.is_none() && display.wishes.is_some()
        };
        if let Some(display) = self.displays.get_mut(&id).filter(shows) {
            let taken = display.live.add(request.view, request.pixels, &request.rays);
            ensure!(taken, "it asked for more than {MAX_LIVE_RAYS_HELD} live rays at a time");
        }
        Ok(())
    }

    /// Returns the next live rays of a display.
    pub(super) fn next_live(&mut self, id: ConnectionId) -> Option<LiveAssignment> {
        let display = self.displays.get_mut(&id)?;
        let wishes = display.wishes.as_ref()?;
        let (view, rays) = (display.live.view(), display.live.next(wishes.pixels()));
        if rays.is_empty() {
            return None;
        }
        self.last_packet += 1;
        let paths = self.holodeck.about.settings.paths_per_sample;
        Some(LiveAssignment { id: self.last_packet, display: id, view, paths, rays })
    }

    /// Hands a worker's live results to the displays that asked, if they still look.
    pub(super) fn live_results(&mut self, id: ConnectionId, results: &LiveResults) -> Result<()> {
        let mut outgoing = BTreeMap::new();
        let taken = self.take_live(id, results, &mut outgoing);
        // Even if a packet was refused: those before it are good.
        for (id, message) in outgoing {
            if let Some(display) = self.displays.get(&id) {
                display.outbox.send(FrameKind::LiveSamples, &LiveSamples::encode(&message))?;
            }
        }
        taken
    }

    fn take_live(
        &mut self,
        id: ConnectionId,
        results: &LiveResults,
        outgoing: &mut BTreeMap<ConnectionId, LiveSamples>,
    ) -> Result<()> {
        let now = Instant::now();
        let mut rest = results.hits.as_slice();
        for traced in &results.packets {
            let Some(worker) = self.workers.get_mut(&id) else { return Ok(()) };
            let (hits, after) = rest.split_at(traced.count as usize);
            rest = after;
            let finished = worker.finish_live(traced, now)?;
            // Late rays have been given to others.
            let PacketState::InTime(assignment) = finished else { continue };
            if let Err(error) = self.holodeck.plausible.live(&assignment.rays, hits) {
                self.live_again([assignment]);
                return Err(error.into());
            }
            let LiveAssignment { display, view, rays, .. } = assignment;
            if self.displays.get(&display).is_some_and(|display| display.wants_live(view)) {
                let message = outgoing
                    .entry(display)
                    .or_insert_with(|| LiveSamples { view, samples: Vec::new() });
                let numbers = rays.iter().map(|ray| ray.number);
                message
                    .samples
                    .extend(numbers.zip(hits).map(|(number, &hit)| LiveResult { number, hit }));
            }
        }
        Ok(())
    }

    /// Queues live rays again that a worker has not traced, if they are still of use.
    pub(super) fn live_again(&mut self, lost: impl IntoIterator<Item = LiveAssignment>) {
        for LiveAssignment { display, view, rays, .. } in lost {
            let display = self.displays.get_mut(&display);
            if let Some(display) = display.filter(|display| display.wants_live(view)) {
                display.live.put_back(&rays);
            }
        }
    }
}
