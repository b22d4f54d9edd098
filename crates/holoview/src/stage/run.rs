//! The stage's loop: inputs, then the eye, then a frame, then what the server sent.

use std::{
    sync::{Arc, mpsc},
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use glam::DVec3;
use holo_display::{Frame, Look, Resolution};
use holo_net::NetError;
use holo_picture::ViewSpec;
use holo_walk::Walker;

use super::{
    detail::Detail,
    input::{Input, Numbered},
    record::Record,
    shown::{Phase, Publisher, Shown, State},
};
use crate::session::{Session, Uncovered, Waited};

/// The eye rests once it has not moved for so long. Inputs of a moving hand follow each other
/// faster. Whoever moves on after it has to wait for the frame at rest.
const REST: Duration = Duration::from_millis(80);

/// Least time between the beginnings of two frames while the eye moves: screens show no more.
const FRAME: Duration = Duration::from_millis(16);

/// Longest step of a motion, seconds: after a frame that took longer, one moves on, not ahead.
const LONGEST_STEP: f64 = 0.25;

/// Least time between two frames of a view at rest.
const REDRAW: Duration = Duration::from_millis(100);

/// Longest time between two frames of a view at rest for which samples come.
const LATEST_REDRAW: Duration = Duration::from_secs(2);

/// Pause between frames at rest, as a share of the time since the eye moved. The longer one looks,
/// the less a moment's samples change.
const REDRAW_SHARE: f64 = 0.1;

/// Frames at rest take at most one part in so many of the time: the rest is for tracing.
const DRAWING_PART: u32 = 4;

/// Unknown share of a picture that is too much for a view to which one jumps: the picture before
/// stays.
const MOST_UNKNOWN: f64 = 0.4;

/// Time after a jump when any picture is shown.
const MOST_PATIENCE: Duration = Duration::from_secs(1);

/// How often the stage looks for news of the server while it rests.
const NEWS: Duration = Duration::from_millis(100);

/// How often the state is published.
const STATE: Duration = Duration::from_millis(250);

/// Largest picture, pixels: four of a usual screen.
const MOST_PIXELS: u64 = 1 << 23;

/// Runs a stage whose session has begun.
pub struct Player {
    session: Session,
    walker: Walker,
    inputs: mpsc::Receiver<Numbered>,
    publisher: Publisher,
    record: Option<Record>,
    detail: Detail,
    /// The picture at rest, pixels at the most.
    size: (u32, u32),
    cursor: Option<(f64, f64)>,
    /// The last input that was taken.
    input: (u32, u64),
    is_paused: bool,
    /// Whether the program is to end.
    stops: bool,
    /// Whether the current view is not shown because no section covers anything of it.
    is_uncovered: bool,
    /// Why the current view is not shown otherwise.
    trouble: Option<String>,
    /// Why the last view that was asked for is none.
    refusal: Option<String>,
    /// What the session looks at.
    looked: Option<Look>,
    /// The last frame that was published.
    last: Option<Arc<Shown>>,
    /// Whether a later frame was not, because it shows less than that one.
    is_held_back: bool,
    times: Times,
    /// Samples in the last frame's view when it was drawn.
    drawn_samples: u64,
    facts: State,
}

/// When things happened last.
struct Times {
    advanced: Instant,
    moved: Instant,
    /// When the eye last went to a view without walking there.
    jumped: Option<Instant>,
    /// When the last frame was begun.
    begun: Instant,
    /// When it was done.
    frame: Instant,
    /// How long the last frame took.
    drawn_in: Duration,
    state: Instant,
}

/// Whether the stage goes on.
#[derive(PartialEq, Eq)]
enum Flow {
    GoOn,
    Quit,
}

impl Player {
    /// Returns a stage that begins with the view `first`.
    ///
    /// # Errors
    /// If `first` is no view.
    pub fn new(
        session: Session,
        first: ViewSpec,
        unit: f64,
        size: (u32, u32),
        inputs: mpsc::Receiver<Numbered>,
        publisher: Publisher,
        record: Option<Record>,
    ) -> Result<Player> {
        first.resolve(size).context("the first view")?;
        let walker = Walker::new(first, unit).context("the first view has no direction")?;
        let now = Instant::now();
        let facts = State {
            phase: Phase::Running,
            traces: session.traces(),
            views: Arc::new(session.named_views().to_vec()),
            sections: Arc::new(session.sections().iter().map(|s| s.spec().clone()).collect()),
            up: session.up().to_array(),
            ..State::default()
        };
        let times = Times {
            advanced: now,
            moved: now,
            jumped: None,
            begun: now,
            frame: now,
            drawn_in: Duration::ZERO,
            state: now,
        };
        Ok(Player {
            session,
            walker,
            inputs,
            publisher,
            record,
            detail: Detail::default(),
            size,
            cursor: None,
            input: (0, 0),
            is_paused: false,
            stops: false,
            is_uncovered: false,
            trouble: None,
            refusal: None,
            looked: None,
            last: None,
            is_held_back: false,
            times,
            drawn_samples: 0,
            facts,
        })
    }

    /// Shows views until somebody quits, then lets everything under way be stored.
    ///
    /// # Errors
    /// If the server is lost.
    pub fn play(mut self) -> Result<()> {
        self.frame(true)?;
        self.walker.stay();
        loop {
            let before = *self.walker.view();
            if self.take_inputs()? == Flow::Quit {
                break;
            }
            self.advance();
            if *self.walker.view() != before {
                self.times.moved = Instant::now();
                self.frame(false)?;
            } else if self.is_due() {
                self.frame(true)?;
                self.walker.stay();
            }
            self.publish_state();
            self.stops = self.stops || self.session.wait(self.next_due())? == Waited::Stop;
            if self.stops {
                break;
            }
        }
        if let Some(record) = &mut self.record {
            record.end(Instant::now())?;
        }
        self.session.settle()
    }

    /// Moves by what is held.
    fn advance(&mut self) {
        let now = Instant::now();
        let seconds = now.saturating_duration_since(self.times.advanced).as_secs_f64();
        self.times.advanced = now;
        let (under, towards) = self.under_cursor();
        self.walker.advance(seconds.min(LONGEST_STEP), under, towards);
    }

    /// Takes all inputs that wait.
    fn take_inputs(&mut self) -> Result<Flow> {
        while let Ok(Numbered { from, input }) = self.inputs.try_recv() {
            self.input = from;
            if input == Input::Quit {
                return Ok(Flow::Quit);
            }
            self.take(input)?;
        }
        Ok(Flow::GoOn)
    }

    fn take(&mut self, input: Input) -> Result<()> {
        let (under, towards) = self.under_cursor();
        let walker = &mut self.walker;
        match input {
            Input::Hold(controls) => {
                if !walker.controls.moves() {
                    // What is held counts from now on.
                    self.times.advanced = Instant::now();
                }
                walker.controls = controls;
            }
            Input::Cursor(at) => self.cursor = at,
            Input::Turn(right, up) => _ = walker.turn(right, up),
            Input::Orbit(right, up) => _ = walker.orbit(right, up, under, towards),
            Input::Wheel(steps) => _ = walker.wheel(steps, under, towards),
            Input::Slide(right, up) => self.slide(right, up, under),
            Input::View(_) | Input::GoTo(_) | Input::Home | Input::Back | Input::Forward => {
                self.jump(input)
            }
            Input::LockHeight(lock) => walker.height_is_locked = lock,
            Input::Pause(pause) => {
                self.session.pause(pause)?;
                self.is_paused = pause;
            }
            Input::Size(width, height) => self.resize((width, height)),
            Input::Quit | Input::Cancel => {}
            _ => self.refusal = Some("this cannot be done yet".to_owned()),
        }
        Ok(())
    }

    /// Goes to another view at once.
    fn jump(&mut self, input: Input) {
        self.times.jumped = Some(Instant::now());
        match input {
            Input::View(change) => self.look(&change),
            Input::GoTo(eye) => _ = self.walker.go_to(eye),
            Input::Home => _ = self.walker.go_home(),
            Input::Back => _ = self.walker.back(),
            Input::Forward => _ = self.walker.forward(),
            _ => {}
        }
    }

    /// Goes to a view, or says why it is none.
    fn look(&mut self, change: &ViewSpec) {
        let view = self.walker.view().overridden_by(change);
        match view.resolve(self.size) {
            Ok(_) => {
                self.walker.look(change);
                self.refusal = None;
            }
            Err(error) => self.refusal = Some(error.to_string()),
        }
    }

    fn slide(&mut self, right: f64, up: f64, under: Option<DVec3>) {
        let Some(last) = &self.last else { return };
        let (across, along) = last.view.extent();
        let distance = under.map_or(1.0, |point| (point - last.view.eye()).dot(last.view.vd));
        let distance = if last.view.kind.has_eye() { distance.max(0.0) } else { 1.0 };
        self.walker.shift(0.0, right * across * distance, up * along * distance);
    }

    fn resize(&mut self, size: (u32, u32)) {
        let is_sound = size.0 > 0
            && size.1 > 0
            && u64::from(size.0) * u64::from(size.1) <= MOST_PIXELS
            && self.walker.view().resolve(size).is_ok();
        if is_sound && size != self.size {
            self.size = size;
            // A frame of the new size is due at once.
            self.last = None;
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

    /// Returns whether a frame at rest is due.
    fn is_due(&self) -> bool {
        if !self.is_shown() {
            return false;
        }
        let now = Instant::now();
        let Some(last) = &self.last else { return true };
        if self.is_held_back {
            return now >= self.times.frame + REDRAW;
        }
        if !last.is_at_rest {
            return now >= self.times.moved + REST;
        }
        self.publisher.is_watched()
            && (self.samples() != self.drawn_samples || self.session.refines())
            && now >= self.next_redraw()
    }

    fn next_redraw(&self) -> Instant {
        let looked = self.times.frame.saturating_duration_since(self.times.moved);
        let pause = looked.mul_f64(REDRAW_SHARE).clamp(REDRAW, LATEST_REDRAW);
        self.times.frame + pause.max(self.times.drawn_in * DRAWING_PART)
    }

    /// Returns until when the stage waits for the server, unless an input comes.
    fn next_due(&self) -> Instant {
        let now = Instant::now();
        if self.walker.controls.moves() {
            return now.max(self.times.begun + FRAME);
        }
        match &self.last {
            Some(last) if !last.is_at_rest && self.is_shown() => self.times.moved + REST,
            _ if self.is_held_back => self.times.frame + REDRAW,
            _ => self.next_redraw().clamp(now + NEWS, now + STATE),
        }
    }

    /// Samples that have arrived for the current view.
    fn samples(&self) -> u64 {
        let counts = self.session.counts();
        counts.stored + counts.traced + self.session.live_rays()
    }

    /// Shows the current view and publishes a frame of it.
    fn frame(&mut self, is_at_rest: bool) -> Result<()> {
        let begin = Instant::now();
        let spec = *self.walker.view();
        let (view, full) = spec.resolve(self.size)?;
        let size = if is_at_rest { full } else { self.detail.size(full) };
        self.session.set_moving(!is_at_rest);
        let resolution = if is_at_rest { Resolution::Full } else { Resolution::Moving };
        let look = Look { view, size, resolution };
        let is_shown = self.looked == Some(look) && self.is_shown();
        if !is_shown && !self.show(look)? {
            return Ok(());
        }
        self.stops |= self.session.wait(begin)? == Waited::Stop;
        let looked = Instant::now();
        self.drawn_samples = self.samples();
        let (frame, _) = self.session.draw();
        let end = Instant::now();
        let took = end.saturating_duration_since(begin);
        if !is_at_rest {
            self.detail.note(size, full, took.as_secs_f64());
        }
        let jumped = self.times.jumped.map(|jumped| end.saturating_duration_since(jumped));
        let is_of_other = self.last.as_ref().is_some_and(|last| last.view != view);
        self.is_held_back = is_of_other && !replaces(unknown(&frame), jumped);
        (self.times.begun, self.times.frame, self.times.drawn_in) = (begin, end, took);
        if self.is_held_back {
            return Ok(());
        }
        let shown = Shown {
            number: 0,
            input: self.input,
            view,
            options: holo_walk::options(&spec),
            frame,
            is_at_rest,
            took: [looked - begin, end.saturating_duration_since(looked)]
                .map(|took| took.as_secs_f64()),
            done: end,
        };
        self.last = Some(self.publisher.frame(shown));
        if let Some(record) = &mut self.record {
            record.view(&spec, begin, is_at_rest)?;
        }
        Ok(())
    }

    /// Has the session look at a view. Returns whether it can be shown.
    fn show(&mut self, look: Look) -> Result<bool> {
        (self.is_uncovered, self.trouble) = (false, None);
        self.looked = Some(look);
        match self.session.look(look) {
            Ok(()) => {}
            Err(error) if error.is::<NetError>() => return Err(error),
            Err(error) if error.is::<Uncovered>() => self.is_uncovered = true,
            Err(error) => self.trouble = Some(format!("{error:#}")),
        }
        Ok(self.is_shown())
    }

    /// Returns whether the current view can be shown.
    fn is_shown(&self) -> bool {
        !self.is_uncovered && self.trouble.is_none()
    }

    /// Publishes how things are, unless that was done a moment ago.
    fn publish_state(&mut self) {
        let now = Instant::now();
        if now < self.times.state + STATE {
            return;
        }
        self.times.state = now;
        let pose = self.walker.pose();
        let status = self.session.status().copied();
        self.publisher.state(State {
            is_uncovered: self.is_uncovered,
            trouble: self.trouble.clone().or_else(|| self.refusal.clone()),
            options: holo_walk::options(self.walker.view()),
            pose: [pose.eye, pose.direction, pose.up].map(|vector| vector.to_array()),
            height_is_locked: self.walker.height_is_locked,
            is_paused: self.is_paused,
            view_samples: self.samples(),
            samples: status.map_or(0, |status| status.samples),
            samples_per_second: status.map_or(0.0, |status| status.samples_per_second),
            workers: status.map(|status| status.workers),
            driver: self.session.driver_name(),
            ..self.facts.clone()
        });
    }
}

/// Returns the share of a frame's pixels of which nothing is known.
fn unknown(frame: &Frame) -> f64 {
    frame.empty_pixels as f64 / frame.depth.len().max(1) as f64
}

/// Returns whether a frame replaces one of another view. `jumped` is the time since the last jump:
/// whoever walks always sees where.
fn replaces(unknown: f64, jumped: Option<Duration>) -> bool {
    unknown <= MOST_UNKNOWN || jumped.is_none_or(|jumped| jumped >= MOST_PATIENCE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_of_which_little_is_known_replaces_another_only_after_a_while() {
        let mut frame = Frame::black((100, 100));
        frame.empty_pixels = 9_000;
        assert!(!replaces(unknown(&frame), Some(Duration::from_millis(100))));
        assert!(replaces(unknown(&frame), Some(Duration::from_secs(2))));
        assert!(replaces(unknown(&frame), None), "one walks");
        frame.empty_pixels = 1_000;
        assert!(replaces(unknown(&frame), Some(Duration::ZERO)));
    }
}
