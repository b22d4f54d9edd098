//! The coordinator: one thread that owns all decisions of a server (Larson & Simmons 1999, §2.2 and §2.5).
//!
//! It never waits for anyone: connections are tasks that send it events, recall and flushing are threads that report
//! back, and frames to others are queued. What always holds:
//! - every packet given out is either with exactly one connected worker, or waiting to be given out again;
//! - a packet's samples are stored once, whoever traces it and however often;
//! - a display gets every sample of its view's beams, stored or traced, from whatever cause they were traced, and is told
//!   which of them see nothing;
//! - a beam known to see nothing is given to no worker.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
        mpsc::{Receiver, RecvTimeoutError, Sender},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use holo_beamfile::ExtentMeta;
use holo_net::{Message, Outbox, PING_EVERY};
use holo_proto::{
    MAX_RAYS_PER_PACKET,
    bulk::{Packet, Results, Run, Samples, Source, ViewRequest},
    control::{Control, Status},
    frame::Kind,
    hello::Role,
};
use holo_section::{Sample, SampleKind, Viewpoint};

use crate::{
    allotment::{Allotment, BeamKey},
    batch::BatchOrder,
    holodeck::Holodeck,
    listen::ConnectionId,
    progress::Progress,
    recall::{Recall, send_scene, tell_unseen},
    wishes::Wishes,
    workers::{Assignment, ResultsError, Worker},
};

/// How often displays are told how the server fares.
const STATUS_EVERY: Duration = Duration::from_millis(500);

/// The longest that the coordinator sleeps: timers are this exact.
const TICK: Duration = Duration::from_millis(20);

/// How long packets under way are waited for at the end; whoever takes longer hangs.
const LAST_PACKETS: Duration = Duration::from_secs(3);

/// Bytes that wait for a display at the most; above, nothing more is traced for it until it reads.
const DISPLAY_QUEUE_BYTES: usize = 32 << 20;

/// Samples that wait for a failing disk at the most, bytes; above, nothing more is traced until it takes them. What is
/// under way then still fits in the memory that the beam file allows itself.
const STALLED_BYTES: u64 = 64 << 20;

/// How often newly found unseen beams are written to the file, at the most. After a crash they are found again.
const SAVE_UNSEEN_EVERY: Duration = Duration::from_secs(5);

/// Bytes that samples have added to the file for each byte of a list of unseen beams written: old lists stay in it.
const SAMPLES_PER_UNSEEN_BYTE: u64 = 32;

/// Packets in one message to a worker: half a megabyte, far below a frame's limit.
const PACKETS_PER_MESSAGE: usize = 16_384;

/// Beams that batch filling looks at before it sees to its events again, if none wants a ray.
const BATCH_LOOKS: usize = 20_000;

/// Something that has happened.
#[derive(Debug)]
pub enum Event {
    /// Somebody was taken.
    Joined { id: ConnectionId, role: Role, name: String, outbox: Outbox },
    /// It said something.
    Message { id: ConnectionId, message: Message },
    /// It is gone; with a reason unless it closed its connection.
    Left { id: ConnectionId, reason: Option<String> },
    /// It broke the protocol.
    Broke { id: ConnectionId, reason: String },
    /// A view's stored samples are all sent.
    Recalled { id: ConnectionId, view: u32, result: Result<(), String> },
    /// Everything stored before is on disk, for a display that settles.
    Flushed { id: ConnectionId, view: u32 },
    /// End.
    Shutdown,
}

/// When a server ends by itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct Goal {
    /// After so long.
    pub time: Option<Duration>,
    /// Once so many samples have been added.
    pub samples: Option<u64>,
}

struct Display {
    outbox: Outbox,
    wishes: Option<Wishes>,
    newest: Arc<AtomicU32>,
    recalling: bool,
    settling: bool,
}

/// See the module's words.
pub struct Coordinator {
    holodeck: Arc<Holodeck>,
    events: Sender<Event>,
    workers: BTreeMap<ConnectionId, Worker>,
    displays: BTreeMap<ConnectionId, Display>,
    last_served: Option<ConnectionId>,
    again: VecDeque<Assignment>,
    allotment: Allotment,
    batch: Option<BatchOrder>,
    batch_rest: Option<(BeamKey, u64)>,
    next_packet: u64,
    goal: Goal,
    started: Instant,
    ending: Option<Instant>,
    progress: Progress,
    last_status: Instant,
    last_ping: Instant,
    /// When unseen beams were last written, and how many samples had been added then.
    last_save: (Instant, u64),
    saving: Option<JoinHandle<()>>,
    /// The disk fails and much waits for it.
    stalled: bool,
}

impl Coordinator {
    /// A server's state at its start. With `fill`, beams are traced in batch order whenever no display wants anything.
    pub fn new(holodeck: Arc<Holodeck>, events: Sender<Event>, fill: bool, goal: Goal, progress: Progress) -> Self {
        let stored = holodeck.file.stats().samples;
        let batch =
            (fill && holodeck.writable).then(|| BatchOrder::new(&holodeck.sections, stored, &holodeck.unseen()));
        let now = Instant::now();
        Coordinator {
            holodeck,
            events,
            workers: BTreeMap::new(),
            displays: BTreeMap::new(),
            last_served: None,
            again: VecDeque::new(),
            allotment: Allotment::default(),
            batch,
            batch_rest: None,
            next_packet: 0,
            goal,
            started: now,
            ending: None,
            progress,
            last_status: now,
            last_ping: now,
            last_save: (now, 0),
            saving: None,
            stalled: false,
        }
    }

    /// Works until the goal is reached or a shutdown is asked for; everything is then stored. Gives the samples added.
    ///
    /// # Errors
    /// If samples cannot be stored.
    pub fn run(mut self, events: &Receiver<Event>) -> Result<u64> {
        loop {
            match events.recv_timeout(TICK) {
                Ok(event) => {
                    self.handle(event)?;
                    // Whatever else has happened, before new work is dealt out.
                    for event in events.try_iter().take(256) {
                        self.handle(event)?;
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.check_goal();
            if let Some(since) = self.ending {
                let done = self.workers.values().all(Worker::is_idle);
                if done || since.elapsed() > LAST_PACKETS {
                    break;
                }
            } else {
                self.deal();
            }
            self.tick();
        }
        self.finish()
    }

    fn finish(mut self) -> Result<u64> {
        if let Some(saving) = self.saving.take() {
            // A thread that panicked has said so on standard error.
            let _ = saving.join();
        }
        // Unseen beams that a failing disk does not take are found again.
        let _ = self.holodeck.save_unseen();
        let flushed = self.holodeck.writable.then(|| self.holodeck.file.flush()).transpose();
        let bye = Control::Bye { reason: "the session is over".into() };
        for outbox in self.outboxes() {
            let _ = outbox.control(&bye);
        }
        self.progress.finish();
        flushed?;
        Ok(self.progress.added())
    }

    fn outboxes(&self) -> impl Iterator<Item = &Outbox> {
        self.workers.values().map(|worker| &worker.outbox).chain(self.displays.values().map(|display| &display.outbox))
    }

    fn check_goal(&mut self) {
        // Packets under way are finished: stop dealing a little before the time is up.
        let time_up = self.goal.time.is_some_and(|time| self.started.elapsed() + Duration::from_millis(100) >= time);
        let enough = self.goal.samples.is_some_and(|samples| self.progress.added() >= samples);
        let hopeless = self.goal.samples.is_some() && self.sees_nothing();
        if hopeless && self.ending.is_none() {
            self.progress.say("no ray of any section meets anything: there is nothing to trace");
        }
        if self.ending.is_none() && (time_up || enough || hopeless) {
            self.ending = Some(Instant::now());
        }
    }

    /// Whether not a single beam sees anything.
    fn sees_nothing(&self) -> bool {
        let unseen = self.holodeck.unseen();
        self.holodeck.sections.iter().enumerate().all(|(at, section)| unseen.count_in(at) == section.beam_count())
    }

    fn tick(&mut self) {
        let now = Instant::now();
        if now - self.last_ping >= PING_EVERY {
            self.last_ping = now;
            for outbox in self.outboxes() {
                let _ = outbox.control(&Control::Ping(0));
            }
        }
        if now - self.last_status >= STATUS_EVERY {
            self.last_status = now;
            let status = Status {
                samples: self.progress.total(),
                samples_per_second: self.progress.rate(),
                workers: self.workers.len() as u32,
                displays: self.displays.len() as u32,
            };
            for display in self.displays.values() {
                let _ = display.outbox.control(&Control::Status(status));
            }
            let stats = self.holodeck.file.stats();
            self.stalled = stats.last_error.is_some() && stats.pending_bytes > STALLED_BYTES;
            self.progress.show(&status, self.started.elapsed(), &self.goal, stats.last_error.as_deref());
            self.save_unseen(now);
        }
    }

    /// Starts writing newly found unseen beams if it is time.
    fn save_unseen(&mut self, now: Instant) {
        let (since, added) = self.last_save;
        let bytes = (self.progress.added() - added) * size_of::<Sample>() as u64;
        let due = now - since >= SAVE_UNSEEN_EVERY
            && bytes >= SAMPLES_PER_UNSEEN_BYTE * self.holodeck.unseen().encoded_bytes()
            && self.saving.as_ref().is_none_or(JoinHandle::is_finished);
        if due && self.holodeck.writable {
            self.last_save = (now, self.progress.added());
            let holodeck = Arc::clone(&self.holodeck);
            self.saving = Some(std::thread::spawn(move || {
                // A disk that fails is named in the file's statistics; unseen beams are found again.
                let _ = holodeck.save_unseen();
            }));
        }
    }

    fn handle(&mut self, event: Event) -> Result<()> {
        match event {
            Event::Joined { id, role: Role::Worker, name, outbox } => {
                self.progress.say(&format!("{name} joined"));
                self.workers.insert(id, Worker::new(outbox, name));
            }
            Event::Joined { id, role: Role::Display, name, outbox } => {
                self.progress.say(&format!("{name} joined"));
                let newest = Arc::default();
                let display = Display { outbox, wishes: None, newest, recalling: false, settling: false };
                self.displays.insert(id, display);
            }
            Event::Message { id, message } => {
                if let Err(error) = self.message(id, message) {
                    // Only a failing disk is everybody's trouble; the rest ends with the one who caused it.
                    if error.downcast_ref::<holo_beamfile::Error>().is_some() {
                        return Err(error);
                    }
                    self.expel(id, format!("{error:#}"));
                }
            }
            Event::Left { id, reason } => self.leave(id, reason),
            Event::Broke { id, reason } => self.expel(id, reason),
            Event::Recalled { id, view, result } => self.recalled(id, view, result),
            Event::Flushed { id, view } => {
                if let Some(display) = self.displays.get(&id) {
                    let _ = display.outbox.control(&Control::Settled { view });
                }
            }
            Event::Shutdown => {
                self.ending.get_or_insert_with(Instant::now);
            }
        }
        Ok(())
    }

    fn message(&mut self, id: ConnectionId, message: Message) -> Result<()> {
        let is_worker = self.workers.contains_key(&id);
        let is_display = self.displays.contains_key(&id);
        match message {
            // Said by a connection that was ended here a moment ago.
            _ if !is_worker && !is_display => {}
            Message::Control(Control::Ping(number)) => {
                if let Some(outbox) = self.outbox(id) {
                    outbox.control(&Control::Pong(number))?;
                }
            }
            Message::Control(Control::SceneWanted) => {
                if let Some(outbox) = self.outbox(id) {
                    send_scene(Arc::clone(&self.holodeck), outbox.clone())?;
                }
            }
            Message::Control(Control::Ready { threads }) if is_worker => {
                if let Some(worker) = self.workers.get_mut(&id) {
                    worker.ready(threads);
                }
            }
            Message::Control(Control::Failed { reason }) if is_worker => bail!("{reason}"),
            Message::Results(results) if is_worker => self.results(id, &results)?,
            Message::View(request) if is_display => self.view(id, request)?,
            Message::Control(Control::Settle { view }) if is_display => self.settle(id, view),
            _ => bail!("it sent a message that is not for a server"),
        }
        Ok(())
    }

    fn outbox(&self, id: ConnectionId) -> Option<&Outbox> {
        let worker = self.workers.get(&id).map(|worker| &worker.outbox);
        worker.or_else(|| self.displays.get(&id).map(|display| &display.outbox))
    }

    /// Ends the connection of whoever broke the rules, and tells it why.
    fn expel(&mut self, id: ConnectionId, reason: String) {
        if let Some(outbox) = self.outbox(id) {
            // A reason longer than a control message is none for people; the connection ends all the same.
            let _ = outbox.control(&Control::Bye { reason: reason.clone() });
        }
        self.leave(id, Some(reason));
    }

    fn leave(&mut self, id: ConnectionId, reason: Option<String>) {
        let reason = reason.unwrap_or_else(|| "it closed its connection".into());
        if let Some(worker) = self.workers.remove(&id) {
            self.progress.say(&format!("{} left: {reason}", worker.name));
            self.again.extend(worker.into_assignments());
            // What was traced for a view that is no longer looked at need not be traced again.
            self.forget_stale();
        }
        if let Some(display) = self.displays.remove(&id) {
            display.newest.store(u32::MAX, Ordering::Release);
            self.progress.say(&format!("a display left: {reason}"));
            self.forget_stale();
        }
        self.try_settle();
    }

    fn forget_stale(&mut self) {
        let displays = &self.displays;
        self.again.retain(|assignment| {
            assignment.display.is_none_or(|id| displays.get(&id).is_some_and(|display| !display.settling))
        });
    }

    /// A worker's results: stored, then sent to every display that looks at their beams.
    fn results(&mut self, id: ConnectionId, results: &Results) -> Result<()> {
        let mut outgoing = BTreeMap::new();
        let taken = self.take_results(id, results, &mut outgoing).and_then(|()| self.take_unseen(id, &results.unseen));
        // Even if a packet was refused: those before it are stored, so displays get them.
        for (id, message) in outgoing {
            if let Some(display) = self.displays.get(&id) {
                display.outbox.send(Kind::Samples, &message.encode())?;
            }
        }
        self.try_settle();
        taken
    }

    fn take_results(
        &mut self,
        id: ConnectionId,
        results: &Results,
        outgoing: &mut BTreeMap<ConnectionId, Samples>,
    ) -> Result<()> {
        let mut rest = results.samples.as_slice();
        for traced in &results.packets {
            let Some(worker) = self.workers.get_mut(&id) else { return Ok(()) };
            let assignment = worker.finish(traced)?;
            let (samples, after) = rest.split_at(traced.count as usize);
            rest = after;
            match self.store(&assignment.packet, samples) {
                Ok(()) => {}
                Err(holo_beamfile::Error::NotWritten { .. }) => {
                    // No memory left for what a full disk does not take: it is traced again when there is room.
                    self.again.push_back(assignment);
                    continue;
                }
                Err(error) => return Err(error.into()),
            }
            self.forward(&assignment.packet, samples, outgoing);
        }
        Ok(())
    }

    /// Packets that a worker did not trace since their beams see nothing: remembered, and told to whoever looks at them.
    fn take_unseen(&mut self, id: ConnectionId, packets: &[u64]) -> Result<()> {
        let mut outgoing: BTreeMap<ConnectionId, BTreeSet<_>> = BTreeMap::new();
        let taken = packets.iter().try_for_each(|&packet| {
            let key = self.finish_unseen(id, packet)?;
            self.holodeck.unseen_mut().insert(key);
            for (&display, looking) in &self.displays {
                if looking.wishes.as_ref().is_some_and(|wishes| wishes.contains(key)) {
                    // Several packets of one beam may have been under way.
                    outgoing.entry(display).or_default().insert((key.section, key.beam));
                }
            }
            Ok(())
        });
        // Even if a packet was refused, as with samples.
        for (id, beams) in outgoing {
            if let Some((display, view)) = self.displays.get(&id).and_then(|d| Some((d, d.wishes.as_ref()?.view))) {
                tell_unseen(&display.outbox, view, &Vec::from_iter(beams))?;
            }
        }
        taken
    }

    fn finish_unseen(&mut self, id: ConnectionId, packet: u64) -> Result<BeamKey> {
        ensure!(self.holodeck.skip_unseen, ResultsError::NotAsked);
        let worker = self.workers.get_mut(&id).context("it has left")?;
        let packet = worker.finish_unseen(packet)?.packet;
        Ok(BeamKey { section: packet.section, beam: packet.beam })
    }

    fn store(&mut self, packet: &Packet, samples: &[Sample]) -> Result<(), holo_beamfile::Error> {
        let meta = ExtentMeta {
            key: BeamKey { section: packet.section, beam: packet.beam },
            first: packet.first,
            count: samples.len() as u32,
            kind: kind(packet),
            paths: packet.paths,
            settings: 0,
            generation: 0,
        };
        self.holodeck.file.append(meta, samples)?;
        self.progress.add(samples.len() as u64);
        Ok(())
    }

    fn forward(&self, packet: &Packet, samples: &[Sample], outgoing: &mut BTreeMap<ConnectionId, Samples>) {
        let key = BeamKey { section: packet.section, beam: packet.beam };
        for (&id, display) in &self.displays {
            let Some(wishes) = display.wishes.as_ref().filter(|wishes| wishes.contains(key)) else { continue };
            let message = outgoing.entry(id).or_insert_with(|| Samples {
                view: wishes.view,
                source: Source::Traced,
                runs: Vec::new(),
                samples: Vec::new(),
            });
            message.runs.push(Run {
                section: packet.section,
                beam: packet.beam,
                kind: kind(packet),
                first: packet.first,
                count: samples.len() as u32,
                paths: packet.paths,
            });
            message.samples.extend_from_slice(samples);
        }
    }

    /// A display's view: recall what is stored, and from now on trace for it. The same view again only moves the
    /// viewpoint's radius.
    fn view(&mut self, id: ConnectionId, request: ViewRequest) -> Result<()> {
        let sections = &self.holodeck.sections;
        let known = request.beams.iter().all(|wanted| {
            sections.get(usize::from(wanted.section)).is_some_and(|section| wanted.beam < section.beam_count())
        });
        ensure!(known, "it asked for beams that do not exist");
        let in_order = request.beams.is_sorted_by_key(|wanted| (wanted.section, wanted.beam))
            && request.beams.windows(2).all(|pair| (pair[0].section, pair[0].beam) != (pair[1].section, pair[1].beam));
        ensure!(in_order, "it asked for a beam twice, or not in order");
        let Some(display) = self.displays.get_mut(&id) else { return Ok(()) };
        if let Some(wishes) = display.wishes.as_mut().filter(|wishes| wishes.view == request.view) {
            wishes.viewpoint = request.viewpoint;
            return Ok(());
        }
        let file = &self.holodeck.file;
        let beams = request.beams.iter().map(|wanted| {
            let key = BeamKey { section: wanted.section, beam: holo_section::BeamId(wanted.beam) };
            (key, wanted.weight, file.count(key))
        });
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
        display.settling = false;
        let events = self.events.clone();
        recall.start(move |view, result| {
            // If the coordinator is gone, so is the process.
            let _ = events.send(Event::Recalled { id, view, result });
        })?;
        // Packets for the display's former view are no longer urgent; what is under way arrives and is stored.
        self.again.retain(|assignment| assignment.display != Some(id));
        Ok(())
    }

    fn recalled(&mut self, id: ConnectionId, view: u32, result: Result<(), String>) {
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

    fn settle(&mut self, id: ConnectionId, view: u32) {
        if let Some(display) = self.displays.get_mut(&id) {
            display.settling = display.wishes.as_ref().is_some_and(|wishes| wishes.view == view);
            if !display.settling {
                // No such view: nothing is under way for it.
                let _ = display.outbox.control(&Control::Settled { view });
            }
        }
        self.forget_stale();
        self.try_settle();
    }

    /// Tells displays that wait for it that nothing of their view is under way any more.
    fn try_settle(&mut self) {
        for (&id, display) in &mut self.displays {
            let Some(wishes) = display.wishes.as_ref().filter(|_| display.settling && !display.recalling) else {
                continue;
            };
            let under_way = self.workers.values().any(|worker| {
                worker.assignments().any(|assignment| {
                    wishes.contains(BeamKey { section: assignment.packet.section, beam: assignment.packet.beam })
                })
            });
            if under_way {
                continue;
            }
            let (view, events, holodeck) = (wishes.view, self.events.clone(), Arc::clone(&self.holodeck));
            display.settling = false;
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

    /// Gives work to every worker that has too little.
    fn deal(&mut self) {
        if self.stalled {
            return;
        }
        // What is under way counts for the goal: it is reached, not overrun by what fast workers are given ahead.
        let under_way: f64 = self.workers.values().map(Worker::rays_ahead).sum();
        let so_far = self.progress.added() as f64 + under_way;
        let mut left = self.goal.samples.map_or(f64::INFINITY, |goal| goal as f64 - so_far);
        let hungry: Vec<_> = self.workers.iter().map(|(&id, worker)| (id, worker.hunger())).collect();
        for (id, hunger) in hungry {
            let mut rays = 0.0;
            let mut assignments = Vec::new();
            while rays < hunger && left > 0.0 && assignments.len() < PACKETS_PER_MESSAGE {
                let Some(assignment) = self.next_assignment() else { break };
                rays += f64::from(assignment.packet.count);
                left -= f64::from(assignment.packet.count);
                assignments.push(assignment);
            }
            if let Some(worker) = self.workers.get_mut(&id).filter(|_| !assignments.is_empty()) {
                worker.assign(assignments);
            }
        }
    }

    /// The most urgent packet: lost ones, then displays in turn, then batch order.
    fn next_assignment(&mut self) -> Option<Assignment> {
        if let Some(assignment) = self.again.pop_front() {
            return Some(assignment);
        }
        self.next_for_displays().or_else(|| self.next_in_batch())
    }

    fn next_for_displays(&mut self) -> Option<Assignment> {
        // In turn: from the one after the last served, around to it.
        let after = |id: &&ConnectionId| self.last_served.is_some_and(|last| **id > last);
        let ids: Vec<ConnectionId> = {
            let later = self.displays.keys().filter(after);
            later.chain(self.displays.keys().filter(|id| !after(id))).copied().collect()
        };
        for id in ids {
            let unseen = self.holodeck.unseen();
            let Some(display) = self.displays.get_mut(&id) else { continue };
            if display.settling || display.outbox.queued_bytes() > DISPLAY_QUEUE_BYTES {
                continue;
            }
            let Some(wishes) = display.wishes.as_mut() else { continue };
            let viewpoint = wishes.viewpoint;
            while let Some((key, count)) = wishes.next(|key| unseen.contains(key)) {
                let kind = SampleKind::ViewpointLimited;
                let Some(first) = self.allotment.take(&self.holodeck.file, key, kind, count) else { continue };
                self.last_served = Some(id);
                drop(unseen);
                return Some(self.assignment(key, first, count, Some(viewpoint), Some(id)));
            }
        }
        None
    }

    fn next_in_batch(&mut self) -> Option<Assignment> {
        let batch = self.batch.as_mut()?;
        let unseen = self.holodeck.unseen();
        for _ in 0..BATCH_LOOKS {
            let (key, wanted) = match self.batch_rest.take() {
                Some(rest) => rest,
                None => batch.next(),
            };
            if unseen.contains(key) {
                continue;
            }
            let file = &self.holodeck.file;
            let have = u64::from(self.allotment.taken(file, key, SampleKind::Uniform))
                + u64::from(self.allotment.taken(file, key, SampleKind::ViewpointLimited));
            if have >= wanted {
                continue;
            }
            let count = (wanted - have).min(MAX_RAYS_PER_PACKET as u64) as u8;
            let Some(first) = self.allotment.take(file, key, SampleKind::Uniform, count) else { continue };
            self.batch_rest = Some((key, wanted));
            drop(unseen);
            return Some(self.assignment(key, first, count, None, None));
        }
        None
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
        let packet =
            Packet { id: self.next_packet, section: key.section, beam: key.beam, first, count, paths, viewpoint: None };
        Assignment { packet, viewpoint, display }
    }
}

fn kind(packet: &Packet) -> SampleKind {
    if packet.viewpoint.is_some() { SampleKind::ViewpointLimited } else { SampleKind::Uniform }
}
