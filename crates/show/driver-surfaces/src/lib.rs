//! The driver `surfaces`: stores light on the scene's surfaces, where it does not depend on the
//! eye.
//!
//! 1. A [`Placer`] finds the surface of each sample once, when the sample arrives. It divides the
//!    sample's radiance by what the material reflects.
//! 2. A [`LightStore`] stores these samples by place for the whole session.
//! 3. A [`SurfaceView`] finds what its pixels see, also through mirrors and panes. At rest, it
//!    casts several rays through pixels on edges.
//! 4. [`Gathered`] sums the samples on visible surfaces. Each sample counts in one pixel, so the
//!    noise of different pixels is independent.
//! 5. A filter, or Open Image Denoise, smooths the sums of small squares of pixels. Squares behind
//!    panes first lose the light that the panes mirror. A picture is the smooth light times the
//!    materials' reflectance.
//! 6. While the eye moves, the driver looks up light by place that earlier pictures found.
//!
//! A [`SurfaceLight`] is the light of a session, and a [`SurfaceRenderer`] draws from it. The
//! driver of [`stand_ins_driver`] does the same for scenes with simpler geometry for some sections.
//!
//! `docs/notes/surface-light.md` lists every filter that was tried, with figures.
//!
//! Invariants:
//! - Sums are integers, so the order and the batches of samples change no bit of a picture.
//! - A sample is placed once, when it arrives. The store outlives the views.
//! - The folder `light_store` uses nothing of the rest, which draws. A test holds that.
//! - The crate does no input or output, and reads no clock.

mod ambient;
mod behind;
mod coats;
mod cube_light;
mod draw;
mod driver;
mod edges;
mod estimate;
mod filter;
mod gather;
mod known;
mod light_store;
mod likely;
mod owners;
mod parts;
mod planes;
mod portals;
mod shown;
mod squares;
mod stand_ins;
mod view;
mod visible;

pub use draw::Drawn;
pub use driver::{SurfaceLight, SurfaceRenderer, surfaces_driver};
pub use filter::EXAMPLE;
pub use gather::Gathered;
pub use light_store::{LightStore, Materials, Placed, Placer, RaySample, Sums};
pub use stand_ins::{MakeDriver, StandIn, StandIns, stand_ins_driver};
pub use view::SurfaceView;
pub use visible::{Edge, EdgePiece, InPane, SurfaceTrail, VisiblePoint};
