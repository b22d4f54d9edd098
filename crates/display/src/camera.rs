//! A view as reprojection needs it: right, up and forward, and where on the picture a point of these coordinates falls.
//!
//! Invariant: [`Camera::to_camera`] is a rotation, so distances in camera coordinates are distances in the scene.

use glam::{DVec3, Vec3};
use holo_picture::{Clip, View, ViewKind};

/// Camera coordinates: x right, y up, z forward, the eye at the origin (of a parallel view the middle of the plane on which its
/// rays begin).
#[derive(Clone, Debug)]
pub struct Camera {
    /// The eye in the scene.
    pub eye: DVec3,
    /// Right in the picture, a unit vector in the scene.
    pub right: DVec3,
    /// Up in the picture, a unit vector in the scene.
    pub up: DVec3,
    /// Into the picture, a unit vector in the scene.
    pub forward: DVec3,
    /// Pixels per unit of x/z and of y/z, if the view is a perspective.
    pub focal: (f64, f64),
    /// What lies straight ahead, in pixels from the picture's left and from its top.
    pub centre: (f64, f64),
    /// How wide pixels are.
    pub pixel_width: PixelWidth,
    view: View,
    size: (f64, f64),
}

/// How wide a pixel is on what it sees: the larger of the two directions.
#[derive(Clone, Copy, Debug)]
pub struct PixelWidth {
    /// At distance 1 along the axis, or anywhere in a parallel view.
    pub width: f64,
    /// Whether it grows in proportion to the distance.
    pub grows: bool,
}

impl PixelWidth {
    /// At a point of camera coordinates.
    #[inline]
    pub fn at(&self, point: Vec3) -> f32 {
        self.width as f32 * if self.grows { point.length() } else { 1.0 }
    }

    /// Squared, at this distance squared.
    #[inline]
    pub fn squared_at(&self, distance_squared: f64) -> f64 {
        self.width * self.width * if self.grows { distance_squared } else { 1.0 }
    }
}

impl Camera {
    /// Returns the camera of a view with a picture of `size` pixels.
    pub fn new(view: &View, size: (u32, u32)) -> Self {
        let (across, along) = view.extent();
        let size = (f64::from(size.0), f64::from(size.1));
        let width = (across / size.0).max(along / size.1);
        Self {
            eye: view.eye(),
            right: view.right(),
            up: view.up(),
            forward: view.vd,
            focal: (size.0 / across, size.1 / along),
            centre: ((0.5 - view.vs) * size.0, (0.5 + view.vl) * size.1),
            pixel_width: PixelWidth { width, grows: view.kind.has_eye() },
            view: *view,
            size,
        }
    }

    /// Whether [`focal`](Self::focal) and [`centre`](Self::centre) are all that there is to projection.
    pub fn is_perspective(&self) -> bool {
        self.view.kind == ViewKind::Perspective
    }

    /// Where a point of camera coordinates is seen: pixels from the left and from the top. `None` if it is not, as behind the
    /// eye of a perspective view.
    #[inline]
    pub fn pixel(&self, point: Vec3) -> Option<(f32, f32)> {
        if !self.is_perspective() {
            return self.project(point.as_dvec3()).map(|(x, y)| (x as f32, y as f32));
        }
        let inverse_depth = point.z.recip();
        let x = self.centre.0 as f32 + self.focal.0 as f32 * point.x * inverse_depth;
        let y = self.centre.1 as f32 - self.focal.1 as f32 * point.y * inverse_depth;
        (point.z > 0.0).then_some((x, y))
    }

    /// As [`pixel`](Self::pixel), in double precision and of any type of view.
    pub fn project(&self, point: DVec3) -> Option<(f64, f64)> {
        let (x, y) = self.view.project_local(point)?;
        Some((x * self.size.0, (1.0 - y) * self.size.1))
    }

    /// Whether a point of camera coordinates is shown.
    #[inline]
    pub fn clip(&self, point: DVec3) -> Clip {
        self.view.clip_local(point)
    }

    /// Whether what meets nothing is black.
    pub fn clips_sky(&self) -> bool {
        self.view.clips_sky()
    }

    /// From where a point of camera coordinates is seen: the eye, or its foot on a parallel view's plane.
    #[inline]
    pub fn eye_of(&self, point: DVec3) -> DVec3 {
        if self.pixel_width.grows { DVec3::ZERO } else { DVec3::new(point.x, point.y, 0.0) }
    }

    /// How far numbers of the size of a point's coordinates reach: what f32 rounds is in proportion to it.
    #[inline]
    pub fn reach(&self, point: Vec3) -> f32 {
        if self.is_perspective() { point.z } else { point.length() }
    }

    /// From where it is seen to a point of camera coordinates.
    #[inline]
    pub fn sight(&self, point: Vec3) -> Vec3 {
        if self.pixel_width.grows { point } else { Vec3::new(0.0, 0.0, point.z) }
    }

    /// A vector of the scene in camera coordinates.
    pub fn to_camera(&self, vector: DVec3) -> DVec3 {
        DVec3::new(vector.dot(self.right), vector.dot(self.up), vector.dot(self.forward))
    }
}
