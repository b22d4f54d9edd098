//! The table of actions.

use holo_walk::Controls;
use serde::Serialize;

use crate::State;

/// An action that a key triggers.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Action {
    /// Its name. For actions of the stage, this is also the command line.
    pub name: &'static str,
    /// Its keys.
    pub keys: &'static [&'static str],
    /// The keys as shown to people.
    pub shown: &'static str,
    /// A short description.
    pub help: &'static str,
    /// Its effect.
    pub does: Does,
}

/// The effect of an action.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Does {
    /// Moves the eye while the key is held: which part of the controls, and by how much.
    Hold(Part, f64),
    /// Multiplies the speed while the key is held.
    Pace(f64),
    /// While the key is held, [`Part::Right`] and [`Part::Ahead`] orbit.
    Orbit,
    /// The stage runs the command line that is the action's name.
    Stage,
    /// The stage switches something on with the first line, and off with the second.
    Toggle(Toggle, &'static str, &'static str),
    /// Goes to the named view of the key's number: the line is `view NUMBER`.
    NamedView,
    /// The front end does it.
    Local(Local),
}

/// Parts of [`Controls`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// [`Controls::ahead`]; while the person orbits, [`Controls::over`] downwards.
    Ahead,
    /// [`Controls::right`]; while the person orbits, [`Controls::around`].
    Right,
    /// [`Controls::rise`].
    Rise,
    /// [`Controls::turn`].
    Turn,
    /// [`Controls::tilt`].
    Tilt,
    /// [`Controls::glide`].
    Glide,
}

/// A state of the stage that is on or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Toggle {
    /// `State::is_paused`.
    Paused,
    /// `State::height_is_locked`.
    Locked,
    /// `State::is_solid`.
    Solid,
}

impl Toggle {
    /// Returns whether it is on.
    pub fn is_on(self, state: &State) -> bool {
        match self {
            Toggle::Paused => state.is_paused,
            Toggle::Locked => state.height_is_locked,
            Toggle::Solid => state.is_solid,
        }
    }
}

/// Actions that a front end does by itself. A front end may leave some out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Local {
    /// Locks the exposure, or lets it follow the light.
    Exposure,
    /// Makes the picture half a stop brighter.
    Brighter,
    /// Makes the picture half a stop darker.
    Darker,
    /// Switches between luminance as colours and the picture.
    FalseColor,
    /// Switches lines of equal luminance on or off.
    Contours,
    /// Changes to the next tone mapping.
    NextTone,
    /// Switches between a logarithmic and a linear scale of luminance.
    LogScale,
    /// Cycles the display of the sections' grids: when they help, always, never.
    Grid,
    /// Saves the picture as it is seen.
    Save,
    /// Saves the picture's radiance.
    SaveRadiance,
    /// Switches looking with the mouse without a button on or off.
    MouseLook,
    /// Changes to the next driver.
    NextDriver,
    /// Shows the panel, or hides it.
    Panel,
    /// Hides everything except the picture.
    Bare,
    /// Switches full screen on or off.
    FullScreen,
    /// Switches between the dark and the light theme.
    Theme,
    /// Shows the keys.
    Help,
    /// Asks whether to quit.
    Quit,
}

/// All actions, in the order of the help.
pub const ACTIONS: &[Action] = &[
    on("ahead", &["KeyW", "ArrowUp"], "W ↑", "walk ahead", Does::Hold(Part::Ahead, 1.0)),
    on("behind", &["KeyS", "ArrowDown"], "S ↓", "walk back", Does::Hold(Part::Ahead, -1.0)),
    on("left", &["KeyA", "ArrowLeft"], "A ←", "walk left", Does::Hold(Part::Right, -1.0)),
    on("right", &["KeyD", "ArrowRight"], "D →", "walk right", Does::Hold(Part::Right, 1.0)),
    on("run", &["ShiftLeft", "ShiftRight"], "Shift", "run", Does::Pace(3.0)),
    on("slow", &["KeyC"], "C", "slowly", Does::Pace(0.25)),
    on("turn left", &["KeyQ"], "Q", "turn left", Does::Hold(Part::Turn, -1.0)),
    on("turn right", &["KeyE"], "E", "turn right", Does::Hold(Part::Turn, 1.0)),
    on("look up", &["KeyR"], "R", "look up", Does::Hold(Part::Tilt, 1.0)),
    on("look down", &["KeyF"], "F", "look down", Does::Hold(Part::Tilt, -1.0)),
    on("rise", &["PageUp"], "PgUp", "rise", Does::Hold(Part::Rise, 1.0)),
    on("sink", &["PageDown"], "PgDn", "sink", Does::Hold(Part::Rise, -1.0)),
    on("near", &["Space"], "Space", "towards the cursor’s point", Does::Hold(Part::Glide, 1.0)),
    on("away", &["KeyB"], "B", "away from it", Does::Hold(Part::Glide, -1.0)),
    on("orbit", &["KeyO"], "O + arrows", "orbit that point", Does::Orbit),
    on("home", &["KeyH"], "H", "home", Does::Stage),
    on("back", &["Comma"], ",", "back to the view before", Does::Stage),
    on("forward", &["Period"], ".", "forward again", Does::Stage),
    on("view", DIGITS, "1 … 9", "named view", Does::NamedView),
    on("lock", &["KeyL"], "L", "lock eye height", LOCK),
    on("solid", &["F4"], "F4", "walls stop you, or not", SOLID),
    on("pause", &["KeyP"], "P", "pause tracing, resume", PAUSE),
    on("kill workers", &["Delete"], "Del", "stop the tracers", Does::Stage),
    on("restart workers", &["Insert"], "Ins", "start the workers again", Does::Stage),
    on("restart", &["F9"], "F9", "load the edited scene", Does::Stage),
    on("start over", &["Backspace"], "Backspace", "forget all samples (asks first)", Does::Stage),
    on("cancel", &["Escape"], "Esc", "cancel, close", Does::Stage),
    on("driver", &["KeyY"], "Y", "next driver", Does::Local(Local::NextDriver)),
    on("exposure", &["KeyX"], "X", "exposure auto, locked", Does::Local(Local::Exposure)),
    on("brighter", &["+", "="], "+", "brighter", Does::Local(Local::Brighter)),
    on("darker", &["-"], "−", "darker", Does::Local(Local::Darker)),
    on("false colour", &["KeyJ"], "J", "false colour", Does::Local(Local::FalseColor)),
    on("contours", &["KeyN"], "N", "contours", Does::Local(Local::Contours)),
    on("tone", &["KeyU"], "U", "next tone mapping", Does::Local(Local::NextTone)),
    on("scale", &["/"], "/", "scale linear, logarithmic", Does::Local(Local::LogScale)),
    on("grid", &["KeyG"], "G", "section grids", Does::Local(Local::Grid)),
    on("save", &["KeyK"], "K", "save PNG", Does::Local(Local::Save)),
    on("save radiance", &["F2"], "F2", "save EXR", Does::Local(Local::SaveRadiance)),
    on("mouse", &["KeyM"], "M", "look with the mouse", Does::Local(Local::MouseLook)),
    on("panel", &["KeyV"], "V", "panel", Does::Local(Local::Panel)),
    on("bare", &["KeyI"], "I", "hide all but the picture", Does::Local(Local::Bare)),
    on("full screen", &["KeyZ"], "Z", "full screen", Does::Local(Local::FullScreen)),
    on("theme", &["KeyT"], "T", "dark, light", Does::Local(Local::Theme)),
    on("keys", &["?"], "?", "these keys", Does::Local(Local::Help)),
    on("quit", &["End"], "End", "quit", Does::Local(Local::Quit)),
];

const LOCK: Does = Does::Toggle(Toggle::Locked, "lock", "unlock");

const SOLID: Does = Does::Toggle(Toggle::Solid, "solid", "ghost");

const PAUSE: Does = Does::Toggle(Toggle::Paused, "pause", "resume");

/// Mouse gestures and their effects.
pub const GESTURES: &[(&str, &str)] = &[
    ("drag", "look around"),
    ("right drag", "orbit"),
    ("middle drag", "shift"),
    ("Ctrl drag", "trace here first"),
    ("Shift drag", "move an object"),
    ("Shift wheel", "turn an object"),
    ("wheel", "approach, back off"),
];

const DIGITS: &[&str] =
    &["Digit1", "Digit2", "Digit3", "Digit4", "Digit5", "Digit6", "Digit7", "Digit8", "Digit9"];

const fn on(
    name: &'static str,
    keys: &'static [&'static str],
    shown: &'static str,
    help: &'static str,
    does: Does,
) -> Action {
    Action { name, keys, shown, help, does }
}

/// Returns the action of a key, named by its place or by the character that it types.
pub fn action_of(key: &str) -> Option<&'static Action> {
    ACTIONS.iter().find(|action| action.keys.contains(&key))
}

impl Action {
    /// Returns the command line with which the stage does the action, if the stage does it. `key`
    /// is the key that was pressed.
    pub fn line(&self, key: &str, state: &State) -> Option<String> {
        match self.does {
            Does::Stage => Some(self.name.to_owned()),
            Does::Toggle(toggle, _, off) if toggle.is_on(state) => Some(off.to_owned()),
            Does::Toggle(_, on, _) => Some(on.to_owned()),
            Does::NamedView => key.strip_prefix("Digit").map(|number| format!("view {number}")),
            Does::Hold(..) | Does::Pace(_) | Does::Orbit | Does::Local(_) => None,
        }
    }

    /// Returns the controls of the keys that are held down.
    pub fn controls<'a>(held: impl Iterator<Item = &'a str> + Clone) -> Controls {
        let actions = held.filter_map(action_of);
        let orbits = actions.clone().any(|action| action.does == Does::Orbit);
        let mut controls = Controls::default();
        for action in actions {
            match action.does {
                Does::Hold(part, amount) => {
                    let (part, amount) = match part {
                        Part::Ahead if orbits => (&mut controls.over, -amount),
                        Part::Right if orbits => (&mut controls.around, amount),
                        Part::Ahead => (&mut controls.ahead, amount),
                        Part::Right => (&mut controls.right, amount),
                        Part::Rise => (&mut controls.rise, amount),
                        Part::Turn => (&mut controls.turn, amount),
                        Part::Tilt => (&mut controls.tilt, amount),
                        Part::Glide => (&mut controls.glide, amount),
                    };
                    *part = (*part + amount).clamp(-1.0, 1.0);
                }
                Does::Pace(factor) => controls.pace = factor,
                _ => {}
            }
        }
        controls
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::commands::parse;

    #[test]
    fn a_key_means_one_thing_and_a_name_too() {
        let mut seen = BTreeSet::new();
        for action in ACTIONS {
            assert!(seen.insert(action.name), "{}", action.name);
            assert!(action.keys.iter().all(|key| seen.insert(key)), "{:?}", action.keys);
        }
    }

    #[test]
    fn every_key_of_the_stage_says_a_line_that_it_understands() {
        let (rests, mut paused) = (State::default(), State::default());
        paused.is_paused = true;
        let mut lines = 0;
        for action in ACTIONS {
            for key in action.keys {
                for state in [&rests, &paused] {
                    let Some(line) = action.line(key, state) else { continue };
                    assert!(parse(&line).is_ok(), "{line}");
                    lines += 1;
                }
            }
        }
        assert!(lines > 20, "{lines}");
        let pause = action_of("KeyP").unwrap();
        assert_ne!(pause.line("KeyP", &rests), pause.line("KeyP", &paused));
    }

    #[test]
    fn held_keys_add_up_to_controls() {
        let controls = |keys: &[&str]| Action::controls(keys.iter().copied());
        let walk = controls(&["KeyW", "ArrowUp", "KeyD", "KeyA", "ShiftLeft", "KeyH"]);
        assert_eq!(walk, Controls { ahead: 1.0, pace: 3.0, ..Controls::default() });
        let orbit = controls(&["ArrowUp", "ArrowLeft", "KeyO"]);
        assert_eq!(orbit, Controls { over: -1.0, around: -1.0, ..Controls::default() });
    }
}
