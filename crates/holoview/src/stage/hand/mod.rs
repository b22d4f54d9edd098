//! The hand: takes inputs, moves the eye, and shows at once what is known of where it is.
//!
//! It waits for inputs and for nothing else. While the eye moves, it shows earlier frames from where
//! the eye is ([`super::warp`]). The painter ([`super::painter`]) draws new ones meanwhile.

mod asked;

use std::{
    collections::VecDeque,
    sync::{Arc, mpsc},
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use glam::DVec3;
use holo_display::Frame;
use holo_picture::{View, ViewSpec};
use holo_walk::{Pose, Walker};
use tokio::sync::oneshot;

use super::{
    bell::Bell,
    input::Numbered,
    painter::{Desk, Done, News, Order, Painted, Wanted},
    record::Record,
    shown::{Publisher, Shown, State},
    warp::{Source, can_show, warp},
};
use crate::Crew;

/// The eye rests once it has not moved for so long. Inputs of a moving hand follow each other
/// faster. Whoever moves on sees earlier frames until the frame at rest is done.
const REST: Duration = Duration::from_millis(60);

/// Least time between two frames while the eye moves.
const FRAME: Duration = Duration::from_millis(20);

/// Longest step of a motion, seconds: after a pause one moves on, not ahead.
const LONGEST_STEP: f64 = 0.25;

/// Unknown share of a picture that is too much for a view to which one jumps: the picture before
/// stays.
const MOST_UNKNOWN: f64 = 0.4;

/// Time after a jump when any picture is shown.
const MOST_PATIENCE: Duration = Duration::from_secs(1);

/// How often the state is published.
const STATE: Duration = Duration::from_millis(250);

/// Time over which the eye's motion is measured, to know where it will be.
const MOTION: Duration = Duration::from_millis(100);

/// Longest time for which the motion is taken to go on.
const MOST_AHEAD: Duration = Duration::from_millis(250);

/// How long it is said why something was not done.
const REFUSAL: Duration = Duration::from_secs(8);

/// How long a question waits for its answer.
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
}

impl Question {
    /// Returns the question, for people.
    fn words(self) -> &'static str {
        match self {
            Question::StartOver => "Start over? All samples of this holodeck are forgotten.",
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
        }
    }
}

/// Takes inputs and shows frames.
pub struct Hand {
    walker: Walker,
    inputs: mpsc::Receiver<Numbered>,
    bell: Arc<Bell>,
    /// The painter's desk, while there is one.
    desk: Option<Desk>,
    crew: Option<Crew>,
    /// What was asked, and when.
    question: Option<(Question, Instant)>,
    /// The answer of the crew that reads the scene again.
    scene_read: Option<oneshot::Receiver<Result<()>>>,
    /// Why this ends, once it does.
    ending: Option<Ending>,
    publisher: Publisher,
    record: Option<Record>,
    /// The picture at rest, pixels at the most.
    size: (u32, u32),
    cursor: Option<(f64, f64)>,
    /// The part of the picture that is traced first, until the eye moves.
    focus: Option<[f64; 4]>,
    /// The last input that was taken.
    input: (u32, u64),
    /// Why the last thing that was asked for is not done, and since when that is said.
    refusal: Option<(String, Instant)>,
    news: News,
    /// The size of frames while the eye moves.
    moving_size: Option<(u32, u32)>,
    /// Frames that are shown from elsewhere while the eye moves, the newest first.
    sources: VecDeque<Painted>,
    /// A frame that is not shown yet, because it shows less than the one before.
    held_back: Option<Painted>,
    /// How often the eye has gone somewhere without walking there.
    jumps: u64,
    /// Whether nothing is shown yet of where it went.
    awaits_jump: bool,
    /// The last frame that was published.
    last: Option<Arc<Shown>>,
    /// Whether the painter has drawn a frame that it does not show yet.
    has_news: bool,
    /// Where the eye was a moment ago.
    trail: VecDeque<(Instant, Pose)>,
    times: Times,
    facts: State,
}

/// Why a hand has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Somebody quits, or the painter has ended.
    Quit,
    /// All samples are to be forgotten.
    StartOver,
    /// An edited scene was read, with which the session is to go on.
    Restart,
}

/// When things happened last.
struct Times {
    advanced: Instant,
    moved: Instant,
    jumped: Instant,
    /// When the last frame was published.
    frame: Instant,
    state: Instant,
    /// How long the painter took for its last frame while the eye moved.
    painting: Duration,
}

impl Hand {
    /// Returns a hand that begins with the view `first`, in a scene whose unit is `unit` metres
    /// long.
    ///
    /// # Errors
    /// If `first` is no view.
    pub fn new(
        first: ViewSpec,
        unit: f64,
        wishes: &super::Wishes,
        inputs: mpsc::Receiver<Numbered>,
        bell: Arc<Bell>,
        publisher: Publisher,
    ) -> Result<Hand> {
        let size = wishes.view.size();
        first.resolve(size).context("the first view")?;
        let walker = Walker::new(first, unit).context("the first view has no direction")?;
        let now = Instant::now();
        let times = Times {
            advanced: now,
            // The first frame is to be there soon.
            moved: now,
            jumped: now,
            frame: now,
            state: now,
            painting: Duration::ZERO,
        };
        Ok(Hand {
            walker,
            inputs,
            bell,
            desk: None,
            crew: wishes.crew.clone(),
            question: None,
            scene_read: None,
            ending: None,
            publisher,
            record: wishes.record.as_deref().map(Record::create).transpose()?,
            size,
            cursor: None,
            focus: None,
            input: (0, 0),
            refusal: None,
            news: News::default(),
            moving_size: None,
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

    /// Shows views of a painter until somebody ends it or the painter ends. `facts` is what never
    /// changes meanwhile. Returns how somebody has ended it.
    ///
    /// # Errors
    /// If the walk cannot be recorded.
    pub fn play(&mut self, desk: Desk, facts: State) -> Result<Option<Ending>> {
        (self.desk, self.facts, self.ending) = (Some(desk), facts, None);
        (self.sources, self.held_back, self.has_news) = (VecDeque::new(), None, false);
        self.walker.stay();
        self.want();
        loop {
            let before = *self.walker.view();
            if self.ending.is_none() {
                self.take_scene();
                self.take_inputs();
                match self.ending {
                    Some(Ending::Quit) => self.order(Order::Quit),
                    Some(Ending::StartOver | Ending::Restart) => self.order(Order::Leave),
                    None => {}
                }
            }
            self.advance();
            if *self.walker.view() != before {
                self.has_moved();
            }
            let Some(done) = self.desk.as_ref().map(Desk::take) else { break };
            let is_over = done.is_over;
            self.take_frames(done)?;
            if is_over {
                break;
            }
            self.show_from_here()?;
            self.want();
            self.publish_state();
            self.bell.wait(self.next_due());
        }
        self.publish_state();
        Ok(self.ending)
    }

    /// Ends the record of the walk.
    ///
    /// # Errors
    /// If it cannot be written.
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

    /// Moves by what is held.
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

    /// Takes all inputs that wait, until one ends this.
    fn take_inputs(&mut self) {
        while self.ending.is_none()
            && let Ok(Numbered { from, input }) = self.inputs.try_recv()
        {
            self.input = from;
            self.take(input);
        }
    }

    /// Returns the point under the cursor, if a frame knows it, and the direction of its ray. In
    /// the middle of the picture if the cursor is elsewhere.
    fn under_cursor(&self) -> (Option<DVec3>, DVec3) {
        let Some(last) = &self.last else { return (None, self.walker.pose().direction) };
        let (x, y) = self.cursor.unwrap_or((0.5, 0.5));
        let (origin, towards) = last.view.ray(x, 1.0 - y);
        let known = last.radiance_at(x, y).map(|(_, distance)| f64::from(distance));
        let known = known.filter(|distance| *distance > 0.0 && distance.is_finite());
        (known.map(|distance| origin + towards * distance), towards)
    }

    fn is_moving(&self) -> bool {
        self.walker.controls.moves() || self.times.moved.elapsed() < REST
    }

    /// Says which view is wanted: while the eye moves, the one where it will be when the frame is
    /// there.
    fn want(&self) {
        let is_moving = self.is_moving();
        let spec = if is_moving { self.ahead() } else { *self.walker.view() };
        let (size, jumps) = (self.size, self.jumps);
        if let Some(desk) = &self.desk {
            desk.want(Wanted { spec, size, is_moving, jumps, focus: self.focus });
        }
    }

    /// Returns where the eye will be after the time that a frame takes, if it goes on so.
    fn ahead(&self) -> ViewSpec {
        let now = *self.walker.view();
        let Some((since, before)) = self.trail.front() else { return now };
        let over = self.times.moved.saturating_duration_since(*since).as_secs_f64();
        if over <= 0.0 {
            return now;
        }
        let lead = self.times.painting.min(MOST_AHEAD).as_secs_f64();
        let ahead = self.walker.ahead(before, lead / over);
        if ahead.resolve(self.size).is_ok() { ahead } else { now }
    }

    /// Takes what the painter has done.
    fn take_frames(&mut self, done: Done) -> Result<()> {
        self.news = done.news;
        if let Some(refusal) = done.refusal {
            self.refuse(refusal);
        }
        self.moving_size = done.moving_size.or(self.moving_size);
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

    /// Shows a frame of the painter, or keeps it to be shown from where the eye is by now.
    fn show(&mut self, painted: Painted) -> Result<()> {
        self.awaits_jump = false;
        let is_of_now = painted.wanted.spec == *self.walker.view();
        let is_resting = is_of_now && !painted.has_few;
        let cannot_wait = self
            .walker
            .view()
            .resolve(self.size)
            .is_ok_and(|(view, _)| !can_show(&painted.view, &view));
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

    /// Shows what is known from where the eye is, if that is not shown yet.
    fn show_from_here(&mut self) -> Result<()> {
        let Ok((view, full)) = self.walker.view().resolve(self.size) else { return Ok(()) };
        let shows = |last: &Arc<Shown>| last.view == view && (last.is_at_rest || !self.has_news);
        let is_shown = self.last.as_ref().is_some_and(shows);
        let is_soon = Instant::now() < self.times.frame + FRAME;
        let is_hidden = self.news.is_uncovered || self.news.trouble.is_some();
        if is_shown || is_soon || is_hidden || self.awaits_jump {
            return Ok(());
        }
        let sources = self.sources.iter().filter(|source| can_show(&source.view, &view));
        let sources: Vec<Source<'_>> =
            sources.map(|source| Source { view: &source.view, frame: &source.frame }).collect();
        let begin = Instant::now();
        let size = self.moving_size.unwrap_or((full.0.div_ceil(2), full.1.div_ceil(2)));
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
        let shown = Shown { number: 0, input, view, options, frame, is_at_rest, took, done: now };
        self.last = Some(self.publisher.frame(shown));
        match &mut self.record {
            Some(record) => record.view(&spec, now, is_at_rest),
            None => Ok(()),
        }
    }

    /// Returns until when the hand waits, unless the bell rings.
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

    /// Publishes how things are, unless that was done a moment ago.
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
        let pose = self.walker.pose();
        let news = self.news.clone();
        self.publisher.state(State {
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
            is_paused: news.is_paused,
            view_samples: news.view_samples,
            samples: news.samples,
            samples_per_second: news.samples_per_second,
            workers: news.workers,
            driver: news.driver,
            ..self.facts.clone()
        });
    }
}

/// Returns the share of a frame's pixels of which nothing is known.
fn unknown(frame: &Frame) -> f64 {
    frame.empty_pixels as f64 / frame.depth.len().max(1) as f64
}
