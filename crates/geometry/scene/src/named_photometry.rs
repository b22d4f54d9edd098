//! Photometric files that models name.

use std::path::PathBuf;

use glam::DMat4;

/// A photometric file that a model names for a part of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedPhotometry {
    /// The file, in the model's folder.
    pub path: PathBuf,
    /// The part.
    pub part: LuminousPart,
}

/// The part of a model that a photometric file is for.
#[derive(Clone, Debug, PartialEq)]
pub enum LuminousPart {
    /// The faces of a material.
    Material {
        /// The material.
        id: u32,
        /// Degrees by which its luminaires are turned about their axis.
        turn: f64,
    },
    /// A node, whose -Y is the nadir and whose X is the direction C0.
    Node {
        /// Its name.
        name: String,
        /// Its map to world coordinates.
        matrix: DMat4,
    },
}
