//! The form of a node's mesh: placed by the node, posed by the joints of a skin, and deformed by
//! the weights of morph targets. All are those of the scene at rest.

use glam::{DMat4, Vec3};

use super::accessor;
use super::buffers::Buffers;
use super::reading::GltfReading;

/// The form of a mesh.
pub(super) struct Form {
    /// Places the mesh, or those of its vertices that no joint moves.
    pub matrix: DMat4,
    /// For each joint of the skin, the map from the mesh to the world.
    joints: Vec<DMat4>,
    weights: Vec<f32>,
}

/// Numbers or weights of four joints, for each vertex.
type Fours = Vec<[f32; 4]>;

/// The maps of the vertices of a primitive to the world.
pub(super) struct VertexTransforms<'a> {
    form: &'a Form,
    /// Numbers and weights of four joints, for each set and vertex.
    sets: Vec<(Fours, Fours)>,
}

/// Most sets of four joints that move one vertex. Exporters write one or two.
const MAX_SETS: u32 = 8;

impl Form {
    /// Returns the form of a mesh that a matrix places.
    pub(super) fn rigid(matrix: DMat4) -> Form {
        Form { matrix, joints: Vec::new(), weights: Vec::new() }
    }

    /// Returns the form of a node's mesh, whose world matrix is `matrix`.
    pub(super) fn of(
        reading: &GltfReading,
        node: &gltf::Node,
        mesh: &gltf::Mesh,
        matrix: DMat4,
    ) -> Result<Form, String> {
        let weights = node.weights().or(mesh.weights()).unwrap_or_default();
        let is_moved = weights.iter().any(|&weight| weight != 0.0);
        let weights = if is_moved { weights.to_vec() } else { Vec::new() };
        let Some(skin) = node.skin() else {
            return Ok(Form { matrix, joints: Vec::new(), weights });
        };
        let unbound = match skin.inverse_bind_matrices() {
            Some(matrices) => accessor::floats::<16>(&matrices, &reading.buffers)?,
            None => Vec::new(),
        };
        let joint = |(number, joint): (usize, gltf::Node)| {
            let world = reading.worlds.get(joint.index()).copied().unwrap_or(DMat4::IDENTITY);
            let unbind = unbound.get(number).map(|matrix| matrix.map(f64::from));
            world * unbind.map_or(DMat4::IDENTITY, |matrix| DMat4::from_cols_array(&matrix))
        };
        let joints: Vec<DMat4> = skin.joints().enumerate().map(joint).collect();
        if joints.iter().any(|joint| !joint.is_finite()) {
            return Err("the joints of its skin have no finite place".to_owned());
        }
        Ok(Form { matrix, joints, weights })
    }

    /// Returns whether joints place the vertices.
    pub(super) fn is_posed(&self) -> bool {
        !self.joints.is_empty()
    }

    /// Returns whether nothing but its place differs from the mesh.
    pub(super) fn is_rigid(&self) -> bool {
        !self.is_posed() && self.weights.is_empty()
    }

    /// Adds the weighted displacements of morph targets to positions or normals.
    pub(super) fn morph(
        &self,
        primitive: &gltf::Primitive,
        of: gltf::Semantic,
        values: &mut [[f32; 3]],
        buffers: &Buffers,
    ) -> Result<(), String> {
        if self.weights.is_empty() {
            return Ok(());
        }
        for (target, &weight) in primitive.morph_targets().zip(&self.weights) {
            let moved = match of {
                gltf::Semantic::Normals => target.normals(),
                _ => target.positions(),
            };
            let Some(moved) = moved.filter(|_| weight != 0.0) else { continue };
            let moved = accessor::floats::<3>(&moved, buffers)?;
            for (value, moved) in values.iter_mut().zip(moved) {
                *value = (Vec3::from(*value) + weight * Vec3::from(moved)).to_array();
            }
        }
        Ok(())
    }

    /// Returns the maps of a primitive's vertices to the world.
    pub(super) fn places(
        &self,
        primitive: &gltf::Primitive,
        reading: &GltfReading,
    ) -> Result<VertexTransforms<'_>, String> {
        let mut sets = Vec::new();
        for set in (0..MAX_SETS).take_while(|_| self.is_posed()) {
            let joints = primitive.get(&gltf::Semantic::Joints(set));
            let weights = primitive.get(&gltf::Semantic::Weights(set));
            let Some((joints, weights)) = joints.zip(weights) else { break };
            let read = |array| accessor::floats::<4>(array, &reading.buffers);
            sets.push((read(&joints)?, read(&weights)?));
        }
        Ok(VertexTransforms { form: self, sets })
    }
}

impl VertexTransforms<'_> {
    /// Returns the map of a vertex to the world. Weights need not have the sum 1.
    pub(super) fn matrix(&self, vertex: usize) -> DMat4 {
        let (mut sum, mut whole) = (DMat4::ZERO, 0.0);
        for (joints, weights) in &self.sets {
            let (Some(joints), Some(weights)) = (joints.get(vertex), weights.get(vertex)) else {
                continue;
            };
            for (&joint, &weight) in joints.iter().zip(weights) {
                if let Some(matrix) = self.form.joints.get(joint as usize).filter(|_| weight > 0.0)
                {
                    sum += *matrix * f64::from(weight);
                    whole += f64::from(weight);
                }
            }
        }
        if whole > 0.0 { sum * (1.0 / whole) } else { self.form.matrix }
    }
}

/// Returns the world matrices of all nodes; none if the file has no skin. A node that is its own
/// descendant has none: it is the identity.
pub(super) fn worlds(document: &gltf::Document) -> Vec<DMat4> {
    if document.skins().len() == 0 {
        return Vec::new();
    }
    let nodes: Vec<gltf::Node> = document.nodes().collect();
    let mut is_child = vec![false; nodes.len()];
    let children = nodes.iter().flat_map(|node| node.children().map(|child| child.index()));
    children.for_each(|child| is_child[child] = true);
    let mut worlds: Vec<Option<DMat4>> = vec![None; nodes.len()];
    let roots = (0..nodes.len()).filter(|&node| !is_child[node]);
    let mut pending: Vec<(usize, DMat4)> = roots.map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((node, parent)) = pending.pop() {
        if worlds[node].is_none() {
            let own = nodes[node].transform().matrix().map(|c| c.map(f64::from));
            let world = parent * DMat4::from_cols_array_2d(&own);
            worlds[node] = Some(world);
            pending.extend(nodes[node].children().map(|child| (child.index(), world)));
        }
    }
    worlds.into_iter().map(Option::unwrap_or_default).collect()
}
