//! Indirect light on surfaces, shared by all who trace a scene: irradiance caching (Ward, Rubinstein and Clear 1988) with gradients
//! (Ward and Heckbert 1992) and records that are checked for being in sight.
//!
//! Always true: the light is without the albedo of the surface that it falls on, and without the light that comes straight from
//! lamps and sky, which is sampled at every point anew.

mod gather;
mod record;
mod store;

pub use gather::{Arrival, Hemisphere, Source, hold};
pub use record::Record;
pub use store::{Found, MAX_RECORDS, Store};
