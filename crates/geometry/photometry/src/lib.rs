//! Photometry of luminaires: reads IES LM-63 files (1986 to 2019) and EULUMDAT files. This crate
//! knows no scene.
//!
//! A luminaire has a frame: x points to the half-plane of 0° (C0), y to that of 90° (C90), and -z
//! to its nadir, into which most lamps shine. The [`PhotometricWeb`] gives its luminous intensity
//! in each direction of that frame. The [`LuminousOpening`] is what of it shines.
//!
//! Invariants:
//! - Text from outside gives a valid [`Photometry`] or an error with its line, never a panic.
//!   Counts are bounded before memory is taken for them.
//! - Intensities are candela as the lamp has them in use: factors of the file, of ballasts and of
//!   lamps are multiplied in.
//! - A web is interpolated linearly in the angles of its file, and is 0 outside of them. Symmetries
//!   of a file are written out, so that a web covers all angles that its lamp shines into.
#![forbid(unsafe_code)]

mod angles;
mod error;
mod eulumdat;
mod lm63;
mod opening;
mod photometry;
mod reading;
mod text;
mod web;

pub use error::PhotometryError;
pub use opening::{LuminousOpening, OpeningMesh, OpeningShape};
pub use photometry::{MAX_PHOTOMETRY_BYTES, Photometry, TiltTable};
pub use web::{MAX_ANGLES, MAX_WEB_VALUES, PhotometricWeb, WebPole};
