//! Moving through a scene (Larson & Simmons 1999, §2.4.1). Pure functions take a pose, an input and
//! the time that passes, and return the next pose.
//!
//! - [`Pose`]: where the eye is and where it looks. Its methods are the single motions.
//! - [`Walker`]: a pose with what is held down, a home, and the views before and after.
//! - [`options()`]: a view in Radiance's options, as short as it can be.
//!
//! What always holds:
//! - Nothing here reads a clock. The same inputs and times give the same poses.
//! - How far a held key moves the eye depends on the time, and not on the number of frames.
//! - A pose is finite, and its direction is never along its up vector.

mod history;
mod pose;
mod view;
mod walker;

pub use history::History;
pub use pose::{NEAREST, Pose};
pub use view::options;
pub use walker::{Controls, Walker};
