//! The render cache (Walter, Drettakis & Parker 1999; Walter, Drettakis & Greenberg 2002), and
//! frameless rendering (Bishop, Fuchs, McMillan & Scher Zagier 1994): drivers that need nothing but
//! samples, and keep what they have from view to view.
//!
//! TODO
//!
//! ```
//! use holo_driver_rendercache::{Moment, Place, PointImage, PointImageParams, Sample};
//! # use holo_picture::View;
//! # let size = (64, 48);
//! # let eye = [0.0; 3].into();
//! # let view = View::new(eye, [0.0, 1.0, 0.0].into(), [0.0, 0.0, 1.0].into(), None, None, size)?;
//! let mut cache = PointImage::new(size, PointImageParams::default())?;
//! let mut samples = Vec::new();
//! for _ in 0..3 {
//!     let frame = cache.frame(&Moment { view, predicted: None, samples: &samples, wanted: 100 });
//!     samples = frame
//!         .requests()
//!         .map(|(tag, origin, direction)| {
//!             // The renderer: a wall two units away.
//!             let place = Place::At(origin + direction * (2.0 / direction.y));
//!             Sample { tag, ..Sample::new(place, [0.5, 0.5, 0.4]) }
//!         })
//!         .collect();
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cache;
mod colour;
mod cull;
mod dither;
mod driver;
mod frame;
pub mod frameless;
mod frameless_driver;
mod interpolate;
mod map;
mod noise;
mod params;
mod planes;
mod points;
mod predict;
mod prefilter;
mod project;
mod requests;
mod rows;
mod sample;
mod screen;
mod settings;
mod stage;
mod take;
mod zbuffer;

pub use cache::{Moment, PointImage};
pub use driver::RenderCacheDriver;
pub use frame::Frame;
pub use frameless_driver::FramelessDriver;
pub use params::{EmptyPixels, PointImageError, PointImageParams, Smoothing};
pub use sample::{Place, Sample, Tag};
pub use settings::{SETTINGS, Setting};
pub use stage::{Stage, Stages};
