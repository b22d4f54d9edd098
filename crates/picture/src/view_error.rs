//! What can be wrong with a view, in words for the person who gave it.

use crate::picture::{MAX_PIXELS, MAX_SIDE};

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
    /// An angle is not that of a fisheye or of a panorama.
    #[error("{option} {degrees} must be above 0 and at most {most} degrees")]
    WideAngle {
        /// The option, as typed in a view file.
        option: &'static str,
        /// What was given.
        degrees: f64,
        /// The largest that there is.
        most: f64,
    },
    /// A size of a parallel view is none.
    #[error("{option} {length} must be a length above 0, in scene units")]
    Length {
        /// The option, as typed in a view file.
        option: &'static str,
        /// What was given.
        length: f64,
    },
    /// With one size given, no other makes pixels square.
    #[error(
        "with {given} {size} this picture has no {other} that makes its pixels square: give both"
    )]
    NoSquare {
        /// The option that was given.
        given: &'static str,
        /// Its value.
        size: f64,
        /// The option that was not.
        other: &'static str,
    },
    /// A picture size is zero or above the limits.
    #[error(
        "a picture of {width}x{height} pixels: each side must be 1 to {MAX_SIDE}, and at most {MAX_PIXELS} in all"
    )]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// A Radiance view type that is not implemented, or none.
    #[error(
        "view type -vt{0} is not supported: there are v (perspective), l (parallel), c (cylindrical panorama), a (angular \
         fisheye) and h (hemispherical fisheye)"
    )]
    UnsupportedKind(String),
    /// A fore clipping surface behind the eye.
    #[error("-vo {vo} is behind the eye: it must be at least 0, but in parallel views")]
    ForeBehindEye {
        /// What was given.
        vo: f64,
    },
    /// An aft clipping surface that nothing is before.
    #[error("-va {va} must be larger than -vo {vo}, or 0 for none")]
    AftBeforeFore {
        /// Fore clipping distance.
        vo: f64,
        /// Aft clipping distance.
        va: f64,
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
