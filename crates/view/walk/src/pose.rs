//! The eye's position and direction, and single motions of it.

use glam::{DQuat, DVec3};

/// Least distance of the eye from the point that it moves towards, metres.
pub const NEAREST: f64 = 0.1;

/// Share of the distance to a point that is left after [`GLIDE_SECONDS`] (Larson & Simmons 1999,
/// §2.4.1: each step goes a tenth of the way).
const GLIDE_LEFT: f64 = 0.9;

/// Seconds of one such step.
const GLIDE_SECONDS: f64 = 0.1;

/// Greatest angle between the view direction and the level plane, radians: 89°.
const STEEPEST: f64 = 89.0 / 180.0 * std::f64::consts::PI;

/// The eye's position, its direction, and the up vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The eye, scene units.
    pub eye: DVec3,
    /// View direction; unit length.
    pub direction: DVec3,
    /// Up in the world; unit length, not along `direction`.
    pub up: DVec3,
}

impl Pose {
    /// Moves towards `point` for `seconds`, by a tenth of the distance in 0.1 s. If `seconds` is
    /// negative, moves away. The direction does not change, so the point keeps its place in the
    /// picture. The eye never comes closer than `nearest`.
    #[must_use]
    pub fn glide(self, point: DVec3, seconds: f64, nearest: f64) -> Pose {
        let way = point - self.eye;
        let distance = way.length();
        let next = distance * GLIDE_LEFT.powf(seconds / GLIDE_SECONDS);
        // If the eye is nearer already, it may move away but not closer.
        let next = if seconds > 0.0 { next.max(nearest.min(distance)) } else { next };
        let eye = point - way.normalize_or_zero() * next;
        Pose { eye: if eye.is_finite() { eye } else { self.eye }, ..self }
    }

    /// Turns in place, by radians to the right and upwards.
    #[must_use]
    pub fn turn(self, right: f64, up: f64) -> Pose {
        self.turned(self.rotation(right, up), self.eye)
    }

    /// Moves around `point`, by radians to the right and upwards around it. The point keeps its
    /// place in the picture.
    #[must_use]
    pub fn orbit(self, point: DVec3, right: f64, up: f64) -> Pose {
        let rotation = self.rotation(right, up);
        self.turned(rotation, point + rotation * (self.eye - point))
    }

    /// Moves by scene units: `ahead` and `right` on the level plane, `rise` along the up vector.
    #[must_use]
    pub fn walk(self, ahead: f64, right: f64, rise: f64) -> Pose {
        let way = self.level() * ahead + self.right() * right + self.up * rise;
        let eye = self.eye + way;
        Pose { eye: if eye.is_finite() { eye } else { self.eye }, ..self }
    }

    /// Returns the pose with the height of `other`.
    #[must_use]
    pub fn at_height_of(self, other: &Pose) -> Pose {
        let up = self.up;
        Pose { eye: self.eye + up * (other.eye - self.eye).dot(up), ..self }
    }

    /// Returns the direction that is right in the picture; unit length.
    pub fn right(&self) -> DVec3 {
        self.direction.cross(self.up).normalize_or(self.up.any_orthonormal_vector())
    }

    /// Returns the view direction on the level plane; unit length.
    fn level(&self) -> DVec3 {
        self.up.cross(self.right())
    }

    /// Returns the pose that follows if the motion since `before` continues for `share` of its
    /// length.
    #[must_use]
    pub fn ahead(self, before: &Pose, share: f64) -> Pose {
        let turned = DQuat::from_rotation_arc(before.direction, self.direction);
        let (axis, angle) = turned.to_axis_angle();
        let rotation = DQuat::from_axis_angle(axis, share * angle);
        self.turned(rotation, self.eye + share * (self.eye - before.eye))
    }

    /// Returns the rotation of the whole camera that turns its direction to the right and upwards.
    fn rotation(&self, right: f64, up: f64) -> DQuat {
        if !(right.is_finite() && up.is_finite()) {
            return DQuat::IDENTITY;
        }
        let height = self.direction.dot(self.up).clamp(-1.0, 1.0).asin();
        // If the view is steeper already, it may only become less steep.
        let steepest = STEEPEST.max(height.abs());
        let tilt = (height + up).clamp(-steepest, steepest) - height;
        let tilt = DQuat::from_axis_angle(self.right(), tilt);
        DQuat::from_axis_angle(self.up, -right) * tilt
    }

    fn turned(self, rotation: DQuat, eye: DVec3) -> Pose {
        let direction = (rotation * self.direction).normalize_or(self.direction);
        Pose { eye: if eye.is_finite() { eye } else { self.eye }, direction, ..self }
    }
}
