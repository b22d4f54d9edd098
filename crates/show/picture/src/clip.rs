//! Fore and aft clipping (Radiance's `-vo` and `-va`): a view shows only what lies between two
//! surfaces.
//!
//! The surfaces are those of Radiance's `viewray` (image.c). In perspective and parallel views they
//! are planes perpendicular to the view direction. In panoramas they are cylinders around the up
//! vector, and in fisheyes spheres around the eye. Objects before the fore surface are ignored.
//! Beyond the aft surface everything is black, the sky too.
//!
//! Invariants: the aft surface, if there is one, is beyond the fore surface. The fore surface is
//! not behind the eye.

use crate::kind::ViewKind;
use crate::view::View;
use glam::DVec3;

/// The position of a point relative to a view's clipping surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clip {
    /// Before the fore surface: the point is ignored.
    Before,
    /// Between the surfaces.
    Shown,
    /// Beyond the aft surface: the point is black.
    Beyond,
}

impl View {
    /// Returns the origin of distances: the eye. For a parallel view, it is the centre of the fore
    /// clipping plane, where rays begin.
    #[inline]
    pub fn eye(&self) -> DVec3 {
        if self.kind.has_eye() || self.vo == 0.0 { self.vp } else { self.vp + self.vd * self.vo }
    }

    /// Returns whether the view clips anything, seen from [`eye`](Self::eye).
    #[inline]
    pub fn is_clipped(&self) -> bool {
        self.va != 0.0 || (self.vo != 0.0 && self.kind.has_eye())
    }

    /// Returns whether the sky is clipped: rays that hit nothing are black.
    pub fn clips_sky(&self) -> bool {
        self.va != 0.0
    }

    /// Returns the distances at which a ray of this unit direction crosses the clipping surfaces; 0
    /// and infinity without surfaces.
    #[inline]
    pub fn span(&self, direction: DVec3) -> [f64; 2] {
        if !self.is_clipped() {
            return [0.0, f64::INFINITY];
        }
        let pace = self.clip_depth(self.to_local(direction));
        self.limits().map(|limit| limit / pace)
    }

    /// Returns the ray through picture coordinates (`x`, `y`), as [`try_ray`](Self::try_ray) does,
    /// but starting on the fore surface. The third value is the distance from there to the aft
    /// surface; infinite without one.
    #[inline]
    pub fn clipped_ray(&self, x: f64, y: f64) -> Option<(DVec3, DVec3, f64)> {
        let (origin, direction) = self.try_ray(x, y)?;
        let [fore, aft] = self.span(direction);
        Some((origin + direction * fore, direction, aft - fore))
    }

    /// Classifies a point relative to [`eye`](Self::eye), given as (right, up, forward).
    #[inline]
    pub fn clip_local(&self, place: DVec3) -> Clip {
        if !self.is_clipped() {
            return Clip::Shown;
        }
        let ([fore, aft], depth) = (self.limits(), self.clip_depth(place));
        if depth > aft {
            Clip::Beyond
        } else if depth < fore {
            Clip::Before
        } else {
            Clip::Shown
        }
    }

    /// Classifies a point of the scene.
    #[inline]
    pub fn clip(&self, p: DVec3) -> Clip {
        if self.is_clipped() { self.clip_local(self.to_local(p - self.eye())) } else { Clip::Shown }
    }

    /// Returns the quantity that the distances of the surfaces limit.
    #[inline]
    fn clip_depth(&self, place: DVec3) -> f64 {
        match self.kind {
            ViewKind::Perspective | ViewKind::Parallel => place.z,
            ViewKind::Cylindrical => place.x.hypot(place.z),
            ViewKind::Angular | ViewKind::Hemispherical => place.length(),
        }
    }

    /// Returns the distances of the surfaces from [`eye`](Self::eye).
    fn limits(&self) -> [f64; 2] {
        let fore = if self.kind.has_eye() { self.vo } else { 0.0 };
        [fore, if self.va == 0.0 { f64::INFINITY } else { self.va - self.vo + fore }]
    }
}
