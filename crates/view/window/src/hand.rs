//! Translates motions of the mouse and of fingers over the picture into inputs.

use std::collections::BTreeMap;

use holo_picture::View;
use holo_stage::Input;

use super::canvas::{Point, Rect};

/// Radians per pixel while the mouse turns the eye without a pressed button.
const LOOKING: f64 = 0.0025;

/// Angles of the whole picture if the view is no perspective, radians.
const OTHER_ANGLES: (f64, f64) = (1.0, 0.6);

/// Share of the distance that remains after one step of the wheel.
const STEP_LEAVES: f64 = 0.9;

/// Most steps of a wheel in one event.
const MOST_STEPS: f64 = 4.0;

/// Least width and height of a part to trace first, in shares of the picture. A smaller one is a
/// click.
const LEAST_PART: f64 = 0.02;

/// The effect of a pressed button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drag {
    /// Turn in place.
    Turn,
    /// Move around the point under the cursor.
    Orbit,
    /// Move the picture.
    Slide,
}

/// The picture that pointers move over.
#[derive(Clone, Copy, Debug)]
pub struct PointerTarget {
    /// Its place in the window.
    pub rect: Rect,
    /// Its angles, radians.
    pub angles: (f64, f64),
}

impl PointerTarget {
    /// Returns a picture's target.
    pub fn new(rect: Rect, view: Option<&View>) -> PointerTarget {
        let perspective = view.filter(|view| view.kind.letter() == 'v');
        let angles = perspective.map_or(OTHER_ANGLES, |view| {
            let (across, along) = view.extent();
            (2.0 * (across / 2.0).atan(), 2.0 * (along / 2.0).atan())
        });
        PointerTarget { rect, angles }
    }

    /// Returns the cursor's place in the picture, if it is inside.
    pub fn cursor(&self, at: Point) -> Input {
        Input::Cursor(self.rect.contains(at).then(|| self.rect.shares(at)))
    }
}

/// The state of the mouse and the fingers.
#[derive(Clone, Debug, Default)]
pub struct WindowPointers {
    /// Position of the mouse, while it is in the window.
    at: Option<Point>,
    drag: Option<Drag>,
    /// First corner of the rectangle that is being dragged.
    corner: Option<Point>,
    fingers: BTreeMap<u64, Point>,
}

impl WindowPointers {
    /// Returns the position of the mouse.
    pub fn at(&self) -> Option<Point> {
        self.at
    }

    /// Returns the effect of the pressed button.
    pub fn drag(&self) -> Option<Drag> {
        self.drag
    }

    /// Records that the mouse has left the window.
    pub fn left(&mut self) {
        self.at = None;
    }

    /// Records that a button is pressed over the picture.
    pub fn press(&mut self, drag: Drag) {
        self.drag = self.drag.or(Some(drag));
    }

    /// Records that a button is released.
    pub fn release(&mut self, drag: Drag) {
        self.drag = self.drag.filter(|now| *now != drag);
    }

    /// Begins to drag a rectangle from the position of the mouse.
    pub fn begin_part(&mut self) {
        self.corner = self.at;
    }

    /// Returns the part of the picture inside the dragged rectangle: left, top, right and bottom.
    pub fn part(&self, target: &PointerTarget) -> Option<[f64; 4]> {
        let inside = |(x, y): Point| (x.clamp(0.0, 1.0), y.clamp(0.0, 1.0));
        let (a, b) = self.corner.zip(self.at)?;
        let [a, b] = [a, b].map(|at| inside(target.rect.shares(at)));
        Some([a.0.min(b.0), a.1.min(b.1), a.0.max(b.0), a.1.max(b.1)])
    }

    /// Ends the rectangle, if one is being dragged. Returns the resulting input.
    pub fn end_part(&mut self, target: &PointerTarget) -> Option<Input> {
        let part = self.part(target);
        self.corner.take()?;
        let is_large = |[left, top, right, bottom]: &[f64; 4]| {
            right - left > LEAST_PART && bottom - top > LEAST_PART
        };
        Some(Input::Focus(part.filter(is_large)))
    }

    /// Returns the input for a motion of the mouse.
    pub fn move_to(&mut self, at: Point, target: &PointerTarget) -> Option<Input> {
        let before = self.at.replace(at);
        if self.corner.is_some() {
            return None;
        }
        let (Some(before), Some(drag)) = (before, self.drag) else {
            return Some(target.cursor(at));
        };
        dragged(drag, before, at, target)
    }

    /// Returns the input for a finger's touch or motion.
    pub fn finger(&mut self, finger: u64, at: Point, target: &PointerTarget) -> Vec<Input> {
        let Some(before) = self.fingers.insert(finger, at) else {
            return if self.fingers.len() == 1 { vec![target.cursor(at)] } else { Vec::new() };
        };
        let other = self.fingers.iter().find(|(other, _)| **other != finger);
        match other {
            None => dragged(Drag::Turn, before, at, target).into_iter().collect(),
            Some((_, &other)) => two_fingers(before, at, other, target),
        }
    }

    /// Records that a finger is lifted.
    pub fn lift(&mut self, finger: u64) {
        self.fingers.remove(&finger);
    }
}

/// Returns the input for a motion without a pressed button, in pixels to the right and down.
pub fn looked(right: f64, down: f64) -> Input {
    Input::Turn(right * LOOKING, -down * LOOKING)
}

/// Returns the input for steps of the wheel.
pub fn wheeled(steps: f64) -> Input {
    Input::Wheel(steps.clamp(-MOST_STEPS, MOST_STEPS))
}

fn dragged(drag: Drag, from: Point, to: Point, target: &PointerTarget) -> Option<Input> {
    let (from, to) = (target.rect.shares(from), target.rect.shares(to));
    let (right, down) = (to.0 - from.0, to.1 - from.1);
    if right == 0.0 && down == 0.0 {
        return None;
    }
    let (across, along) = target.angles;
    let half_turn = std::f64::consts::PI;
    Some(match drag {
        // The grabbed point stays under the cursor.
        Drag::Turn => Input::Turn(-right * across, down * along),
        Drag::Orbit => Input::Orbit(right * half_turn, -down * half_turn / 2.0),
        Drag::Slide => Input::Slide(-right, down),
    })
}

/// Returns the inputs for a motion of one of two fingers. Spreading approaches the point between
/// the fingers, pinching backs off. A common motion shifts the picture.
fn two_fingers(from: Point, to: Point, other: Point, target: &PointerTarget) -> Vec<Input> {
    let apart = |a: Point, b: Point| (a.0 - b.0).hypot(a.1 - b.1).max(1.0);
    let steps = (apart(to, other) / apart(from, other)).ln() / -STEP_LEAVES.ln();
    let middle = ((to.0 + other.0) / 2.0, (to.1 + other.1) / 2.0);
    let (from, to) = (target.rect.shares(from), target.rect.shares(to));
    vec![
        target.cursor(middle),
        wheeled(steps),
        Input::Slide(-(to.0 - from.0) / 2.0, (to.1 - from.1) / 2.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target() -> PointerTarget {
        let rect = Rect { x: 100, y: 0, width: 800, height: 400 };
        PointerTarget { rect, angles: (1.6, 0.8) }
    }

    #[test]
    fn a_drag_turns_by_the_angle_that_the_cursor_passes() {
        let mut hand = WindowPointers::default();
        let target = target();
        let moved = hand.move_to((500.0, 200.0), &target);
        assert_eq!(moved, Some(Input::Cursor(Some((0.5, 0.5)))));
        hand.press(Drag::Turn);
        let turned = hand.move_to((600.0, 100.0), &target);
        assert_eq!(turned, Some(Input::Turn(-0.125 * 1.6, -0.25 * 0.8)));
        assert_eq!(hand.move_to((600.0, 100.0), &target), None);
        // Another button changes nothing until the first is released.
        hand.press(Drag::Orbit);
        hand.release(Drag::Orbit);
        assert_eq!(hand.drag(), Some(Drag::Turn));
        hand.release(Drag::Turn);
        assert_eq!(hand.move_to((0.0, 0.0), &target), Some(Input::Cursor(None)));
    }

    #[test]
    fn a_rectangle_is_a_part_of_the_picture_and_a_click_is_none() {
        let (mut hand, target) = (WindowPointers::default(), target());
        hand.move_to((500.0, 100.0), &target);
        assert_eq!(hand.end_part(&target), None);
        hand.begin_part();
        assert_eq!(hand.move_to((300.0, 900.0), &target), None);
        assert_eq!(hand.part(&target), Some([0.25, 0.25, 0.5, 1.0]));
        let focus = Input::Focus(Some([0.25, 0.25, 0.5, 1.0]));
        assert_eq!(hand.end_part(&target), Some(focus));
        hand.begin_part();
        assert_eq!(hand.end_part(&target), Some(Input::Focus(None)));
        assert!(matches!(hand.move_to((310.0, 90.0), &target), Some(Input::Cursor(_))));
    }

    #[test]
    fn one_finger_turns_and_two_approach_what_is_between_them() {
        let mut hand = WindowPointers::default();
        let target = target();
        assert_eq!(hand.finger(1, (500.0, 200.0), &target).len(), 1);
        let turned = hand.finger(1, (580.0, 200.0), &target);
        assert!(matches!(turned[..], [Input::Turn(right, _)] if right < 0.0), "{turned:?}");
        assert_eq!(hand.finger(2, (680.0, 200.0), &target), []);
        let inputs = hand.finger(2, (780.0, 200.0), &target);
        assert_eq!(inputs[0], Input::Cursor(Some((0.725, 0.5))));
        assert!(matches!(inputs[1], Input::Wheel(steps) if steps > 1.0), "{inputs:?}");
        hand.lift(1);
        let turned = hand.finger(2, (700.0, 200.0), &target);
        assert!(matches!(turned[..], [Input::Turn(..)]), "{turned:?}");
    }

    #[test]
    fn a_flood_of_wheel_steps_is_bounded() {
        assert_eq!(wheeled(1e9), Input::Wheel(MOST_STEPS));
        let inputs = two_fingers((0.0, 0.0), (1e9, 0.0), (1.0, 0.0), &target());
        assert_eq!(inputs[1], Input::Wheel(MOST_STEPS));
    }
}
