//! Moving through a scene: pure functions from a pose, what a person does and the time that passes
//! to the next pose (Larson & Simmons 1999, §2.4.1).
//!
//! - [`Pose`]: where the eye is and where it looks. Its methods are the single motions.
//! - [`Walker`]: a pose with what is held down, a home, and the views before and after.
//! - [`options()`]: a view in Radiance's options, as short as it can be.
//!
//! What always holds:
//! - Nothing here reads a clock. The same inputs and times give the same poses.
//! - A motion by held keys depends on how long they are held, not on how many frames that is.
//! - A pose is finite, and its direction is never along its up vector.

mod history;
mod pose;
mod view;
mod walker;

pub use history::History;
pub use pose::{NEAREST, Pose};
pub use view::options;
pub use walker::{Controls, Walker};
