//! Splats: the light of a holodeck as a hierarchy of discs (Rusinkiewicz & Levoy 2000, "QSplat: A
//! Multiresolution Point Rendering System for Large Meshes"). They serve files larger than memory,
//! and pages without a server.
//!
//! Samples become *surfels*: one for each cell of a grid that rays hit, with place, normal, light,
//! and the light's standard error ([`SurfelCells`]). Light of surfels with few samples is smoothed
//! along their surface. A hierarchy of bounding spheres joins up to four surfels or spheres at a
//! time ([`SplatTree`]). Each sphere has the mean light of what it contains, so any level shows
//! everything. A node takes 8 bytes ([`PackedNode`]). Levels follow each other in the file, so any
//! beginning of the file is a whole picture. `docs/splats.md` draws the bytes.
//!
//! Invariants:
//! - A file is written once, under another name, and renamed into place. It never changes.
//! - No node is used before the hash of its chunk was compared ([`SplatFile::node`]). The header's
//!   hash covers the hashes of all chunks.
//! - A child's number is greater than its parent's and less than the number of nodes. A node has one
//!   parent at most. Both hold in a file made to harm too, so a traversal visits each node once.
//! - Equal samples in equal order give equal files, whatever the number of threads.

mod cells;
mod children;
mod error;
mod format;
mod light;
mod node;
mod normals;
mod reader;
mod smooth;
mod surfel;
mod tree;
mod write;

pub use cells::{LEAST_REFLECTANCE, LightPoint, SurfelCells};
pub use error::SplatError;
pub use format::{
    CHUNK_BYTES, CHUNK_NODES, HEADER_BYTES, MAX_LEVELS, NODE_BYTES, SplatHeader, VERSION, seal,
};
pub use light::LightCode;
pub use node::{Disc, PackedNode, Sphere};
pub use reader::{SplatFile, SplatNode};
pub use surfel::Surfel;
pub use tree::SplatTree;
pub use write::{Origin, write};
