//! The coordinator: one thread that makes all decisions of a server (Larson & Simmons 1999, §2.2
//! and §2.5).
//!
//! It never waits for anyone. Connections are tasks that send it events; threads that read or write
//! the disk report back; frames to others are queued. Invariants:
//! - Every packet given out is with exactly one connected worker, or waits to be given out again.
//!   An overdue packet waits again. If its worker returns it late, the samples count only while it
//!   still waits.
//! - A packet's samples are stored once, whoever traces it and however often.
//! - A display gets every sample of its view's beams, stored or traced, whatever it was traced for.
//!   It also learns which of these beams see nothing.
//! - No worker gets a packet of a beam that is known to see nothing, except to check that.
//! - Live samples go only to the display that requested them.
//! - No better sample replaces one in a beam that a display looks at.

mod audits;
mod blob_queue;
mod blobs;
mod checks;
mod dealing;
mod display;
mod fill;
mod live;
mod peers;
mod results;
mod saver;
mod sharing;
mod status;
mod views;
mod writer;

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use anyhow::{Result, bail};
use holo_beamfile::{Error as FileError, FileLoss, Maker};
use holo_net::{Message, Outbox};
use holo_progress::said_once;
use holo_proto::{
    control::{Control, Farewell, SceneInfo},
    report::FaultReport,
};
use holo_section::Sample;
use tokio::{
    sync::mpsc::{UnboundedReceiver, UnboundedSender},
    time::{Instant, timeout},
};

use crate::{
    allotment::Allotment,
    assignment::Assignment,
    audits::Audits,
    batch::BatchOrder,
    claims::UnseenClaims,
    damage::DamageReport,
    events::{ConnectionId, ServerEvent},
    holodeck::Holodeck,
    mailbox::{Mail, Mailbox},
    progress::{SampleProgress, Totals},
    recall::Blob,
    schedule::{Goal, Schedule},
    shard::Share,
    workers::ConnectedWorker,
};
use blob_queue::BlobQueue;
use display::ConnectedDisplay;
use fill::Fill;
use saver::Saver;
use writer::ViewWriter;

/// Interval at which displays get a status.
const STATUS_EVERY: Duration = Duration::from_millis(500);

/// The longest that the coordinator sleeps: timers are this exact.
const TICK: Duration = Duration::from_millis(20);

/// Events handled before work is dealt out again, at most.
const EVENTS_PER_TURN: usize = 256;

/// Longest time of handling events before work is dealt out again. Handling a view may take as
/// long.
const TURN: Duration = Duration::from_millis(20);

/// Bytes of samples that may wait for a failing disk. Above, nothing more is traced. The samples
/// under way then still fit in the memory that the beam file allows itself.
const STALLED_BYTES: u64 = 64 << 20;

/// Bytes of the file that a packet takes besides its samples, at most: its extent, and its part of
/// checksums.
const PACKET_BYTES: usize = 64;

/// Longest time that the end waits until the peers have read what was sent to them.
const FAREWELL: Duration = Duration::from_secs(1);

/// Options of filling the file while no display wants anything.
#[derive(Clone, Debug)]
pub struct FillOptions {
    /// Samples that are enough for the file; `None`: as many as its sections suggest.
    pub enough: Option<u64>,
    /// The beams that are filled.
    pub share: Share,
}

/// A server's whole state.
pub struct Coordinator {
    holodeck: Arc<Holodeck>,
    events: UnboundedSender<ServerEvent>,
    workers: BTreeMap<ConnectionId, ConnectedWorker>,
    displays: BTreeMap<ConnectionId, ConnectedDisplay>,
    /// Who asks how the server fares.
    admins: BTreeMap<ConnectionId, Outbox>,
    /// Mail from each connection that is not handled yet.
    mailboxes: BTreeMap<ConnectionId, Arc<Mailbox>>,
    /// Workers that want cells of surface light, and how many each has been sent.
    listeners: BTreeMap<ConnectionId, usize>,
    /// The display for which a packet was last dealt.
    last_served: Option<ConnectionId>,
    /// Packets of lost workers, and overdue ones, by name.
    lost: BTreeMap<u64, Assignment>,
    claims: UnseenClaims,
    audits: Audits,
    /// Machines that returned impossible results since the server started.
    faults: BTreeMap<Maker, FaultReport>,
    /// Workers that differ, two by two. It is unknown which of them are wrong.
    in_doubt: Vec<FaultReport>,
    /// Packets that check claims and samples and that no worker has yet, by name.
    checks: BTreeMap<u64, Assignment>,
    allotment: Allotment,
    fill: Option<Fill>,
    last_packet: u64,
    schedule: Schedule,
    progress: SampleProgress,
    last_status: Instant,
    /// When overdue packets were last looked for.
    last_overdue: Instant,
    saver: Saver,
    writer: ViewWriter,
    /// Blobs for peers that asked for some.
    blobs: BTreeMap<ConnectionId, BlobQueue>,
    damage: DamageReport,
    /// True if the disk fails and many samples wait for it.
    stalled: bool,
    /// The farewell that all peers get at the end.
    farewell: Farewell,
}

impl Coordinator {
    /// Returns a server's state at its start. With `fill`, beams are traced in batch order whenever
    /// no display wants anything.
    pub fn new(
        holodeck: Arc<Holodeck>,
        events: UnboundedSender<ServerEvent>,
        fill: Option<FillOptions>,
        goal: Goal,
        progress: SampleProgress,
    ) -> Self {
        let stored = holodeck.file.stats().samples;
        let damage = DamageReport::of_opening(&holodeck.file);
        let paths = holodeck.about.settings.paths_per_sample;
        let fill = fill.filter(|_| holodeck.writable).map(|FillOptions { enough, share }| {
            let unseen = holodeck.unseen();
            // Estimates the samples of all shards, assuming that the others hold as many as this
            // one.
            let stored = share.all_shards(stored);
            Fill::new(BatchOrder::new(&holodeck.sections, stored, &unseen, enough, paths), share)
        });
        let claims = UnseenClaims::restore(&holodeck.unproven());
        Coordinator {
            holodeck,
            events,
            workers: BTreeMap::new(),
            displays: BTreeMap::new(),
            admins: BTreeMap::new(),
            mailboxes: BTreeMap::new(),
            listeners: BTreeMap::new(),
            last_served: None,
            lost: BTreeMap::new(),
            claims,
            audits: Audits::default(),
            faults: BTreeMap::new(),
            in_doubt: Vec::new(),
            checks: BTreeMap::new(),
            allotment: Allotment::default(),
            fill,
            last_packet: 0,
            schedule: Schedule::new(goal),
            progress,
            last_status: Instant::now(),
            last_overdue: Instant::now(),
            saver: Saver::new(),
            writer: ViewWriter::default(),
            blobs: BTreeMap::new(),
            damage,
            stalled: false,
            farewell: Farewell::SessionOver,
        }
    }

    /// Serves until the goal is reached or a shutdown is requested, and then stores everything.
    /// `doors` ends the taking of connections: whoever is told to come back must not reach this
    /// server again.
    ///
    /// # Errors
    /// If samples cannot be stored.
    pub async fn run(
        mut self,
        mut events: UnboundedReceiver<ServerEvent>,
        doors: impl Future<Output = ()>,
    ) -> Result<Totals> {
        loop {
            match timeout(TICK, events.recv()).await {
                Ok(Some(event)) => {
                    let end = Instant::now() + TURN;
                    self.handle(event)?;
                    for _ in 0..EVENTS_PER_TURN {
                        let Ok(event) = events.try_recv() else { break };
                        self.handle(event)?;
                        if Instant::now() > end {
                            break;
                        }
                    }
                }
                Ok(None) => break,
                Err(_) => {}
            }
            self.take_overdue();
            self.begin_checks();
            self.check_goal();
            // Before work, so that what others know is used for it.
            self.hand_cells();
            self.deal();
            if self.schedule.is_ending() && (self.is_done() || self.schedule.is_overdue()) {
                break;
            }
            self.report();
            if let Some(error) = self.cut_off() {
                self.farewell = Farewell::Dropped { reason: error.to_string() };
                self.finish(doors).await?;
                return Err(error.into());
            }
            self.writer.write(&self.holodeck, &self.events);
        }
        self.finish(doors).await
    }

    /// Returns the error of a file that lost its end. Its pictures would lack samples.
    fn cut_off(&self) -> Option<FileError> {
        let is_cut = |error: &FileError| {
            matches!(error, FileError::Lost { how: FileLoss::Shortened { .. }, .. })
        };
        self.holodeck.file.lost().filter(is_cut)
    }

    /// Returns whether nothing is left that could still arrive.
    fn is_done(&self) -> bool {
        // Packets of lost workers are traced again first, if there is another worker.
        let lost = !self.lost.is_empty() && !self.workers.is_empty();
        !lost && self.workers.values().all(ConnectedWorker::is_idle)
    }

    /// Stores everything and says goodbye.
    async fn finish(mut self, doors: impl Future<Output = ()>) -> Result<Totals> {
        self.writer.finish(&self.holodeck);
        self.saver.finish(&self.holodeck);
        let flushed = self.holodeck.writable.then(|| self.holodeck.file.flush()).transpose();
        doors.await;
        let bye = Control::Bye(self.farewell.clone());
        let workers = self.workers.values().map(|worker| &worker.outbox);
        let displays = self.displays.values().map(|display| &display.outbox);
        let peers = workers.chain(displays).chain(self.admins.values());
        let peers: Vec<Outbox> = peers.cloned().collect();
        for outbox in &peers {
            let _ = outbox.control(&bye);
        }
        let drained = async {
            for outbox in &peers {
                outbox.drained().await;
            }
        };
        // A peer that reads too slowly finds its connection closed.
        let _ = timeout(FAREWELL, drained).await;
        self.progress.finish();
        self.damage.print_new(&self.holodeck.file);
        flushed?;
        Ok(self.progress.totals(&self.holodeck.file.stats(), self.schedule.elapsed()))
    }

    /// Begins the end if the goal is reached, or cannot be.
    fn check_goal(&mut self) {
        if self.schedule.is_ending() {
            return;
        }
        if let Some(reason) = self.nothing_to_trace() {
            self.progress.say(reason);
            self.schedule.end();
        } else if self.schedule.is_reached(self.progress.traced(), self.coming_bytes()) {
            self.schedule.end();
        }
    }

    /// Returns the greatest length that the file can have once everything under way is stored. 0 if
    /// the goal does not depend on it.
    fn coming_bytes(&self) -> u64 {
        if self.schedule.goal.disk.is_none() {
            return 0;
        }
        let assignments = self.workers.values().flat_map(ConnectedWorker::assignments);
        let under_way: usize = assignments
            .map(|assignment| {
                PACKET_BYTES + usize::from(assignment.packet.count) * size_of::<Sample>()
            })
            .sum();
        let file = self.holodeck.file.stats();
        file.file_bytes + file.pending_bytes + under_way as u64
    }

    /// Returns why a server with a goal will never trace anything more.
    fn nothing_to_trace(&self) -> Option<&'static str> {
        // Nobody can check the claims of the only worker, so they end a fill. Until a
        // worker is ready, claims of earlier ones do not.
        let is_known = !self.is_checking()
            && (self.workers.values().any(ConnectedWorker::is_ready)
                || self.holodeck.unproven().count() == 0);
        if self.schedule.goal.samples.is_some() && is_known && self.sees_nothing() {
            return Some("no ray of any section hits anything: there is nothing to trace");
        }
        let exhausted = self.fill.as_ref().is_some_and(Fill::is_exhausted);
        let idle = self.lost.is_empty() && self.workers.values().all(ConnectedWorker::is_idle);
        (self.schedule.goal.is_some() && exhausted && idle && is_known && self.displays.is_empty())
            .then_some(
                "every sample has as many paths as it may get: there is nothing left to trace",
            )
    }

    /// Returns whether not a single beam sees anything.
    fn sees_nothing(&self) -> bool {
        let unseen = self.holodeck.unseen();
        let sections = self.holodeck.sections.iter().enumerate();
        sections.into_iter().all(|(at, section)| unseen.count_in(at) == section.beam_count())
    }

    /// Handles an event. Only a failing disk is an error. Any other fault ends the connection that
    /// caused it.
    fn handle(&mut self, event: ServerEvent) -> Result<()> {
        match event {
            ServerEvent::Joined { id, hello, access, outbox, mailbox } => {
                self.mailboxes.insert(id, mailbox);
                self.join(id, hello, access, outbox);
            }
            ServerEvent::Mail { id, mailbox } => {
                let (mail, is_more) = mailbox.take();
                if is_more {
                    // The mail goes behind that of other peers. Sending fails only if the
                    // coordinator itself is gone.
                    let _ = self.events.send(ServerEvent::Mail { id, mailbox });
                }
                return mail.map_or(Ok(()), |mail| self.mail(id, mail));
            }
            ServerEvent::Recalled { id, view, result } => self.recalled(id, view, result),
            ServerEvent::PartSent { id, section, result } => self.part_sent(id, section, result),
            ServerEvent::Flushed { id, view, mark } => {
                if let Some(display) = self.displays.get_mut(&id) {
                    display.settled_at = Some(mark);
                    let _ = display.outbox.control(&Control::Settled { view });
                }
            }
            ServerEvent::ViewsKept { views, refused } => self.views_kept(views, refused),
            ServerEvent::BlobSent { id } => self.blob_sent(id),
            ServerEvent::Shutdown(farewell) => {
                self.farewell = farewell;
                self.schedule.end();
            }
        }
        Ok(())
    }

    /// Handles what a peer did. Only a failing disk is an error.
    fn mail(&mut self, id: ConnectionId, mail: Mail) -> Result<()> {
        match mail {
            Mail::Message(message) => {
                if let Err(error) = self.message(id, message) {
                    if error.downcast_ref::<holo_beamfile::Error>().is_some() {
                        return Err(error);
                    }
                    self.accuse(id, &error);
                    self.expel(id, said_once(error.as_ref()));
                }
            }
            Mail::Left(reason) => self.leave(id, reason),
            Mail::Broke(reason) => self.expel(id, reason),
        }
        Ok(())
    }

    /// Handles a message by who sent it. A connection that was ended here a moment ago is ignored.
    fn message(&mut self, id: ConnectionId, message: Message) -> Result<()> {
        if self.workers.contains_key(&id) {
            self.workers_message(id, message)
        } else if self.displays.contains_key(&id) {
            self.displays_message(id, message)
        } else {
            self.admins_message(id, message)
        }
    }

    fn workers_message(&mut self, id: ConnectionId, message: Message) -> Result<()> {
        match message {
            Message::Results(results) => self.results(id, &results),
            Message::LiveResults(results) => self.live_results(id, &results),
            Message::Cells(cells) => self.cells(id, cells),
            Message::Control(Control::Ready { threads }) => {
                if let Some(worker) = self.workers.get_mut(&id) {
                    worker.ready(threads);
                }
                self.schedule.begin();
                Ok(())
            }
            Message::Control(Control::CellsWanted) => {
                self.listeners.entry(id).or_insert(0);
                self.hand_cells();
                Ok(())
            }
            Message::Control(Control::CellsUsed { maker }) => self.cells_used(id, Maker(maker)),
            Message::Control(Control::Failed { reason }) => bail!("{reason}"),
            Message::Control(control) => self.anyones_message(id, control),
            _ => bail!(NOT_FOR_A_SERVER),
        }
    }

    fn displays_message(&mut self, id: ConnectionId, message: Message) -> Result<()> {
        match message {
            Message::View(request) => self.view(id, request),
            Message::Rays(request) => self.rays(id, &request),
            Message::LiveWanted(request) => self.live_wanted(id, &request),
            Message::Control(Control::Settle { view }) => {
                self.settle(id, view);
                Ok(())
            }
            Message::Control(Control::KeepView { name, options }) => {
                self.keep_view(id, name, options);
                Ok(())
            }
            Message::Control(Control::PartWanted { section, first, samples, as_settled }) => {
                self.part(id, section, first, samples, as_settled)
            }
            Message::Control(Control::StandInsWanted) => self.stand_ins_wanted(id),
            Message::Control(control) => self.anyones_message(id, control),
            _ => bail!(NOT_FOR_A_SERVER),
        }
    }

    /// Sends a display the stand-ins, after a message that says what they are, or that there are
    /// none.
    fn stand_ins_wanted(&mut self, id: ConnectionId) -> Result<()> {
        let Some(outbox) = self.outbox(id) else { return Ok(()) };
        let stand_ins = self.holodeck.about.stand_ins.as_ref().map(|stand_ins| stand_ins.blob);
        let none = SceneInfo { hash: [0; 32], bytes: 0 };
        outbox.control(&Control::StandIns(stand_ins.unwrap_or(none)))?;
        if stand_ins.is_some() {
            self.blob_wanted(id, Blob::StandIns);
        }
        Ok(())
    }

    /// Handles what workers and displays may ask for alike.
    fn anyones_message(&mut self, id: ConnectionId, message: Control) -> Result<()> {
        let Some(outbox) = self.outbox(id) else { return Ok(()) };
        match message {
            Control::Ping(number) => outbox.control(&Control::Pong(number))?,
            Control::SceneWanted => {
                let stand_ins = self.holodeck.about.stand_ins.as_ref();
                if let Some(stand_ins) = stand_ins.filter(|_| self.displays.contains_key(&id)) {
                    outbox.control(&Control::StandIns(stand_ins.blob))?;
                }
                self.blob_wanted(id, Blob::Scene);
            }
            _ => bail!(NOT_FOR_A_SERVER),
        }
        Ok(())
    }
}

const NOT_FOR_A_SERVER: &str = "it sent a message that is not for a server";
