//! The views of two eyes.

use holo_display::{DriverError, FrameRequest};
use holo_picture::View;

use crate::StereoArrangement;

/// Two eyes, and how a picture shows what they see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoEyes {
    /// The arrangement of the two pictures.
    pub arrangement: StereoArrangement,
    /// Distance between the eyes, scene units.
    pub distance: f64,
    /// Distance at which both eyes see a point at the same place of their pictures, scene units;
    /// `None` for infinitely far away, with parallel axes.
    pub convergence: Option<f64>,
}

impl StereoEyes {
    /// Returns what the left and the right eye of a request see. The request's view is seen from
    /// the middle between the eyes.
    ///
    /// # Errors
    /// If an eye would be at no finite place.
    pub fn requests(&self, look: &FrameRequest) -> Result<[FrameRequest; 2], DriverError> {
        let (columns, rows) = self.arrangement.part(look.size);
        let size = (columns.end - columns.start, rows.end - rows.start);
        let middle = look.view.part(look.size, columns, rows);
        let eye = |side: f64| {
            let right = 0.5 * self.distance * side;
            let vp = middle.vp + middle.right() * right;
            let moved = middle
                .moved(vp, middle.vd)
                .map_err(|error| DriverError { driver: "stereo", reason: error.to_string() })?;
            let view = self.converged(&moved, right);
            Ok(FrameRequest { view, size, is_moving: look.is_moving })
        };
        Ok([eye(-1.0)?, eye(1.0)?])
    }

    /// Shifts the picture of an eye that is `right` of the middle, so that a point straight ahead of
    /// the middle at the convergence distance is in its middle. The view's axis stays, so vertical
    /// lines stay vertical and there is no vertical disparity.
    fn converged(&self, view: &View, right: f64) -> View {
        match self.convergence {
            Some(convergence) => view.shifted(-right / (convergence * view.extent().0)),
            None => *view,
        }
    }
}
