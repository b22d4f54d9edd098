//! Two drivers that need only samples and reuse them from view to view: the render cache and
//! frameless rendering.
//!
//! # The render cache, `pointimage`
//!
//! The method is that of Walter, Drettakis & Parker 1999 and Walter, Drettakis & Greenberg 2002.
//! [`PointImage`] stores recent samples of any renderer as coloured points of the scene, slightly
//! more points than the picture has pixels. A frame runs these [stages](Stage):
//!
//! 1. Points grow older, the oldest are removed, and new samples are added (`points`, `take`). A
//!    new ray through a point confirms the point, or replaces it if the colour has changed.
//! 2. Points are projected into the predicted view: where the camera will be if its motion
//!    continues. Rays are requested for the parts of that view without points (`predict`).
//! 3. Points are projected into the current view and sorted by tile (`project`, `map`). A z-buffer
//!    determines the nearest point of each pixel: the point image (`zbuffer`, `planes`).
//! 4. Points that show through a nearer surface are removed (`cull`).
//! 5. Gaps are filled from 7×7 pixels (`prefilter`), which a pyramid of all wider windows completes
//!    where points are few (`pyramid`). Then 3×3 pixels fill and smooth (`interpolate`). If samples
//!    are noisy, both results are mixed (`noise`).
//! 6. A dither chooses the pixels that need a ray most: those without a point, then those with an
//!    old one (`dither`, `requests`).
//!
//! A renderer or an application may also give [hints](PointImage::move_object): an object has
//! moved, or places are likely to change. In a session, the points outlive their driver: if an
//! object of the scene is moved, the next driver goes on with them ([`PointMemory`]).
//!
//! The renderer answers the requests, each with its [`Tag`]:
//!
//! ```
//! use holo_driver_rendercache::{Moment, Place, PointImage, PointImageParams, RayResult};
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
//!             RayResult { tag, ..RayResult::new(place, [0.5, 0.5, 0.4]) }
//!         })
//!         .collect();
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`pointimage_driver`] runs the cache for a session (`driver`). Each request becomes the nearest
//! ray that can be stored, so traced pixels enter the holodeck. The requests also weight the view's
//! beams, for tracers that have time for more (`frame`). A stored sample is a pixel's own if its
//! ray passes the eye within a quarter of a pixel's footprint. At rest a pixel shows the mean of
//! its own samples. Until it has any, it shows other samples (`screen`).
//!
//! # Frameless rendering, `frameless`
//!
//! [`frameless::Frameless`] stores one radiance per pixel (Bishop, Fuchs, McMillan & Scher Zagier
//! 1994). It is the mean of the pixel's samples for the newest view with any.
//! [`frameless_driver()`] runs it for a session.
//!
//! # Invariants
//!
//! - The same calls give the same bits, on any processor and any number of threads. The crate reads
//!   no clock: a callback marks the end of each stage.
//! - At rest every pixel of the render cache tends to the mean of its own rays, the box filter. If
//!   samples are noisy, the share of other pixels' light falls as 1/n for n samples.
//! - Surfaces before a view's fore clipping surface are not shown. Surfaces beyond the aft one are
//!   black.
//! - If nothing has changed and no ray is wanted, a frame computes nothing.
//! - No number in a sample makes it panic. Samples with numbers that are not finite are ignored.
//!
//! # Where a change goes
//!
//! - A number of the method: a field in `params` and a line in `settings`, which also names it for
//!   the command line.
//! - A part that can be switched: [`Stages`].
//! - A filter: a module with one loop over the rows of the planes, called in `cache`.
//! - The meaning of a stored sample for a pixel, in both drivers: `screen`.
//!
//! Experiments that failed are in docs/notes/render-cache.md.

mod awaited;
mod cache;
mod colour;
mod cull;
mod dither;
mod driver;
mod frame;
pub mod frameless;
mod frameless_driver;
mod hints;
mod interpolate;
mod map;
mod memory;
mod noise;
mod params;
mod path_noise;
mod planes;
mod points;
mod predict;
mod prefilter;
mod project;
mod pyramid;
mod requests;
mod rows;
mod sample;
mod screen;
mod settings;
mod stage;
mod take;
mod zbuffer;

pub use cache::{CacheFrame, Moment, PointImage};
pub use driver::{pointimage_driver, pointimage_driver_with_memory};
pub use frameless_driver::frameless_driver;
pub use memory::PointMemory;
pub use params::{EmptyPixels, PointImageError, PointImageParams, Smoothing};
pub use sample::{Place, RayResult, Tag};
pub use settings::{SETTINGS, Setting};
pub use stage::{Stage, Stages};
