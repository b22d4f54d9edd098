//! Who traces what next: lost packets, then what displays wish, in turn, then batch order: beams that have too few samples, then
//! samples that have too few paths. A display's live rays and its beams share what is traced for it.

use holo_proto::{MAX_RAYS_PER_PACKET, bulk::Packet};
use holo_section::{BeamKey, RayCoords, SampleKind, Viewpoint};

use super::Coordinator;
use crate::{
    batch::Wanted,
    better,
    listen::ConnectionId,
    live::LiveAssignment,
    wishes::RayPacket,
    workers::{Assignment, Worker},
};

/// Bytes that wait for a display at the most; above, nothing more is traced for it until it reads.
const DISPLAY_QUEUE_BYTES: usize = 32 << 20;

/// Packets in one message to a worker: half a megabyte, far below a frame's limit.
const PACKETS_PER_MESSAGE: usize = 16_384;

/// Beams that batch filling looks at before it sees to its events again, if none wants a ray.
const BATCH_LOOKS: usize = 20_000;

/// What a worker is given.
enum Next {
    /// A packet whose samples are stored.
    Packet(Assignment),
    /// Rays that are not.
    Live(LiveAssignment),
}

impl Coordinator {
    /// Gives work to every worker that has too little.
    pub(super) fn deal(&mut self) {
        if self.stalled {
            return;
        }
        // What is under way counts for the goal: it is reached, not overrun by what fast workers are given ahead.
        let under_way: f64 = self.workers.values().map(Worker::rays_ahead).sum();
        let so_far = self.progress.traced() as f64 + under_way;
        let goal = self.goal.samples.filter(|_| self.ending.is_none());
        let mut left = goal.map_or(f64::INFINITY, |goal| goal as f64 - so_far);
        let hungry: Vec<_> =
            self.workers.iter().map(|(&id, worker)| (id, worker.hunger())).collect();
        for (id, hunger) in hungry {
            let usual = self.holodeck.about.settings.paths_per_sample;
            let mut work = 0.0;
            let (mut assignments, mut live) = (Vec::new(), Vec::new());
            while work < hunger
                && left > 0.0
                && assignments.len().max(live.len()) < PACKETS_PER_MESSAGE
            {
                match self.next_assignment() {
                    Some(Next::Packet(assignment)) => {
                        work += assignment.work(usual);
                        left -= f64::from(assignment.packet.count);
                        assignments.push(assignment);
                    }
                    Some(Next::Live(assignment)) => {
                        work += assignment.rays.len() as f64;
                        live.push(assignment);
                    }
                    None => break,
                }
            }
            let Some(worker) = self.workers.get_mut(&id) else { continue };
            if !live.is_empty() {
                worker.assign_live(live);
            }
            if !assignments.is_empty() {
                worker.assign(assignments);
            }
        }
    }

    /// The most urgent packet: lost ones, then displays in turn, then batch order. At the end, lost ones only.
    fn next_assignment(&mut self) -> Option<Next> {
        if let Some(assignment) = self.again.pop_front() {
            return Some(Next::Packet(assignment));
        }
        if self.ending.is_some() {
            return None;
        }
        self.next_for_displays().or_else(|| {
            let assignment = self.next_in_batch();
            self.batch_packets += usize::from(assignment.is_some());
            assignment.map(Next::Packet)
        })
    }

    fn next_for_displays(&mut self) -> Option<Next> {
        // In turn: from the one after the last served, around to it.
        let after = |id: &&ConnectionId| self.last_served.is_some_and(|last| **id > last);
        let ids: Vec<ConnectionId> = {
            let later = self.displays.keys().filter(after);
            later.chain(self.displays.keys().filter(|id| !after(id))).copied().collect()
        };
        for id in ids {
            let Some(display) = self.displays.get(&id) else { continue };
            if display.settling.is_some() || display.outbox.queued_bytes() > DISPLAY_QUEUE_BYTES {
                continue;
            }
            let live_first = display.live.is_next();
            let next = match live_first {
                true => self.next_live(id).map(Next::Live),
                false => self
                    .next_of_beams(id)
                    .map(Next::Packet)
                    .or_else(|| self.next_live(id).map(Next::Live)),
            };
            if next.is_some() {
                self.last_served = Some(id);
                return next;
            }
        }
        None
    }

    /// A display's most urgent packet: of single rays, then of its view's beams.
    fn next_of_beams(&mut self, id: ConnectionId) -> Option<Assignment> {
        let unseen = self.holodeck.unseen();
        let display = self.displays.get_mut(&id)?;
        let wishes = display.wishes.as_mut()?;
        let (viewpoint, pixels) = (wishes.viewpoint, wishes.pixels());
        while let Some(RayPacket { key, mut rays, count }) =
            wishes.next_rays(|key| unseen.contains(key))
        {
            let taken = self.allotment.take(&self.holodeck.file, key, SampleKind::SingleRay, count);
            let Some((first, given)) = taken else { continue };
            // Numbers given back before come in the ranges that they were given in.
            let used = given.min(count);
            if used < given {
                let rest = first + u32::from(used);
                self.allotment.give_back(key, SampleKind::SingleRay, rest, given - used);
            }
            wishes.put_back(key, &rays[usize::from(used)..usize::from(count)]);
            rays[usize::from(used)..].fill(RayCoords::default());
            display.live.passed_over(f64::from(used), pixels);
            drop(unseen);
            let mut assignment = self.assignment(key, first, used, None, Some(id));
            assignment.packet.rays = Some(rays);
            return Some(assignment);
        }
        while let Some((key, count)) = wishes.next(|key| unseen.contains(key)) {
            let kind = SampleKind::ViewpointLimited;
            let Some((first, count)) = self.allotment.take(&self.holodeck.file, key, kind, count)
            else {
                continue;
            };
            display.live.passed_over(f64::from(count), pixels);
            drop(unseen);
            return Some(self.assignment(key, first, count, Some(viewpoint), Some(id)));
        }
        None
    }

    fn next_in_batch(&mut self) -> Option<Assignment> {
        if self.exhausted {
            return None;
        }
        for _ in 0..BATCH_LOOKS {
            if let Some(assignment) = self.next_better() {
                return Some(assignment);
            }
            let unseen = self.holodeck.unseen();
            let (key, wanted) = match self.batch_rest.take() {
                Some(rest) => rest,
                // What is under way is in no extent yet. This happens once for each level.
                None if self.batch.as_ref()?.waits_for_results() && self.batch_packets > 0 => {
                    return None;
                }
                None => match self.batch.as_mut()?.next(&unseen) {
                    Some(next) => next,
                    None => {
                        self.exhausted = true;
                        return None;
                    }
                },
            };
            if unseen.contains(key) {
                continue;
            }
            drop(unseen);
            let file = &self.holodeck.file;
            let wanted = match wanted {
                Wanted::Samples(wanted) => wanted,
                Wanted::Paths(paths) => {
                    if !self.is_looked_at(key) {
                        let worse = better::worse(&file.runs(key), paths, &(0..u32::MAX));
                        self.better_rest =
                            worse.into_iter().map(|numbers| (key, numbers, paths)).collect();
                    }
                    continue;
                }
            };
            let kinds = [SampleKind::Uniform, SampleKind::ViewpointLimited, SampleKind::SingleRay];
            let have: u64 =
                kinds.map(|kind| u64::from(self.allotment.taken(file, key, kind))).iter().sum();
            if have >= wanted {
                continue;
            }
            let count = (wanted - have).min(MAX_RAYS_PER_PACKET as u64) as u8;
            let Some((first, count)) = self.allotment.take(file, key, SampleKind::Uniform, count)
            else {
                continue;
            };
            self.batch_rest = Some((key, Wanted::Samples(wanted)));
            return Some(self.assignment(key, first, count, None, None));
        }
        None
    }

    /// The next packet of what is left of a beam whose samples get more paths.
    fn next_better(&mut self) -> Option<Assignment> {
        let (key, mut numbers, paths) = self.better_rest.pop_front()?;
        if self.is_looked_at(key) {
            // Somebody looks since: it is passed over until the next level.
            self.better_rest.clear();
            return None;
        }
        let first = numbers.start;
        let count = better::rays_per_packet(paths).min(numbers.end - first) as u8;
        numbers.start += u32::from(count);
        if !numbers.is_empty() {
            self.better_rest.push_front((key, numbers, paths));
        }
        let mut assignment = self.assignment(key, first, count, None, None);
        assignment.packet.paths = paths;
        Some(assignment)
    }

    fn assignment(
        &mut self,
        key: BeamKey,
        first: u32,
        count: u8,
        viewpoint: Option<Viewpoint>,
        display: Option<ConnectionId>,
    ) -> Assignment {
        self.next_packet += 1;
        let paths = self.holodeck.about.settings.paths_per_sample;
        let id = self.next_packet;
        let packet = Packet { id, key, first, count, paths, viewpoint: None, rays: None };
        Assignment { packet, viewpoint, display }
    }
}
