//! Views of displays: from the request, through recall and tracing, until they settle.

use std::{
    collections::BTreeMap,
    sync::{Arc, atomic::Ordering},
};

use anyhow::{Result, ensure};
use holo_proto::{
    bulk::{MAX_HELD, RaysWanted, RequestedBeam, ViewRequest},
    control::Control,
};
use tracing::error;

use super::{Coordinator, dealing::DISPLAY_QUEUE_BYTES, display::ConnectedDisplay};
use crate::{
    assignment::{Assignment, PacketPurpose},
    events::{ConnectionId, ServerEvent},
    recall::{FilePart, Recall, lasting},
    wishes::{Wishes, keep_heaviest, most_beams},
};

impl Coordinator {
    /// Takes a display's view: sends what is stored, and from now on traces for it. The same view
    /// again only moves the viewpoint's radius.
    pub(super) fn view(&mut self, id: ConnectionId, mut request: ViewRequest) -> Result<()> {
        self.check_beams(&request)?;
        let most = most_beams(self.displays.len());
        keep_heaviest(&mut request.beams, most);
        for wishes in self.displays.values_mut().filter_map(|display| display.wishes.as_mut()) {
            wishes.keep_heaviest(most);
        }
        let Some(display) = self.displays.get_mut(&id) else { return Ok(()) };
        if let Some(wishes) = display.wishes.as_mut().filter(|wishes| wishes.view == request.view) {
            wishes.viewpoint = request.viewpoint;
            return Ok(());
        }
        let file = &self.holodeck.file;
        let (mut keys, mut earlier) = (Vec::new(), Vec::new());
        let beams = request.beams.iter().map(|wanted| {
            let &RequestedBeam { key, weight, held, has_earlier } = wanted;
            let stored = file.count(key);
            if held == 0 || held == MAX_HELD || stored > u64::from(held) {
                keys.push((key, weight));
            }
            if !has_earlier && lasting(file.count_earlier(key), stored) > 0 {
                earlier.push((key, weight));
            }
            (key, weight, stored)
        });
        let wishes = Wishes::new(request.view, request.viewpoint, beams);
        display.newest.store(request.view, Ordering::Release);
        let recall = Recall {
            holodeck: Arc::clone(&self.holodeck),
            outbox: display.outbox.clone(),
            view: request.view,
            keys,
            earlier,
            newest: Arc::clone(&display.newest),
        };
        display.wishes = Some(wishes);
        display.recalling = true;
        display.settling = None;
        display.next_recall = Some(recall);
        self.start_recall(id)?;
        // Lost packets of its former view are no longer urgent.
        self.forget(|assignment| assignment.display == Some(id));
        Ok(())
    }

    /// Starts to send stored samples of a display's view, unless a thread still sends those of an
    /// earlier one. So each display has one such thread, however fast its views change.
    fn start_recall(&mut self, id: ConnectionId) -> Result<()> {
        let Some(display) = self.displays.get_mut(&id).filter(|display| !display.has_recall) else {
            return Ok(());
        };
        if let Some(recall) = display.next_recall.take() {
            display.has_recall = true;
            let events = self.events.clone();
            recall.start(move |view, result| {
                // If the coordinator is gone, so is the process.
                let _ = events.send(ServerEvent::Recalled { id, view, result });
            })?;
        }
        Ok(())
    }

    /// Checks that a view's beams exist, in order and each once.
    fn check_beams(&self, request: &ViewRequest) -> Result<()> {
        let sections = &self.holodeck.sections;
        let known = request.beams.iter().all(|wanted| wanted.key.section_in(sections).is_some());
        ensure!(known, "it asked for beams that do not exist");
        let in_order = request.beams.is_sorted_by(|one, next| one.key < next.key);
        ensure!(in_order, "it asked for a beam twice, or not in order");
        Ok(())
    }

    /// Takes the single rays that a display's view wants most.
    pub(super) fn rays(&mut self, id: ConnectionId, request: &RaysWanted) -> Result<()> {
        let sections = &self.holodeck.sections;
        let known = request.rays.iter().all(|ray| ray.key.section_in(sections).is_some());
        ensure!(known, "it asked for rays of beams that do not exist");
        let wishes = self.displays.get_mut(&id).and_then(|display| display.wishes.as_mut());
        if let Some(wishes) = wishes.filter(|wishes| wishes.view == request.view) {
            wishes.want_rays(&request.rays);
        }
        Ok(())
    }

    /// Informs a display that all stored samples of its view have been sent.
    pub(super) fn recalled(&mut self, id: ConnectionId, view: u32, result: Result<(), String>) {
        let Some(display) = self.displays.get_mut(&id) else { return };
        display.has_recall = false;
        if display.next_recall.is_some() {
            if let Err(error) = self.start_recall(id) {
                self.expel(id, format!("the server cannot send it samples: {error}"));
            }
            return;
        }
        if display.wishes.as_ref().is_none_or(|wishes| wishes.view != view) {
            return;
        }
        display.recalling = false;
        if let Err(error) = result {
            error!(error, "reading stored samples failed");
            self.progress.say(&format!("reading stored samples failed: {error}"));
        }
        let _ = display.outbox.control(&Control::StoredSent { view });
        self.try_settle();
    }

    /// Sends a part of the file that no view requested.
    pub(super) fn part(
        &mut self,
        id: ConnectionId,
        section: u16,
        first: u64,
        samples: u32,
        as_settled: bool,
    ) -> Result<()> {
        let is_known = usize::from(section) < self.holodeck.sections.len();
        ensure!(is_known, "it asked for a section that does not exist");
        let Some(display) = self.displays.get_mut(&id) else { return Ok(()) };
        let is_early = std::mem::replace(&mut display.is_sending_part, true);
        ensure!(!is_early, "it asked for a part of the file before it had the last one");
        let (holodeck, outbox) = (Arc::clone(&self.holodeck), display.outbox.clone());
        let events = self.events.clone();
        let until = display.settled_at.filter(|_| as_settled);
        FilePart { holodeck, outbox, section, first, samples, until }.start(move |result| {
            // If the coordinator is gone, so is the process.
            let _ = events.send(ServerEvent::PartSent { id, section, result });
        })?;
        Ok(())
    }

    /// Reports to a display that a part of the file is sent.
    pub(super) fn part_sent(
        &mut self,
        id: ConnectionId,
        section: u16,
        result: Result<Option<u64>, String>,
    ) {
        let Some(display) = self.displays.get_mut(&id) else { return };
        display.is_sending_part = false;
        let next = result.unwrap_or_else(|error| {
            self.progress.say(&format!("reading stored samples failed: {error}"));
            None
        });
        let _ = display.outbox.control(&Control::PartSent { section, next });
    }

    /// Stops tracing for a view; the display hears once nothing of it is under way.
    pub(super) fn settle(&mut self, id: ConnectionId, view: u32) {
        if let Some(display) = self.displays.get_mut(&id) {
            let shown = display.wishes.as_ref().is_some_and(|wishes| wishes.view == view);
            display.settling = shown.then_some(self.last_packet);
            display.live.clear();
            if !shown {
                // No such view: nothing is under way for it.
                let _ = display.outbox.control(&Control::Settled { view });
            }
        }
        self.forget_stale();
        self.try_settle();
    }

    /// Ends the views of settling displays once none of their packets is under way.
    pub(super) fn try_settle(&mut self) {
        for (&id, display) in &mut self.displays {
            let (Some(wishes), Some(last), false) =
                (&display.wishes, display.settling, display.recalling)
            else {
                continue;
            };
            let under_way = self.workers.values().any(|worker| {
                worker.assignments().any(|assignment| {
                    let is_wanted = assignment.purpose == PacketPurpose::Store
                        && wishes.contains(assignment.key());
                    is_wanted && assignment.packet.id <= last
                })
            });
            if under_way {
                continue;
            }
            // Flushing waits for the disk, and the coordinator waits for no one.
            self.writer.settle(id, wishes.view);
            display.settling = None;
            display.wishes = None;
        }
    }

    /// Keeps a named view in the file. Writing waits for the disk, so the writer does.
    pub(super) fn keep_view(&mut self, id: ConnectionId, name: String, options: String) {
        if self.displays.get(&id).is_some_and(|display| display.is_read_only) {
            let reason = "this display may only look: it keeps no views".to_owned();
            return self.refuse(id, reason);
        }
        if let Err(reason) = self.writer.keep_view(id, name, options) {
            self.refuse(id, reason);
        }
    }

    /// Sends the list of views to everyone, and a reason to each display that was refused.
    pub(super) fn views_kept(
        &mut self,
        views: Vec<(String, String)>,
        refused: Vec<(ConnectionId, String)>,
    ) {
        let views = Control::Views(views);
        for display in self.displays.values().filter(|display| !is_behind(display)) {
            let _ = display.outbox.control(&views);
        }
        for (id, reason) in refused {
            self.refuse(id, reason);
        }
    }

    /// Reports to a display why it does not get what it asked for.
    fn refuse(&self, id: ConnectionId, reason: String) {
        if let Some(display) = self.displays.get(&id).filter(|display| !is_behind(display)) {
            let _ = display.outbox.control(&Control::Refused { reason });
        }
    }

    /// Forgets lost packets of displays that have left or settle.
    pub(super) fn forget_stale(&mut self) {
        let wanted: Vec<_> = self
            .displays
            .iter()
            .filter(|(_, display)| display.settling.is_none())
            .map(|(&id, _)| id)
            .collect();
        self.forget(|assignment| assignment.display.is_some_and(|id| !wanted.contains(&id)));
    }

    /// Forgets some lost packets. Later packets get their sample numbers.
    fn forget(&mut self, is_stale: impl Fn(&Assignment) -> bool) {
        let (stale, kept): (BTreeMap<_, _>, _) =
            std::mem::take(&mut self.lost).into_iter().partition(|(_, packet)| is_stale(packet));
        self.lost = kept;
        for assignment in stale.into_values() {
            let Assignment { packet, .. } = assignment;
            self.allotment.give_back(
                assignment.key(),
                assignment.kind(),
                packet.first,
                packet.count,
            );
        }
    }
}

/// Returns whether so much waits for a display that words for people are left out.
fn is_behind(display: &ConnectedDisplay) -> bool {
    display.outbox.queued_bytes() > DISPLAY_QUEUE_BYTES
}
