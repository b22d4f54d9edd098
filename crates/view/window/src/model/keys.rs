//! Effects of keys, and the command line that is typed.

use std::time::Instant;

use super::{Effect, Grids, Modes, Modifiers, SaveFormat, WindowModel};
use holo_stage::{
    DriverArg, Input,
    commands::{self, Action, Does, Local, action_of},
};

/// Longest command line, bytes.
const MOST_TYPED: usize = 1000;

impl WindowModel {
    /// Records which modifier keys are held.
    pub fn set_modifiers(&mut self, modifiers: Modifiers) {
        self.modifiers = modifiers;
    }

    /// Records that the window has lost the keyboard.
    pub fn lose_focus(&mut self) -> Vec<Effect> {
        self.held.clear();
        let looks = std::mem::take(&mut self.modes.looks);
        let mut effects = self.hold();
        effects.extend(looks.then_some(Effect::Grab(false)));
        effects
    }

    /// Records that a key is released.
    pub fn release(&mut self, name: &str) -> Vec<Effect> {
        self.held.remove(name);
        self.hold()
    }

    /// Returns the effects of a key: `name` is its place on the keyboard, `sign` the text that it
    /// writes.
    pub fn press(&mut self, name: &str, sign: &str, repeats: bool, now: Instant) -> Vec<Effect> {
        let Modifiers { ctrl, other, .. } = self.modifiers;
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

    /// Adds a key to the command line that is being typed.
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
                // A wrong line stays, so that it can be corrected.
                self.typed = effects.is_empty().then_some(line);
                return effects;
            }
            _ if line.len() < MOST_TYPED => line.push_str(sign),
            _ => {}
        }
        Vec::new()
    }

    /// Passes a command line to the stage.
    pub(super) fn command(&mut self, line: &str, now: Instant) -> Vec<Effect> {
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

    /// Performs an action of the window itself, and returns its effects.
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
            Local::Save => vec![Effect::Save(SaveFormat::Seen)],
            Local::SaveRadiance => vec![Effect::Save(SaveFormat::Radiance)],
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

    /// Shows or hides a part of the overlay.
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

    /// Returns whether something is open that Esc would close.
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
}

/// Returns the driver after the one of this name.
fn next_driver(now: &str) -> &'static str {
    let names = DriverArg::names();
    let at = names.iter().position(|name| *name == now).map_or(0, |at| at + 1);
    names[at % names.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_driver_follows_in_the_list() {
        let names = DriverArg::names();
        for (at, name) in names.iter().enumerate() {
            assert_eq!(next_driver(name), names[(at + 1) % names.len()]);
        }
        assert_eq!(next_driver("none"), names[0]);
    }
}
