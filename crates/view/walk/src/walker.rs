//! The state of a walk: a view, the controls that are held down, a home, and the views before and
//! after.

use std::sync::Arc;

use glam::DVec3;
use holo_picture::ViewSpec;

use crate::{
    History, NEAREST, Pose, Surroundings,
    solid::{Body, KEPT},
};

/// Walking pace of a person indoors, metres per second.
const WALKING: f64 = 1.4;

/// Turning pace, radians per second: half a turn takes two seconds.
const TURNING: f64 = std::f64::consts::FRAC_PI_2;

/// Distance of the point to move towards if no surface is known under the cursor, metres.
const AFAR: f64 = 10.0;

/// Seconds of motion for one step of a wheel.
const WHEEL_SECONDS: f64 = 0.1;

/// The controls that are held down. Numbers are from -1 to 1 unless stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controls {
    /// Ahead on the level plane; backwards if negative.
    pub ahead: f64,
    /// To the right.
    pub right: f64,
    /// Up.
    pub rise: f64,
    /// Turn to the right.
    pub turn: f64,
    /// Look upwards.
    pub tilt: f64,
    /// Towards the point under the cursor; away from it if negative.
    pub glide: f64,
    /// Around the point under the cursor, to the right.
    pub around: f64,
    /// Around the point under the cursor, upwards.
    pub over: f64,
    /// Factor of the walking pace, above 0.
    pub pace: f64,
}

impl Default for Controls {
    fn default() -> Controls {
        Controls {
            ahead: 0.0,
            right: 0.0,
            rise: 0.0,
            turn: 0.0,
            tilt: 0.0,
            glide: 0.0,
            around: 0.0,
            over: 0.0,
            pace: 1.0,
        }
    }
}

impl Controls {
    /// Returns true if any control that moves the eye is held.
    pub fn moves(&self) -> bool {
        Controls { pace: 1.0, ..*self } != Controls::default()
    }
}

/// The state of a walk.
#[derive(Clone, Debug)]
pub struct Walker {
    spec: ViewSpec,
    pose: Pose,
    home: ViewSpec,
    history: History,
    /// Scene units per metre.
    metre: f64,
    /// The controls that are held down.
    pub controls: Controls,
    /// True if the eye's height is locked, so that no motion changes it.
    pub height_is_locked: bool,
    /// The surfaces that the eye moves among, if they are known.
    pub surroundings: Option<Arc<dyn Surroundings>>,
    /// True if surfaces stop the eye and carry it.
    pub is_solid: bool,
    /// True if the eye may leave the house.
    pub may_leave: bool,
    /// True if a motion ended because it would have left the house.
    is_at_exit: bool,
    /// The view where the eye last stayed, until it moves again.
    stayed: Option<ViewSpec>,
}

/// Kinds of motion, which surfaces stop in different ways.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// In place.
    Turn,
    /// On a floor, or up and down. It slides along walls.
    Walk,
    /// On a straight line, up to a surface.
    Fly,
}

impl Walker {
    /// Returns a walk that starts at `home`. `None` if this view has no valid eye and direction.
    /// `unit` is the length of a scene unit in metres.
    pub fn new(home: ViewSpec, unit: f64) -> Option<Walker> {
        let pose = pose(&home)?;
        let metre = if unit.is_finite() && unit > 0.0 { 1.0 / unit } else { 1.0 };
        Some(Walker {
            spec: at(&home, &pose),
            pose,
            home,
            history: History::default(),
            metre,
            controls: Controls::default(),
            height_is_locked: false,
            surroundings: None,
            is_solid: true,
            may_leave: false,
            is_at_exit: false,
            stayed: None,
        })
    }

    /// Returns the view.
    pub fn view(&self) -> &ViewSpec {
        &self.spec
    }

    /// Returns the number of scene units in a metre.
    pub fn metre(&self) -> f64 {
        self.metre
    }

    /// Returns the eye's position and direction.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Returns the pose that follows if the motion since `before` continues for `share` of its
    /// length.
    pub fn ahead(&self, before: &Pose, share: f64) -> ViewSpec {
        at(&self.spec, &self.pose.ahead(before, share))
    }

    /// Moves for `seconds` by the controls that are held. `under` is the point under the cursor, if
    /// known, and `towards` the direction of the ray under the cursor. Returns true if the eye
    /// moved.
    pub fn advance(&mut self, seconds: f64, under: Option<DVec3>, towards: DVec3) -> bool {
        let held = self.controls;
        if !held.moves() || seconds.is_nan() || seconds <= 0.0 {
            return false;
        }
        let pace = held.pace;
        let step = WALKING * pace * self.metre * seconds;
        let angle = TURNING * pace.min(2.0) * seconds;
        let length = held.ahead.hypot(held.right).max(1.0);
        let point = self.target(under, towards);
        let mut next = self.pose.turn(held.turn * angle, held.tilt * angle);
        next = next.walk(held.ahead / length * step, held.right / length * step, held.rise * step);
        let mut has_moved = self.go(next, Motion::Walk);
        if held.around != 0.0 || held.over != 0.0 {
            has_moved |= self.go_around(point, held.around * angle, held.over * angle);
        }
        if held.glide != 0.0 {
            let next = self.pose.glide(point, held.glide * pace * seconds, self.nearest());
            has_moved |= self.go(next, Motion::Fly);
        }
        has_moved
    }

    /// Turns in place, by radians to the right and upwards.
    pub fn turn(&mut self, right: f64, up: f64) -> bool {
        self.go(self.pose.turn(right, up), Motion::Turn)
    }

    /// Moves around the point under the cursor, as in [`advance`](Self::advance), by radians.
    pub fn orbit(&mut self, right: f64, up: f64, under: Option<DVec3>, towards: DVec3) -> bool {
        let point = self.target(under, towards);
        self.go_around(point, right, up)
    }

    /// Moves towards the point under the cursor by steps of a wheel, or away from it if `steps` is
    /// negative.
    pub fn wheel(&mut self, steps: f64, under: Option<DVec3>, towards: DVec3) -> bool {
        let point = self.target(under, towards);
        let seconds = (steps * WHEEL_SECONDS).clamp(-2.0, 2.0);
        self.go(self.pose.glide(point, seconds, self.nearest()), Motion::Fly)
    }

    /// Moves by scene units: ahead and to the right on the level plane, and up.
    pub fn shift(&mut self, ahead: f64, right: f64, rise: f64) -> bool {
        self.go(self.pose.walk(ahead, right, rise), Motion::Fly)
    }

    /// Goes to a view. Parts that `change` leaves out stay as they are. If the result has no valid
    /// eye and direction, changes nothing and returns false.
    pub fn look(&mut self, change: &ViewSpec) -> bool {
        self.jump(self.spec.overridden_by(change))
    }

    /// Goes to a place without turning.
    pub fn go_to(&mut self, eye: DVec3) -> bool {
        self.jump(ViewSpec { vp: Some(eye), ..self.spec })
    }

    /// Goes to the home view.
    pub fn go_home(&mut self) -> bool {
        self.jump(self.home)
    }

    /// Goes back to the view before.
    pub fn back(&mut self) -> bool {
        let view = self.history.back(self.spec);
        view.is_some_and(|view| self.set(view))
    }

    /// Undoes [`back`](Self::back).
    pub fn forward(&mut self) -> bool {
        let view = self.history.forward(self.spec);
        view.is_some_and(|view| self.set(view))
    }

    /// Marks this view as one where the eye stays. The next motion adds it to the history.
    pub fn stay(&mut self) {
        self.stayed = Some(self.spec);
    }

    fn target(&self, under: Option<DVec3>, towards: DVec3) -> DVec3 {
        let afar = self.pose.eye + towards.normalize_or(self.pose.direction) * AFAR * self.metre;
        under.filter(|point| point.is_finite()).unwrap_or(afar)
    }

    /// Returns whether a motion ended because it would have left the house, once.
    pub fn take_exit(&mut self) -> bool {
        std::mem::take(&mut self.is_at_exit)
    }

    /// Returns how near the eye may come to the point that it moves towards.
    fn nearest(&self) -> f64 {
        let metres = if self.is_solid { NEAREST.max(KEPT) } else { NEAREST };
        metres * self.metre
    }

    /// Returns the surroundings that stop the eye, if any do.
    fn solid(&self) -> Option<Arc<dyn Surroundings>> {
        let has_eye = self.spec.kind.unwrap_or_default().has_eye();
        self.surroundings.clone().filter(|_| self.is_solid && has_eye)
    }

    fn go_around(&mut self, point: DVec3, right: f64, up: f64) -> bool {
        let (from, up) = (self.pose, if self.height_is_locked { 0.0 } else { up });
        let part = |share: f64| from.orbit(point, share * right, share * up);
        let next = match self.solid() {
            Some(world) => {
                let body = Body { world: world.as_ref(), metre: self.metre };
                body.orbit(from, right.hypot(up), part)
            }
            None => part(1.0),
        };
        self.accept(next)
    }

    fn go(&mut self, next: Pose, motion: Motion) -> bool {
        let next = match self.solid().filter(|_| next.eye != self.pose.eye) {
            Some(world) => {
                let body = Body { world: world.as_ref(), metre: self.metre };
                match motion {
                    Motion::Turn => next,
                    Motion::Walk => body.walk(&self.pose, next),
                    Motion::Fly => body.fly(&self.pose, next),
                }
            }
            None => next,
        };
        self.accept(next)
    }

    /// Moves to a pose, unless that leaves the house and nobody has allowed it.
    fn accept(&mut self, next: Pose) -> bool {
        let next = if self.height_is_locked { next.at_height_of(&self.pose) } else { next };
        if next == self.pose {
            return false;
        }
        if let Some(world) = self.solid() {
            let (was_in, is_in) = (world.is_in_house(self.pose.eye), world.is_in_house(next.eye));
            if was_in && !is_in && !self.may_leave {
                self.is_at_exit = true;
                return false;
            }
            // The permission ends at the return.
            self.may_leave &= was_in || !is_in;
        }
        if let Some(stayed) = self.stayed.take() {
            self.history.leave(stayed);
        }
        self.pose = next;
        self.spec = at(&self.spec, &next);
        true
    }

    fn jump(&mut self, view: ViewSpec) -> bool {
        let before = self.spec;
        let can = self.set(view);
        if can {
            self.history.leave(before);
        }
        can
    }

    fn set(&mut self, view: ViewSpec) -> bool {
        let Some(pose) = pose(&view) else { return false };
        self.stayed = None;
        self.pose = pose;
        self.spec = at(&view, &pose);
        true
    }
}

/// Returns the pose of a view that has one.
fn pose(spec: &ViewSpec) -> Option<Pose> {
    let eye = spec.vp.filter(|eye| eye.is_finite())?;
    let direction = spec.vd?.try_normalize()?;
    let up = spec.vu.unwrap_or(DVec3::Z).try_normalize()?;
    let is_sound = direction.cross(up).length() > 1e-6;
    is_sound.then_some(Pose { eye, direction, up })
}

fn at(spec: &ViewSpec, pose: &Pose) -> ViewSpec {
    ViewSpec { vp: Some(pose.eye), vd: Some(pose.direction), vu: Some(pose.up), ..*spec }
}
