//! Two drivers that need nothing but samples, and that keep what they have from view to view: the
//! render cache and frameless rendering.
//!
//! # The render cache, `pointimage`
//!
//! The method is that of Walter, Drettakis & Parker 1999 and Walter, Drettakis & Greenberg 2002.
//! [`PointImage`] keeps recent samples of any renderer as coloured points of the scene, slightly
//! more points than the picture has pixels. A frame runs these [stages](Stage):
//!
//! 1. Points grow older, the oldest leave, and new samples come in (`points`, `take`). A ray that
//!    went through a point confirms it, or replaces it if its colour has changed.
//! 2. Points are projected into the view that comes next if the camera goes on as it does. Parts
//!    of it without points are asked for (`predict`).
//! 3. Points are projected into the view at hand and sorted by tile (`project`, `map`). A z-buffer
//!    keeps the nearest point of each pixel: the point image (`zbuffer`, `planes`).
//! 4. Points that show through a nearer surface are removed (`cull`).
//! 5. Gaps are filled from 7×7 pixels (`prefilter`), then from 3×3 pixels, which also smooths
//!    (`interpolate`). If samples are noisy, both are mixed (`noise`).
//! 6. A dither picks the pixels that want a ray most: those without a point, then those with an old
//!    one (`dither`, `requests`).
//!
//! The renderer answers the requests, each with its [`Tag`]:
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
//!
//! [`RenderCacheDriver`] runs the cache for a session (`driver`). Its requests become the nearest
//! rays that can be stored, so that traced pixels enter the holodeck, and weights of the view's
//! beams for what tracers can do besides (`frame`). A stored sample counts as a pixel's own if its
//! ray passes the eye within a quarter of a pixel's footprint. At rest a pixel shows the mean of
//! its own samples. All other samples fill in until those come (`screen`).
//!
//! # Frameless rendering, `frameless`
//!
//! [`frameless::Frameless`] keeps one radiance per pixel: the mean of its samples of one view, the
//! newest that it has any of (Bishop, Fuchs, McMillan & Scher Zagier 1994). [`FramelessDriver`]
//! runs it for a session.
//!
//! # What always holds
//!
//! - The same calls give the same bits, on any processor and any number of threads. There is no
//!   clock: a caller that wants the time of a stage is told when the stage ends.
//! - At rest every pixel of the render cache tends to the mean of its own rays, the box filter. No
//!   other pixel's light is in it, or in proportion to 1/n of n noisy samples.
//! - What lies before a view's fore clipping surface is not shown, and what lies beyond the aft one
//!   is black.
//! - If nothing changes and nothing is wanted, nothing is computed.
//! - No number that comes in makes it panic. Samples with numbers that are not finite are ignored.
//!
//! # Where a change goes
//!
//! - A number of the method: a field in `params` and a line in `settings`, by which it also gets a
//!   name for the command line.
//! - A part that can be switched: [`Stages`].
//! - A filter: a module that takes the planes, one loop over their rows, called in `cache`.
//! - What a stored sample means to a pixel: `screen`, for both drivers.
//! - Experiments that failed are in docs/notes/render-cache.md.

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

pub use cache::{Frame, Moment, PointImage};
pub use driver::RenderCacheDriver;
pub use frameless_driver::FramelessDriver;
pub use params::{EmptyPixels, PointImageError, PointImageParams, Smoothing};
pub use sample::{Place, Sample, Tag};
pub use settings::{SETTINGS, Setting};
pub use stage::{Stage, Stages};
