//! A perspective view: where the eye is, which way it looks, how wide, and the ray of every point of its picture.
//!
//! Invariant: a [`View`] is finite and not degenerate: its axes are orthonormal and both angles lie strictly between
//! 0 and 180 degrees. Its parameters can be read like fields, and never changed.

use crate::picture::{MAX_PIXELS, MAX_SIDE};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::ops::Deref;

/// Horizontal angle, in degrees, when neither angle is given.
pub const DEFAULT_VH: f64 = 60.0;

/// Sine of the smallest angle allowed between the view direction and the up vector.
const MIN_UP_SINE: f64 = 1e-6;

/// Why a view cannot be used or understood.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// An option that a view needs was not given.
    #[error("the view lacks {0}")]
    Missing(&'static str),
    /// A number is infinite or not a number.
    #[error("{option} must be finite")]
    NotFinite {
        /// The option, as typed in a view file.
        option: &'static str,
    },
    /// A direction has length zero.
    #[error("{option} has length zero: it must be a direction")]
    ZeroDirection {
        /// The option, as typed in a view file.
        option: &'static str,
    },
    /// The view direction and the up vector are parallel.
    #[error("-vd and -vu are parallel: no direction is up in this picture")]
    UpIsAlongView,
    /// An angle is not that of a perspective view.
    #[error("{option} {degrees} must lie between 0 and 180 degrees, both excluded")]
    Angle {
        /// The option, as typed in a view file.
        option: &'static str,
        /// What was given.
        degrees: f64,
    },
    /// A picture size is zero or above the limits.
    #[error("a picture of {width}x{height} pixels: each side must be 1 to {MAX_SIDE}, and at most {MAX_PIXELS} in all")]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// A Radiance view type that is not implemented.
    #[error("view type -vt{0} is not supported: only -vtv (perspective) is")]
    UnsupportedKind(String),
    /// A Radiance option that is not implemented, with a value that would change the picture.
    #[error("{option} {value} is not supported: leave it out or give 0")]
    UnsupportedOption {
        /// The option, as typed in a view file.
        option: &'static str,
        /// What was given.
        value: f64,
    },
    /// A word that is no view option.
    #[error("`{0}` is not a view option (-vtv -vp -vd -vu -vh -vv -vo -va -vs -vl)")]
    UnknownOption(String),
    /// An option with the wrong number of numbers.
    #[error("{option} takes {wanted} number(s), found {found}")]
    Count {
        /// The option, as typed.
        option: String,
        /// Numbers that it takes.
        wanted: usize,
        /// Numbers that follow it.
        found: usize,
    },
    /// Something that is not a finite number stands where one must be.
    #[error("{option}: `{word}` is not a finite number")]
    Number {
        /// The option, as typed.
        option: String,
        /// The word in question.
        word: String,
    },
    /// A view file without a view.
    #[error("no view found: a view is a line such as `rview -vtv -vp 0 0 0 -vd 0 1 0 -vu 0 0 1 -vh 60 -vv 45`")]
    NoView,
    /// An error in a line of a view file.
    #[error("line {line}: {error}")]
    Line {
        /// Line number, from 1.
        line: usize,
        /// What is wrong with it.
        error: Box<ViewError>,
    },
}

/// The parameters of a [`View`], readable through it: `view.vp`, `view.vh`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ViewParams {
    /// Eye, in scene units.
    pub vp: DVec3,
    /// Direction of the picture's centre, of length 1.
    pub vd: DVec3,
    /// Direction that is up in the picture, of length 1; not always at right angles to `vd`.
    pub vu: DVec3,
    /// Full horizontal angle, degrees.
    pub vh: f64,
    /// Full vertical angle, degrees.
    pub vv: f64,
}

/// A perspective view (Radiance's `-vtv`).
///
/// Picture coordinates are `x` from 0 (left) to 1 (right) and `y` from 0 (**bottom**) to 1 (top), as in Radiance;
/// pixel coordinates count rows from the **top**, as [`Picture`](crate::Picture) stores them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "ViewParams", into = "ViewParams")]
pub struct View {
    params: ViewParams,
    /// Right in the picture, of length 1.
    right: DVec3,
    /// Up in the picture, of length 1, at right angles to `vd` and `right`.
    up: DVec3,
    /// tan(vh/2) and tan(vv/2).
    tan_half: [f64; 2],
}

/// Lets `view.vp` and the like be read; with no `DerefMut`, nothing can make a view invalid.
impl Deref for View {
    type Target = ViewParams;

    fn deref(&self) -> &ViewParams {
        &self.params
    }
}

impl TryFrom<ViewParams> for View {
    type Error = ViewError;

    fn try_from(params: ViewParams) -> Result<View, ViewError> {
        View::from_angles(params)
    }
}

impl From<View> for ViewParams {
    fn from(view: View) -> ViewParams {
        view.params
    }
}

impl View {
    /// A view for a picture of `size` pixels (only its shape matters here).
    ///
    /// An angle left out follows from the other one and `size` so that pixels are square; with neither, `vh` is
    /// [`DEFAULT_VH`]. Given both, both are kept. The lengths of `vd` and `vu` do not matter.
    ///
    /// # Errors
    /// Numbers that are not finite, zero or parallel directions, angles outside (0, 180), impossible sizes.
    pub fn new(
        vp: DVec3,
        vd: DVec3,
        vu: DVec3,
        vh: Option<f64>,
        vv: Option<f64>,
        size: (u32, u32),
    ) -> Result<View, ViewError> {
        check_size(size)?;
        let aspect = f64::from(size.1) / f64::from(size.0);
        let (vh, vv) = match (vh, vv) {
            (Some(vh), Some(vv)) => (vh, vv),
            (Some(vh), None) => (vh, other_angle("-vh", vh, aspect)?),
            (None, Some(vv)) => (other_angle("-vv", vv, 1.0 / aspect)?, vv),
            (None, None) => (DEFAULT_VH, other_angle("-vh", DEFAULT_VH, aspect)?),
        };
        View::from_angles(ViewParams { vp, vd, vu, vh, vv })
    }

    /// The view, and the size of its picture: `max_size` itself, unless both angles are given; then the largest
    /// picture with square pixels that fits into `max_size` (Radiance's `rpict -x -y -pa 1`).
    ///
    /// # Errors
    /// As [`View::new`].
    pub fn resolve(
        vp: DVec3,
        vd: DVec3,
        vu: DVec3,
        vh: Option<f64>,
        vv: Option<f64>,
        max_size: (u32, u32),
    ) -> Result<(View, (u32, u32)), ViewError> {
        let view = View::new(vp, vd, vu, vh, vv, max_size)?;
        let size = if vh.is_some() && vv.is_some() { view.fit(max_size) } else { max_size };
        Ok((view, size))
    }

    /// The largest size with square pixels for this view's shape that fits into `max_size`; each side at least 1.
    pub fn fit(&self, max_size: (u32, u32)) -> (u32, u32) {
        let shape = self.tan_half[1] / self.tan_half[0];
        let (width, height) = (f64::from(max_size.0), f64::from(max_size.1));
        // The casts saturate; rounding to the nearest is Radiance's own (image.c, normaspect).
        if shape * width > height {
            (((height / shape + 0.5) as u32).clamp(1, max_size.0.max(1)), max_size.1)
        } else {
            (max_size.0, ((shape * width + 0.5) as u32).clamp(1, max_size.1.max(1)))
        }
    }

    /// The ray through picture coordinates (`x`, `y`), `y` = 0 at the bottom: its origin and its direction of length 1.
    #[inline]
    pub fn ray(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let across = (2.0 * x - 1.0) * self.tan_half[0];
        let along = (2.0 * y - 1.0) * self.tan_half[1];
        (self.params.vp, (self.params.vd + self.right * across + self.up * along).normalize())
    }

    /// Where the point `p` is seen: (`x`, `y`, distance from the eye), the inverse of [`View::ray`].
    ///
    /// `x` and `y` leave [0, 1] for points outside the picture; None for points not in front of the eye.
    #[inline]
    pub fn project(&self, p: DVec3) -> Option<(f64, f64, f64)> {
        let d = p - self.params.vp;
        let (x, y) = self.project_direction(d)?;
        Some((x, y, d.length()))
    }

    /// Where something infinitely far away in direction `d` (of any length) is seen: (`x`, `y`); None behind the eye.
    #[inline]
    pub fn project_direction(&self, d: DVec3) -> Option<(f64, f64)> {
        let depth = d.dot(self.params.vd);
        if depth > 0.0 {
            let x = 0.5 + 0.5 * d.dot(self.right) / (depth * self.tan_half[0]);
            let y = 0.5 + 0.5 * d.dot(self.up) / (depth * self.tan_half[1]);
            Some((x, y))
        } else {
            None
        }
    }

    /// Picture coordinates of the centre of a pixel; `row` 0 is at the top.
    #[inline]
    pub fn pixel_centre(size: (u32, u32), column: u32, row: u32) -> (f64, f64) {
        ((f64::from(column) + 0.5) / f64::from(size.0), 1.0 - (f64::from(row) + 0.5) / f64::from(size.1))
    }

    /// The (column, row) of the pixel that picture coordinates fall into, row 0 at the top; None outside the picture.
    #[inline]
    pub fn pixel_at(size: (u32, u32), x: f64, y: f64) -> Option<(u32, u32)> {
        let (column, row) = ((x * f64::from(size.0)).floor(), ((1.0 - y) * f64::from(size.1)).floor());
        let inside = column >= 0.0 && row >= 0.0 && column < f64::from(size.0) && row < f64::from(size.1);
        inside.then_some((column as u32, row as u32))
    }

    /// World width of one pixel, in scene units, at `distance` along the axis of a picture of `size` pixels.
    pub fn pixel_footprint(&self, size: (u32, u32), distance: f64) -> f64 {
        2.0 * self.tan_half[0] * distance / f64::from(size.0)
    }

    /// Right in the picture, of length 1.
    pub fn right(&self) -> DVec3 {
        self.right
    }

    /// Up in the picture, of length 1, at right angles to the view direction (`vu` need not be).
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// (tan(vh/2), tan(vv/2)): half the picture's width and height at distance 1 along the axis.
    pub fn tan_half(&self) -> (f64, f64) {
        (self.tan_half[0], self.tan_half[1])
    }

    /// The view as Radiance's options: `-vtv -vp 1 2 3 -vd 0 1 0 -vu 0 0 1 -vh 60 -vv 45 -vo 0 -va 0 -vs 0 -vl 0`.
    /// Numbers are written so that they read back as they are.
    pub fn to_vf_options(&self) -> String {
        let ViewParams { vp, vd, vu, vh, vv } = self.params;
        format!(
            "-vtv -vp {} {} {} -vd {} {} {} -vu {} {} {} -vh {vh} -vv {vv} -vo 0 -va 0 -vs 0 -vl 0",
            vp.x, vp.y, vp.z, vd.x, vd.y, vd.z, vu.x, vu.y, vu.z
        )
    }

    fn from_angles(params: ViewParams) -> Result<View, ViewError> {
        let ViewParams { vp, vd, vu, vh, vv } = params;
        if !vp.is_finite() {
            return Err(ViewError::NotFinite { option: "-vp" });
        }
        let vd = unit("-vd", vd)?;
        let vu = unit("-vu", vu)?;
        let tan_half = [tan_half("-vh", vh)?, tan_half("-vv", vv)?];
        let across = vd.cross(vu);
        if across.length() < MIN_UP_SINE {
            return Err(ViewError::UpIsAlongView);
        }
        let right = across.normalize();
        let up = right.cross(vd).normalize();
        Ok(View { params: ViewParams { vp, vd, vu, vh, vv }, right, up, tan_half })
    }
}

/// Fails unless a picture of `size` may be made.
pub(crate) fn check_size(size: (u32, u32)) -> Result<(), ViewError> {
    let (width, height) = size;
    let sides = (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height);
    if sides && u64::from(width) * u64::from(height) <= MAX_PIXELS {
        Ok(())
    } else {
        Err(ViewError::Size { width, height })
    }
}

fn unit(option: &'static str, v: DVec3) -> Result<DVec3, ViewError> {
    if !v.is_finite() {
        return Err(ViewError::NotFinite { option });
    }
    let largest = v.abs().max_element();
    if largest == 0.0 {
        return Err(ViewError::ZeroDirection { option });
    }
    // A vector that already has length 1 stays as it is, so that a view written and read again is the same view.
    if (v.length_squared() - 1.0).abs() < 4.0 * f64::EPSILON {
        return Ok(v);
    }
    // Scaled first: the square of a very short or very long vector is 0 or infinite.
    Ok((v / largest).normalize())
}

fn tan_half(option: &'static str, degrees: f64) -> Result<f64, ViewError> {
    let tan = (degrees.to_radians() / 2.0).tan();
    // The second test catches angles so small that their tangent vanishes when squared.
    if degrees > 0.0 && degrees < 180.0 && tan > 1e-100 { Ok(tan) } else { Err(ViewError::Angle { option, degrees }) }
}

/// The angle whose half has `ratio` times the tangent of half of `degrees`.
fn other_angle(option: &'static str, degrees: f64, ratio: f64) -> Result<f64, ViewError> {
    Ok((tan_half(option, degrees)? * ratio).atan().to_degrees() * 2.0)
}
