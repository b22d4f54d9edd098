//! The traits of drivers that a session uses, and what several drivers share.
//!
//! [`select_beams`] turns a view into wanted beams (Larson & Simmons 1999, §2.4.2). The server
//! answers with samples. A [`Driver`] turns samples into a [`Frame`]. It has two parts. [`Light`]
//! takes the samples and lives for a session. A [`Renderer`] draws the frames of one view after
//! another from that light, and there may be several. Its [`RayWishes`] are the samples that its
//! view would gain from. A [`FramePhase`] says what a frame is for. Each driver is a crate of its
//! own that uses this one and no other driver.
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
mod light;
mod live;
mod motion;
mod parts;
mod phase;
mod pixel_weights;
mod random;
mod renderer;
mod request;
mod select;
mod sky_view;
mod stored;
mod view_light;
mod wishes;

pub use bands::for_bands;
pub use camera::{Camera, PixelWidth};
pub use candidates::{Candidate, best_beam, candidates, section_of};
pub use covered::{covered, uncovered_pixels};
pub use driver::{Driver, DriverPart};
pub use ending::{BeamSearch, Search, UsefulBeam, VisibleEnd, beams_ending_on};
pub use frame::{Certainty, Frame};
pub use interrupt::Interrupt;
pub use light::{Age, Light};
pub use live::LiveSample;
pub use motion::{ObjectMotion, moved_along};
pub use parts::PartsPlan;
pub use phase::{FramePhase, ViewPhases};
pub use pixel_weights::PixelWeights;
pub use random::{mix, pair, split_mix};
pub use renderer::{PartsRenderer, Renderer};
pub use request::{DriverError, FrameRequest};
pub use select::{
    Coverage, SelectOptions, Selection, WantedBeam, select_beams, select_weighted_beams, viewpoint,
    viewpoint_radius,
};
pub use sky_view::SkyView;
pub use stored::{DistanceTable, PlacedSection};
pub use view_light::{StoringRenderer, ViewLight};
pub use wishes::RayWishes;
