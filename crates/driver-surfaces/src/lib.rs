//! The driver `surfaces`: keeps light on the scene's surfaces, where it does not depend on the eye.
//!
//! 1. A [`Placer`] finds the surface of each sample once, when the sample arrives. It divides the
//!    sample's radiance by what the material reflects.
//! 2. A [`Store`] keeps these samples by place for the whole session.
//! 3. A [`View`] finds what its pixels see, through mirrors and panes. At rest it looks into pixels
//!    on edges.
//! 4. [`Gathered`] sums the samples on seen surfaces, each in one pixel. Noise is then independent
//!    from pixel to pixel.
//! 5. A filter, or Open Image Denoise, smooths the sums of small squares of pixels. Pictures are
//!    this light times the materials.
//! 6. While the eye moves, light that earlier pictures found is looked up by place.
//!
//! A [`StandInsDriver`] does the same for scenes that have simpler geometry for some sections.
//!
//! `docs/notes/surface-light.md` has the figures of every filter that was tried.
//!
//! What always holds:
//! - Sums are of integers: the order and the batches of samples change no bit of a picture.
//! - A sample is placed once, when it arrives. Views come and go, the store stays.
//! - No input, no output, no clocks.

mod cell;
mod draw;
mod driver;
mod edges;
mod estimate;
mod filter;
mod gather;
mod known;
mod materials;
mod place;
mod planes;
mod portals;
mod squares;
mod stand_ins;
mod store;
mod trail;
mod usual;
mod view;

pub use cell::Sums;
pub use draw::Drawn;
pub use driver::SurfacesDriver;
pub use edges::{Edge, Piece};
pub use gather::Gathered;
pub use materials::Materials;
pub use place::{Placed, Placer, RaySample};
pub use stand_ins::{MakeDriver, StandIn, StandIns, StandInsDriver};
pub use store::Store;
pub use view::{InPane, Seen, View, Way};
