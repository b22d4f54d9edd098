//! The chart of a mesh: which direction around the canonical eye a point of the scene has.
//!
//! A parallel view has no eye. Its chart places a point by where the picture shows it, as if the
//! picture stood before an eye.

use glam::DVec3;
use holo_display::Camera;
use holo_picture::View;

use crate::direction::GridDirection;

/// What a stored ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RayEnd {
    /// A point of the scene.
    Point(DVec3),
    /// Nothing, in this direction.
    Sky(DVec3),
}

/// Directions around a canonical eye, and depths along them.
pub struct Chart {
    /// The canonical eye, in the scene.
    pub eye: DVec3,
    /// The camera of a parallel view, and the width of its picture; `None` with an eye.
    plane: Option<(Camera, f64)>,
}

impl Chart {
    /// Returns the chart around a view's eye.
    pub fn new(view: &View) -> Chart {
        let plane = || (Camera::new(view, (1, 1)), view.extent().0);
        Chart { eye: view.eye(), plane: (!view.kind.has_eye()).then(plane) }
    }

    /// Returns whether the chart is that of a view's eye.
    pub fn is_of(&self, view: &View) -> bool {
        self.plane.is_none() && view.kind.has_eye() && self.eye == view.eye()
    }

    /// Returns whether the chart has an eye.
    pub fn has_eye(&self) -> bool {
        self.plane.is_none()
    }

    /// Returns direction and depth of a ray's end; the depth of the sky is infinite. `None` at the
    /// eye itself, and for the sky of a parallel view, which needs a place.
    pub fn place(&self, end: RayEnd) -> Option<(GridDirection, f64)> {
        let (vector, depth) = match (end, &self.plane) {
            (RayEnd::Point(point), None) => (point - self.eye, (point - self.eye).length()),
            (RayEnd::Sky(direction), None) => (direction, f64::INFINITY),
            (RayEnd::Point(point), Some((camera, width))) => {
                let point = camera.to_camera(point - self.eye);
                // Camera coordinates are left-handed, and those of the scene are not.
                (DVec3::new(-point.x / width, point.y / width, 1.0), point.z)
            }
            (RayEnd::Sky(_), Some(_)) => return None,
        };
        Some((GridDirection::nearest(vector)?, depth))
    }

    /// Returns the end of a ray: the inverse of [`place`](Self::place).
    pub fn end(&self, direction: GridDirection, depth: f64) -> RayEnd {
        let unit = direction.unit();
        match &self.plane {
            None if depth.is_finite() => RayEnd::Point(self.eye + unit * depth),
            None => RayEnd::Sky(unit),
            Some((camera, width)) => {
                // The sky lies on the plane itself: only its place counts.
                let depth = if depth.is_finite() { depth } else { 0.0 };
                let scale = width / unit.z;
                let across = camera.right * (-unit.x * scale) + camera.up * (unit.y * scale);
                RayEnd::Point(self.eye + across + camera.forward * depth)
            }
        }
    }
}
