//! The state of a glTF file while it is read.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat4, Vec3};

use super::buffers::Buffers;
use super::look::MaterialTextures;
use super::mesh_copies::Sharing;
use crate::limits::MAX_MATERIALS;
use crate::model::{LoadProgress, Model};
use crate::texture_files::TextureFiles;
use crate::{LoadOptions, Material, SceneError, smooth};

/// A file while it is read.
pub(super) struct GltfReading<'a> {
    pub path: &'a Path,
    pub options: &'a LoadOptions,
    pub document: &'a gltf::Document,
    /// The world matrices of all nodes; empty if the file has no skin.
    pub worlds: Vec<DMat4>,
    pub buffers: Buffers,
    pub model: Model,
    /// Index into the model's materials, by the file's index; `None` is the default material.
    pub materials: BTreeMap<Option<usize>, u32>,
    /// The textures of each of the model's materials.
    pub looks: Vec<MaterialTextures>,
    pub files: TextureFiles,
    /// Whether a node is the one that is being read, or an ancestor of it.
    pub is_above: Vec<bool>,
    /// Number of nodes that were read.
    pub visits: usize,
    /// Whether nodes share a mesh, by its index.
    pub sharing: Vec<Sharing>,
    /// Number of triangles of all instances of shared meshes.
    pub placed: usize,
    /// Parts of the file that the scene cannot represent, with counts.
    pub counts: BTreeMap<String, usize>,
    /// Photometric files, by the index of the node that names them.
    pub photometry: BTreeMap<usize, String>,
    pub bytes: u64,
    pub watch: &'a mut dyn FnMut(LoadProgress),
}

impl GltfReading<'_> {
    pub(super) fn problem(&self, problem: String) -> SceneError {
        SceneError::Gltf { path: self.path.to_owned(), problem }
    }

    pub(super) fn count(&mut self, what: impl Into<String>) {
        *self.counts.entry(what.into()).or_default() += 1;
    }

    pub(super) fn add_material(
        &mut self,
        key: Option<usize>,
        made: Material,
    ) -> Result<u32, SceneError> {
        let index = self.model.materials.len();
        if index == MAX_MATERIALS {
            let (count, limit) = (index as u64 + 1, MAX_MATERIALS as u64);
            return Err(SceneError::Limit { what: "materials", count, limit });
        }
        self.model.materials.push(made);
        self.looks.push(MaterialTextures::default());
        self.materials.insert(key, index as u32);
        Ok(index as u32)
    }

    /// Gives all triangles so far without normals those of their facets.
    pub(super) fn fill_normals(&mut self) {
        let model = &mut self.model;
        let normals = model.shading.normals.to_mut();
        for &triangle in &model.triangles[normals.len()..] {
            let facet = smooth::facet(&model.positions, triangle);
            normals.push(smooth::packed(facet, [Vec3::ZERO; 3]));
        }
    }
}
