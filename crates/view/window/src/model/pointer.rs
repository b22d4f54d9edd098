//! Effects of the mouse and of fingers.

use std::{path::PathBuf, time::Instant};

use holo_stage::{Input, ObjectOrder};

use super::{Effect, Point, WindowModel};
use crate::{
    hand::{Drag, PointerTarget, looked, wheeled},
    overlay::space::{OverlayCamera, Plan},
};

/// Degrees by which a step of the wheel turns an object.
const SPIN: f64 = 15.0;

impl WindowModel {
    /// Returns the effects of a motion of the mouse to a point.
    pub fn move_to(&mut self, at: Point) -> Vec<Effect> {
        if self.modes.looks {
            return Vec::new();
        }
        let target = self.target();
        let input = self.hand.move_to(at, &target);
        let has_part = self.hand.part(&target).is_some();
        if has_part || self.modes.has_panel && !self.modes.is_bare {
            self.touch();
        }
        let held = self.cursor().filter(|_| self.holds);
        let held = held.map(|(x, y)| Input::Object(ObjectOrder::DragTo([x, y])));
        held.or(input).map(|input| self.send(input)).unwrap_or_default()
    }

    /// Returns the effects of a motion of the mouse by some pixels, wherever it is.
    pub fn move_by(&mut self, right: f64, down: f64) -> Vec<Effect> {
        if self.modes.looks { self.send(looked(right, down)) } else { Vec::new() }
    }

    /// Records that the mouse has left the window.
    pub fn leave(&mut self) -> Vec<Effect> {
        self.hand.left();
        self.send(Input::Cursor(None))
    }

    /// Returns the effects of a pressed button.
    pub fn button(&mut self, drag: Drag) -> Vec<Effect> {
        if std::mem::take(&mut self.modes.has_help) {
            self.touch();
            return Vec::new();
        }
        match self.hand.at() {
            Some(_) if drag == Drag::Turn && self.modifiers.ctrl => {
                self.hand.begin_part();
                Vec::new()
            }
            Some(at) if drag == Drag::Turn && self.modifiers.shift => {
                self.click(at).unwrap_or_else(|| {
                    self.holds = true;
                    let at = self.cursor().map(|(x, y)| ObjectOrder::Grab([x, y]));
                    at.map(|order| self.send(Input::Object(order))).unwrap_or_default()
                })
            }
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

    /// Returns the effects of a released button.
    pub fn button_up(&mut self, drag: Drag) -> Vec<Effect> {
        self.hand.release(drag);
        self.holds &= drag != Drag::Turn;
        let target = self.target();
        let part = if drag == Drag::Turn { self.hand.end_part(&target) } else { None };
        part.map(|input| self.send(input)).unwrap_or_default()
    }

    /// Returns the part of the picture that is being dragged, or else the part that is traced
    /// first.
    pub fn focus(&self) -> Option<[f64; 4]> {
        self.hand.part(&self.target()).or(self.state.focus)
    }

    /// Returns the effects of a click on the panel; `None` if the click is beside it.
    fn click(&mut self, at: Point) -> Option<Vec<Effect>> {
        let layout = self.panel();
        if self.modes.is_bare || !self.modes.has_panel || !layout.rect.contains(at) {
            return None;
        }
        if let Some(index) = layout.views.iter().position(|line| line.contains(at)) {
            return Some(self.command(&format!("view {}", index + 1), Instant::now()));
        }
        let part = layout.parts.iter().position(|line| line.contains(at));
        if let Some(part) = part.and_then(|index| self.state.parts.get(index)) {
            let word = if part.is_on { "without" } else { "with" };
            let line = format!("{word} {}", part.name);
            return Some(self.command(&line, Instant::now()));
        }
        let view = self.seen.as_ref().map(|seen| &seen.shown.view);
        let camera = OverlayCamera::now(&self.state, view);
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

    /// Returns the effects of steps of the wheel.
    pub fn wheel(&mut self, steps: f64) -> Vec<Effect> {
        match self.cursor().filter(|_| self.modifiers.shift) {
            Some((x, y)) => {
                let order = ObjectOrder::Spin([x, y], -SPIN * steps);
                self.send(Input::Object(order))
            }
            None => self.send(wheeled(steps)),
        }
    }

    /// Returns the effects of a model that is dropped on the window. Without a cursor, it is put
    /// in the middle of the picture: not every system says where a file is dropped.
    pub fn drop_model(&mut self, path: PathBuf) -> Vec<Effect> {
        let (x, y) = self.cursor().unwrap_or((0.5, 0.5));
        self.send(Input::Drop(path, [x, y]))
    }

    /// Returns the effects of a finger's touch or motion.
    pub fn finger(&mut self, finger: u64, at: Point) -> Vec<Effect> {
        let target = self.target();
        let inputs = self.hand.finger(finger, at, &target);
        inputs.into_iter().flat_map(|input| self.send(input)).collect()
    }

    /// Records that a finger is lifted.
    pub fn lift(&mut self, finger: u64) {
        self.hand.lift(finger);
    }

    fn target(&self) -> PointerTarget {
        PointerTarget::new(self.picture(), self.seen.as_ref().map(|seen| &seen.shown.view))
    }
}
