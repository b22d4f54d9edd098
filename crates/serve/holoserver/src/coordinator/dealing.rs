//! Who traces what next: packets of lost workers, then what displays want, then batch order.
//!
//! Displays take turns. A display's live rays and its beams share what is traced for it.

use std::time::Duration;

use holo_proto::bulk::Packet;
use holo_section::{BeamKey, RayCoords, SampleKind, Viewpoint};
use tokio::time::Instant;
use tracing::warn;

use super::{Coordinator, display::is_looked_at, fill::FillState};
use crate::{
    assignment::{Assignment, PacketPurpose},
    events::ConnectionId,
    live::LiveAssignment,
    wishes::RayPacket,
    worker_id::WorkerId,
    workers::ConnectedWorker,
};

/// Bytes that may wait for a display. Above, nothing more is traced for it until it reads.
pub(super) const DISPLAY_QUEUE_BYTES: usize = 32 << 20;

/// Packets in one message to a worker: half a megabyte, far below a frame's limit.
const PACKETS_PER_MESSAGE: usize = 16_384;

/// Interval at which overdue packets are looked for.
const OVERDUE_EVERY: Duration = Duration::from_millis(250);

/// Most checks that a worker gets at once. Unlike checks, the rest of its work is stored.
const CHECKS_AT_A_TIME: usize = 16;

/// Packets of lost workers that are looked at for one that a worker may have. Others wait for
/// another worker.
const LOST_LOOKED_AT: usize = 256;

/// One piece of work for a worker.
enum DealtWork {
    /// A packet whose samples are stored.
    Packet(Assignment),
    /// Rays whose samples are not stored.
    Live(LiveAssignment),
}

impl Coordinator {
    /// Gives work to every worker that has too little.
    pub(super) fn deal(&mut self) {
        if self.stalled {
            return;
        }
        let mut left = self.samples_left();
        let now = Instant::now();
        let hungry: Vec<_> = self
            .workers
            .iter()
            .map(|(&id, worker)| {
                (id, worker.id, worker.hunger(), worker.room().min(PACKETS_PER_MESSAGE))
            })
            .collect();
        for (id, worker, hunger, room) in hungry {
            let (packets, live) = self.pick(worker, hunger, room, &mut left);
            let Some(worker) = self.workers.get_mut(&id) else { continue };
            if !live.is_empty() {
                worker.assign_live(live, now);
            }
            if !packets.is_empty() {
                worker.assign(packets, now);
            }
        }
    }

    /// Takes overdue packets away from workers, so that others get them.
    pub(super) fn take_overdue(&mut self) {
        let now = Instant::now();
        if now - self.last_overdue < OVERDUE_EVERY {
            return;
        }
        self.last_overdue = now;
        let (mut overdue, mut lives) = (Vec::new(), Vec::new());
        for worker in self.workers.values_mut() {
            let (packets, live) = worker.take_overdue(now, || {
                self.last_packet += 1;
                self.last_packet
            });
            let count = packets.len() + live.len();
            if count > 0 {
                let name = &worker.name;
                warn!(peer = name, packets = count, "overdue");
                self.progress.say(&format!(
                    "{name} has not returned {count} packets in time: others may trace them"
                ));
            }
            overdue.extend(packets);
            lives.extend(live);
        }
        self.lose(overdue);
        self.live_again(lives);
        self.forget_stale();
        self.try_settle();
    }

    /// Takes packets back that a worker has not traced, for others.
    pub(super) fn lose(&mut self, packets: impl IntoIterator<Item = Assignment>) {
        for assignment in packets {
            let waiting = match assignment.purpose {
                PacketPurpose::Store => &mut self.lost,
                PacketPurpose::Claim(_) | PacketPurpose::Again(_) => &mut self.checks,
            };
            waiting.insert(assignment.packet.id, assignment);
        }
    }

    /// Returns how many more samples may be dealt. Samples under way count towards the goal, so
    /// that it is reached and not overrun.
    fn samples_left(&self) -> f64 {
        let goal = self.schedule.goal.samples.filter(|_| !self.schedule.is_ending());
        let under_way: f64 = self.workers.values().map(ConnectedWorker::rays_ahead).sum();
        goal.map_or(f64::INFINITY, |goal| goal as f64 - self.progress.traced() as f64 - under_way)
    }

    /// Takes work worth `hunger` rays for a worker, at most `room` packets, and takes its samples
    /// off `left`.
    fn pick(
        &mut self,
        worker: WorkerId,
        hunger: f64,
        room: usize,
        left: &mut f64,
    ) -> (Vec<Assignment>, Vec<LiveAssignment>) {
        let usual = self.holodeck.about.settings.paths_per_sample;
        let (mut packets, mut live) = (Vec::new(), Vec::new());
        let mut work = 0.0;
        if hunger > 0.0 && room >= CHECKS_AT_A_TIME && !self.schedule.is_ending() {
            packets = self.pick_checks(worker);
        }
        while work < hunger && *left > 0.0 && packets.len() + live.len() < room {
            match self.next_work(worker) {
                Some(DealtWork::Packet(assignment)) => {
                    work += assignment.work(usual);
                    *left -= f64::from(assignment.packet.count);
                    packets.push(assignment);
                }
                Some(DealtWork::Live(assignment)) => {
                    work += assignment.rays.len() as f64;
                    live.push(assignment);
                }
                None => break,
            }
        }
        (packets, live)
    }

    /// Returns checks that a worker may make.
    fn pick_checks(&mut self, worker: WorkerId) -> Vec<Assignment> {
        let for_it = self.checks.iter().filter(|(_, packet)| packet.is_for(worker, false));
        let ids: Vec<u64> = for_it.map(|(&id, _)| id).take(CHECKS_AT_A_TIME).collect();
        ids.iter().filter_map(|id| self.checks.remove(id)).collect()
    }

    /// Returns the most urgent piece of work for a worker. At the end, that is only what lost
    /// workers had.
    fn next_work(&mut self, worker: WorkerId) -> Option<DealtWork> {
        if let Some(assignment) = self.next_lost(worker) {
            return Some(DealtWork::Packet(assignment));
        }
        if self.schedule.is_ending() {
            return None;
        }
        self.next_for_displays().or_else(|| self.next_in_batch().map(DealtWork::Packet))
    }

    /// Returns the oldest packet of a lost worker that this one may have.
    fn next_lost(&mut self, worker: WorkerId) -> Option<Assignment> {
        let is_alone = self.workers.len() == 1;
        let mut oldest = self.lost.iter().take(LOST_LOOKED_AT);
        let (&id, _) = oldest.find(|(_, packet)| packet.is_for(worker, is_alone))?;
        self.lost.remove(&id)
    }

    /// Returns work for the display whose turn it is, or for the next one that wants any.
    fn next_for_displays(&mut self) -> Option<DealtWork> {
        let after = |id: &&ConnectionId| self.last_served.is_some_and(|last| **id > last);
        let later = self.displays.keys().filter(after);
        let ids: Vec<ConnectionId> =
            later.chain(self.displays.keys().filter(|id| !after(id))).copied().collect();
        for id in ids {
            let Some(display) = self.displays.get(&id) else { continue };
            let is_behind = display.outbox.queued_bytes() > DISPLAY_QUEUE_BYTES;
            if display.is_read_only || display.settling.is_some() || is_behind {
                continue;
            }
            let work = if display.live.is_next() {
                self.next_live(id).map(DealtWork::Live)
            } else {
                let packet = self.next_single_rays(id).or_else(|| self.next_of_view(id));
                packet.map(DealtWork::Packet).or_else(|| self.next_live(id).map(DealtWork::Live))
            };
            if work.is_some() {
                self.last_served = Some(id);
                return work;
            }
        }
        None
    }

    /// Returns the single rays that a display wants most, as many as belong to one beam.
    fn next_single_rays(&mut self, id: ConnectionId) -> Option<Assignment> {
        let unseen = self.holodeck.unseen();
        let display = self.displays.get_mut(&id)?;
        let wishes = display.wishes.as_mut()?;
        let kind = SampleKind::SingleRay;
        while let Some(RayPacket { key, mut rays, count }) =
            wishes.next_rays(|key| unseen.contains(key))
        {
            let taken = self.allotment.take(&self.holodeck.file, key, kind, count);
            let Some((first, given)) = taken else { continue };
            // Numbers that were given back are given out in the same ranges as before.
            let used = given.min(count);
            if used < given {
                self.allotment.give_back(key, kind, first + u32::from(used), given - used);
            }
            wishes.put_back(key, &rays[usize::from(used)..usize::from(count)]);
            rays[usize::from(used)..].fill(RayCoords::default());
            display.live.passed_over(f64::from(used), wishes.pixels());
            drop(unseen);
            let mut assignment = self.assignment(key, first, used, None, Some(id));
            assignment.packet.rays = Some(rays);
            return Some(assignment);
        }
        None
    }

    /// Returns the next packet of a display's view: its least filled and most wanted beam.
    fn next_of_view(&mut self, id: ConnectionId) -> Option<Assignment> {
        let unseen = self.holodeck.unseen();
        let display = self.displays.get_mut(&id)?;
        let wishes = display.wishes.as_mut()?;
        let (viewpoint, pixels) = (wishes.viewpoint, wishes.pixels());
        let kind = SampleKind::ViewpointLimited;
        while let Some((key, count)) = wishes.next(|key| unseen.contains(key)) {
            let taken = self.allotment.take(&self.holodeck.file, key, kind, count);
            let Some((first, count)) = taken else { continue };
            display.live.passed_over(f64::from(count), pixels);
            drop(unseen);
            return Some(self.assignment(key, first, count, Some(viewpoint), Some(id)));
        }
        None
    }

    /// Returns the next packet in batch order, if the file is being filled.
    fn next_in_batch(&mut self) -> Option<Assignment> {
        let fill = self.fill.as_mut()?;
        let displays = &self.displays;
        let packet = fill.next(&mut FillState {
            file: &self.holodeck.file,
            unseen: &self.holodeck.unseen(),
            allotment: &mut self.allotment,
            is_looked_at: &|key| is_looked_at(displays, key),
        })?;
        let mut assignment = self.assignment(packet.key, packet.first, packet.count, None, None);
        if let Some(paths) = packet.paths {
            assignment.packet.paths = paths;
        }
        Some(assignment)
    }

    /// Makes a packet of `count` samples of the usual paths, with a new name.
    fn assignment(
        &mut self,
        key: BeamKey,
        first: u32,
        count: u8,
        viewpoint: Option<Viewpoint>,
        display: Option<ConnectionId>,
    ) -> Assignment {
        self.last_packet += 1;
        let paths = self.holodeck.about.settings.paths_per_sample;
        let id = self.last_packet;
        let packet = Packet { id, key, first, count, paths, viewpoint: None, rays: None };
        Assignment { packet, viewpoint, display, purpose: PacketPurpose::Store, not_for: None }
    }
}
