//! Indirect light on surfaces, shared by everyone who traces a scene: irradiance caching (Ward,
//! Rubinstein and Clear 1988) with gradients (Ward and Heckbert 1992) and a visibility test between
//! point and record.
//!
//! Invariants: the light excludes the albedo of the surface that it falls on. It also excludes
//! light that comes straight from lamps and sky, which is sampled anew at every point.
//!
//! docs/notes/indirect-light.md compares this with other caches.

mod gather;
mod record;
mod store;

pub use gather::{Arrival, Hemisphere, Source, limit_outliers};
pub use record::Record;
pub use store::{Found, MAX_RECORDS, Store};
