//! A view as the linear map that reprojection needs: right, up and forward, and pixels per unit of slope.
//!
//! Invariant: [`Camera::to_camera`] is a rotation, so distances in camera coordinates are distances in the scene.

use glam::{DVec3, Vec3};
use holo_picture::View;

/// Camera coordinates: x right, y up, z forward, the eye at the origin.
#[derive(Clone, Debug)]
pub(crate) struct Camera {
    pub eye: DVec3,
    /// The picture's axes in the scene, unit.
    pub right: DVec3,
    pub up: DVec3,
    pub forward: DVec3,
    /// Pixels per unit of x/z and of y/z.
    pub focal: (f64, f64),
    /// The picture's middle, in pixels from its left and from its top.
    pub centre: (f64, f64),
    /// Width of a pixel at distance 1 along the axis, squared: the larger of the two directions.
    pub pixel_width_squared: f64,
}

impl Camera {
    /// The map is read off the view's own rays, so it cannot disagree with them.
    pub fn new(view: &View, size: (u32, u32)) -> Self {
        let (eye, forward) = view.ray(0.5, 0.5);
        // From the picture's middle to the middle of its right and of its top edge, on the plane at distance 1.
        let to_edge = |x, y| {
            let direction = view.ray(x, y).1;
            direction / direction.dot(forward) - forward
        };
        let (to_right, to_top) = (to_edge(1.0, 0.5), to_edge(0.5, 1.0));
        let (width, height) = (f64::from(size.0), f64::from(size.1));
        let pixel_width = (2.0 * to_right.length() / width).max(2.0 * to_top.length() / height);
        Self {
            eye,
            right: to_right.normalize_or_zero(),
            up: to_top.normalize_or_zero(),
            forward,
            focal: (0.5 * width / to_right.length(), 0.5 * height / to_top.length()),
            centre: (0.5 * width, 0.5 * height),
            pixel_width_squared: pixel_width * pixel_width,
        }
    }

    /// Where a point of camera coordinates is seen: pixels from the left and from the top. `None` behind the eye.
    #[inline]
    pub fn pixel(&self, point: Vec3) -> Option<(f32, f32)> {
        let inverse_depth = point.z.recip();
        let x = self.centre.0 as f32 + self.focal.0 as f32 * point.x * inverse_depth;
        let y = self.centre.1 as f32 - self.focal.1 as f32 * point.y * inverse_depth;
        (point.z > 0.0).then_some((x, y))
    }

    /// A vector of the scene in camera coordinates.
    pub fn to_camera(&self, vector: DVec3) -> DVec3 {
        DVec3::new(vector.dot(self.right), vector.dot(self.up), vector.dot(self.forward))
    }
}
