//! View types: projections of the directions that an eye sees onto a plane (Radiance's `-vt`;
//! rpict's manual page).
//!
//! A picture is a rectangle of that plane, centred on its origin unless it is shifted. The meaning
//! of `-vh` and `-vv` depends on the type:
//!
//! | type | plane | `-vh` | `-vv` |
//! |---|---|---|---|
//! | `v` perspective | tangents | angle below 180° | angle below 180° |
//! | `l` parallel | lengths | width, scene units | height, scene units |
//! | `c` cylindrical panorama | angle around, tangent up | angle to 360° | angle below 180° |
//! | `a` angular fisheye | angle from the centre | angle to 360° | angle to 360° |
//! | `h` hemispherical fisheye | sine of the angle from the centre | angle to 180° | angle to 180° |
//!
//! Invariants: [`ViewKind::direction`] is the inverse of [`ViewKind::plane`]. Local coordinates
//! are right, up and forward.

use crate::view_error::ViewError;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A projection of directions onto a picture. Radiance's planispheric fisheye (`s`) is not
/// supported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ViewKind {
    /// Perspective, `-vtv`.
    #[default]
    Perspective,
    /// Parallel, `-vtl`: all rays have one direction and begin on the plane through `-vp`.
    Parallel,
    /// Cylindrical panorama, `-vtc`: around the up vector.
    Cylindrical,
    /// Angular fisheye, `-vta`: the distance from the centre is proportional to the angle.
    Angular,
    /// Hemispherical fisheye, `-vth`: a hemisphere seen from far away. Areas are projected solid
    /// angles.
    Hemispherical,
}

/// The relation between the side of a picture and its option.
#[derive(Clone, Copy, PartialEq)]
enum Law {
    /// 2·tan of half the angle.
    Tangent,
    Length,
    /// Radians.
    Angle,
    /// 2·sin of half the angle.
    Sine,
}

/// A side of a picture: its option, and the index of its axis.
pub(crate) const ACROSS: (&str, usize) = ("-vh", 0);
/// See [`ACROSS`].
pub(crate) const ALONG: (&str, usize) = ("-vv", 1);

/// Smallest side, so that its square does not vanish.
const LEAST_SIDE: f64 = 1e-100;

impl ViewKind {
    /// All view types.
    pub const ALL: [ViewKind; 5] = [
        ViewKind::Perspective,
        ViewKind::Parallel,
        ViewKind::Cylindrical,
        ViewKind::Angular,
        ViewKind::Hemispherical,
    ];

    /// Returns the letter that follows `-vt`.
    pub fn letter(self) -> char {
        match self {
            ViewKind::Perspective => 'v',
            ViewKind::Parallel => 'l',
            ViewKind::Cylindrical => 'c',
            ViewKind::Angular => 'a',
            ViewKind::Hemispherical => 'h',
        }
    }

    /// Returns the type of a letter.
    pub fn from_letter(letter: char) -> Option<ViewKind> {
        ViewKind::ALL.into_iter().find(|kind| kind.letter() == letter)
    }

    /// Returns whether all rays pass through one point, the eye. True for all types but the
    /// parallel one.
    pub fn has_eye(self) -> bool {
        self != ViewKind::Parallel
    }

    /// Returns the size of a side on the plane, from its option.
    pub(crate) fn extent(
        self,
        (option, axis): (&'static str, usize),
        size: f64,
    ) -> Result<f64, ViewError> {
        let law = self.law(axis);
        let (extent, fits) = match law {
            Law::Tangent => (2.0 * (size.to_radians() / 2.0).tan(), size > 0.0 && size < 180.0),
            Law::Length => (size, size > 0.0 && size.is_finite()),
            Law::Angle => (size.to_radians(), size > 0.0 && size <= 360.0),
            Law::Sine => (2.0 * (size.to_radians() / 2.0).sin(), size > 0.0 && size <= 180.0),
        };
        // The second test rejects sizes whose square vanishes.
        if fits && extent > 2.0 * LEAST_SIDE {
            return Ok(extent);
        }
        Err(match law {
            Law::Tangent => ViewError::Angle { option, degrees: size },
            Law::Length => ViewError::Length { option, length: size },
            Law::Angle => ViewError::WideAngle { option, degrees: size, most: 360.0 },
            Law::Sine => ViewError::WideAngle { option, degrees: size, most: 180.0 },
        })
    }

    /// Returns the option's value for a size of a side on the plane; `None` if the type does not
    /// allow that size.
    pub(crate) fn option_value(self, (_, axis): (&'static str, usize), extent: f64) -> Option<f64> {
        // The largest possible square must not fail because of rounding.
        let within = |most: f64| (extent <= most * (1.0 + 1e-12)).then(|| extent.min(most));
        match self.law(axis) {
            Law::Tangent => Some((extent / 2.0).atan().to_degrees() * 2.0),
            Law::Length => Some(extent),
            Law::Angle => within(2.0 * PI).map(f64::to_degrees),
            Law::Sine => within(2.0).map(|extent| (extent / 2.0).asin().to_degrees() * 2.0),
        }
    }

    fn law(self, axis: usize) -> Law {
        match self {
            ViewKind::Perspective => Law::Tangent,
            ViewKind::Parallel => Law::Length,
            ViewKind::Cylindrical if axis == ACROSS.1 => Law::Angle,
            ViewKind::Cylindrical => Law::Tangent,
            ViewKind::Angular => Law::Angle,
            ViewKind::Hemispherical => Law::Sine,
        }
    }

    /// Returns the unit direction that a point of the plane shows. `None` for points that show
    /// none, such as a fisheye's corners.
    #[inline]
    pub(crate) fn direction(self, [u, v]: [f64; 2]) -> Option<DVec3> {
        match self {
            ViewKind::Perspective => Some(DVec3::new(u, v, 1.0).normalize()),
            ViewKind::Parallel => Some(DVec3::Z),
            ViewKind::Cylindrical => {
                let (sine, cosine) = u.sin_cos();
                Some(DVec3::new(sine, v, cosine).normalize())
            }
            ViewKind::Angular => {
                let angle = u.hypot(v);
                let (sine, cosine) = angle.sin_cos();
                let scale = if angle > 0.0 { sine / angle } else { 1.0 };
                (angle <= PI).then(|| DVec3::new(u * scale, v * scale, cosine))
            }
            ViewKind::Hemispherical => {
                let forward = 1.0 - u * u - v * v;
                (forward >= 0.0).then(|| DVec3::new(u, v, forward.sqrt()))
            }
        }
    }

    /// Returns the point of the plane at which a point `place` is seen; if there is an eye, only
    /// its direction matters. `None` if it is not seen: behind the eye (or plane) of types that do
    /// not look back, or along the axis of a cylinder.
    #[inline]
    pub(crate) fn plane(self, place: DVec3) -> Option<[f64; 2]> {
        let DVec3 { x, y, z } = place;
        match self {
            ViewKind::Perspective => (z > 0.0).then(|| [x / z, y / z]),
            ViewKind::Parallel => (z > 0.0).then_some([x, y]),
            ViewKind::Cylindrical => {
                let around = x.hypot(z);
                (around > 0.0).then(|| [x.atan2(z), y / around])
            }
            ViewKind::Angular => {
                let aside = x.hypot(y);
                let angle = aside.atan2(z);
                if aside > 0.0 {
                    Some([x / aside * angle, y / aside * angle])
                } else {
                    // The direction straight behind is the whole rim; one of its points represents
                    // it. The eye itself has no direction.
                    (z != 0.0).then_some([angle, 0.0])
                }
            }
            ViewKind::Hemispherical => {
                let length = place.length();
                (z >= 0.0 && length > 0.0).then(|| [x / length, y / length])
            }
        }
    }
}
