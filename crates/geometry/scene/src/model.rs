//! The common part of readers of model files. Each format has one reader.
//!
//! A format is one module that has a [`FormatReader`], and an entry in the list of `load`.

use std::path::Path;

use glam::{DMat4, DVec3};

use crate::warnings::Warnings;
use crate::{
    Geometry, LoadOptions, Material, ModelFacts, NamedPhotometry, PunctualLight, SceneError,
    Shading, Sun,
};

/// The contents of a file, in world coordinates.
#[derive(Default)]
pub(crate) struct Model {
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    /// An index into `materials` for each triangle.
    pub material_ids: Vec<u32>,
    pub materials: Vec<Material>,
    /// Attributes of `triangles` and `materials`.
    pub shading: Shading,
    pub suns: Vec<Sun>,
    /// Point and spot lights, and their places. The scene decides their radius.
    pub punctual_lights: Vec<(DVec3, PunctualLight)>,
    pub about: ModelFacts,
    /// Photometric files for parts of it.
    pub photometry: Vec<NamedPhotometry>,
    /// Meshes that several nodes share, in their own coordinates.
    pub meshes: Vec<SharedMesh>,
    /// Indices into `meshes`, and maps to world coordinates.
    pub placements: Vec<(u32, DMat4)>,
    /// The line of each triangle, for messages. Empty if the format has no lines.
    pub lines: crate::faces::Faces,
    /// The file's real format, for people, if it has no triangle.
    pub instead: Option<String>,
}

/// A mesh in its own coordinates.
#[derive(Default)]
pub(crate) struct SharedMesh {
    pub positions: Vec<[f32; 3]>,
    /// The corners of a box around the positions.
    pub corners: [[f32; 3]; 8],
    pub triangles: Vec<[u32; 3]>,
    /// An index into the model's materials for each triangle.
    pub material_ids: Vec<u32>,
    /// Attributes of `triangles`.
    pub shading: Shading,
}

impl SharedMesh {
    pub(crate) fn geometry(&self) -> Geometry<'_> {
        Geometry {
            positions: &self.positions,
            triangles: &self.triangles,
            material_ids: &self.material_ids,
        }
    }
}

/// The part of a file that has been read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadProgress {
    /// Bytes read.
    pub bytes: u64,
    /// Bytes in the file.
    pub total_bytes: u64,
    /// Triangles read.
    pub triangles: u64,
}

/// A file to be read.
pub(crate) struct ModelFile<'a> {
    pub path: &'a Path,
    pub options: &'a LoadOptions,
    /// Called with the progress of reading.
    pub watch: &'a mut dyn FnMut(LoadProgress),
    pub warnings: &'a mut Warnings,
}

/// Reads one format.
pub(crate) struct FormatReader {
    /// Returns whether a file has this format, from its first bytes and its name.
    pub recognises: fn(&[u8], &Path) -> bool,
    /// Reads a file.
    pub read: fn(ModelFile) -> Result<Model, SceneError>,
}
