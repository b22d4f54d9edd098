//! Moving through a scene (Larson & Simmons 1999, §2.4.1). Pure functions take a pose, an input and
//! the time that passes, and return the next pose.
//!
//! - [`Pose`]: the eye's position and direction. Its methods are the single motions.
//! - [`Walker`]: a pose with the controls that are held down, a home, and the views before and
//!   after.
//! - [`Surroundings`]: the surfaces that stop the eye and carry it.
//! - [`options()`]: a view as Radiance's options, in few words.
//!
//! Invariants:
//! - Nothing here reads a clock. The same inputs and times give the same poses.
//! - A held key moves the eye by a distance that depends on the time, not on the number of frames.
//! - A pose is finite, and its direction is never along its up vector.

mod history;
mod pose;
mod solid;
mod view;
mod walker;

pub use history::History;
pub use pose::{NEAREST, Pose};
pub use solid::{Surface, Surroundings};
pub use view::options;
pub use walker::{Controls, Walker};
