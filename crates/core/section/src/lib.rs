//! Sections, beams, ray coordinates, the sample codec, and sampling in a beam: pure mathematics,
//! without input or output.
//!
//! A *section* is a parallelepiped whose six walls are gridded into cells. A *beam* is all rays
//! from one cell to another. A *sample* is one stored ray of 10 bytes (Larson & Simmons 1999,
//! §2.1). Numbers are `f64`, and every result depends on the arguments alone: no clocks, no global
//! state, no threads.
//!
//! Invariants:
//! - A [`Section`] is valid by construction, and its beams are numbered densely from 0.
//! - [`Section::line`] of [`Section::ray`] gives back the same cells and coordinates, for each of a
//!   beam's 256⁴ rays.
//! - The ray of a sample number depends only on (section, beam, sample number, viewpoint).

mod cells;
pub mod distance;
mod hash;
mod importance;
mod line;
mod order;
mod polygon;
mod proximity;
pub mod rgbe;
mod run;
mod sample;
mod sampler;
mod section;
mod sobol;

pub use cells::{BeamId, CellIndex, CellPair, RayCoords};
pub use glam::DVec3;
pub use hash::seed;
pub use importance::ImportanceTable;
pub use line::LineHit;
pub use order::BeamOrder;
pub use run::{BeamKey, NumberRun};
pub use sample::{Sample, SampleKind};
pub use sampler::{BeamSampler, Viewpoint};
pub use section::{
    MAX_GRID, Section, SectionError, SectionRay, SectionSpec, USUAL_BEAMS, ViewClass,
    ray_eye_distance,
};
