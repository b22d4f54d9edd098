//! Light kept on surfaces: what samples tell of it, wherever they looked from, and pictures of it from any eye.
//!
//! A [`Store`] sums the light that samples bring, divided by what their surfaces reflect, in cells of several sizes. A
//! [`View`] finds the surfaces that its pixels see, looks their light up, filters it, and multiplies it by the materials.
//!
//! What always holds:
//! - Sums are of integers: the order and the batches of samples change no bit of a picture.
//! - A sample is placed once, when it arrives. Views come and go, the store stays.
//! - No input, no output, no clocks.

mod cell;
mod draw;
mod driver;
mod filter;
mod gather;
mod known;
mod materials;
mod place;
mod store;
mod trail;
mod view;

pub use cell::Sums;
pub use draw::Drawn;
pub use driver::SurfacesDriver;
pub use gather::Gathered;
pub use materials::Materials;
pub use place::{Placed, Placer, RaySample};
pub use store::Store;
pub use view::{Seen, View, Way};
