//! The trait [`Driver`] that front ends use, and what several drivers share.
//!
//! [`select_beams`] turns a view into wanted beams (Larson & Simmons 1999, §2.4.2). The server
//! answers with samples. A [`Driver`] turns samples into a [`Frame`]. Each driver is a crate of
//! its own that uses this one and no other driver.
//!
//! Invariants, here and in every driver:
//! - No input or output, no clock, and no randomness except what the caller seeds: the same calls
//!   give the same bits.
//! - Selection and coverage use one rule: a section covers a pixel exactly if a beam can be
//!   requested for the pixel's ray.

mod bands;
mod camera;
mod candidates;
mod covered;
mod driver;
mod ending;
mod frame;
mod interrupt;
mod live;
mod parts;
mod random;
mod select;
mod stored;

pub use bands::for_bands;
pub use camera::{Camera, PixelWidth};
pub use candidates::{Candidate, best_beam, candidates, section_of};
pub use covered::{covered, uncovered_pixels};
pub use driver::{Driver, DriverError, Look, Resolution, SurfaceAt};
pub use ending::{BeamSearch, End, Search, UsefulBeam, beams_ending_on};
pub use frame::{Certainty, Frame};
pub use interrupt::Interrupt;
pub use live::LiveSample;
pub use parts::PartsPlan;
pub use random::{mix, pair, split_mix};
pub use select::{
    Coverage, SelectOptions, Selection, WantedBeam, select_beams, viewpoint, viewpoint_radius,
};
pub use stored::{DistanceTable, PlacedSection};
