//! Two eyes (Larson & Simmons 1999, §2.4.6): any driver's pictures of a left and a right eye, arranged
//! in one picture.
//!
//! A [stereo driver](stereo_driver) has the light of another driver, and two renderers of it. So all
//! samples are stored as that driver stores them, and serve both eyes.
//!
//! Invariants:
//! - Each eye's pixels are those of its own view, drawn by its own renderer from the same samples.
//! - Beams are requested for both eyes, and rays should pass within a sphere around both.
//! - Pixels outside all sections want no live rays: those would be rays of one view.

mod arrangement;
mod eyes;
mod renderer;

pub use arrangement::StereoArrangement;
pub use eyes::StereoEyes;
pub use renderer::stereo_driver;
