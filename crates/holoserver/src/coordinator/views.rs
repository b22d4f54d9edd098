//! What displays ask for: a view from its beginning, recalled and wished for, to its settling.

use std::sync::{Arc, atomic::Ordering};

use anyhow::{Result, ensure};
use holo_proto::{
    bulk::{RaysWanted, ViewRequest},
    control::Control,
};

use super::{Coordinator, Event};
use crate::{listen::ConnectionId, recall::Recall, wishes::Wishes, workers::Assignment};

impl Coordinator {
    /// A display's view: recall what is stored, and from now on trace for it. The same view again only moves the
    /// viewpoint's radius.
    pub(super) fn view(&mut self, id: ConnectionId, request: ViewRequest) -> Result<()> {
        let sections = &self.holodeck.sections;
        let known = request.beams.iter().all(|wanted| wanted.key.section_in(sections).is_some());
        ensure!(known, "it asked for beams that do not exist");
        let in_order = request.beams.is_sorted_by(|one, next| one.key < next.key);
        ensure!(in_order, "it asked for a beam twice, or not in order");
        let Some(display) = self.displays.get_mut(&id) else { return Ok(()) };
        if let Some(wishes) = display.wishes.as_mut().filter(|wishes| wishes.view == request.view) {
            wishes.viewpoint = request.viewpoint;
            return Ok(());
        }
        let file = &self.holodeck.file;
        let beams =
            request.beams.iter().map(|wanted| (wanted.key, wanted.weight, file.count(wanted.key)));
        let wishes = Wishes::new(request.view, request.viewpoint, beams);
        display.newest.store(request.view, Ordering::Release);
        let recall = Recall {
            holodeck: Arc::clone(&self.holodeck),
            outbox: display.outbox.clone(),
            view: request.view,
            keys: wishes.keys(),
            newest: Arc::clone(&display.newest),
        };
        display.wishes = Some(wishes);
        display.recalling = true;
        display.settling = None;
        let events = self.events.clone();
        recall.start(move |view, result| {
            // If the coordinator is gone, so is the process.
            let _ = events.send(Event::Recalled { id, view, result });
        })?;
        // Packets for the display's former view are no longer urgent; what is under way arrives and is stored.
        self.forget(|assignment| assignment.display == Some(id));
        Ok(())
    }

    /// Single rays that a display's view wants most.
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

    pub(super) fn recalled(&mut self, id: ConnectionId, view: u32, result: Result<(), String>) {
        let Some(display) = self.displays.get_mut(&id) else { return };
        if display.wishes.as_ref().is_none_or(|wishes| wishes.view != view) {
            return;
        }
        display.recalling = false;
        if let Err(error) = result {
            self.progress.say(&format!("reading stored samples failed: {error}"));
        }
        let _ = display.outbox.control(&Control::StoredSent { view });
        self.try_settle();
    }

    pub(super) fn settle(&mut self, id: ConnectionId, view: u32) {
        if let Some(display) = self.displays.get_mut(&id) {
            let shown = display.wishes.as_ref().is_some_and(|wishes| wishes.view == view);
            display.settling = shown.then_some(self.next_packet);
            display.live.clear();
            if !shown {
                // No such view: nothing is under way for it.
                let _ = display.outbox.control(&Control::Settled { view });
            }
        }
        self.forget_stale();
        self.try_settle();
    }

    /// Tells displays that wait for it that nothing of their view is under way any more.
    pub(super) fn try_settle(&mut self) {
        for (&id, display) in &mut self.displays {
            let (Some(wishes), Some(last), false) =
                (&display.wishes, display.settling, display.recalling)
            else {
                continue;
            };
            let under_way = self.workers.values().any(|worker| {
                worker.assignments().any(|Assignment { packet, .. }| {
                    packet.id <= last && wishes.contains(packet.key)
                })
            });
            if under_way {
                continue;
            }
            let (view, events, holodeck) =
                (wishes.view, self.events.clone(), Arc::clone(&self.holodeck));
            display.settling = None;
            display.wishes = None;
            // Flushing waits for the disk, and the coordinator waits for no one.
            std::thread::spawn(move || {
                // A disk that fails is named in the file's statistics, and at the end.
                let _ = holodeck.save_unseen();
                let _ = holodeck.writable.then(|| holodeck.file.flush());
                let _ = events.send(Event::Flushed { id, view });
            });
        }
    }

    /// Forgets lost packets for displays that have left or settle.
    pub(super) fn forget_stale(&mut self) {
        let wanted: Vec<_> = self
            .displays
            .iter()
            .filter(|(_, display)| display.settling.is_none())
            .map(|(&id, _)| id)
            .collect();
        self.forget(|assignment| assignment.display.is_some_and(|id| !wanted.contains(&id)));
    }

    /// Does not trace some lost packets again; their sample numbers are given to later packets.
    fn forget(&mut self, stale: impl Fn(&Assignment) -> bool) {
        let (stale, kept) = std::mem::take(&mut self.again).into_iter().partition(stale);
        self.again = kept;
        for assignment in Vec::from(stale) {
            let (packet, kind) = (assignment.packet, assignment.kind());
            let key = packet.key;
            self.allotment.give_back(key, kind, packet.first, packet.count);
        }
    }
}
