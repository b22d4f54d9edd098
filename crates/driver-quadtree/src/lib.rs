//! The quadtree driver.

mod agreement;
mod beams;
mod bins;
mod blend;
mod cells;
mod depths;
mod driver;
mod leaf;
mod live;
mod log;
mod paint;
mod pixels;
mod pyramid;
mod reproject;
mod shown;
mod standing;
mod sums;
mod surface;
mod tree;

pub use cells::{Cells, Filling};
pub use driver::QuadtreeDriver;
pub use tree::{LeafSize, Quadtree, QuadtreeParams};
