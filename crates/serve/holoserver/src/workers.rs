//! Workers, and the packets that each has been given.
//!
//! Invariants:
//! - A worker holds at most [`MAX_PACKETS_HELD`] packets, including overdue ones. Beyond a first
//!   lot, it holds no more rays than it has returned so far.
//! - An overdue packet is taken away, for others to trace. Until the worker returns something, it
//!   gets no more work.

use std::{collections::HashMap, time::Duration};

use crate::{
    assignment::{Assignment, PacketState, ResultsError},
    live::LiveAssignment,
    pace::WorkerPace,
    worker_id::WorkerId,
};
use holo_beamfile::Maker;
use holo_net::Outbox;
use holo_proto::{
    bulk::{LivePacket, LiveWork, TracedPacket, WorkPackets},
    report::WorkerReport,
};
use tokio::time::Instant;

/// Work that a worker gets ahead (the paper allowed five seconds, §2.2).
///
/// It is long enough that a worker 50 ms away never waits for the server. It is short enough that
/// the first samples of a new view arrive within 100 ms. A worker holds at least 0.7 of it, and
/// traces that first.
const AHEAD: Duration = Duration::from_millis(120);

/// A worker's own statement of its speed is believed up to this multiple of the measured speed. The
/// measured speed may be too low, because the server had less work to give.
const BELIEVED: f64 = 4.0;

/// Fewest rays ahead for each thread, also while a worker's speed is not known: four packets. With
/// fewer, threads would wait for the server. More would be overdue in the slowest scenes.
const LEAST_RAYS_PER_THREAD: f64 = 84.0;

/// Most packets that a worker holds before it has returned anything, however many threads it says
/// it has.
const MAX_FIRST_PACKETS: usize = 1024;

/// Most packets that a worker holds, however fast it is. If it hangs, these are late.
pub const MAX_PACKETS_HELD: usize = 16_384;

/// The share of the newest packet in the mean latency.
const LATENCY_SHARE: f64 = 0.05;

/// One connected worker.
pub struct ConnectedWorker {
    pub outbox: Outbox,
    /// Its name, for people.
    pub name: String,
    /// Its machine, by the file's number, and its seat there.
    pub id: WorkerId,
    /// The number under which the file stores what it makes: its machine's, or one that also says
    /// whose surface light it uses.
    pub stored_as: Maker,
    threads: f64,
    /// Work is counted in rays of so many paths.
    usual_paths: u16,
    seconds_per_ray: Option<f64>,
    pace: WorkerPace,
    rays_ahead: f64,
    work_ahead: f64,
    /// Work that it has returned.
    work_returned: f64,
    assigned: HashMap<u64, Held<Assignment>>,
    /// Live rays: they are not stored.
    live: HashMap<u64, Held<LiveAssignment>>,
    /// Packets that were taken away because they are overdue.
    late: HashMap<u64, Late>,
    /// Seconds from a packet to its results, lately.
    latency: f64,
    /// True if something became overdue since it last returned anything.
    is_stuck: bool,
}

/// Something that a worker has.
struct Held<T> {
    what: T,
    given: Instant,
    /// The work that the worker had then, this included.
    ahead: f64,
}

/// A packet that is overdue.
#[derive(Clone, Copy)]
struct Late {
    work: f64,
    /// The packet's new name; `None` for live rays.
    renamed: Option<u64>,
}

impl ConnectedWorker {
    /// Returns a worker that is not ready yet. Its work is counted in rays of `usual_paths` paths.
    pub fn new(outbox: Outbox, name: String, id: WorkerId, usual_paths: u16) -> ConnectedWorker {
        ConnectedWorker {
            outbox,
            name,
            id,
            stored_as: id.maker,
            threads: 0.0,
            usual_paths,
            seconds_per_ray: None,
            pace: WorkerPace::default(),
            rays_ahead: 0.0,
            work_ahead: 0.0,
            work_returned: 0.0,
            assigned: HashMap::new(),
            live: HashMap::new(),
            late: HashMap::new(),
            latency: 0.0,
            is_stuck: false,
        }
    }

    /// Takes note that it has loaded the scene.
    pub fn ready(&mut self, threads: u16) {
        self.threads = f64::from(threads.max(1));
    }

    /// Returns whether it has loaded the scene.
    pub fn is_ready(&self) -> bool {
        self.threads > 0.0
    }

    /// Returns the work that it should get now, in rays of the usual paths. The result is 0 while
    /// it has nearly enough, so that messages are not too small.
    pub fn hunger(&self) -> f64 {
        if self.threads == 0.0 || self.is_stuck || self.room() == 0 {
            return 0.0;
        }
        let ahead = self.enough_ahead();
        if self.work_ahead > 0.7 * ahead { 0.0 } else { ahead - self.work_ahead }
    }

    /// Returns the work that it should have, in rays of the usual paths.
    fn enough_ahead(&self) -> f64 {
        let first = self.threads * LEAST_RAYS_PER_THREAD;
        let (Some(seconds), Some(rate)) = (self.seconds_per_ray, self.pace.rate()) else {
            return first;
        };
        let ahead = AHEAD.as_secs_f64();
        let said = ahead * self.threads / seconds;
        let measured = BELIEVED * ahead * rate;
        said.min(measured)
            .max(self.threads * LEAST_RAYS_PER_THREAD)
            .min(first.max(self.work_returned))
    }

    /// Returns how many more packets it may hold.
    pub fn room(&self) -> usize {
        let most = if self.work_returned > 0.0 { MAX_PACKETS_HELD } else { MAX_FIRST_PACKETS };
        most.saturating_sub(self.assigned.len() + self.live.len() + self.late.len())
    }

    /// Returns the rays that it has and that are to be stored.
    pub fn rays_ahead(&self) -> f64 {
        self.rays_ahead
    }

    /// Sends it packets.
    pub fn assign(&mut self, assignments: Vec<Assignment>, now: Instant) {
        self.pace.begin(now);
        let mut work = WorkPackets::default();
        for mut assignment in assignments {
            assignment.packet.viewpoint = assignment.viewpoint.map(|viewpoint| {
                let known = work.viewpoints.iter().position(|&other| other == viewpoint);
                known.unwrap_or_else(|| {
                    work.viewpoints.push(viewpoint);
                    work.viewpoints.len() - 1
                }) as u16
            });
            work.packets.push(assignment.packet);
            self.rays_ahead += f64::from(assignment.packet.count);
            self.work_ahead += assignment.work(self.usual_paths);
            let held = Held { what: assignment, given: now, ahead: self.work_ahead };
            self.assigned.insert(assignment.packet.id, held);
        }
        // A message holds what a worker's hunger allows, which is far below a frame's limit.
        let _ = self.outbox.send(holo_proto::frame::FrameKind::Work, &work.encode());
    }

    /// Sends it live rays.
    pub fn assign_live(&mut self, assignments: Vec<LiveAssignment>, now: Instant) {
        self.pace.begin(now);
        let mut work = LiveWork::default();
        for assignment in assignments {
            let LiveAssignment { id, paths, ref rays, .. } = assignment;
            work.packets.push(LivePacket { id, paths, rays: rays.clone() });
            self.work_ahead += rays.len() as f64;
            self.live.insert(id, Held { what: assignment, given: now, ahead: self.work_ahead });
        }
        // As with packets of beams.
        let _ = self.outbox.send(holo_proto::frame::FrameKind::LiveWork, &work.encode());
    }

    /// Takes the results of live rays: the worker no longer has them.
    pub fn finish_live(
        &mut self,
        traced: &TracedPacket,
        now: Instant,
    ) -> Result<PacketState<LiveAssignment>, ResultsError> {
        let Some(held) = self.live.get(&traced.id) else { return self.finish_late(traced.id, now) };
        let asked = held.what.rays.len();
        if asked != traced.count as usize {
            return Err(ResultsError::Count { found: traced.count, asked: asked as u8 });
        }
        let held = self.live.remove(&traced.id).ok_or(ResultsError::Unknown)?;
        self.work_ahead -= asked as f64;
        self.took(traced, asked as f64, asked as f64);
        self.waited(held.given, now);
        self.returned(asked as f64, now);
        Ok(PacketState::InTime(held.what))
    }

    /// Takes away all live rays.
    pub fn take_live(&mut self) -> impl Iterator<Item = LiveAssignment> + use<> {
        std::mem::take(&mut self.live).into_values().map(|held| held.what)
    }

    /// Returns the work that it has returned, in rays of the usual number of paths.
    pub fn work_returned(&self) -> f64 {
        self.work_returned
    }

    /// Processes the results of a packet, which the worker no longer holds.
    pub fn finish(
        &mut self,
        traced: &TracedPacket,
        now: Instant,
    ) -> Result<PacketState<Assignment>, ResultsError> {
        let Some(held) = self.assigned.get(&traced.id) else {
            return self.finish_late(traced.id, now);
        };
        let (assignment, given, asked) = (held.what, held.given, held.what.packet.count);
        if u32::from(asked) != traced.count {
            // The packet stays in the list, and another worker gets it.
            return Err(ResultsError::Count { found: traced.count, asked });
        }
        self.assigned.remove(&traced.id);
        let work = self.put_down(&assignment);
        self.took(traced, work, f64::from(asked));
        self.waited(given, now);
        self.returned(work, now);
        Ok(PacketState::InTime(assignment))
    }

    /// Ends a packet that it did not trace, because its beam sees nothing.
    pub fn finish_unseen(
        &mut self,
        id: u64,
        now: Instant,
    ) -> Result<PacketState<Assignment>, ResultsError> {
        let Some(held) = self.assigned.remove(&id) else { return self.finish_late(id, now) };
        let work = self.put_down(&held.what);
        self.returned(work, now);
        Ok(PacketState::InTime(held.what))
    }

    /// Takes note that it has returned a packet which was taken away before.
    fn finish_late<T>(&mut self, id: u64, now: Instant) -> Result<PacketState<T>, ResultsError> {
        let late = self.late.remove(&id).ok_or(ResultsError::Unknown)?;
        self.returned(late.work, now);
        Ok(PacketState::Late(late.renamed))
    }

    /// Takes a packet off what it has, and returns the packet's work.
    fn put_down(&mut self, assignment: &Assignment) -> f64 {
        let work = assignment.work(self.usual_paths);
        self.rays_ahead -= f64::from(assignment.packet.count);
        self.work_ahead -= work;
        work
    }

    fn waited(&mut self, given: Instant, now: Instant) {
        self.latency += LATENCY_SHARE * ((now - given).as_secs_f64() - self.latency);
    }

    fn returned(&mut self, work: f64, now: Instant) {
        self.is_stuck = false;
        self.work_returned += work;
        let is_idle = self.assigned.is_empty() && self.live.is_empty() && self.late.is_empty();
        self.pace.returned(work, is_idle, now);
    }

    /// Takes away what is overdue. `rename` returns a new name for a packet: under it, others get
    /// the packet.
    pub fn take_overdue(
        &mut self,
        now: Instant,
        mut rename: impl FnMut() -> u64,
    ) -> (Vec<Assignment>, Vec<LiveAssignment>) {
        let pace = &self.pace;
        let is_overdue = |given: Instant, ahead| now - given > pace.deadline(ahead);
        let packets: Vec<_> =
            self.assigned.extract_if(|_, held| is_overdue(held.given, held.ahead)).collect();
        let live: Vec<_> =
            self.live.extract_if(|_, held| is_overdue(held.given, held.ahead)).collect();
        self.is_stuck |= !packets.is_empty() || !live.is_empty();
        let mut packets: Vec<_> = packets.into_iter().map(|(_, held)| held.what).collect();
        for assignment in &mut packets {
            let (work, renamed) = (self.put_down(assignment), rename());
            self.late.insert(assignment.packet.id, Late { work, renamed: Some(renamed) });
            assignment.packet.id = renamed;
        }
        let live: Vec<_> = live.into_iter().map(|(_, held)| held.what).collect();
        for assignment in &live {
            let work = assignment.rays.len() as f64;
            self.work_ahead -= work;
            self.late.insert(assignment.id, Late { work, renamed: None });
        }
        (packets, live)
    }

    /// Learns its speed from a packet of so much work and so many rays.
    fn took(&mut self, traced: &TracedPacket, work: f64, rays: f64) {
        // Smoothed over some hundred rays: beams differ much in what a ray costs.
        let seconds = f64::from(traced.nanoseconds.max(1)) * 1e-9 / work;
        let share = 0.005 * rays;
        self.seconds_per_ray =
            Some(self.seconds_per_ray.map_or(seconds, |mean| mean + share * (seconds - mean)));
    }

    /// Returns the packets that it has not done.
    pub fn into_assignments(self) -> impl Iterator<Item = Assignment> {
        self.assigned.into_values().map(|held| held.what)
    }

    /// Iterates over the packets that it has not done.
    pub fn assignments(&self) -> impl Iterator<Item = &Assignment> {
        self.assigned.values().map(|held| &held.what)
    }

    /// Returns a report on the worker.
    pub fn report(&self) -> WorkerReport {
        WorkerReport {
            name: self.name.clone(),
            maker: self.id.maker.0,
            threads: self.threads as u32,
            rays_per_second: self.pace.rate().unwrap_or(0.0),
            rays: self.work_returned as u64,
            packets: (self.assigned.len() + self.live.len()) as u32,
            late_packets: self.late.len() as u32,
            latency: self.latency,
            queued_bytes: self.outbox.queued_bytes() as u64,
        }
    }

    /// Returns whether it has no packet whose samples are stored.
    pub fn is_idle(&self) -> bool {
        self.assigned.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use holo_net::{accept, connect};
    use holo_proto::{bulk::Packet, hello::Role};
    use holo_section::{BeamId, BeamKey};
    use tokio::net::TcpListener;

    use super::*;

    /// Returns a worker of so many threads that is ready, and the other end of its connection.
    async fn worker(threads: u16) -> (ConnectedWorker, impl Sized) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let client = tokio::spawn(connect_on(address));
        let (inbox, outbox, ..) = accept(listener.accept().await.unwrap().0).await.unwrap();
        let id = WorkerId { maker: Maker(1), seat: 0 };
        let mut worker = ConnectedWorker::new(outbox, "a test".into(), id, 1);
        worker.ready(threads);
        (worker, (client, inbox))
    }

    async fn connect_on(address: std::net::SocketAddr) {
        // The worker is never welcomed, because nothing reads its messages.
        let _ = connect(address, Role::Worker, "a test").await;
    }

    /// Gives a worker packets of 21 rays, as many as it wants. Returns their names.
    fn feed(worker: &mut ConnectedWorker, last: &mut u64, now: Instant) -> Vec<u64> {
        let packets = ((worker.hunger() / 21.0).ceil() as usize).min(worker.room());
        let names: Vec<u64> = (0..packets).map(|_| next(last)).collect();
        let key = BeamKey { section: 0, beam: BeamId(0) };
        let packet =
            |id| Packet { id, key, first: 0, count: 21, paths: 1, viewpoint: None, rays: None };
        let assignment = |&id| Assignment {
            packet: packet(id),
            viewpoint: None,
            display: None,
            purpose: crate::assignment::PacketPurpose::Store,
            not_for: None,
        };
        worker.assign(names.iter().map(assignment).collect(), now);
        names
    }

    fn next(last: &mut u64) -> u64 {
        *last += 1;
        *last
    }

    /// Returns results that took this long, according to the worker.
    fn traced(id: u64, nanoseconds: u32) -> TracedPacket {
        TracedPacket { id, count: 21, nanoseconds }
    }

    fn seconds(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    #[tokio::test]
    async fn a_worker_that_returns_nothing_loses_its_packets_and_gets_no_more() {
        let (mut worker, _client) = worker(u16::MAX).await;
        let (start, mut last) = (Instant::now(), 0);
        let given = feed(&mut worker, &mut last, start);
        assert!(given.len() == 1024, "a first lot: {}", given.len());
        assert_eq!(worker.hunger(), 0.0);
        let (early, _) = worker.take_overdue(start + seconds(9.9), || next(&mut last));
        assert!(early.is_empty());
        let (lost, live) = worker.take_overdue(start + seconds(10.1), || next(&mut last));
        assert_eq!((lost.len(), live.len(), worker.is_idle()), (given.len(), 0, true));
        assert!(worker.rays_ahead() == 0.0 && worker.work_ahead == 0.0);
        assert!(lost.iter().all(|lost| !given.contains(&lost.packet.id)), "under new names");
        assert_eq!(worker.hunger(), 0.0, "nothing more until something comes back");
        // A result arrives after all, under the packet's old name, once.
        let late = start + seconds(60.0);
        let finished = worker.finish(&traced(given[5], 1), late).unwrap();
        assert!(
            matches!(finished, PacketState::Late(Some(renamed)) if renamed > given.len() as u64)
        );
        assert!(worker.finish(&traced(given[5], 1), late).is_err(), "twice");
        assert!(worker.hunger() > 0.0);
    }

    #[tokio::test]
    async fn whatever_a_worker_says_of_its_speed_it_holds_no_more_than_it_has_returned() {
        let (mut worker, _client) = worker(64).await;
        let (mut now, mut last, mut returned) = (Instant::now(), 0, 0);
        let mut held = Vec::new();
        for _ in 0..40 {
            held.extend(feed(&mut worker, &mut last, now));
            assert!(held.len() <= returned.max(256), "{} of {returned}", held.len());
            assert!(held.len() <= MAX_PACKETS_HELD);
            now += seconds(0.01);
            // The worker states that a packet takes a nanosecond.
            for id in held.drain(..) {
                worker.finish(&traced(id, 1), now).unwrap();
                returned += 1;
            }
        }
        // The worker was as fast as that, so it gets as much as any other. Then it hangs.
        let given = feed(&mut worker, &mut last, now);
        assert!(given.len() > 10_000, "{}", given.len());
        let (lost, _) = worker.take_overdue(now + seconds(4.0), || next(&mut last));
        assert_eq!(lost.len(), given.len(), "a fast worker's packets are overdue soon");
    }

    #[tokio::test]
    async fn a_worker_that_answers_ever_less_never_holds_more_than_its_cap() {
        let (mut worker, _client) = worker(1000).await;
        let (mut now, mut last) = (Instant::now(), 0);
        for _ in 0..200 {
            let given = feed(&mut worker, &mut last, now);
            let late = worker.late.len();
            assert!(given.len() + late <= MAX_PACKETS_HELD, "{} and {late}", given.len());
            // One packet of each lot comes back, so that it is not stuck; the others never.
            now += seconds(0.1);
            if let Some(&id) = given.first() {
                worker.finish(&traced(id, 1), now).unwrap();
            }
            now += seconds(100.0);
            worker.take_overdue(now, || next(&mut last));
            worker.is_stuck = false;
        }
    }

    #[tokio::test]
    async fn a_slow_scene_is_waited_for() {
        let (mut worker, _client) = worker(1).await;
        let (mut now, mut last) = (Instant::now(), 0);
        // A packet takes 5 seconds. The first lot is late; then the worker's pace is known.
        let mut held: std::collections::VecDeque<u64> = Default::default();
        for step in 0..60 {
            held.extend(feed(&mut worker, &mut last, now));
            now += seconds(5.0);
            if let Some(id) = held.pop_front() {
                let finished = worker.finish(&traced(id, u32::MAX), now).unwrap();
                assert!(matches!(finished, PacketState::InTime(_)), "step {step}");
            }
            let (lost, _) = worker.take_overdue(now, || next(&mut last));
            assert!(lost.is_empty(), "step {step}: {} overdue", lost.len());
        }
    }
}
