//! The window's model: what is shown besides frames, and what keys and pointers do.
//!
//! It draws nothing, and speaks to neither the desktop nor the stage. It answers events with
//! [`Effect`]s.

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
    args::DriverArg,
    commands::{self, Action, Does, Local, action_of},
    stage::{Input, State},
};

/// A new size counts once it has stayed for so long: whoever drags a border passes many.
const RESIZING: Duration = Duration::from_millis(150);

/// Most pixels of a picture at rest: more would take long, and few see the difference.
const MOST_PIXELS: f64 = 2.1e6;

/// Longest line that is typed, bytes.
const MOST_TYPED: usize = 1000;

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

    /// Returns what the person has to be told.
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
        self.held.remove(name);
        self.hold()
    }

    /// Returns what a key does: `name` by its place, `sign` by what it writes.
    pub fn press(&mut self, name: &str, sign: &str, repeats: bool, now: Instant) -> Vec<Effect> {
        let Modifiers { ctrl, other } = self.modifiers;
        if ctrl && name == "KeyQ" {
            return vec![Effect::Leave];
        }
        if self.typed.is_some() {
            let sign = if ctrl || other { "" } else { sign };
            return self.type_key(name, sign, now);
        }
        if name == "Enter" && !ctrl && !other {
            self.typed = Some(String::new());
            self.touch();
            self.held.clear();
            return self.hold();
        }
        let named = action_of(name).map(|action| (name, action));
        let known = named.or_else(|| action_of(sign).map(|action| (sign, action)));
        let Some((key, action)) = known.filter(|_| !ctrl && !other) else { return Vec::new() };
        match action.does {
            Does::Hold(..) | Does::Pace(_) | Does::Orbit => {
                self.held.insert(name.to_owned());
                self.hold()
            }
            Does::Local(local @ (Local::Brighter | Local::Darker)) => self.act(local, now),
            _ if repeats => Vec::new(),
            Does::Local(local) => self.act(local, now),
            _ if name == "Escape" && self.has_open() => self.close(),
            Does::Stage | Does::Toggle(..) | Does::NamedView => {
                let line = action.line(key, &self.state);
                line.map(|line| self.command(&line, now)).unwrap_or_default()
            }
        }
    }

    /// Takes a key into the line that is being typed.
    fn type_key(&mut self, name: &str, sign: &str, now: Instant) -> Vec<Effect> {
        self.touch();
        let Some(line) = &mut self.typed else { return Vec::new() };
        match name {
            "Escape" => self.typed = None,
            "Backspace" => _ = line.pop(),
            "Enter" | "NumpadEnter" => {
                let line = std::mem::take(line);
                self.typed = None;
                if line.trim().is_empty() {
                    return Vec::new();
                }
                let effects = self.command(&line, now);
                // A line that is none can be mended.
                self.typed = effects.is_empty().then_some(line);
                return effects;
            }
            _ if line.len() < MOST_TYPED => line.push_str(sign),
            _ => {}
        }
        Vec::new()
    }

    /// Has the stage do what a line says.
    fn command(&mut self, line: &str, now: Instant) -> Vec<Effect> {
        match commands::parse(line) {
            Ok(input) => self.send(input),
            Err(reason) => {
                self.tell(reason, now);
                Vec::new()
            }
        }
    }

    fn hold(&mut self) -> Vec<Effect> {
        let controls = Action::controls(self.held.iter().map(String::as_str));
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

    /// Returns what this window does by itself.
    fn act(&mut self, local: Local, now: Instant) -> Vec<Effect> {
        self.has_acted = true;
        let exposure = self.seen.as_ref().and_then(|seen| seen.image.exposure);
        match self.display.act(local, exposure) {
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
        match local {
            Local::MouseLook => {
                self.modes.looks = !self.modes.looks;
                vec![Effect::Grab(self.modes.looks)]
            }
            Local::Grid => {
                self.next_grids(now);
                Vec::new()
            }
            Local::Save => vec![Effect::Save(Kind::Seen)],
            Local::SaveRadiance => vec![Effect::Save(Kind::Radiance)],
            Local::NextDriver => {
                let line = format!("driver {}", next_driver(self.state.driver));
                self.command(&line, now)
            }
            Local::FullScreen => {
                self.modes.is_full = !self.modes.is_full;
                vec![Effect::FullScreen(self.modes.is_full)]
            }
            Local::Quit if self.is_over || self.asks_to_quit => vec![Effect::Leave],
            Local::Quit => {
                self.asks_to_quit = true;
                let question = "End the session? Every sample is stored. End: quit. Esc: stay.";
                self.notice = Some((question.to_owned(), None));
                Vec::new()
            }
            _ => {
                self.show(local);
                Vec::new()
            }
        }
    }

    fn next_grids(&mut self, now: Instant) {
        let (grids, when) = match self.modes.grids {
            Grids::Auto => (Grids::Always, "always"),
            Grids::Always => (Grids::Never, "never"),
            Grids::Never => (Grids::Auto, "while moving, and where nothing is known"),
        };
        self.modes.grids = grids;
        self.tell(format!("Section grids: {when}."), now);
    }

    /// Shows or hides what lies over the picture.
    fn show(&mut self, local: Local) {
        let modes = &mut self.modes;
        let mode = match local {
            Local::Panel => &mut modes.has_panel,
            Local::Bare => &mut modes.is_bare,
            Local::Theme => &mut modes.is_light,
            Local::Help => &mut modes.has_help,
            _ => return,
        };
        *mode = !*mode;
    }

    /// Returns whether there is anything that Esc closes.
    fn has_open(&self) -> bool {
        let Modes { looks, has_help, is_full, .. } = self.modes;
        let has_own = looks || has_help || is_full || self.notice.is_some();
        self.is_over || has_own && self.state.question.is_none()
    }

    fn close(&mut self) -> Vec<Effect> {
        if self.is_over {
            return vec![Effect::Leave];
        }
        self.touch();
        let modes = &mut self.modes;
        if std::mem::take(&mut modes.looks) {
            return vec![Effect::Grab(false)];
        }
        let closes = modes.has_help || self.notice.is_some();
        (modes.has_help, self.asks_to_quit) = (false, false);
        self.notice = None;
        if !closes && std::mem::take(&mut modes.is_full) {
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
            return Some(self.command(&format!("view {}", index + 1), Instant::now()));
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

/// Returns the driver after the one of this name.
fn next_driver(now: &str) -> &'static str {
    let names = DriverArg::names();
    let at = names.iter().position(|name| *name == now).map_or(0, |at| at + 1);
    names[at % names.len()]
}

#[cfg(test)]
mod tests;
