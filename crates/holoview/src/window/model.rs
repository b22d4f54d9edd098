//! The window's model: what is shown besides frames, and what keys and pointers do.
//!
//! It draws nothing, and speaks to neither the desktop nor the stage. It answers events with
//! [`Effect`]s.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use holo_picture::{Look, ViewSpec};
use holo_walk::Controls;

use super::{
    canvas::{Point, Rect},
    display::Display,
    hand::{Drag, Hand, Target, looked, wheeled},
    overlay::{
        Layout,
        space::{Camera, Plan},
    },
    pace::Pace,
    saved::Kind,
    seen::Seen,
};
use crate::{
    keys::{self, Action, Held, Key, Modifiers},
    stage::{Input, State},
};

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
    held: Held,
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
            held: Held::default(),
            controls: Controls::default(),
            modifiers: Modifiers::default(),
            hand: Hand::default(),
            notice: None,
            resized: None,
            redraw: None,
            presented: 0,
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

    /// Returns what the person has to be told.
    pub fn notice(&self, now: Instant) -> Option<&str> {
        let own = self.notice.as_ref().filter(|(_, end)| end.is_none_or(|end| now < end));
        own.map(|(text, _)| text.as_str()).or(self.state.trouble.as_deref())
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

    /// Notes what is held beside keys.
    pub fn set_modifiers(&mut self, modifiers: Modifiers) {
        self.modifiers = modifiers;
    }

    /// Notes that the keyboard belongs to another window.
    pub fn lose_focus(&mut self) -> Vec<Effect> {
        self.held.clear();
        let looks = std::mem::take(&mut self.modes.looks);
        let mut effects = self.hold();
        effects.extend(looks.then_some(Effect::Grab(false)));
        effects
    }

    /// Notes that a key is up.
    pub fn release(&mut self, name: &str) -> Vec<Effect> {
        self.held.release(name);
        self.hold()
    }

    /// Returns what a key does: `name` by its place, `sign` by what it writes.
    pub fn press(&mut self, name: &str, sign: &str, repeats: bool, now: Instant) -> Vec<Effect> {
        match keys::key(name, sign, self.modifiers) {
            Some(Key::Moves(..) | Key::Changes(_)) => {
                self.held.press(name);
                self.hold()
            }
            Some(Key::Does(action @ (Action::Brighter | Action::Darker))) => self.act(action, now),
            Some(Key::Does(action)) if !repeats => self.act(action, now),
            _ => Vec::new(),
        }
    }

    fn hold(&mut self) -> Vec<Effect> {
        let controls = self.held.controls();
        if controls == self.controls {
            return Vec::new();
        }
        self.controls = controls;
        self.send(Input::Hold(controls))
    }

    fn send(&mut self, input: Input) -> Vec<Effect> {
        if !self.has_acted && !matches!(input, Input::Cursor(_)) {
            self.has_acted = true;
            self.touch();
        }
        vec![Effect::Send(input)]
    }

    /// Returns what an action does.
    pub fn act(&mut self, action: Action, now: Instant) -> Vec<Effect> {
        self.has_acted = true;
        let exposure = self.seen.as_ref().and_then(|seen| seen.image.exposure);
        match self.display.act(action, exposure) {
            Some(Ok(())) => {
                self.touch();
                return vec![Effect::Look(self.display.look())];
            }
            Some(Err(reason)) => {
                self.tell(reason, now);
                return Vec::new();
            }
            None => {}
        }
        self.touch();
        match action {
            Action::Home => self.send(Input::Home),
            Action::Back => self.send(Input::Back),
            Action::Forward => self.send(Input::Forward),
            Action::View(index) => self.recall(index, now),
            Action::LockHeight => {
                let lock = !self.state.height_is_locked;
                self.tell(if lock { "Eye height locked." } else { "Eye height free." }, now);
                self.send(Input::LockHeight(lock))
            }
            Action::Pause => self.send(Input::Pause(!self.state.is_paused)),
            Action::MouseLook => {
                self.modes.looks = !self.modes.looks;
                vec![Effect::Grab(self.modes.looks)]
            }
            Action::Grids => {
                let (grids, when) = match self.modes.grids {
                    Grids::Auto => (Grids::Always, "always"),
                    Grids::Always => (Grids::Never, "never"),
                    Grids::Never => (Grids::Auto, "while moving, and where nothing is known"),
                };
                self.modes.grids = grids;
                self.tell(format!("Section grids: {when}."), now);
                Vec::new()
            }
            Action::SavePng => vec![Effect::Save(Kind::Seen)],
            Action::SaveExr => vec![Effect::Save(Kind::Radiance)],
            Action::FullScreen => {
                self.modes.is_full = !self.modes.is_full;
                vec![Effect::FullScreen(self.modes.is_full)]
            }
            Action::Quit => vec![Effect::Leave],
            Action::Close => self.close(),
            _ => {
                self.show(action);
                Vec::new()
            }
        }
    }

    /// Shows or hides what lies over the picture.
    fn show(&mut self, action: Action) {
        let modes = &mut self.modes;
        let mode = match action {
            Action::Panel => &mut modes.has_panel,
            Action::Bare => &mut modes.is_bare,
            Action::Theme => &mut modes.is_light,
            Action::Help => &mut modes.has_help,
            _ => return,
        };
        *mode = !*mode;
    }

    fn recall(&mut self, index: usize, now: Instant) -> Vec<Effect> {
        let mut view = ViewSpec::default();
        let known = self.state.views.get(index).map(|(_, options)| view.apply_line(options));
        match known {
            Some(Ok(())) => self.send(Input::View(Box::new(view))),
            Some(Err(error)) => {
                self.tell(error.to_string(), now);
                Vec::new()
            }
            None => {
                self.tell(format!("No view has the number {}.", index + 1), now);
                Vec::new()
            }
        }
    }

    fn close(&mut self) -> Vec<Effect> {
        if self.is_over {
            return vec![Effect::Leave];
        }
        if std::mem::take(&mut self.modes.looks) {
            return vec![Effect::Grab(false)];
        }
        let modes = &mut self.modes;
        let is_open = modes.has_help || self.notice.is_some();
        modes.has_help = false;
        self.notice = None;
        if !is_open && std::mem::take(&mut modes.is_full) {
            return vec![Effect::FullScreen(false)];
        }
        Vec::new()
    }

    /// Returns what a motion of the mouse to a place does.
    pub fn move_to(&mut self, at: Point) -> Vec<Effect> {
        if self.modes.looks {
            return Vec::new();
        }
        let target = self.target();
        let input = self.hand.move_to(at, &target);
        if self.modes.has_panel && !self.modes.is_bare {
            self.touch();
        }
        input.map(|input| self.send(input)).unwrap_or_default()
    }

    /// Returns what a motion of the mouse by some pixels does, wherever it is.
    pub fn move_by(&mut self, right: f64, down: f64) -> Vec<Effect> {
        if self.modes.looks { self.send(looked(right, down)) } else { Vec::new() }
    }

    /// Notes that the mouse has left the window.
    pub fn leave(&mut self) -> Vec<Effect> {
        self.hand.left();
        self.send(Input::Cursor(None))
    }

    /// Returns what a pressed button does.
    pub fn button(&mut self, drag: Drag) -> Vec<Effect> {
        if std::mem::take(&mut self.modes.has_help) {
            self.touch();
            return Vec::new();
        }
        match self.hand.at() {
            Some(at) if drag == Drag::Turn => self.click(at).unwrap_or_else(|| {
                self.hand.press(drag);
                Vec::new()
            }),
            _ => {
                self.hand.press(drag);
                Vec::new()
            }
        }
    }

    /// Notes that a button is released.
    pub fn button_up(&mut self, drag: Drag) {
        self.hand.release(drag);
    }

    /// Returns what a click on the panel does; `None` beside it.
    fn click(&mut self, at: Point) -> Option<Vec<Effect>> {
        let layout = self.panel();
        if self.modes.is_bare || !self.modes.has_panel || !layout.rect.contains(at) {
            return None;
        }
        if let Some(index) = layout.views.iter().position(|line| line.contains(at)) {
            return Some(self.recall(index, Instant::now()));
        }
        let view = self.seen.as_ref().map(|seen| &seen.shown.view);
        let camera = Camera::now(&self.state, view);
        let plan = Plan::new(&self.state).filter(|_| layout.plan.contains(at));
        Some(match plan.zip(camera) {
            Some((plan, camera)) => {
                let eye = plan.point(layout.plan.shares(at), camera.eye);
                self.send(Input::GoTo(eye))
            }
            None => Vec::new(),
        })
    }

    /// Returns whether the mouse drags the picture.
    pub fn is_dragging(&self) -> bool {
        self.hand.drag().is_some()
    }

    /// Returns what steps of the wheel do.
    pub fn wheel(&mut self, steps: f64) -> Vec<Effect> {
        self.send(wheeled(steps))
    }

    /// Returns what a finger that touches or moves does.
    pub fn finger(&mut self, finger: u64, at: Point) -> Vec<Effect> {
        let target = self.target();
        let inputs = self.hand.finger(finger, at, &target);
        inputs.into_iter().flat_map(|input| self.send(input)).collect()
    }

    /// Notes that a finger is lifted.
    pub fn lift(&mut self, finger: u64) {
        self.hand.lift(finger);
    }

    fn target(&self) -> Target {
        Target::new(self.picture(), self.seen.as_ref().map(|seen| &seen.shown.view))
    }
}

#[cfg(test)]
mod tests;
