//! Decides which meshes of a glTF file are shared by their nodes, and reads these once.

use glam::{DMat4, DVec3, Vec3};

use super::form::Form;
use super::instancing;
use super::mesh_copies::Sharing;
use super::reading::GltfReading;
use crate::assemble::placement;
use crate::limits::{MAX_COORDINATE, MAX_MESHES, MAX_TRIANGLES};
use crate::model::SharedMesh;
use crate::thin::box_corners;
use crate::{Material, SceneError, smooth};

/// Fewest triangles of a shared mesh. Rays visit an instance in about the time of some dozens of
/// triangles, so small meshes are faster as copies in one hierarchy.
const LEAST_TRIANGLES: usize = 64;

/// Fewest triangles that sharing must save in a file: about 35 MB. Below, memory does not matter,
/// and rays are faster without instances.
const LEAST_SAVED: usize = 100_000;

/// Returns the nodes from which a file is read, each once.
pub(super) fn roots(document: &gltf::Document) -> Vec<gltf::Node<'_>> {
    match document.default_scene().or_else(|| document.scenes().next()) {
        Some(scene) => {
            let mut is_named = vec![false; document.nodes().len()];
            let is_new = |node: &gltf::Node| !std::mem::replace(&mut is_named[node.index()], true);
            scene.nodes().filter(is_new).collect()
        }
        // A file without scenes is a library of nodes; those without a parent are read.
        None => {
            let mut is_child = vec![false; document.nodes().len()];
            let children = document.nodes().flat_map(|node| node.children().map(|c| c.index()));
            children.for_each(|child| is_child[child] = true);
            document.nodes().filter(|node| !is_child[node.index()]).collect()
        }
    }
}

/// Returns for each mesh whether nodes share it, as far as their number and its size tell.
pub(super) fn plan(document: &gltf::Document) -> Vec<Sharing> {
    let mut nodes_of = vec![0_usize; document.meshes().len()];
    let mut is_visited = vec![false; document.nodes().len()];
    let mut pending = roots(document);
    while let Some(node) = pending.pop() {
        if !std::mem::replace(&mut is_visited[node.index()], true) {
            // Posed and morphed meshes have a shape of their own at each node.
            if let Some(mesh) = node.mesh().filter(|_| node.skin().is_none()) {
                let places = instancing::count(&node, document);
                nodes_of[mesh.index()] = nodes_of[mesh.index()].saturating_add(places);
            }
            pending.extend(node.children());
        }
    }
    let triangles = |mesh: gltf::Mesh| -> usize {
        let corners = mesh.primitives().filter_map(|primitive| {
            primitive.indices().or_else(|| primitive.get(&gltf::Semantic::Positions))
        });
        corners.map(|accessor| accessor.count() / 3).fold(0, usize::saturating_add)
    };
    let saved: Vec<usize> = document
        .meshes()
        .zip(&nodes_of)
        .map(|(mesh, &nodes)| match triangles(mesh) {
            count if count < LEAST_TRIANGLES => 0,
            count => count.saturating_mul(nodes.saturating_sub(1)),
        })
        .collect();
    let is_worth_it =
        saved.iter().fold(0, |sum: usize, &one| sum.saturating_add(one)) >= LEAST_SAVED;
    let of = |&saved: &usize| {
        if is_worth_it && saved > 0 { Sharing::Wanted } else { Sharing::Copied }
    };
    saved.iter().map(of).collect()
}

impl GltfReading<'_> {
    /// Adds an instance of a mesh if its nodes share it. Returns false if the node needs a copy.
    pub(super) fn share(&mut self, mesh: &gltf::Mesh, matrix: DMat4) -> Result<bool, SceneError> {
        if matches!(self.sharing[mesh.index()], Sharing::Wanted) {
            self.sharing[mesh.index()] = self.read_shared(mesh)?;
        }
        let Sharing::Read(index) = self.sharing[mesh.index()] else { return Ok(false) };
        let shared = &self.model.meshes[index as usize];
        let is_within = |&position: &[f32; 3]| {
            let place = matrix.transform_point3(Vec3::from(position).as_dvec3());
            place.abs().max_element() <= MAX_COORDINATE
        };
        let is_possible = placement(matrix, DVec3::ZERO).is_some();
        if !is_possible || !shared.corners.iter().all(is_within) {
            return Ok(false);
        }
        self.placed += shared.triangles.len();
        let count = self.model.triangles.len() + self.placed;
        if count > MAX_TRIANGLES {
            let (count, limit) = (count as u64, MAX_TRIANGLES as u64);
            return Err(SceneError::Limit { what: "triangles", count, limit });
        }
        self.model.placements.push((index, matrix));
        Ok(true)
    }

    /// Reads a mesh in its own coordinates. A mesh that emits light is not shared, because each
    /// lamp has a record of its own anyway.
    fn read_shared(&mut self, mesh: &gltf::Mesh) -> Result<Sharing, SceneError> {
        // It is read into an empty model, and materials are the file's.
        let mut whole = std::mem::take(&mut self.model);
        std::mem::swap(&mut whole.materials, &mut self.model.materials);
        let form = Form::rigid(DMat4::IDENTITY);
        let read = mesh.primitives().try_for_each(|primitive| self.primitive(&primitive, &form));
        std::mem::swap(&mut whole.materials, &mut self.model.materials);
        let read_model = std::mem::replace(&mut self.model, whole);
        read?;
        let materials = &self.model.materials;
        let emits = read_model
            .material_ids
            .iter()
            .any(|&id| materials.get(id as usize).is_some_and(Material::emits));
        if emits || self.model.meshes.len() == MAX_MESHES {
            return Ok(Sharing::Copied);
        }
        // They are the file's f32, which f64 represents.
        let positions: Vec<[f32; 3]> =
            read_model.positions.iter().map(|p| p.as_vec3().to_array()).collect();
        self.model.meshes.push(SharedMesh {
            corners: box_corners(&positions),
            positions,
            triangles: read_model.triangles,
            material_ids: read_model.material_ids,
            shading: read_model.shading,
        });
        Ok(Sharing::Read(self.model.meshes.len() as u32 - 1))
    }

    /// Gives all triangles of a shared mesh normals. Those without have their facets'.
    pub(super) fn fill_normals_of(mesh: &mut SharedMesh) {
        let at = |corner: u32| Vec3::from(mesh.positions[corner as usize]).as_dvec3();
        let normals = mesh.shading.normals.to_mut();
        for triangle in &mesh.triangles[normals.len()..] {
            let [a, b, c] = triangle.map(at);
            let facet = (b - a).cross(c - a).normalize_or_zero();
            normals.push(smooth::packed(facet, [Vec3::ZERO; 3]));
        }
    }
}
