//! The hand: receives inputs, moves the eye, and at once shows what is known from there.
//!
//! It waits only for inputs. While the eye moves, it shows earlier frames from where the eye is
//! ([`super::warp`]). Meanwhile the painter ([`super::painter`]) draws new ones.

mod asked;
mod drop;

use std::{
    collections::VecDeque,
    sync::{Arc, mpsc},
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use glam::DVec3;
use holo_display::Frame;
use holo_picture::{DEFAULT_VH, View, ViewKind, ViewSpec};
use holo_raycast::Raycaster;
use holo_session::{
    CarriedObjects, Crew, DriverArg, EyeVelocity, SceneChange, StatedOptions, scaled,
};
use holo_walk::{Controls, Pose, Surroundings, Walker};
use tokio::sync::oneshot;

use super::{
    input::Numbered,
    painter::{Done, FrameRequests, News, Order, Painted, StageView},
    record::ScriptRecorder,
    shown::{PublishedFrame, Publisher, SceneLight, State},
    signal::ThreadSignal,
    warp::{Source, can_show, warp},
    wishes::Wishes,
    world::World,
};

/// The eye is at rest once it has not moved for this long. Inputs of a moving hand follow each
/// other faster. A person who moves on sees earlier frames until the frame at rest is ready.
const REST: Duration = Duration::from_millis(60);

/// Least time between two frames while the eye moves.
const FRAME: Duration = Duration::from_millis(20);

/// The share of each side of frames while the eye moves, before the painter has measured any.
const FIRST_SHARE: f64 = 0.5;

/// Longest step of a motion, seconds, so that the eye does not leap after a pause.
const LONGEST_STEP: f64 = 0.25;

/// After a jump, a picture with a greater unknown share is held back and the picture before stays.
const MOST_UNKNOWN: f64 = 0.4;

/// Time after a jump from which any picture is shown.
const MOST_PATIENCE: Duration = Duration::from_secs(1);

/// Interval at which the state is published.
const STATE: Duration = Duration::from_millis(250);

/// Time over which the eye's motion is measured, to predict where the eye will be.
const MOTION: Duration = Duration::from_millis(100);

/// Longest time for which the motion is extrapolated.
const MOST_AHEAD: Duration = Duration::from_millis(250);

/// Time for which the reason of a refusal is shown.
const REFUSAL: Duration = Duration::from_secs(8);

/// Time for which a question can be answered.
const ANSWER: Duration = Duration::from_secs(15);

/// What is said while a scene is read again.
const READING: &str = "reading the scene again; the one before is shown until then";

/// What somebody has to confirm by doing it once more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
    /// Whether all samples are to be forgotten.
    StartOver,
    /// Whether the scene is to be read again.
    Restart,
    /// Whether the eye is to leave the house.
    Leave,
}

impl Question {
    /// Returns the question, for people.
    fn words(self) -> &'static str {
        match self {
            Question::StartOver => "Start over? All samples of this holodeck are forgotten.",
            Question::Leave => {
                "Leave the house? Outside, less is known of the light, and you may lose your way. \
                 Home and Back return."
            }
            Question::Restart => {
                "Restart with the scene as its file is now? If it was edited, the samples of the \
                 scene before give way to new ones."
            }
        }
    }

    /// Returns the line that confirms it.
    fn answer(self) -> &'static str {
        match self {
            Question::StartOver => "start over",
            Question::Restart => "restart",
            Question::Leave => "leave",
        }
    }
}

/// Takes inputs and shows frames.
pub struct Hand {
    walker: Walker,
    inputs: mpsc::Receiver<Numbered>,
    signal: Arc<ThreadSignal>,
    /// The painter's desk, while there is a painter.
    desk: Option<FrameRequests>,
    crew: Option<Crew>,
    /// The scene, if it is known.
    scene: Option<Arc<Raycaster>>,
    /// The open question, and when it was asked.
    question: Option<(Question, Instant)>,
    /// The driver that the user has chosen last.
    driver: Option<DriverArg>,
    /// The view that was removed last, with its name.
    removed_view: Option<(String, String)>,
    /// The answer of the crew that reads the scene again.
    scene_read: Option<oneshot::Receiver<Result<()>>>,
    /// The change with which it reads it.
    scene_change: SceneChange,
    /// The objects that are carried.
    objects: CarriedObjects,
    /// Groups of the scene's lamps, once the scene is known.
    lamp_groups: Option<Vec<String>>,
    /// The light that those groups and this statement say.
    light: Option<(Arc<StatedOptions>, Arc<SceneLight>)>,
    /// Why the hand ends, once it does.
    ending: Option<HandEnding>,
    publisher: Publisher,
    record: Option<ScriptRecorder>,
    /// Most columns and rows of the picture at rest.
    size: (u32, u32),
    cursor: Option<(f64, f64)>,
    /// The part of the picture that is traced first, until the eye moves.
    focus: Option<[f64; 4]>,
    /// The last input that was processed.
    input: (u32, u64),
    /// Why the last refused input was refused, and since when the reason is shown.
    refusal: Option<(String, Instant)>,
    news: News,
    /// The share of each side that frames have while the eye moves.
    moving_share: Option<f64>,
    /// Frames that can be shown from elsewhere while the eye moves, the newest first.
    sources: VecDeque<Painted>,
    /// A frame that is not shown yet, because too much of it is unknown.
    held_back: Option<Painted>,
    /// Number of jumps of the eye to another view.
    jumps: u64,
    /// True if no picture has been shown since the last jump.
    awaits_jump: bool,
    /// The last published frame.
    last: Option<Arc<PublishedFrame>>,
    /// True if the painter has drawn a frame that the last published one does not show.
    has_news: bool,
    /// Recent positions of the eye.
    trail: VecDeque<(Instant, Pose)>,
    times: InputTimes,
    facts: State,
}

/// Why a hand has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HandEnding {
    /// The user quits, or the painter has ended.
    Quit,
    /// All samples are to be forgotten.
    StartOver,
    /// An edited scene was read, with which the session is to go on.
    Restart,
}

/// Times of the last events.
struct InputTimes {
    advanced: Instant,
    moved: Instant,
    jumped: Instant,
    /// When the last frame was published.
    frame: Instant,
    state: Instant,
    /// When the eye last came to the end of the house.
    exit: Option<Instant>,
    /// Time that the painter took for its last frame while the eye moved.
    painting: Duration,
}

impl Hand {
    /// Returns a hand that begins with the view `first`, in a scene whose unit is `unit` metres
    /// long.
    ///
    /// # Errors
    /// If `first` is malformed.
    pub fn new(
        first: ViewSpec,
        unit: f64,
        wishes: &Wishes,
        objects: CarriedObjects,
        inputs: mpsc::Receiver<Numbered>,
        signal: Arc<ThreadSignal>,
        publisher: Publisher,
    ) -> Result<Hand> {
        let size = wishes.view.size();
        first.resolve(size).context("the first view")?;
        let walker = Walker::new(first, unit).context("the first view has no direction")?;
        let now = Instant::now();
        let times = InputTimes {
            advanced: now,
            // The first frame is due at once.
            moved: now,
            jumped: now,
            frame: now,
            state: now,
            exit: None,
            painting: Duration::ZERO,
        };
        Ok(Hand {
            walker,
            inputs,
            signal,
            desk: None,
            crew: wishes.crew.clone(),
            scene: None,
            question: None,
            driver: None,
            removed_view: None,
            scene_read: None,
            scene_change: SceneChange::default(),
            objects,
            lamp_groups: None,
            light: None,
            ending: None,
            publisher,
            record: wishes.record.as_deref().map(ScriptRecorder::create).transpose()?,
            size,
            cursor: None,
            focus: None,
            input: (0, 0),
            refusal: None,
            news: News::default(),
            moving_share: None,
            sources: VecDeque::new(),
            held_back: None,
            jumps: 0,
            awaits_jump: false,
            last: None,
            has_news: false,
            trail: VecDeque::new(),
            times,
            facts: State::default(),
        })
    }

    /// Shows a painter's frames until the user ends it or the painter ends. `facts` is the part of
    /// the state that stays constant meanwhile. Returns how the user has ended it; `None` if the
    /// painter ended.
    ///
    /// # Errors
    /// If the walk cannot be recorded.
    pub fn play(&mut self, desk: FrameRequests, facts: State) -> Result<Option<HandEnding>> {
        (self.desk, self.facts, self.ending) = (Some(desk), facts, None);
        (self.sources, self.held_back, self.has_news) = (VecDeque::new(), None, false);
        self.walker.stay();
        // A new session has the driver of the options, and traces.
        if let Some(driver) = self.driver {
            self.order(Order::Driver(driver));
        }
        if self.news.is_paused {
            self.order(Order::Pause(true));
        }
        self.want();
        loop {
            let before = *self.walker.view();
            if self.ending.is_none() {
                self.take_scene();
                self.take_inputs();
                match self.ending {
                    Some(HandEnding::Quit) => self.order(Order::Quit),
                    Some(HandEnding::StartOver | HandEnding::Restart) => self.order(Order::Leave),
                    None => {}
                }
            }
            self.advance();
            self.ask_at_exit();
            if *self.walker.view() != before {
                self.has_moved();
            }
            let Some(done) = self.desk.as_ref().map(FrameRequests::take) else { break };
            let is_over = done.is_over;
            self.take_frames(done)?;
            if is_over {
                break;
            }
            self.show_from_here()?;
            self.want();
            self.publish_state();
            self.signal.wait(self.next_due());
        }
        self.publish_state();
        Ok(self.ending)
    }

    /// Ends the recording of the walk.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn end(mut self) -> Result<()> {
        match &mut self.record {
            Some(record) => record.end(Instant::now()),
            None => Ok(()),
        }
    }

    fn order(&self, order: Order) {
        if let Some(desk) = &self.desk {
            desk.order(order);
        }
    }

    /// Moves the eye by the controls that are held down.
    fn advance(&mut self) {
        let now = Instant::now();
        let seconds = now.saturating_duration_since(self.times.advanced).as_secs_f64();
        self.times.advanced = now;
        let (under, towards) = self.under_cursor();
        self.walker.advance(seconds.min(LONGEST_STEP), under, towards);
    }

    fn has_moved(&mut self) {
        let now = Instant::now();
        self.times.moved = now;
        self.focus = None;
        self.trail.push_back((now, *self.walker.pose()));
        let is_old = |(at, _): &(Instant, Pose)| now.saturating_duration_since(*at) > MOTION;
        while self.trail.len() > 1 && self.trail.front().is_some_and(is_old) {
            self.trail.pop_front();
        }
    }

    /// Takes the scene as the eye's surroundings.
    fn see_world(&mut self, scene: Option<Arc<Raycaster>>) {
        let is_same = match (&self.scene, &scene) {
            (Some(before), Some(now)) => Arc::ptr_eq(before, now),
            (before, now) => before.is_none() && now.is_none(),
        };
        if !is_same {
            let sections = &self.facts.sections;
            let world = |scene: &Arc<Raycaster>| -> Arc<dyn Surroundings> {
                Arc::new(World::new(Arc::clone(scene), sections, self.walker.metre()))
            };
            self.walker.surroundings = scene.as_ref().map(world);
            if let Some(scene) = &scene {
                (self.lamp_groups, self.light) = (Some(scene.scene().lamp_groups()), None);
            }
            self.scene = scene;
        }
    }

    /// Asks whether the eye is to leave the house, if a motion would. After a no, the question
    /// returns only after a while.
    fn ask_at_exit(&mut self) {
        if !self.walker.take_exit() {
            return;
        }
        let is_late = self.times.exit.is_none_or(|asked| asked.elapsed() >= ANSWER);
        if self.question.is_none() && is_late {
            let now = Instant::now();
            (self.question, self.times.exit) = (Some((Question::Leave, now)), Some(now));
            // A key that is held would go on after the answer.
            self.walker.controls = Controls::default();
        }
    }

    /// Processes all waiting inputs, until one ends the session.
    fn take_inputs(&mut self) {
        while self.ending.is_none()
            && let Ok(Numbered { from, input }) = self.inputs.try_recv()
        {
            self.input = from;
            self.take(input);
        }
    }

    /// Returns the point under the cursor, if a frame knows it, and the direction of its ray. If
    /// the cursor is outside, the middle of the picture counts.
    fn under_cursor(&self) -> (Option<DVec3>, DVec3) {
        let Some(last) = &self.last else { return (None, self.walker.pose().direction) };
        let (x, y) = self.cursor.unwrap_or((0.5, 0.5));
        let (origin, towards) = last.view.ray(x, 1.0 - y);
        if let Some(world) = &self.walker.surroundings
            && !last.view.is_clipped()
            && towards != DVec3::ZERO
        {
            // A frame knows what a mirror or a pane shows, but not where its glass is.
            let surface = world.surface(origin, towards);
            return (surface.map(|surface| origin + towards * surface.distance), towards);
        }
        let known = last.radiance_at(x, y).map(|(_, distance)| f64::from(distance));
        let known = known.filter(|distance| *distance > 0.0 && distance.is_finite());
        (known.map(|distance| origin + towards * distance), towards)
    }

    fn is_moving(&self) -> bool {
        self.walker.controls.moves() || self.times.moved.elapsed() < REST
    }

    /// Requests a view from the painter: while the eye moves, from where the eye will be when the
    /// frame is ready.
    fn want(&self) {
        let is_moving = self.is_moving();
        let spec = if is_moving { self.ahead() } else { self.spec() };
        let (size, jumps) = (self.size, self.jumps);
        if let Some(desk) = &self.desk {
            let velocity = if is_moving { self.velocity() } else { EyeVelocity::default() };
            let focus = self.focus;
            desk.want(StageView { spec, size, is_moving, velocity, jumps, focus });
        }
    }

    /// Returns the view for the picture's shape.
    fn spec(&self) -> ViewSpec {
        framed(self.walker.view(), self.size)
    }

    /// Returns the eye's velocity over its recent positions.
    fn velocity(&self) -> EyeVelocity {
        let Some((since, before)) = self.trail.front() else { return EyeVelocity::default() };
        let over = self.times.moved.saturating_duration_since(*since).as_secs_f64();
        let now = self.walker.pose();
        let [before, now] = [before, now].map(|pose| [pose.eye, pose.direction]);
        EyeVelocity::between(before, now, over)
    }

    /// Returns where the eye will be after the duration of a frame, if its motion continues.
    fn ahead(&self) -> ViewSpec {
        let now = self.spec();
        let Some((since, before)) = self.trail.front() else { return now };
        let over = self.times.moved.saturating_duration_since(*since).as_secs_f64();
        if over <= 0.0 {
            return now;
        }
        let lead = self.times.painting.min(MOST_AHEAD).as_secs_f64();
        let ahead = framed(&self.walker.ahead(before, lead / over), self.size);
        if ahead.resolve(self.size).is_ok() { ahead } else { now }
    }

    /// Processes the painter's results.
    fn take_frames(&mut self, done: Done) -> Result<()> {
        self.news = done.news;
        self.see_world(done.scene);
        if let Some(refusal) = done.refusal {
            self.refuse(refusal);
        }
        self.moving_share = done.moving_share.or(self.moving_share);
        if let Some(painted) = done.painted.filter(|painted| painted.wanted.jumps == self.jumps) {
            if painted.wanted.is_moving {
                self.times.painting = painted.took.iter().sum();
            }
            self.held_back = Some(painted);
        }
        let waits = |painted: &Painted| {
            self.awaits_jump
                && unknown(&painted.frame) > MOST_UNKNOWN
                && self.last.is_some()
                && self.trail.is_empty()
                && self.times.jumped.elapsed() < MOST_PATIENCE
        };
        match self.held_back.take_if(|painted| !waits(painted)) {
            Some(painted) => self.show(painted),
            None => Ok(()),
        }
    }

    /// Shows a frame of the painter. If the eye has moved, keeps it as a source for pictures from
    /// the current position.
    fn show(&mut self, painted: Painted) -> Result<()> {
        self.awaits_jump = false;
        // A frame of an earlier size may have another shape.
        let is_of_now = painted.wanted.spec == self.spec() && painted.wanted.size == self.size;
        let is_resting = is_of_now && !painted.has_few;
        let cannot_wait =
            self.spec().resolve(self.size).is_ok_and(|(view, _)| !can_show(&painted.view, &view));
        let cannot_wait = cannot_wait || painted.frame.is_stereo;
        self.sources.push_front(painted.clone());
        self.sources.truncate(2);
        if is_resting || cannot_wait {
            let took = painted.took.map(|took| took.as_secs_f64());
            self.publish(painted.view, painted.frame, is_resting, took)?;
            if is_resting {
                self.walker.stay();
            }
        } else {
            self.has_news = true;
            self.show_from_here()?;
        }
        Ok(())
    }

    /// Shows what is known from the current position of the eye, unless that is shown already.
    fn show_from_here(&mut self) -> Result<()> {
        let Ok((view, full)) = self.spec().resolve(self.size) else { return Ok(()) };
        let is_whole = |last: &PublishedFrame| last.is_at_rest && last.frame.picture.size() == full;
        let shows =
            |last: &Arc<PublishedFrame>| last.view == view && (is_whole(last) || !self.has_news);
        let is_shown = self.last.as_ref().is_some_and(shows);
        let is_soon = Instant::now() < self.times.frame + FRAME;
        let is_hidden = self.news.is_uncovered || self.news.trouble.is_some();
        if is_shown || is_soon || is_hidden || self.awaits_jump {
            return Ok(());
        }
        // The pixels of two eyes are not those of one view.
        let is_source =
            |source: &&Painted| can_show(&source.view, &view) && !source.frame.is_stereo;
        let sources = self.sources.iter().filter(is_source);
        let sources: Vec<Source<'_>> =
            sources.map(|source| Source { view: &source.view, frame: &source.frame }).collect();
        let begin = Instant::now();
        let size = scaled(full, self.moving_share.unwrap_or(FIRST_SHARE));
        let Some(frame) = warp(&sources, &view, size) else { return Ok(()) };
        let took = begin.elapsed().as_secs_f64();
        self.publish(view, Arc::new(frame), false, [took, 0.0])
    }

    fn publish(
        &mut self,
        view: View,
        frame: Arc<Frame>,
        is_at_rest: bool,
        took: [f64; 2],
    ) -> Result<()> {
        let now = Instant::now();
        self.times.frame = now;
        self.has_news = false;
        let spec = *self.walker.view();
        let options = holo_walk::options(&spec);
        let input = self.input;
        let shown =
            PublishedFrame { number: 0, input, view, options, frame, is_at_rest, took, done: now };
        self.last = Some(self.publisher.frame(shown));
        match &mut self.record {
            Some(record) => record.view(&spec, now, is_at_rest),
            None => Ok(()),
        }
    }

    /// Returns when the hand must act next, unless the signal is raised before.
    fn next_due(&self) -> Instant {
        let now = Instant::now();
        let is_shown = self.last.as_ref().is_some_and(|last| last.is_at_rest);
        if self.walker.controls.moves() {
            now.max(self.times.frame + FRAME)
        } else if self.is_moving() || !is_shown {
            now + FRAME
        } else {
            now + STATE
        }
    }

    /// Returns the scene's light, if it is known and the crew can change it.
    fn light(&mut self) -> Option<Arc<SceneLight>> {
        let stated = self.crew.as_ref()?.stated();
        let groups = self.lamp_groups.as_ref()?;
        let is_of_now = |(of, _): &(Arc<StatedOptions>, _)| Arc::ptr_eq(of, &stated);
        if !self.light.as_ref().is_some_and(is_of_now) {
            let light = Arc::new(SceneLight::new(groups, &stated));
            self.light = Some((stated, light));
        }
        self.light.as_ref().map(|(_, light)| Arc::clone(light))
    }

    /// Publishes the state, unless that was done a moment ago.
    fn publish_state(&mut self) {
        let now = Instant::now();
        if now < self.times.state + STATE {
            return;
        }
        self.times.state = now;
        self.refusal.take_if(|(_, since)| since.elapsed() >= REFUSAL);
        self.question = self.question.filter(|(_, since)| since.elapsed() < ANSWER);
        let reading = self.scene_read.as_ref().map(|_| READING.to_owned());
        let refusal = self.refusal.as_ref().map(|(refusal, _)| refusal.clone());
        let light = self.light();
        let pose = self.walker.pose();
        let news = self.news.clone();
        self.publisher.state(State {
            light,
            is_uncovered: news.is_uncovered,
            trouble: news.trouble.or(reading).or(refusal),
            views: news.views,
            focus: self.focus,
            question: self.question.map(|(question, _)| question.words().to_owned()),
            answer: self.question.map(|(question, _)| question.answer()),
            has_crew: self.crew.is_some(),
            options: holo_walk::options(self.walker.view()),
            pose: [pose.eye, pose.direction, pose.up].map(|vector| vector.to_array()),
            height_is_locked: self.walker.height_is_locked,
            is_solid: self.walker.is_solid,
            is_paused: news.is_paused,
            saving: news.saving,
            view_samples: news.view_samples,
            gleams: news.gleams,
            samples: news.samples,
            samples_per_second: news.samples_per_second,
            workers: news.workers,
            driver: news.driver,
            parts: news.parts,
            ..self.facts.clone()
        });
    }
}

/// Returns a view for a picture of a shape. If the picture is higher than wide, a stated width of a
/// perspective view is its height instead: on a phone that is held upright, 75° across would be
/// 107° from top to bottom.
fn framed(spec: &ViewSpec, size: (u32, u32)) -> ViewSpec {
    let is_perspective = spec.kind.unwrap_or_default() == ViewKind::Perspective;
    if is_perspective && size.1 > size.0 && spec.vv.is_none() {
        return ViewSpec { vh: None, vv: Some(spec.vh.unwrap_or(DEFAULT_VH)), ..*spec };
    }
    *spec
}

/// Returns the share of a frame's pixels without known light.
fn unknown(frame: &Frame) -> f64 {
    frame.empty_pixels as f64 / frame.depth.len().max(1) as f64
}
