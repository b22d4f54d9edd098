//! A session: the connection to a server, the view that is shown, and the driver that draws it
//! (Larson & Simmons 1999, §2.4).
//!
//! A front end calls [`Session::look`], [`Session::wait`] and [`Session::draw`], and never uses a
//! socket. Messages arrive on a task of their own (`incoming`); the session processes them while
//! it waits. A [`DriverChoice`] makes its driver.
//!
//! Invariants:
//! - A session knows no front end, and no driver by name.
//! - The server learns which beams are wanted, and sends samples. It never learns what a picture
//!   looks like.
//! - A sample counts once in a picture, however often it arrives.
//! - A driver that keeps samples, or takes late ones, receives all that arrive, because samples of
//!   one view serve the next. Other drivers receive only samples requested for the current view.
//! - A frame drawn at rest by one of the others depends only on the samples sent for its view.

mod ahead;
mod connect;
mod control;
mod crew;
mod current_view;
mod default_view;
mod demand;
mod driver_choice;
mod earlier;
mod focus;
mod haze;
mod incoming;
mod light_change;
mod live;
mod motion;
mod objects;
mod received;
mod scene;
mod scene_change;
mod schedule;
#[cfg(test)]
mod tests;
mod velocity;
mod waker;
mod weighing;
mod weighing_schedule;

use std::{
    ops::Range,
    sync::{Arc, mpsc},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use glam::DVec3;
use holo_display::{Driver, DriverPart, Frame, FramePhase, FrameRequest, Interrupt, PartsPlan};
use holo_net::{Message, Outbox};
use holo_picture::{Picture, View, ViewSpec};
use holo_proto::{
    bulk::SampleSource,
    control::{Control, Status, Welcome},
};
use holo_raycast::Ray;
use holo_section::Section;
use serde::Serialize;

use ahead::Ahead;
pub use connect::{Again, Connected, is_lost, is_of_connection, starts_again};
pub use crew::{Crew, CrewMailbox, CrewOrder, Restarted, StatedOptions, crew};
pub use current_view::ArrivalCounts;
use current_view::{CurrentView, RequestedSamples};
use default_view::default_view;
pub use demand::Uncovered;
pub use driver_choice::{DriverArg, DriverChoice, LoadedScene, LoadedStandIn, SceneUse};
use haze::Haze;
pub use haze::HazeOption;
pub use holo_local_objects::ObjectPose;
pub use holo_net::RETURN_TIME;
use incoming::Incoming;
pub use light_change::{LightChange, NONE};
pub use motion::MovedObject;
use objects::SessionObjects;
pub use objects::{CarriedObjects, ObjectFolder, ObjectOrder, ObjectState, PoseChange};
use received::Received;
pub use scene_change::{PlacedModel, SceneChange};
pub use schedule::{FrameSchedule, FrameSize, scaled};
pub use velocity::EyeVelocity;
use velocity::RayDelay;
pub use waker::Waker;

/// Time after a deadline during which messages that have arrived are still processed. If the
/// deadline had passed before the wait began, the time is at least half the duration of the last
/// drawing.
const LATE: Duration = Duration::from_millis(20);

/// Longest time without any stored sample in which the server must settle. It gives up hanging
/// workers after some seconds.
const SETTLE_TIME: Duration = Duration::from_secs(60);

/// Duration of one stage of a picture.
#[derive(Clone, Debug, Serialize)]
pub struct StageTime {
    /// Its name, as in Walter et al. 2002, Table 1.
    pub stage: &'static str,
    /// Wall clock, milliseconds.
    pub milliseconds: f64,
}

/// What a session waits for when it settles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Settling {
    /// That everything under way for the view is stored.
    View,
    /// For the same, and then for the whole file.
    WholeFile,
    /// For the rest of the whole file.
    Loading,
}

/// A session with a server.
pub struct Session {
    welcome: Welcome,
    choice: Box<dyn DriverChoice>,
    /// The holodeck's sections.
    sections: Arc<[Section]>,
    driver: Driver,
    /// Ends the drawing of a frame at rest.
    interrupt: Interrupt,
    /// The scene, once it has arrived.
    scene: Option<Box<LoadedScene>>,
    /// Models that a person carries into the scene.
    objects: SessionObjects,
    outbox: Outbox,
    messages: mpsc::Receiver<Incoming>,
    /// Receives the results of searches.
    waker: Waker,
    current: Option<CurrentView>,
    /// Progress of loading the file.
    ahead: Ahead,
    /// True if nothing has been requested for the current view yet.
    is_unasked: bool,
    settling: Settling,
    /// True until the stored samples have arrived that were requested for a picture beside the
    /// current view.
    awaits_beside: bool,
    /// When stored samples last arrived.
    last_stored: Instant,
    /// Number of the latest request.
    request_number: u32,
    /// Duration of the last drawing.
    drawing: Duration,
    /// The eye's velocity, if it moves, so that the current view is soon replaced.
    velocity: Option<EyeVelocity>,
    /// The time that single rays are under way.
    ray_delay: RayDelay,
    /// True if tracing for this display is paused.
    is_paused: bool,
    /// The part of the picture on which tracing concentrates.
    focus: Option<[f64; 4]>,
    status: Option<Status>,
    /// The server's last refusal, with its reason.
    refusal: Option<String>,
    start: Instant,
    tasks: [tokio::task::JoinHandle<()>; 2],
}

/// Why a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waited {
    /// The deadline has passed.
    TimeUp,
    /// Everything under way has arrived.
    Settled,
    /// A [`Waker`] was used.
    Woken,
    /// The user wants to quit.
    Stop,
}

impl Drop for Session {
    fn drop(&mut self) {
        self.keep_objects();
        self.tasks.iter().for_each(tokio::task::JoinHandle::abort);
    }
}

impl Session {
    /// Returns the holodeck's named views, each as Radiance's options.
    pub fn named_views(&self) -> &[(String, String)] {
        &self.welcome.views
    }

    /// Returns the view that the holodeck begins with: its first named view, or the default view of
    /// its first section.
    ///
    /// # Errors
    /// If the holodeck's own view is malformed.
    pub fn first_view(&self) -> Result<ViewSpec> {
        let up = DVec3::from_array(self.welcome.up);
        if let Some((_, first)) = self.welcome.views.first() {
            let mut spec = ViewSpec { vu: Some(up), ..ViewSpec::default() };
            spec.apply_line(first).context("the holodeck's own view")?;
            return Ok(spec);
        }
        Ok(match self.sections.first() {
            Some(section) => default_view(section, up),
            None => ViewSpec { vu: Some(up), ..ViewSpec::default() },
        })
    }

    /// Returns when the current view was requested; before the first view, when the session began.
    pub fn since(&self) -> Instant {
        self.current.as_ref().map_or(self.start, |current| current.since)
    }

    /// Counts the session's seconds from `start`.
    pub fn start_clock(&mut self, start: Instant) {
        self.start = start;
    }

    /// Returns when the session's seconds began.
    pub fn start(&self) -> Instant {
        self.start
    }

    /// Returns the server's last report on its state.
    pub fn status(&self) -> Option<&Status> {
        self.status.as_ref()
    }

    /// Returns the driver's name.
    pub fn driver_name(&self) -> &'static str {
        self.driver.name
    }

    /// Returns how many samples have arrived for the current view.
    pub fn counts(&self) -> ArrivalCounts {
        self.current.as_ref().map_or_else(ArrivalCounts::default, |current| current.counts.clone())
    }

    /// Returns how many live rays have arrived for the current view.
    pub fn live_rays(&self) -> u64 {
        self.current
            .as_ref()
            .and_then(|current| current.live.as_ref())
            .map_or(0, live::LiveRays::arrived)
    }

    /// Returns how many beams the current view crosses.
    pub fn beams(&self) -> usize {
        self.current.as_ref().map_or(0, |current| current.wanted.len())
    }

    /// Returns whether there is a view.
    pub fn has_view(&self) -> bool {
        self.current.is_some()
    }

    /// Switches a part of the driver on or off. It stays so if the session makes its driver again.
    ///
    /// # Errors
    /// If the driver has no such part.
    pub fn switch(&mut self, part: &str, on: bool) -> Result<()> {
        if !self.driver.renderer.switch(part, on) {
            bail!(
                "driver {} has no part `{part}` to switch; `--driver pointimage` has parts",
                self.driver.name
            );
        }
        self.choice.switch(part, on);
        let parts = self.driver.parts.iter_mut().filter(|known| known.name == part);
        parts.for_each(|known| known.is_on = on);
        Ok(())
    }

    /// Returns the parts of the driver that can be switched.
    pub fn parts(&self) -> &[DriverPart] {
        &self.driver.parts
    }

    /// Returns the chosen driver with its options, and with the parts that are switched off.
    pub fn choice(&self) -> Box<dyn DriverChoice> {
        self.choice.clone()
    }

    /// Draws the current view with the samples that have arrived, and measures the driver's stages.
    /// There is no frame without a view, and if the frame was interrupted.
    pub fn draw(&mut self) -> (Option<Frame>, Vec<StageTime>) {
        let phase = self.current.as_ref().map_or(FramePhase::First, CurrentView::phase);
        self.draw_in(phase)
    }

    /// Draws as [`draw`](Self::draw) does, as well as the driver can. Nothing interrupts the frame.
    pub fn draw_for_file(&mut self) -> (Option<Frame>, Vec<StageTime>) {
        self.draw_in(FramePhase::File)
    }

    fn draw_in(&mut self, phase: FramePhase) -> (Option<Frame>, Vec<StageTime>) {
        let mut stages: Vec<StageTime> = Vec::new();
        let begin = Instant::now();
        let mut last = begin;
        let frame = self.driver.renderer.draw(phase, &self.interrupt, &mut |stage| {
            let now = Instant::now();
            let milliseconds = 1e3 * now.saturating_duration_since(last).as_secs_f64();
            last = now;
            match stages.iter_mut().find(|known| known.stage == stage) {
                Some(known) => known.milliseconds += milliseconds,
                None => stages.push(StageTime { stage, milliseconds }),
            }
        });
        self.drawing = begin.elapsed();
        let is_moving = self.is_moving();
        if let Some(view) = self.current.as_mut().filter(|_| frame.is_some()) {
            view.phases.note_frame();
            // A driver chooses rays best right after a frame. While the eye moves, the next frame
            // needs them.
            view.has_new_frame = is_moving;
        }
        let frame = frame.map(|frame| self.with_objects(frame, phase));
        (frame.map(|frame| self.in_haze(frame)), stages)
    }

    /// Plans a picture that is drawn in parts beside the current view, from the samples that have
    /// arrived. `None` if the driver cannot draw parts, or has no distances for haze.
    pub fn plan_parts(&mut self, look: &FrameRequest) -> Option<PartsPlan> {
        // Parts have no distances of their own.
        if self.haze().is_some() && self.scene.is_none() {
            return None;
        }
        self.driver.renderer.parts().map(|parts| parts.plan(look))
    }

    /// Draws these columns and rows of a planned picture. `None` if it was interrupted.
    pub fn draw_part(
        &mut self,
        plan: &PartsPlan,
        columns: Range<u32>,
        rows: Range<u32>,
    ) -> Option<Picture> {
        let view = plan.look.view.part(plan.look.size, columns.clone(), rows.clone());
        let part = self.driver.renderer.parts()?.part(plan, columns, rows, &self.interrupt)?;
        Some(self.finish_part(part, &view))
    }

    /// Returns the haze in which frames are shown, if any.
    fn haze(&self) -> Option<Haze> {
        self.choice.haze().map(|haze| haze.in_scene(self.welcome.unit, self.welcome.sky))
    }

    /// Adds haze to a finished frame.
    fn in_haze(&self, mut frame: Frame) -> Frame {
        if let Some(haze) = self.haze() {
            haze.veil(&mut frame);
        }
        frame
    }

    /// Returns the signal that ends the drawing of frames at rest and of parts.
    pub fn interrupt(&self) -> Interrupt {
        self.interrupt.clone()
    }

    /// Returns whether drawing again would improve the frame without any new samples.
    pub fn refines(&self) -> bool {
        self.driver.renderer.refines()
    }

    /// Lets the driver finish all work that improves the next frame without further samples.
    pub fn finish_view(&mut self) {
        self.settle_view();
        while self.driver.renderer.prepare(FramePhase::Rest) {}
    }

    /// Reports that all stored samples of the current view have arrived.
    fn settle_view(&mut self) {
        self.driver.renderer.settle();
        self.current.iter_mut().for_each(|current| current.phases.settle());
    }

    /// Does a piece of work for the next frame. Returns true if more is left.
    fn prepare(&mut self) -> bool {
        let phase = self.current.as_ref().map_or(FramePhase::First, CurrentView::phase);
        self.driver.renderer.prepare(phase)
    }

    /// Returns how many samples of the current view have arrived that were requested for it.
    pub fn view_samples(&self) -> u64 {
        let counts = self.counts();
        counts.stored + counts.traced + self.live_rays()
    }

    /// Returns how many samples have arrived since the current view was requested, including parts
    /// of the file and samples requested for earlier views.
    pub fn arrived_samples(&self) -> u64 {
        let counts = self.counts();
        self.view_samples() + counts.parts + counts.late
    }

    /// Returns how many samples of the view there are per pixel of a picture of this size.
    pub fn samples_per_pixel(&self, size: (u32, u32)) -> f64 {
        let samples = match self.has_whole_file() {
            true => self.samples_here(),
            false => self.view_samples(),
        };
        samples as f64 / (f64::from(size.0) * f64::from(size.1))
    }

    /// Returns true if all frames must have the same size, because the driver's pixels keep what
    /// they showed.
    pub fn keeps_pixels(&self) -> bool {
        self.driver.keeps_pixels
    }

    /// Returns whether samples of one view serve the next.
    fn keeps_samples(&self) -> bool {
        self.driver.light.room() > 0
    }

    /// Returns the triangle of the scene under the middle of a pixel of the current view. `None`
    /// if nothing is there, and if the driver does not draw from the scene.
    pub fn triangle_at(&self, column: u32, row: u32) -> Option<u32> {
        let (look, scene) = (self.current.as_ref()?.look, self.scene.as_ref()?);
        let (x, y) = View::pixel_centre(look.size, column, row);
        let (origin, direction, reach) = look.view.clipped_ray(x, y)?;
        let (ray, skipped) = scene.raycaster.localize(origin, direction)?;
        let ray = Ray { t_max: (reach - skipped) as f32, ..ray };
        let hit = scene.raycaster.nearest(&ray).filter(|_| self.driver.knows_surfaces);
        hit.map(|hit| hit.triangle)
    }

    /// Processes messages until `deadline`, and meanwhile sends the requests that are due.
    ///
    /// Messages that have arrived by then are still processed, but only for `LATE`, so that a
    /// server that never pauses does not delay the caller.
    ///
    /// # Errors
    /// If the server ends the session or is lost.
    pub fn wait(&mut self, deadline: Instant) -> Result<Waited> {
        self.wait_for(deadline, false)
    }

    /// Asks the server to stop tracing, and waits until everything under way has arrived and is
    /// stored. If `whole`, also loads the whole file, if there is room. A replay of the file then
    /// draws the same picture.
    ///
    /// # Errors
    /// If the server does not settle, or is lost.
    pub fn settle(&mut self, whole: bool) -> Result<()> {
        self.settling = if whole { Settling::WholeFile } else { Settling::View };
        self.ask_for_lights()?;
        self.settle_once()?;
        self.objects.note_settled();
        let Some(current) = &mut self.current else { return Ok(()) };
        current.fade(self.driver.light.as_mut());
        if current.received.earlier.is_stuck(true) {
            // Only a new driver of this kind shows none. Nothing more is traced for that.
            let was_paused = std::mem::replace(&mut self.is_paused, true);
            let again = self.make_driver().and_then(|()| self.settle_once());
            self.is_paused = was_paused;
            again?;
        }
        self.finish_view();
        Ok(())
    }

    fn settle_once(&mut self) -> Result<()> {
        self.ask_if_unasked()?;
        let loads = self.loads_whole_file() && self.settling != Settling::View;
        let Some(current) = &mut self.current else { return Ok(()) };
        if loads {
            // Loading the whole file replaces all other requests.
            current.asked = RequestedSamples::All;
            current.asks_later = false;
            current.also.clear();
        }
        let asks_on = std::mem::take(&mut current.asks_later);
        if asks_on || (self.welcome.tracing && !current.also.is_empty()) {
            // Samples of beams that the view does not cross may have been stored without being
            // sent.
            self.ask_for_all()?;
        }
        self.ask_to_settle()?;
        self.last_stored = Instant::now();
        // A large file takes its time, for as long as something of it arrives.
        while self.wait_for(self.last_stored + SETTLE_TIME, true)? == Waited::TimeUp {
            if self.last_stored.elapsed() >= SETTLE_TIME {
                let is_loading = self.settling == Settling::Loading;
                let what = if is_loading { "sent the file" } else { "settled" };
                self.settling = Settling::View;
                bail!("the server has not {what} for {} seconds", SETTLE_TIME.as_secs());
            }
        }
        Ok(())
    }

    fn wait_for(&mut self, deadline: Instant, for_settled: bool) -> Result<Waited> {
        let now = Instant::now();
        let late = if now > deadline { LATE.max(self.drawing / 2) } else { LATE };
        let last = deadline.max(now) + late;
        loop {
            let now = Instant::now();
            if now >= last {
                return Ok(Waited::TimeUp);
            }
            let next = self.ask_for_what_is_due(now, for_settled)?;
            let until = next.map_or(deadline, |next| next.min(deadline));
            let next = match self.messages.try_recv() {
                Err(mpsc::TryRecvError::Empty) => {
                    // A search uses the same threads and brings samples, so it goes first.
                    let is_searching =
                        self.current.as_ref().is_some_and(|current| current.is_searching);
                    if !is_searching && Instant::now() < until && self.prepare() {
                        continue;
                    }
                    self.messages.recv_timeout(until.saturating_duration_since(Instant::now()))
                }
                next => next.map_err(|_| mpsc::RecvTimeoutError::Disconnected),
            };
            match next {
                Ok(incoming) => {
                    if let Some(waited) = self.take(incoming, for_settled)? {
                        return Ok(waited);
                    }
                }
                Err(mpsc::RecvTimeoutError::Timeout) if Instant::now() >= deadline => {
                    return Ok(Waited::TimeUp);
                }
                // A request is due before the deadline.
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) => bail!("lost the server"),
            }
        }
    }

    /// Processes what has arrived. Returns why the wait ends, if it does.
    fn take(&mut self, incoming: Incoming, for_settled: bool) -> Result<Option<Waited>> {
        match incoming {
            Incoming::Message { message: Message::Control(message), .. } => {
                self.control(message, for_settled)
            }
            Incoming::Message { message, .. } => self.samples(message).map(|()| None),
            Incoming::SceneFetched { .. } | Incoming::ScenePreparing => Ok(None),
            Incoming::Scene(scene) => self.change_scene(scene).map(|()| None),
            Incoming::Object(loaded) => {
                self.take_object(*loaded);
                Ok(Some(Waited::Woken).filter(|_| !for_settled))
            }
            Incoming::Found { first_request, beams } => {
                self.ask_for_found(first_request, beams, for_settled).map(|()| None)
            }
            Incoming::Weighed { first_request, beams } => {
                if !for_settled {
                    self.ask_for_weighed(first_request, &beams)?;
                }
                Ok(None)
            }
            Incoming::Lost(error) => Err(error).context("lost the server"),
            Incoming::Wake => Ok((!for_settled).then_some(Waited::Woken)),
            Incoming::Stop => Ok(Some(Waited::Stop)),
        }
    }

    fn samples(&mut self, message: Message) -> Result<()> {
        let takes_late = self.keeps_samples() || self.driver.takes_late;
        let newest = self.request_number;
        let Driver { light, renderer, .. } = &mut self.driver;
        let current = self.current.as_mut();
        let is_of =
            |current: &CurrentView, number| (current.first_request..=newest).contains(&number);
        match message {
            Message::Samples(samples) => {
                self.objects.note_samples(samples.samples.len());
                if samples.source != SampleSource::Traced {
                    self.last_stored = Instant::now();
                }
                let counts = |current: &&mut CurrentView| {
                    matches!(samples.source, SampleSource::Part | SampleSource::Earlier)
                        || takes_late
                        || is_of(current, samples.view)
                };
                self.ray_delay.receive(&samples, Instant::now());
                if let Some(current) = current.filter(counts) {
                    current.insert(light.as_mut(), &samples);
                    if current.received.earlier.is_due() {
                        current.fade(light.as_mut());
                    }
                    if current.received.earlier.is_stuck(false) {
                        self.make_driver()?;
                    }
                }
            }
            Message::Unseen(unseen) => {
                if current.is_some_and(|current| is_of(current, unseen.view)) {
                    for &beam in &unseen.beams {
                        light.insert_unseen(beam);
                    }
                }
            }
            Message::LiveSamples(samples) => {
                if let Some(current) = current {
                    current.insert_live(renderer.as_mut(), &samples);
                }
            }
            _ => bail!("the server sent a message that is not for a display"),
        }
        Ok(())
    }

    fn control(&mut self, message: Control, for_settled: bool) -> Result<Option<Waited>> {
        match message {
            Control::Settled { view } if for_settled && view == self.request_number => {
                let is_enough = self.settling == Settling::View;
                if is_enough || !self.loads_whole_file() || self.has_all_of_replay() {
                    return Ok(Some(Waited::Settled));
                }
                self.settling = Settling::Loading;
                self.load_again()?;
            }
            Control::PartSent { section, next } => {
                let is_settled = self.part_sent(section, next)?;
                return Ok(is_settled.then_some(Waited::Settled));
            }
            Control::Bye(farewell) => bail!("the server ended the session: {farewell}"),
            Control::Status(status) => self.status = Some(status),
            Control::Views(views) => self.welcome.views = views,
            Control::Refused { reason } => self.refusal = Some(reason),
            Control::StoredSent { view } if view == self.request_number => {
                self.awaits_beside = false;
                self.current.iter_mut().for_each(|current| current.has_crossed = true);
                self.ask_on(for_settled)?;
            }
            _ => {}
        }
        Ok(None)
    }

    /// Changes to the driver that draws from the scene, because the scene has arrived late.
    fn change_scene(&mut self, scene: Result<Box<LoadedScene>>) -> Result<()> {
        let scene = match scene {
            Ok(scene) => scene,
            Err(error) if self.choice.scene_use() == SceneUse::Required => return Err(error),
            Err(_) => return Ok(()),
        };
        self.scene = Some(scene);
        let uses_scene = self.choice.scene_use() != SceneUse::None || self.welcome.sky_varies;
        if uses_scene { self.make_driver() } else { Ok(()) }
    }

    /// Creates the chosen driver again, and shows it the current view.
    fn make_driver(&mut self) -> Result<()> {
        let scene = self.scene.as_deref();
        let (sky, unit) = (driver_choice::sky_of(&self.welcome, scene), self.welcome.unit);
        self.driver = self.choice.make(&self.sections, sky, unit, scene);
        // Samples are sent again, so that the picture depends on them alone.
        self.choice.forget();
        self.objects.note_driver();
        self.ahead.restart();
        if let Some(current) = &mut self.current {
            current.received = Received::default();
        }
        self.show_again()
    }
}
