//! What keys do: one table for every front end that people use.
//!
//! A key is named by its place on the keyboard, as in the W3C's UI Events (`KeyW`), so that the keys
//! to walk lie together on every layout. A sign such as `?` is named by itself, because its place
//! differs.

use std::collections::BTreeSet;

use holo_walk::Controls;

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Key {
    /// Moves the eye while it is held: which way, 1 or -1.
    Moves(Way, f64),
    /// Changes what other keys do while it is held.
    Changes(Change),
    /// Does something once.
    Does(Action),
}

/// A part of the controls: see [`Controls`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Ahead on the level plane.
    Ahead,
    /// To the right.
    Right,
    /// Up.
    Rise,
    /// Turn to the right.
    Turn,
    /// Look upwards.
    Tilt,
    /// Towards the point under the cursor.
    Glide,
}

/// How a held key changes others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Three times the pace.
    Run,
    /// A quarter of the pace.
    Slow,
    /// Walking keys move around the point under the cursor.
    Orbit,
}

/// Something that is done once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Go to where one began.
    Home,
    /// Go to the view before.
    Back,
    /// Go to the view that one came back from.
    Forward,
    /// Go to the named view of this number, from 0.
    View(usize),
    /// Lock the eye's height, or unlock it.
    LockHeight,
    /// Look around without a pressed button, or end that.
    MouseLook,
    /// Pause tracing, or resume it.
    Pause,
    /// Lock the exposure, or make it automatic.
    LockExposure,
    /// Half a stop brighter.
    Brighter,
    /// Half a stop darker.
    Darker,
    /// The next tone mapping.
    Tone,
    /// Show luminance as colours, or end that.
    FalseColor,
    /// Draw lines of equal luminance, or end that.
    Contours,
    /// A logarithmic scale for both, or a linear one.
    LogScale,
    /// Draw the sections' grids: automatically, always, never.
    Grids,
    /// Save the picture as seen.
    SavePng,
    /// Save the picture's radiance.
    SaveExr,
    /// Show the panel, or hide it.
    Panel,
    /// Show nothing but the picture, or end that.
    Bare,
    /// Fill the screen, or end that.
    FullScreen,
    /// The dark theme or the light one.
    Theme,
    /// Show the keys, or hide them.
    Help,
    /// Close what lies over the picture.
    Close,
    /// End the session.
    Quit,
}

use Action::*;
use Key::{Changes, Does, Moves};

/// Keys by their names.
const KEYS: [(&str, Key); 46] = [
    ("KeyW", Moves(Way::Ahead, 1.0)),
    ("ArrowUp", Moves(Way::Ahead, 1.0)),
    ("KeyS", Moves(Way::Ahead, -1.0)),
    ("ArrowDown", Moves(Way::Ahead, -1.0)),
    ("KeyD", Moves(Way::Right, 1.0)),
    ("ArrowRight", Moves(Way::Right, 1.0)),
    ("KeyA", Moves(Way::Right, -1.0)),
    ("ArrowLeft", Moves(Way::Right, -1.0)),
    ("KeyE", Moves(Way::Turn, 1.0)),
    ("KeyQ", Moves(Way::Turn, -1.0)),
    ("KeyR", Moves(Way::Tilt, 1.0)),
    ("KeyF", Moves(Way::Tilt, -1.0)),
    ("PageUp", Moves(Way::Rise, 1.0)),
    ("PageDown", Moves(Way::Rise, -1.0)),
    ("Space", Moves(Way::Glide, 1.0)),
    ("KeyB", Moves(Way::Glide, -1.0)),
    ("ShiftLeft", Changes(Change::Run)),
    ("ShiftRight", Changes(Change::Run)),
    ("KeyC", Changes(Change::Slow)),
    ("KeyO", Changes(Change::Orbit)),
    ("KeyH", Does(Home)),
    ("Comma", Does(Back)),
    ("Period", Does(Forward)),
    ("Digit1", Does(View(0))),
    ("Digit2", Does(View(1))),
    ("Digit3", Does(View(2))),
    ("Digit4", Does(View(3))),
    ("Digit5", Does(View(4))),
    ("Digit6", Does(View(5))),
    ("Digit7", Does(View(6))),
    ("Digit8", Does(View(7))),
    ("Digit9", Does(View(8))),
    ("KeyL", Does(LockHeight)),
    ("KeyM", Does(MouseLook)),
    ("KeyP", Does(Pause)),
    ("KeyX", Does(LockExposure)),
    ("KeyU", Does(Tone)),
    ("KeyJ", Does(FalseColor)),
    ("KeyN", Does(Contours)),
    ("KeyY", Does(LogScale)),
    ("KeyG", Does(Grids)),
    ("KeyV", Does(Panel)),
    ("KeyI", Does(Bare)),
    ("KeyZ", Does(FullScreen)),
    ("KeyT", Does(Theme)),
    ("Escape", Does(Close)),
];

/// Signs: of these the place on the keyboard differs.
const SIGNS: [(&str, Action); 4] = [("?", Help), ("+", Brighter), ("=", Brighter), ("-", Darker)];

/// Keys that do another thing with Shift, and those that need Ctrl.
const WITH_SHIFT: [(&str, Action); 1] = [("KeyK", SaveExr)];
const WITH_CTRL: [(&str, Action); 1] = [("KeyQ", Quit)];

/// What people are told: keys, and what they do.
pub const HELP: [(&str, &str); 33] = [
    ("W A S D, arrows", "walk"),
    ("Shift", "run"),
    ("C", "slowly"),
    ("Q E", "turn"),
    ("R F", "look up, down"),
    ("PgUp PgDn", "rise, sink"),
    ("Space", "towards the cursor's point"),
    ("B", "away from it"),
    ("O + arrows", "orbit that point"),
    ("drag", "look around"),
    ("right drag", "orbit"),
    ("middle drag", "shift"),
    ("wheel", "approach, back off"),
    ("M", "look with the mouse"),
    ("H", "home"),
    (", .", "back, forward"),
    ("L", "lock eye height"),
    ("1 to 9", "named view"),
    ("P", "pause tracing"),
    ("X", "exposure auto, locked"),
    ("+ -", "brighter, darker"),
    ("U", "next tone mapping"),
    ("J", "false colour"),
    ("N", "contours"),
    ("Y", "scale linear, logarithmic"),
    ("G", "section grids"),
    ("K, Shift K", "save PNG, save EXR"),
    ("V", "panel with the plan"),
    ("I", "hide all but the picture"),
    ("Z", "full screen"),
    ("T", "theme"),
    ("?, Esc", "these keys, close"),
    ("Ctrl Q", "quit"),
];

/// What is held beside a key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modifiers {
    /// Whether Shift is held.
    pub shift: bool,
    /// Whether Ctrl is held.
    pub ctrl: bool,
    /// Whether another one is held: such combinations belong to the desktop.
    pub other: bool,
}

/// Returns what a key does: `name` by its place, `sign` by what it writes.
pub fn key(name: &str, sign: &str, held: Modifiers) -> Option<Key> {
    if held.other {
        return None;
    }
    let of = |table: &[(&str, Action)], name: &str| {
        table.iter().find(|(other, _)| *other == name).map(|(_, action)| Does(*action))
    };
    if held.ctrl {
        return of(&WITH_CTRL, name);
    }
    let shifted = held.shift.then(|| of(&WITH_SHIFT, name)).flatten();
    shifted.or_else(|| of(&SIGNS, sign)).or_else(|| {
        let plain = || KEYS.iter().find(|(other, _)| *other == name).map(|(_, key)| *key);
        (name == "KeyK").then_some(Does(SavePng)).or_else(plain)
    })
}

/// Keys that are held down.
#[derive(Clone, Debug, Default)]
pub struct Held(BTreeSet<String>);

impl Held {
    /// Notes that a key went down.
    pub fn press(&mut self, name: &str) {
        self.0.insert(name.to_owned());
    }

    /// Notes that a key came up.
    pub fn release(&mut self, name: &str) {
        self.0.remove(name);
    }

    /// Notes that all keys are up.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Returns how the eye moves.
    pub fn controls(&self) -> Controls {
        let keys = || {
            self.0.iter().filter_map(|name| {
                KEYS.iter().find(|(other, _)| other == name).map(|(_, key)| *key)
            })
        };
        let changes = |change| keys().any(|key| key == Changes(change));
        let orbits = changes(Change::Orbit);
        let mut controls = Controls::default();
        for key in keys() {
            let Moves(way, amount) = key else { continue };
            match way {
                Way::Ahead if orbits => controls.over -= amount,
                Way::Right if orbits => controls.around += amount,
                Way::Ahead => controls.ahead += amount,
                Way::Right => controls.right += amount,
                Way::Rise => controls.rise += amount,
                Way::Turn => controls.turn += amount,
                Way::Tilt => controls.tilt += amount,
                Way::Glide => controls.glide += amount,
            }
        }
        for part in [&mut controls.ahead, &mut controls.right] {
            *part = part.clamp(-1.0, 1.0);
        }
        for part in [&mut controls.around, &mut controls.over] {
            *part = part.clamp(-1.0, 1.0);
        }
        if changes(Change::Slow) {
            controls.pace = 0.25;
        } else if changes(Change::Run) {
            controls.pace = 3.0;
        }
        controls
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Modifiers = Modifiers { shift: false, ctrl: false, other: false };

    #[test]
    fn no_key_has_two_meanings() {
        let names: BTreeSet<&str> = KEYS.iter().map(|(name, _)| *name).collect();
        assert_eq!(names.len(), KEYS.len());
    }

    #[test]
    fn held_keys_add_up_and_opposite_ones_cancel() {
        let mut held = Held::default();
        held.press("KeyW");
        held.press("ArrowUp");
        held.press("KeyD");
        let both = Controls { ahead: 1.0, right: 1.0, ..Controls::default() };
        assert_eq!(held.controls(), both);
        held.press("KeyA");
        assert_eq!(held.controls(), Controls { ahead: 1.0, ..Controls::default() });
        held.press("ShiftLeft");
        assert_eq!(held.controls().pace, 3.0);
        held.press("KeyC");
        assert_eq!(held.controls().pace, 0.25);
        held.clear();
        assert_eq!(held.controls(), Controls::default());
    }

    #[test]
    fn walking_keys_orbit_while_that_key_is_held() {
        let mut held = Held::default();
        held.press("KeyO");
        held.press("ArrowRight");
        held.press("ArrowUp");
        let expected = Controls { around: 1.0, over: -1.0, ..Controls::default() };
        assert_eq!(held.controls(), expected);
        held.release("KeyO");
        assert_eq!(held.controls(), Controls { ahead: 1.0, right: 1.0, ..Controls::default() });
    }

    #[test]
    fn combinations_of_the_desktop_do_nothing_and_signs_count_wherever_they_are() {
        let ctrl = Modifiers { ctrl: true, ..NONE };
        let alt = Modifiers { other: true, ..NONE };
        let shift = Modifiers { shift: true, ..NONE };
        assert_eq!(key("KeyQ", "q", NONE), Some(Moves(Way::Turn, -1.0)));
        assert_eq!(key("KeyQ", "q", ctrl), Some(Does(Quit)));
        assert_eq!(key("KeyW", "w", ctrl), None);
        assert_eq!(key("KeyW", "w", alt), None);
        assert_eq!(key("KeyK", "k", NONE), Some(Does(SavePng)));
        assert_eq!(key("KeyK", "K", shift), Some(Does(SaveExr)));
        // A German keyboard has `?` where others have `-`.
        assert_eq!(key("Minus", "?", shift), Some(Does(Help)));
        assert_eq!(key("Slash", "-", NONE), Some(Does(Darker)));
    }
}
