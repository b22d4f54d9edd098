//! Indirect light on surfaces, shared by all workers that trace a scene. The method is irradiance
//! caching (Ward, Rubinstein and Clear 1988) with gradients (Ward and Heckbert 1992). A record
//! serves a point only if nothing stands between the two.
//!
//! Invariants: stored light excludes the albedo of the surface that it falls on. It also excludes
//! direct light from lamps and sky, which is sampled at every point.
//!
//! docs/notes/indirect-light.md compares this with other caches.

mod blend;
mod gather;
mod record;
mod store;

pub use gather::{Arrival, Hemisphere, Source, limit_outliers};
pub use record::{MAX_GRADE, Record, grade_weight};
pub use store::{Found, MAX_RECORDS, Store};
