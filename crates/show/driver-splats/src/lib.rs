//! The driver `splats`: draws a hierarchy of discs that was made of all samples of a holodeck
//! (Rusinkiewicz & Levoy 2000, "QSplat").
//!
//! A frame goes down the hierarchy from the root ([`Traversal`]). It leaves out spheres outside
//! the picture and those whose surfaces all face away. It stops at spheres that are smaller than a
//! pixel, and draws them as discs. While the eye moves, it stops earlier, so that the number of
//! discs stays within a budget. Only the pages of the file that a view needs are read, so a file
//! may be far larger than memory.
//!
//! Invariants:
//! - The driver uses no samples and requests none: all light is in the splats. New samples are
//!   shown once the splats are made again.
//! - Pictures do not depend on the number of threads.
//! - A damaged part of the file is not drawn: what is above it in the hierarchy is, and the next
//!   view is refused with the reason.

mod driver;
mod holes;
mod paint;
mod shape;
mod traversal;

pub use driver::splats_driver;
pub use shape::SplatShape;
pub use traversal::{Culled, SplatCut, Traversal};
