//! Camera coordinates of a view, and the projection from them to pixels.
//!
//! Invariant: [`Camera::to_camera`] is a rotation, so distances in camera coordinates equal
//! distances in the scene.

use glam::{DVec3, Vec3};
use holo_picture::{Clip, View, ViewKind};

/// A view with its camera coordinates: x right, y up, z forward, in scene units.
///
/// The origin is the eye. A parallel view has no eye: its origin is the middle of the plane on
/// which its rays begin.
#[derive(Clone, Debug)]
pub struct Camera {
    /// The origin of camera coordinates, in the scene.
    pub eye: DVec3,
    /// Right in the picture, a unit vector in the scene.
    pub right: DVec3,
    /// Up in the picture, a unit vector in the scene.
    pub up: DVec3,
    /// Into the picture, a unit vector in the scene.
    pub forward: DVec3,
    /// Pixels per unit of x/z and of y/z. Only perspective views use it.
    pub focal: (f64, f64),
    /// Where the view direction meets the picture, in pixels from its left and from its top.
    pub centre: (f64, f64),
    /// The width of a pixel on the surface that it shows.
    pub pixel_width: PixelWidth,
    view: View,
    size: (f64, f64),
}

/// The width of a pixel on the surface that it shows, scene units: the larger of its two sides.
#[derive(Clone, Copy, Debug)]
pub struct PixelWidth {
    /// The width at distance 1 along the axis; in a parallel view the width at any distance.
    pub width: f64,
    /// True if the width grows in proportion to the distance.
    pub grows: bool,
}

impl PixelWidth {
    /// Returns the width at a point of camera coordinates.
    #[inline]
    pub fn at(&self, point: Vec3) -> f32 {
        self.width as f32 * if self.grows { point.length() } else { 1.0 }
    }

    /// Returns the square of the width at a distance whose square is `distance_squared`.
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

    /// Returns whether the view is a perspective, so that [`focal`](Self::focal) and
    /// [`centre`](Self::centre) define its projection.
    pub fn is_perspective(&self) -> bool {
        self.view.kind == ViewKind::Perspective
    }

    /// Returns where the picture shows a point of camera coordinates, in pixels from its left and
    /// from its top. `None` if no ray of the view can reach the point, such as a point behind the
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

    /// Returns the same as [`pixel`](Self::pixel), in double precision.
    pub fn project(&self, point: DVec3) -> Option<(f64, f64)> {
        let (x, y) = self.view.project_local(point)?;
        Some((x * self.size.0, (1.0 - y) * self.size.1))
    }

    /// Returns whether a point of camera coordinates lies between the clipping surfaces.
    #[inline]
    pub fn clip(&self, point: DVec3) -> Clip {
        self.view.clip_local(point)
    }

    /// Returns whether rays that hit nothing are black.
    pub fn clips_sky(&self) -> bool {
        self.view.clips_sky()
    }

    /// Returns where the view ray to a point begins, both in camera coordinates: the eye, or the
    /// foot of the point on a parallel view's plane.
    #[inline]
    pub fn eye_of(&self, point: DVec3) -> DVec3 {
        if self.pixel_width.grows { DVec3::ZERO } else { DVec3::new(point.x, point.y, 0.0) }
    }

    /// Returns a length in proportion to the f32 rounding error of a point's projection: the depth
    /// in a perspective view, else the distance from the origin.
    #[inline]
    pub fn reach(&self, point: Vec3) -> f32 {
        if self.is_perspective() { point.z } else { point.length() }
    }

    /// Returns the vector to a point of camera coordinates from where its view ray begins.
    #[inline]
    pub fn sight(&self, point: Vec3) -> Vec3 {
        if self.pixel_width.grows { point } else { Vec3::new(0.0, 0.0, point.z) }
    }

    /// Turns a vector of the scene into camera coordinates.
    pub fn to_camera(&self, vector: DVec3) -> DVec3 {
        DVec3::new(vector.dot(self.right), vector.dot(self.up), vector.dot(self.forward))
    }
}
