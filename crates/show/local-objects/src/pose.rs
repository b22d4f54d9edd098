//! Where a local object is.

use glam::DVec3;

use crate::error::ObjectError;

/// Greatest coordinate of a pose, scene units; that of the scenes' own coordinates.
const MOST_COORDINATE: f64 = 1e12;

/// Least and greatest scale.
const SCALES: [f64; 2] = [1e-6, 1e6];

/// The place, turn and size of a local object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectPose {
    /// Where the middle of the object's base is, in the scene.
    pub at: DVec3,
    /// Degrees by which the object is turned around the scene's up axis, counter-clockwise seen
    /// from above.
    pub turn: f64,
    /// Factor to the model's size.
    pub scale: f64,
}

impl ObjectPose {
    /// Returns the pose of an object as it was modelled, with the middle of its base at this place.
    #[must_use]
    pub fn at(at: DVec3) -> ObjectPose {
        ObjectPose { at, turn: 0.0, scale: 1.0 }
    }

    /// Checks that the object can be there.
    ///
    /// # Errors
    /// The value that cannot be used.
    pub fn check(&self) -> Result<(), ObjectError> {
        let is_place = |c: f64| c.abs() <= MOST_COORDINATE;
        if !self.at.to_array().into_iter().all(is_place) {
            return Err(ObjectError::Place(self.at));
        }
        if !self.turn.is_finite() {
            return Err(ObjectError::Turn(self.turn));
        }
        if !(SCALES[0]..=SCALES[1]).contains(&self.scale) {
            return Err(ObjectError::Scale(self.scale));
        }
        Ok(())
    }
}
