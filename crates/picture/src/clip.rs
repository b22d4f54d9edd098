//! Fore and aft clipping (Radiance's `-vo` and `-va`): a view shows what lies beyond one surface and before another.
//!
//! The surfaces are planes at right angles to the view's direction in perspectives and parallel views, cylinders around the up vector in
//! panoramas, and spheres around the eye in fisheyes, as in Radiance's `viewray` (image.c). What lies before the fore surface is as if it
//! were not there. Beyond the aft surface all is black, the sky too.
//!
//! Invariant: the aft surface, if there is one, is beyond the fore surface, and that is not behind an eye.

use crate::kind::ViewKind;
use crate::view::View;
use crate::view_error::ViewError;
use glam::DVec3;

/// Where something is with respect to a view's clipping surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clip {
    /// Before the fore surface: as if it were not there.
    Before,
    /// Between them.
    Shown,
    /// Beyond the aft surface: black.
    Beyond,
}

impl View {
    /// From where distances count: the eye; of a parallel view the middle of the plane on which its rays begin, which is its fore
    /// clipping plane.
    #[inline]
    pub fn eye(&self) -> DVec3 {
        if self.kind.has_eye() || self.vo == 0.0 { self.vp } else { self.vp + self.vd * self.vo }
    }

    /// Whether anything is clipped, seen from [`eye`](Self::eye).
    #[inline]
    pub fn is_clipped(&self) -> bool {
        self.va != 0.0 || (self.vo != 0.0 && self.kind.has_eye())
    }

    /// Whether the sky is clipped: whatever meets nothing is black.
    pub fn clips_sky(&self) -> bool {
        self.va != 0.0
    }

    /// Distances along a ray of this direction (of length 1) at which it passes the clipping surfaces; 0 and infinity without.
    #[inline]
    pub fn span(&self, direction: DVec3) -> [f64; 2] {
        if !self.is_clipped() {
            return [0.0, f64::INFINITY];
        }
        let pace = self.clip_depth(self.to_local(direction));
        self.limits().map(|limit| limit / pace)
    }

    /// The ray that is seen through picture coordinates (`x`, `y`) as [`try_ray`](Self::try_ray), but beginning on the fore clipping
    /// surface, and the distance from there at which it ends on the aft one: infinite without.
    #[inline]
    pub fn clipped_ray(&self, x: f64, y: f64) -> Option<(DVec3, DVec3, f64)> {
        let (origin, direction) = self.try_ray(x, y)?;
        let [fore, aft] = self.span(direction);
        Some((origin + direction * fore, direction, aft - fore))
    }

    /// Whether a point, relative to [`eye`](Self::eye) as (right, up, forward), is shown.
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

    /// Whether a point of the scene is shown.
    #[inline]
    pub fn clip(&self, p: DVec3) -> Clip {
        if self.is_clipped() { self.clip_local(self.to_local(p - self.eye())) } else { Clip::Shown }
    }

    /// What the surfaces' distances are measured by.
    #[inline]
    fn clip_depth(&self, place: DVec3) -> f64 {
        match self.kind {
            ViewKind::Perspective | ViewKind::Parallel => place.z,
            ViewKind::Cylindrical => place.x.hypot(place.z),
            ViewKind::Angular | ViewKind::Hemispherical => place.length(),
        }
    }

    /// The surfaces' distances from [`eye`](Self::eye).
    fn limits(&self) -> [f64; 2] {
        let fore = if self.kind.has_eye() { self.vo } else { 0.0 };
        [fore, if self.va == 0.0 { f64::INFINITY } else { self.va - self.vo + fore }]
    }
}

/// Fails unless there is a view with these clipping distances.
pub(crate) fn check(kind: ViewKind, vo: f64, va: f64) -> Result<(), ViewError> {
    for (option, value) in [("-vo", vo), ("-va", va)] {
        if !value.is_finite() {
            return Err(ViewError::NotFinite { option });
        }
    }
    if vo < 0.0 && kind.has_eye() {
        return Err(ViewError::ForeBehindEye { vo });
    }
    // As Radiance's `setview`: 0 is none.
    if va < 0.0 || (va > 0.0 && va <= vo) {
        return Err(ViewError::AftBeforeFore { vo, va });
    }
    Ok(())
}
