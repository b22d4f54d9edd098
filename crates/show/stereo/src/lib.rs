//! Several views in one picture, as any driver draws them: those of two eyes (Larson & Simmons
//! 1999, §2.4.6), or those through the screens of a wall (§2.4.1).
//!
//! A [stereo driver](stereo_driver) and a [wall's](wall_driver) have the light of another driver,
//! and a renderer of it for each view. So all samples are stored as that driver stores them, and
//! serve all views.
//!
//! Invariants:
//! - Each view's pixels are drawn by its own renderer from the same samples.
//! - Beams are requested for all views, and rays should pass within a sphere around all eyes.
//! - Pixels outside all sections want no live rays: those would be rays of one view.

mod arrangement;
mod eyes;
mod renderer;
mod wall;

pub use arrangement::StereoArrangement;
pub use eyes::StereoEyes;
pub use renderer::{stereo_driver, wall_driver};
pub use wall::{Wall, WallScreen};
