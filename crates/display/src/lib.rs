//! The display process without its process: which beams a view wants, and what picture their samples make.
//!
//! [`select_beams`] turns a view into wanted beams (Larson & Simmons 1999, §2.4.2); the server answers with samples; a
//! driver turns samples into pixels. [`Quadtree`] is the driver of §2.4.3, with leaves that know surfaces and noise, [`Voronoi`] that of
//! §2.4.4, with the scene; without one, [`Cells`].
//!
//! What always holds:
//! - No input or output, no clock, no randomness but what the caller seeds: the same calls give the same bits.
//! - A picture at rest does not depend on the order in which samples arrived, nor on how they were batched.
//! - A pixel that no section covers is never invented: it stays 0, or what is known of its surface, and is counted; a picture of live
//!   rays ([`LiveSample`]) is drawn apart.

mod camera;
mod candidates;
mod cells;
mod covered;
mod ending;
pub mod frameless;
mod live;
mod parts;
pub mod pointimage;
mod quadtree;
mod select;
mod voronoi;

pub use candidates::section_of;
pub use cells::{Cells, CellsParams, Filling};
pub use live::LiveSample;
pub use quadtree::{Frame, LeafSize, MultiDepth, Quadtree, QuadtreeParams, REFETCH_DEGREES};
pub use select::{
    Coverage, SelectOptions, Selection, WantedBeam, select_beams, viewpoint, viewpoint_radius,
};
pub use voronoi::{Drawn, Resolution, Voronoi};
