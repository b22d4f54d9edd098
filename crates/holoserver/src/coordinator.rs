//! The coordinator: one thread that owns all decisions of a server (Larson & Simmons 1999, §2.2 and §2.5).
//!
//! It never waits for anyone: connections are tasks that send it events, recall and flushing are threads that report
//! back, and frames to others are queued. What always holds:
//! - every packet given out is either with exactly one connected worker, or waiting to be given out again;
//! - a packet's samples are stored once, whoever traces it and however often;
//! - a display gets every sample of its view's beams, stored or traced, from whatever cause they were traced, and is told
//!   which of them see nothing;
//! - a beam known to see nothing is given to no worker;
//! - what is traced live goes to the display that asked for it, and nowhere else;
//! - a sample that a display may have is not replaced by a better one while it looks at the sample's beam.

mod dealing;
mod live;
mod results;
mod sharing;
mod views;

use std::{
    collections::{BTreeMap, VecDeque},
    ops::Range,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
        mpsc::{Receiver, RecvTimeoutError, Sender},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use anyhow::{Result, bail};
use holo_net::{Message, Outbox, PING_EVERY};
use holo_proto::{
    bulk::Packet,
    control::{Control, Status},
    hello::Role,
};
use holo_section::{BeamKey, Sample};

use crate::{
    allotment::Allotment,
    batch::{BatchOrder, Wanted},
    damage::DamageReport,
    holodeck::Holodeck,
    listen::ConnectionId,
    live::LiveQueue,
    progress::{Done, Progress},
    recall::{send_scene, send_stand_ins},
    wishes::Wishes,
    workers::{Assignment, Worker},
};

/// How often displays are told how the server fares.
const STATUS_EVERY: Duration = Duration::from_millis(500);

/// The longest that the coordinator sleeps: timers are this exact.
const TICK: Duration = Duration::from_millis(20);

/// How long packets under way are waited for at the end; whoever takes longer hangs.
const LAST_PACKETS: Duration = Duration::from_secs(3);

/// Samples that wait for a failing disk at the most, bytes; above, nothing more is traced until it takes them. What is
/// under way then still fits in the memory that the beam file allows itself.
const STALLED_BYTES: u64 = 64 << 20;

/// How often newly found unseen beams and records of light are written to the file, at the most. After a crash they are found again.
const SAVE_EVERY: Duration = Duration::from_secs(5);

/// Bytes that samples have added to the file for each byte of a list of unseen beams written: old lists stay in it.
const SAMPLES_PER_UNSEEN_BYTE: u64 = 32;

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
    /// Once so many samples have been traced, better ones included.
    pub samples: Option<u64>,
}

/// Filling in batch order.
#[derive(Clone, Copy, Debug)]
pub struct Filling {
    /// Samples after which the file has enough; `None`: what is sensible for its sections.
    pub enough: Option<u64>,
}

struct Display {
    outbox: Outbox,
    wishes: Option<Wishes>,
    /// Rays of its view that no section covers.
    live: LiveQueue,
    newest: Arc<AtomicU32>,
    recalling: bool,
    /// If it settles: the number of the last packet that was given out before. A file that is filled at the same time has always
    /// some of the view's beams under way.
    settling: Option<u64>,
}

/// See the module's words.
pub struct Coordinator {
    holodeck: Arc<Holodeck>,
    events: Sender<Event>,
    workers: BTreeMap<ConnectionId, Worker>,
    displays: BTreeMap<ConnectionId, Display>,
    /// Who wants records of indirect light, and how many it has been given.
    listeners: BTreeMap<ConnectionId, usize>,
    last_served: Option<ConnectionId>,
    again: VecDeque<Assignment>,
    allotment: Allotment,
    batch: Option<BatchOrder>,
    batch_rest: Option<(BeamKey, Wanted)>,
    /// Packets of batch order that are under way, lost ones included.
    batch_packets: usize,
    /// Numbers that are to be traced again with more paths, after those of `batch_rest`.
    better_rest: VecDeque<(BeamKey, Range<u32>, u16)>,
    /// Whether batch order has come to its end: every beam has all it may get.
    exhausted: bool,
    /// The paths of better samples that people were last told of.
    said_paths: Option<u16>,
    next_packet: u64,
    goal: Goal,
    started: Instant,
    ending: Option<Instant>,
    progress: Progress,
    last_status: Instant,
    last_ping: Instant,
    /// When unseen beams were last written, and how many samples had been added then.
    last_save: (Instant, u64),
    /// When records of light were last written.
    last_light: Instant,
    saving: Option<JoinHandle<()>>,
    damage: DamageReport,
    /// The disk fails and much waits for it.
    stalled: bool,
}

impl Coordinator {
    /// A server's state at its start. With `filling`, beams are traced in batch order whenever no display wants anything.
    pub fn new(
        holodeck: Arc<Holodeck>,
        events: Sender<Event>,
        filling: Option<Filling>,
        goal: Goal,
        progress: Progress,
    ) -> Self {
        let stored = holodeck.file.stats().samples;
        let paths = holodeck.about.settings.paths_per_sample;
        let batch = filling.filter(|_| holodeck.writable).map(|filling| {
            BatchOrder::new(&holodeck.sections, stored, &holodeck.unseen(), filling.enough, paths)
        });
        let damage = DamageReport::of_opening(&holodeck.file);
        let now = Instant::now();
        Coordinator {
            holodeck,
            events,
            workers: BTreeMap::new(),
            displays: BTreeMap::new(),
            listeners: BTreeMap::new(),
            last_served: None,
            again: VecDeque::new(),
            allotment: Allotment::default(),
            batch,
            batch_rest: None,
            batch_packets: 0,
            better_rest: VecDeque::new(),
            exhausted: false,
            said_paths: None,
            next_packet: 0,
            goal,
            started: now,
            ending: None,
            progress,
            last_status: now,
            last_ping: now,
            last_save: (now, 0),
            last_light: now,
            saving: None,
            damage,
            stalled: false,
        }
    }

    /// Works until the goal is reached or a shutdown is asked for; everything is then stored. Gives what was done.
    ///
    /// # Errors
    /// If samples cannot be stored.
    pub fn run(mut self, events: &Receiver<Event>) -> Result<Done> {
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
            // Before work, so that what others know is used for it.
            self.hand_light();
            self.deal();
            if let Some(since) = self.ending {
                // What lost workers had is traced again first, if there is anybody to do it.
                let left = !self.again.is_empty() && !self.workers.is_empty();
                let done = !left && self.workers.values().all(Worker::is_idle);
                if done || since.elapsed() > LAST_PACKETS {
                    break;
                }
            }
            self.tick();
            if self.holodeck.file.lost().is_some() {
                // The end's flush says what became of the file.
                break;
            }
        }
        self.finish()
    }

    fn finish(mut self) -> Result<Done> {
        if let Some(saving) = self.saving.take() {
            // A thread that panicked has said so on standard error.
            let _ = saving.join();
        }
        // What a failing disk does not take is found again.
        let _ = self.holodeck.save_unseen();
        let _ = self.holodeck.save_light();
        let flushed = self.holodeck.writable.then(|| self.holodeck.file.flush()).transpose();
        let bye = Control::Bye { reason: "the session is over".into() };
        for outbox in self.outboxes() {
            let _ = outbox.control(&bye);
        }
        self.progress.finish();
        self.damage.print_new(&self.holodeck.file);
        flushed?;
        Ok(self.progress.done(&self.holodeck.file.stats()))
    }

    fn outboxes(&self) -> impl Iterator<Item = &Outbox> {
        self.workers
            .values()
            .map(|worker| &worker.outbox)
            .chain(self.displays.values().map(|display| &display.outbox))
    }

    fn check_goal(&mut self) {
        // Packets under way are finished: stop dealing a little before the time is up.
        let time_up = self
            .goal
            .time
            .is_some_and(|time| self.started.elapsed() + Duration::from_millis(100) >= time);
        let enough = self.goal.samples.is_some_and(|samples| self.progress.traced() >= samples);
        let hopeless = self.goal.samples.is_some() && self.sees_nothing();
        if hopeless && self.ending.is_none() {
            self.progress.say("no ray of any section meets anything: there is nothing to trace");
        }
        let goal = self.goal.samples.is_some() || self.goal.time.is_some();
        let idle = self.again.is_empty() && self.workers.values().all(Worker::is_idle);
        let nothing_left = self.exhausted && goal && idle && self.displays.is_empty();
        if nothing_left && !hopeless && self.ending.is_none() {
            self.progress.say(
                "every sample has all the paths that it may get: there is nothing left to trace",
            );
        }
        if self.ending.is_none() && (time_up || enough || hopeless || nothing_left) {
            self.ending = Some(Instant::now());
        }
    }

    /// Whether not a single beam sees anything.
    fn sees_nothing(&self) -> bool {
        let unseen = self.holodeck.unseen();
        self.holodeck
            .sections
            .iter()
            .enumerate()
            .all(|(at, section)| unseen.count_in(at) == section.beam_count())
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
            self.damage.print_new(&self.holodeck.file);
            self.stalled = stats.last_error.is_some() && stats.pending_bytes > STALLED_BYTES;
            let paths = self.batch.as_ref().and_then(BatchOrder::better_paths);
            if let Some(paths) = paths.filter(|_| paths != self.said_paths) {
                self.progress.say(&format!(
                    "enough samples: they are traced again now, with {paths} paths each"
                ));
            }
            self.said_paths = paths;
            self.progress.show(&status, self.started.elapsed(), &self.goal, &stats);
            self.save_findings(now);
        }
    }

    /// Starts writing newly found unseen beams and records of light if it is time.
    fn save_findings(&mut self, now: Instant) {
        if !self.holodeck.writable
            || self.saving.as_ref().is_some_and(|saving| !saving.is_finished())
        {
            return;
        }
        let (since, added) = self.last_save;
        let bytes = (self.progress.traced() - added) * size_of::<Sample>() as u64;
        let unseen = now - since >= SAVE_EVERY
            && bytes >= SAMPLES_PER_UNSEEN_BYTE * self.holodeck.unseen().encoded_bytes();
        let light = now - self.last_light >= SAVE_EVERY;
        if unseen {
            self.last_save = (now, self.progress.traced());
        }
        if light {
            self.last_light = now;
        }
        if unseen || light {
            let holodeck = Arc::clone(&self.holodeck);
            self.saving = Some(std::thread::spawn(move || {
                // A disk that fails is named in the file's statistics; what it does not take is found again.
                if unseen {
                    let _ = holodeck.save_unseen();
                }
                if light {
                    let _ = holodeck.save_light();
                }
            }));
        }
    }

    fn handle(&mut self, event: Event) -> Result<()> {
        match event {
            Event::Joined { id, role: Role::Worker, name, outbox } => {
                self.progress.say(&format!("{name} joined"));
                self.workers.insert(
                    id,
                    Worker::new(outbox, name, self.holodeck.about.settings.paths_per_sample),
                );
            }
            Event::Joined { id, role: Role::Display, name, outbox } => {
                self.progress.say(&format!("{name} joined"));
                let newest = Arc::default();
                let live = LiveQueue::default();
                let display = Display {
                    outbox,
                    wishes: None,
                    live,
                    newest,
                    recalling: false,
                    settling: None,
                };
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
                    if let Some(stand_ins) =
                        self.holodeck.about.stand_ins.as_ref().filter(|_| is_display)
                    {
                        outbox.control(&Control::StandIns(stand_ins.blob))?;
                    }
                    send_scene(Arc::clone(&self.holodeck), outbox.clone())?;
                }
            }
            Message::Control(Control::StandInsWanted) if is_display => {
                if let Some(outbox) = self.outbox(id) {
                    send_stand_ins(Arc::clone(&self.holodeck), outbox.clone())?;
                }
            }
            Message::Control(Control::Ready { threads }) if is_worker => {
                if let Some(worker) = self.workers.get_mut(&id) {
                    worker.ready(threads);
                }
            }
            Message::Control(Control::Failed { reason }) if is_worker => bail!("{reason}"),
            Message::Results(results) if is_worker => self.results(id, &results)?,
            Message::LiveResults(results) if is_worker => self.live_results(id, &results)?,
            Message::Light(light) if is_worker => self.light(id, &light)?,
            Message::Control(Control::LightWanted) => self.light_wanted(id),
            Message::View(request) if is_display => self.view(id, request)?,
            Message::Rays(request) if is_display => self.rays(id, &request)?,
            Message::LiveWanted(request) if is_display => self.live_wanted(id, &request)?,
            Message::Control(Control::Settle { view }) if is_display => self.settle(id, view),
            _ => bail!("it sent a message that is not for a server"),
        }
        Ok(())
    }

    /// A packet's results are here, whatever they are.
    fn done(&mut self, assignment: &Assignment) {
        self.batch_packets =
            self.batch_packets.saturating_sub(usize::from(assignment.display.is_none()));
    }

    /// Whether a packet is of samples that are stored already, for more paths in them.
    fn is_better(&self, packet: &Packet) -> bool {
        packet.paths > self.holodeck.about.settings.paths_per_sample
    }

    /// Whether a display may show samples of the beam.
    fn is_looked_at(&self, key: BeamKey) -> bool {
        self.displays
            .values()
            .any(|display| display.wishes.as_ref().is_some_and(|wishes| wishes.contains(key)))
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
        self.listeners.remove(&id);
        if let Some(mut worker) = self.workers.remove(&id) {
            self.progress.say(&format!("{} left: {reason}", worker.name));
            self.live_again(&mut worker);
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
}
