//! Errors of views, in words for the person who stated the view.

use crate::size::{MAX_PIXELS, MAX_SIDE};

/// The reason why a view cannot be used or understood.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// A required option is missing.
    #[error("the view lacks {0}")]
    Missing(&'static str),
    /// A number is infinite or NaN.
    #[error("{option} must be finite")]
    NotFinite {
        /// The option, as in a view file.
        option: &'static str,
    },
    /// A direction has length zero.
    #[error("{option} has length zero: it must be a direction")]
    ZeroDirection {
        /// The option, as in a view file.
        option: &'static str,
    },
    /// The view direction and the up vector are parallel.
    #[error("-vd and -vu are parallel: no direction is up in this picture")]
    UpIsAlongView,
    /// An angle is not possible for a perspective view.
    #[error("{option} {degrees} must lie between 0 and 180 degrees, both excluded")]
    Angle {
        /// The option, as in a view file.
        option: &'static str,
        /// The value.
        degrees: f64,
    },
    /// An angle is not possible for a fisheye or panorama.
    #[error("{option} {degrees} must be above 0 and at most {most} degrees")]
    WideAngle {
        /// The option, as in a view file.
        option: &'static str,
        /// The value.
        degrees: f64,
        /// The largest possible value.
        most: f64,
    },
    /// A size is not possible for a parallel view.
    #[error("{option} {length} must be a length above 0, in scene units")]
    Length {
        /// The option, as in a view file.
        option: &'static str,
        /// The value.
        length: f64,
    },
    /// For the stated size, no other size makes pixels square.
    #[error(
        "with {given} {size} this picture has no {other} that makes its pixels square: give both"
    )]
    NoSquare {
        /// The option that was stated.
        given: &'static str,
        /// Its value.
        size: f64,
        /// The option that was not stated.
        other: &'static str,
    },
    /// A picture size is zero or above the limits.
    #[error(
        "a picture of {width}x{height} pixels: each side must be 1 to {MAX_SIDE}, and at most {MAX_PIXELS} in all"
    )]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// Radiance's planispheric fisheye.
    #[error(
        "view type -vts (planispheric fisheye) is not supported: -vta (angular fisheye) shows as much, \
         with distances from the centre proportional to angles, and -vth shows a hemisphere"
    )]
    Planispheric,
    /// An unknown or unsupported Radiance view type.
    #[error(
        "view type -vt{0} is not supported; the types are v (perspective), l (parallel), c (cylindrical panorama), a (angular \
         fisheye) and h (hemispherical fisheye)"
    )]
    UnsupportedKind(String),
    /// A fore clipping surface is behind the eye.
    #[error("-vo {vo} is behind the eye: it must be at least 0 except in parallel views")]
    ForeBehindEye {
        /// The value.
        vo: f64,
    },
    /// An aft clipping surface is not beyond the fore one.
    #[error("-va {va} must be larger than -vo {vo}, or 0 for none")]
    AftBeforeFore {
        /// Fore clipping distance.
        vo: f64,
        /// Aft clipping distance.
        va: f64,
    },
    /// A word is not a view option.
    #[error("`{0}` is not a view option (-vtv -vp -vd -vu -vh -vv -vo -va -vs -vl)")]
    UnknownOption(String),
    /// An option has the wrong number of numbers.
    #[error("{option} takes {wanted} number(s), found {found}")]
    Count {
        /// The option, as typed.
        option: String,
        /// Numbers that it takes.
        wanted: usize,
        /// Numbers that follow it.
        found: usize,
    },
    /// A word that should be a finite number is not.
    #[error("{option}: `{word}` is not a finite number")]
    Number {
        /// The option, as typed.
        option: String,
        /// The word.
        word: String,
    },
    /// A view file contains no view.
    #[error(
        "no view found: a view is a line such as `rview -vtv -vp 0 0 0 -vd 0 1 0 -vu 0 0 1 -vh 60 -vv 45`"
    )]
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
