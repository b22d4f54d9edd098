//! The window's model: what is shown besides frames, and what keys and pointers do.
//!
//! It draws nothing, and speaks to neither the desktop nor the stage. It answers events with
//! [`Effect`]s.

mod keys;
mod pointer;

use std::{
    collections::BTreeSet,
    sync::Arc,
    time::{Duration, Instant},
};

use holo_picture::Look;
use holo_walk::Controls;

use super::{
    canvas::{Point, Rect},
    display::Display,
    hand::Hand,
    overlay::Layout,
    pace::Pace,
    saved::Kind,
    seen::Seen,
};
use crate::stage::{Input, State};

/// A new size counts once it has stayed for so long: whoever drags a border passes many.
const RESIZING: Duration = Duration::from_millis(150);

/// Most pixels of a picture at rest: more would take long, and few see the difference.
const MOST_PIXELS: f64 = 2.1e6;

/// How long notices stay.
const NOTICE: Duration = Duration::from_secs(4);

/// The eye counts as moving for so long after the last frame that moved.
const MOVING: Duration = Duration::from_millis(180);

/// What is to be done outside of the model.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// The stage gets an input.
    Send(Input),
    /// Frames get another look.
    Look(Look),
    /// The window fills the screen, or does not any more.
    FullScreen(bool),
    /// The mouse moves the eye alone, or the cursor again.
    Grab(bool),
    /// The picture is saved.
    Save(Kind),
    /// The window closes, and the session ends.
    Leave,
}

/// When the sections' grids are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grids {
    /// While the eye moves, and where nothing is known.
    #[default]
    Auto,
    /// At all times.
    Always,
    /// At no time.
    Never,
}

/// What is held beside keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modifiers {
    /// Whether Ctrl is held.
    pub ctrl: bool,
    /// Whether one is held whose combinations belong to the desktop.
    pub other: bool,
}

/// What is shown and hidden.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modes {
    /// Whether the keys are shown.
    pub has_help: bool,
    /// Whether the panel is shown.
    pub has_panel: bool,
    /// Whether nothing but the picture is shown.
    pub is_bare: bool,
    /// When grids are drawn.
    pub grids: Grids,
    /// Whether text is dark on light.
    pub is_light: bool,
    /// Whether the window fills the screen.
    pub is_full: bool,
    /// Whether the mouse turns the eye without a pressed button.
    pub looks: bool,
}

/// See the module.
pub struct Model {
    /// How the stage is.
    pub state: Arc<State>,
    /// The latest frame.
    pub seen: Option<Arc<Seen>>,
    /// How frames look.
    pub display: Display,
    /// How fast they come.
    pub pace: Pace,
    /// Columns and rows of the window.
    pub size: (u32, u32),
    /// Its pixels to one of a usual screen.
    pub scale: f64,
    /// What is shown and hidden.
    pub modes: Modes,
    /// Whether the person has done anything.
    pub has_acted: bool,
    /// Keys that are held down, by their places.
    held: BTreeSet<String>,
    controls: Controls,
    modifiers: Modifiers,
    hand: Hand,
    notice: Option<(String, Option<Instant>)>,
    /// When the stage hears of a new size.
    resized: Option<Instant>,
    /// When the window changes by itself.
    redraw: Option<Instant>,
    /// Number of the frame on the screen.
    presented: u64,
    /// The line that is being typed, if one is.
    typed: Option<String>,
    /// Whether the person was asked whether to end.
    asks_to_quit: bool,
    /// Whether the session is over; the window then stays only to say why.
    is_over: bool,
    is_stale: bool,
}

impl Model {
    /// Returns the model of a new window.
    pub fn new(look: Look, size: (u32, u32), scale: f64) -> Model {
        Model {
            state: Arc::default(),
            seen: None,
            display: Display::new(look),
            pace: Pace::default(),
            size,
            scale,
            modes: Modes::default(),
            has_acted: false,
            held: BTreeSet::new(),
            controls: Controls::default(),
            modifiers: Modifiers::default(),
            hand: Hand::default(),
            notice: None,
            resized: None,
            redraw: None,
            presented: 0,
            typed: None,
            asks_to_quit: false,
            is_over: false,
            is_stale: true,
        }
    }

    /// Returns where the picture is in the window.
    pub fn picture(&self) -> Rect {
        let size = self.seen.as_ref().map_or(self.size, |seen| seen.shown.frame.picture.size());
        Rect::fit(size, self.size)
    }

    /// Returns where the cursor is in the picture, if it is.
    pub fn cursor(&self) -> Option<Point> {
        let picture = self.picture();
        self.hand.at().filter(|&at| picture.contains(at)).map(|at| picture.shares(at))
    }

    /// Returns where the panel's parts are.
    pub fn panel(&self) -> Layout {
        Layout::new(self.size, self.scale, self.state.views.len())
    }

    /// Returns the notice that is shown.
    pub fn notice(&self, now: Instant) -> Option<&str> {
        let own = self.notice.as_ref().filter(|(_, end)| end.is_none_or(|end| now < end));
        let question = self.state.question.as_deref();
        question.or(own.map(|(text, _)| text.as_str())).or(self.state.trouble.as_deref())
    }

    /// Returns the line that is being typed.
    pub fn typed(&self) -> Option<&str> {
        self.typed.as_deref()
    }

    /// Returns whether the eye moves.
    pub fn is_moving(&self, now: Instant) -> bool {
        self.pace.since_moved(now).is_some_and(|since| since < MOVING)
    }

    /// Returns whether the window has to be drawn anew, once.
    pub fn take_stale(&mut self) -> bool {
        std::mem::take(&mut self.is_stale)
    }

    /// Has the window drawn anew.
    pub fn touch(&mut self) {
        self.is_stale = true;
    }

    /// Tells the person something for a while.
    pub fn tell(&mut self, text: impl Into<String>, now: Instant) {
        self.notice = Some((text.into(), Some(now + NOTICE)));
        self.touch();
    }

    /// Notes how the stage is.
    pub fn set_state(&mut self, state: Arc<State>) {
        if self.state != state {
            self.state = state;
            self.touch();
        }
    }

    /// Notes a new frame.
    pub fn set_seen(&mut self, seen: Arc<Seen>) {
        if self.seen.as_ref().is_none_or(|before| !Arc::ptr_eq(before, &seen)) {
            self.seen = Some(seen);
            self.touch();
        }
    }

    /// Notes that the screen shows the latest frame.
    pub fn presented(&mut self, now: Instant) {
        if let Some(seen) = &self.seen
            && self.presented != seen.shown.number
        {
            self.presented = seen.shown.number;
            self.pace.shown(seen.shown.input.1, seen.shown.is_at_rest, now);
        }
        let grids = self.pace.since_moved(now).and_then(|since| MOVING.checked_sub(since));
        let times = [grids.map(|rest| now + rest), self.pace.until(now)];
        self.redraw = times.into_iter().flatten().min();
    }

    /// Notes the end of the session. Without a reason, the window closes.
    pub fn end(&mut self, reason: Option<String>) -> Vec<Effect> {
        self.is_over = true;
        let Some(reason) = reason else { return vec![Effect::Leave] };
        self.notice = Some((format!("{reason} Esc closes the window."), None));
        self.touch();
        Vec::new()
    }

    /// Notes the window's size and scale.
    pub fn resize(&mut self, size: (u32, u32), scale: f64, now: Instant) {
        if (size, scale) != (self.size, self.scale) {
            (self.size, self.scale) = (size, scale);
            self.resized = Some(now + RESIZING);
            self.touch();
        }
    }

    /// Returns the size that the picture should have: the window's, within reason.
    pub fn wanted_size(&self) -> Input {
        let [width, height] = [self.size.0, self.size.1].map(f64::from);
        let share = (MOST_PIXELS / (width * height).max(1.0)).sqrt().min(1.0);
        let side = |side: f64| ((side * share).round() as u32).max(16);
        Input::Size(side(width), side(height))
    }

    /// Does what was put off until `now`.
    pub fn wake(&mut self, now: Instant) -> Vec<Effect> {
        let is_over = |time: Option<Instant>| time.is_some_and(|time| time <= now);
        if is_over(self.redraw) {
            self.redraw = None;
            self.touch();
        }
        if is_over(self.notice.as_ref().and_then(|(_, end)| *end)) {
            self.notice = None;
            self.touch();
        }
        if !is_over(self.resized) {
            return Vec::new();
        }
        self.resized = None;
        vec![Effect::Send(self.wanted_size())]
    }

    /// Returns when [`wake`](Self::wake) has something to do next.
    pub fn next_change(&self) -> Option<Instant> {
        let notice = self.notice.as_ref().and_then(|(_, end)| *end);
        [self.redraw, self.resized, notice].into_iter().flatten().min()
    }

    fn send(&mut self, input: Input) -> Vec<Effect> {
        if !self.has_acted && !matches!(input, Input::Cursor(_)) {
            self.has_acted = true;
            self.touch();
        }
        vec![Effect::Send(input)]
    }
}

#[cfg(test)]
mod tests;
