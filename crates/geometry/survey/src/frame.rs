//! Directions of a scene as a person in it names them.

use glam::DVec3;

/// Right, ahead and up: unit vectors at right angles, right-handed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UprightAxes {
    /// To the right of a person who looks ahead.
    pub right: DVec3,
    /// Level, in the direction of a person who looks at the front of an object.
    pub ahead: DVec3,
    /// Up.
    pub up: DVec3,
}

impl UprightAxes {
    /// Makes the frame for an up direction of any length. `ahead` is +y if z is up and -z if y is
    /// up, as exporters orient their models. A direction without length counts as +z.
    #[must_use]
    pub fn new(up: DVec3) -> UprightAxes {
        let up = up.try_normalize().unwrap_or(DVec3::Z);
        let right = match up.abs().x {
            x if x > 0.9 => up.any_orthonormal_vector(),
            _ => (DVec3::X - up * up.x).normalize(),
        };
        UprightAxes { right, ahead: up.cross(right), up }
    }

    /// Returns a vector's components along right, ahead and up.
    #[must_use]
    pub fn to_local(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.dot(self.right), v.dot(self.ahead), v.dot(self.up))
    }

    /// Returns the vector with these components along right, ahead and up.
    #[must_use]
    pub fn to_world(&self, v: DVec3) -> DVec3 {
        self.right * v.x + self.ahead * v.y + self.up * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_right_handed_and_ahead_is_as_exporters_have_it() {
        for up in [DVec3::Z, DVec3::Y, DVec3::X, -DVec3::Z, DVec3::new(1.0, 2.0, 3.0)] {
            let frame = UprightAxes::new(up);
            assert!(frame.right.cross(frame.ahead).distance(frame.up) < 1e-12);
            let v = DVec3::new(0.3, -2.0, 7.0);
            assert!(frame.to_world(frame.to_local(v)).distance(v) < 1e-12);
        }
        assert_eq!(UprightAxes::new(DVec3::Z).ahead, DVec3::Y);
        assert_eq!(UprightAxes::new(DVec3::Y).ahead, -DVec3::Z);
    }
}
