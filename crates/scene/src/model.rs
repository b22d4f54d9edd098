//! What readers of model files have in common, one for each format.
//!
//! A format is one module that has a [`Reader`], and an entry in the list of `load`.

use std::path::Path;

use glam::DVec3;

use crate::warnings::Warnings;
use crate::{About, LoadOptions, Material, SceneError, Shading, Sun};

/// What a reader finds in a file, in world coordinates.
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
    pub about: About,
    /// The line of each triangle, for messages. Empty if the format has no lines.
    pub lines: crate::faces::Faces,
    /// What the file is, for people, if it has no triangle.
    pub instead: Option<String>,
}

/// How much of a file has been read.
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
pub(crate) struct Source<'a> {
    pub path: &'a Path,
    pub options: &'a LoadOptions,
    /// Is told how much has been read.
    pub watch: &'a mut dyn FnMut(LoadProgress),
    pub warnings: &'a mut Warnings,
}

/// Reads one format.
pub(crate) struct Reader {
    /// Returns whether a file is of this format, by its first bytes and its name.
    pub recognises: fn(&[u8], &Path) -> bool,
    /// Reads a file.
    pub read: fn(Source) -> Result<Model, SceneError>,
}
