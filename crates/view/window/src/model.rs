//! The window's model: what is shown besides frames, and the effects of keys and pointers.
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
use holo_stage::{Input, State};
use holo_walk::Controls;

use super::{
    canvas::{Point, Rect},
    display::DisplaySettings,
    hand::WindowPointers,
    pace::WindowPace,
    panel_layout::PanelLayout,
    saved::SaveFormat,
    seen::DisplayedFrame,
};

/// A new size takes effect after this time, because dragging a border passes many sizes.
const RESIZING: Duration = Duration::from_millis(150);

/// Most pixels of a picture at rest. More would take longer and hardly be visible.
const MOST_PIXELS: f64 = 2.1e6;

/// Time for which a notice is shown.
const NOTICE: Duration = Duration::from_secs(4);

/// An effect outside the model.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// The stage receives an input.
    Send(Input),
    /// Frames get another look.
    Look(Look),
    /// The window begins or ends filling the screen.
    FullScreen(bool),
    /// The mouse only moves the eye, or is a cursor again.
    Grab(bool),
    /// The picture is saved.
    Save(SaveFormat),
    /// The window closes, and the session ends.
    Leave,
}

/// When the sections' grids are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grids {
    /// While the eye moves, and if little is known.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// Modifier keys that are held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modifiers {
    /// True if Ctrl is held.
    pub ctrl: bool,
    /// True if Shift is held.
    pub shift: bool,
    /// True if a modifier is held whose combinations belong to the desktop.
    pub other: bool,
}

/// The parts of the window that are shown or hidden.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modes {
    /// True if the list of keys is shown.
    pub has_help: bool,
    /// True if the panel is shown.
    pub has_panel: bool,
    /// True if nothing except the picture is shown.
    pub is_bare: bool,
    /// When grids are drawn.
    pub grids: Grids,
    /// True for dark text on a light background.
    pub is_light: bool,
    /// True if the window fills the screen.
    pub is_full: bool,
    /// True if the mouse turns the eye without a pressed button.
    pub looks: bool,
}

/// The window's model; see the module.
pub struct WindowModel {
    /// The state of the stage.
    pub state: Arc<State>,
    /// The latest frame.
    pub seen: Option<Arc<DisplayedFrame>>,
    /// The look of frames.
    pub display: DisplaySettings,
    /// Frame rate and latency.
    pub pace: WindowPace,
    /// Columns and rows of the window.
    pub size: (u32, u32),
    /// Its pixels per pixel of a usual screen.
    pub scale: f64,
    /// What is shown and hidden.
    pub modes: Modes,
    /// True if the person has done anything.
    pub has_acted: bool,
    /// Keys that are held down, by their places.
    held: BTreeSet<String>,
    controls: Controls,
    modifiers: Modifiers,
    /// True while the mouse holds an object.
    holds: bool,
    hand: WindowPointers,
    notice: Option<(String, Option<Instant>)>,
    /// When the stage is informed of a new size.
    resized: Option<Instant>,
    /// When the window changes without an event.
    redraw: Option<Instant>,
    /// Number of the frame on the screen.
    presented: u64,
    /// The command line that is being typed, if any.
    typed: Option<String>,
    /// True if the person was asked whether to quit.
    asks_to_quit: bool,
    /// True if the session is over and the window stays only to show the reason.
    is_over: bool,
    is_stale: bool,
}

impl WindowModel {
    /// Returns the model of a new window.
    pub fn new(look: Look, size: (u32, u32), scale: f64) -> WindowModel {
        WindowModel {
            state: Arc::default(),
            seen: None,
            display: DisplaySettings::new(look),
            pace: WindowPace::default(),
            size,
            scale,
            modes: Modes::default(),
            has_acted: false,
            held: BTreeSet::new(),
            controls: Controls::default(),
            modifiers: Modifiers::default(),
            holds: false,
            hand: WindowPointers::default(),
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

    /// Returns the picture's place in the window.
    pub fn picture(&self) -> Rect {
        let size = self.seen.as_ref().map_or(self.size, |seen| seen.shown.frame.picture.size());
        Rect::fit(size, self.size)
    }

    /// Returns the cursor's place in the picture, if it is inside.
    pub fn cursor(&self) -> Option<Point> {
        let picture = self.picture();
        self.hand.at().filter(|&at| picture.contains(at)).map(|at| picture.shares(at))
    }

    /// Returns the places of the panel's parts.
    pub fn panel(&self) -> PanelLayout {
        let (views, parts) = (self.state.views.len(), self.state.parts.len());
        PanelLayout::new(self.size, self.scale, views, parts)
    }

    /// Returns the notice that is shown.
    pub fn notice(&self, now: Instant) -> Option<&str> {
        let own = self.notice.as_ref().filter(|(_, end)| end.is_none_or(|end| now < end));
        let question = self.state.question.as_deref();
        question.or(own.map(|(text, _)| text.as_str())).or(self.state.trouble.as_deref())
    }

    /// Returns the command line that is being typed.
    pub fn typed(&self) -> Option<&str> {
        self.typed.as_deref()
    }

    /// Returns whether the window must be drawn again, and resets this.
    pub fn take_stale(&mut self) -> bool {
        std::mem::take(&mut self.is_stale)
    }

    /// Requests that the window is drawn again.
    pub fn touch(&mut self) {
        self.is_stale = true;
    }

    /// Shows a notice for a while.
    pub fn tell(&mut self, text: impl Into<String>, now: Instant) {
        self.notice = Some((text.into(), Some(now + NOTICE)));
        self.touch();
    }

    /// Records the state of the stage.
    pub fn set_state(&mut self, state: Arc<State>) {
        if self.state != state {
            self.state = state;
            self.touch();
        }
    }

    /// Records a new frame.
    pub fn set_seen(&mut self, seen: Arc<DisplayedFrame>) {
        if self.seen.as_ref().is_none_or(|before| !Arc::ptr_eq(before, &seen)) {
            self.seen = Some(seen);
            self.touch();
        }
    }

    /// Records that the screen shows the latest frame.
    pub fn presented(&mut self, now: Instant) {
        if let Some(seen) = &self.seen
            && self.presented != seen.shown.number
        {
            self.presented = seen.shown.number;
            self.pace.shown(seen.shown.input.1, seen.shown.is_at_rest, now);
        }
        self.redraw = self.pace.until(now);
    }

    /// Records the end of the session. Without a reason, the window closes.
    pub fn end(&mut self, reason: Option<String>) -> Vec<Effect> {
        self.is_over = true;
        let Some(reason) = reason else { return vec![Effect::Leave] };
        self.notice = Some((format!("{reason} Esc closes the window."), None));
        self.touch();
        Vec::new()
    }

    /// Records the window's size and scale.
    pub fn resize(&mut self, size: (u32, u32), scale: f64, now: Instant) {
        if (size, scale) != (self.size, self.scale) {
            (self.size, self.scale) = (size, scale);
            self.resized = Some(now + RESIZING);
            self.touch();
        }
    }

    /// Returns the size that the picture should have: the window's, with at most [`MOST_PIXELS`].
    pub fn wanted_size(&self) -> Input {
        let [width, height] = [self.size.0, self.size.1].map(f64::from);
        let share = (MOST_PIXELS / (width * height).max(1.0)).sqrt().min(1.0);
        let side = |side: f64| ((side * share).round() as u32).max(16);
        Input::Size(side(width), side(height))
    }

    /// Carries out what is due at `now`.
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

    /// Returns when [`wake`](Self::wake) must be called next.
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
