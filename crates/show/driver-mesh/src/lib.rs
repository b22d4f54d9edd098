//! The driver `mesh`: a mesh of triangles over the samples of a view, without a scene (Larson &
//! Simmons 1999, §2.4.5).
//!
//! # How a picture is made
//!
//! 1. *Landing* (`landing`, `chart`). A sample ends at a point of the scene, which has a direction
//!    around the *canonical eye*, and a depth.
//! 2. *Cells* (`cells`, `sums`). Directions are sorted into cells about as large as a pixel. A cell
//!    has the mean colour, direction and depth of its samples: a vertex.
//! 3. *Triangulation* (`triangulation`, `direction`, `index`). The vertices' directions make a Delaunay
//!    triangulation of the sphere, with exact arithmetic.
//! 4. *Hidden vertices* (`seen`). Rays that pass the eye look behind objects. A vertex that nearer
//!    ones surround shows their surface.
//! 5. *Noise* (`smooth`). The colour of a vertex is a mean over its surroundings, as wide as its noise
//!    demands.
//! 6. *Triangles* (`raster`, `paint`). Each triangle is drawn where the eye sees its three points, with
//!    colours interpolated between them. Triangles across a jump of depth are split there.
//!
//! The [driver](mesh_driver) uses one mesh for several views.
//!
//! # Invariants
//!
//! - A picture at rest is a function of the set of samples. Their order, their batches and the number
//!   of threads change no bit of it.
//! - Pixels that no section covers stay 0 until live rays arrive for them. A pixel whose best beam
//!   sees nothing is the sky, or black if the view clips it.
//! - Memory is bounded, whatever the number of samples.
//!
//! Measurements are in docs/notes/mesh.md.

mod cells;
mod chart;
mod direction;
mod driver;
mod index;
mod landing;
mod mask;
mod mesh;
mod paint;
mod raster;
mod seen;
mod smooth;
mod sums;
mod triangulation;

pub use direction::{GridDirection, HullPoint, is_in_cone};
pub use driver::mesh_driver;
pub use triangulation::{BASE, SphereTriangulation};
