//! Finds sheets of solid glass that enclose nothing, and makes them panes.
//!
//! The inside of solid glass is behind its faces. A single sheet with open edges would put all that
//! lies behind it inside glass, where radiance is greater by the square of the index. A part that
//! has open edges counts as a sheet if rays from its faces inwards do not leave it again. So solids
//! with cracks, and windows of two sheets without a rim, stay solids.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::Bsdf;
use crate::model::{Model, SharedMesh};

/// Most rays that are sent from one part.
const RAYS: usize = 8;

/// Triangles in a leaf of the tree.
const LEAF: usize = 4;

/// Deepest tree: 2²⁸ triangles in halves.
const MAX_DEPTH: usize = 32;

/// An edge between two places, the same in both directions.
type Edge = [[u64; 3]; 2];

/// Makes the sheets of solid glass of a model panes. Returns the number of sheets.
pub(crate) fn to_panes(model: &mut Model) -> usize {
    let is_solid: Vec<bool> =
        model.materials.iter().map(|m| matches!(m.bsdf, Bsdf::Dielectric { .. })).collect();
    if !is_solid.contains(&true) {
        return 0;
    }
    let at = |corner: u32| model.positions[corner as usize];
    let own = sheets(&is_solid, at, &model.triangles, &model.material_ids);
    let of_mesh = |mesh: &SharedMesh| {
        let at = |corner: u32| Vec3::from(mesh.positions[corner as usize]).as_dvec3();
        sheets(&is_solid, at, &mesh.triangles, &mesh.material_ids)
    };
    let of_meshes: Vec<Vec<Vec<usize>>> = model.meshes.iter().map(of_mesh).collect();
    let count = own.len() + of_meshes.iter().map(Vec::len).sum::<usize>();
    if count == 0 {
        return 0;
    }
    let lists =
        || [&model.material_ids].into_iter().chain(model.meshes.iter().map(|m| &m.material_ids));
    // The triangles of each material, less those of sheets.
    let mut solid = vec![0_usize; is_solid.len()];
    lists().flatten().for_each(|&id| solid[id as usize] += 1);
    for (ids, sheets) in lists().zip([&own].into_iter().chain(&of_meshes)) {
        sheets.iter().flatten().for_each(|&k| solid[ids[k] as usize] -= 1);
    }
    let mut panes = HashMap::new();
    let Model { materials, shading, meshes, material_ids, .. } = model;
    let mut pane_of = |id: u32| {
        *panes.entry(id).or_insert_with(|| {
            let mut pane = materials[id as usize].clone();
            if let Bsdf::Dielectric { ior, transmittance, .. } = pane.bsdf {
                pane.bsdf = Bsdf::ThinGlass { ior, transmittance };
            }
            if solid[id as usize] == 0 {
                materials[id as usize] = pane;
                return id;
            }
            materials.push(pane);
            if let Some(&maps) = shading.maps.get(id as usize) {
                shading.maps.push(maps);
            }
            if let Some(&cover) = shading.covers.get(id as usize) {
                shading.covers.push(cover);
            }
            materials.len() as u32 - 1
        })
    };
    own.into_iter().flatten().for_each(|k| material_ids[k] = pane_of(material_ids[k]));
    for (mesh, sheets) in meshes.iter_mut().zip(of_meshes) {
        let ids = &mut mesh.material_ids;
        sheets.into_iter().flatten().for_each(|k| ids[k] = pane_of(ids[k]));
    }
    count
}

/// Returns the triangles of each sheet.
fn sheets(
    is_solid: &[bool],
    at: impl Fn(u32) -> DVec3,
    triangles: &[[u32; 3]],
    material_ids: &[u32],
) -> Vec<Vec<usize>> {
    let is_glass = |&k: &usize| is_solid.get(material_ids[k] as usize) == Some(&true);
    let glass: Vec<usize> = (0..triangles.len()).filter(is_glass).collect();
    let corners = |k: usize| triangles[k].map(&at);
    let mut parts = open_parts(&glass, triangles.len(), &corners);
    if !parts.is_empty() {
        let tree = SheetTree::new(glass.iter().map(|&k| corners(k)).collect());
        parts.retain(|part| is_sheet(part, &corners, &tree));
    }
    parts
}

/// Returns the parts of the glass, connected at edges, that have an edge where nothing else ends.
fn open_parts(
    glass: &[usize],
    triangles: usize,
    corners: &impl Fn(usize) -> [DVec3; 3],
) -> Vec<Vec<usize>> {
    // Adding 0 makes -0 and 0 the same place.
    let bits = |p: DVec3| (p + DVec3::ZERO).to_array().map(f64::to_bits);
    let edges = |k: usize| {
        let [a, b, c] = corners(k).map(bits);
        [[a, b], [b, c], [c, a]].map(|[from, to]| -> Edge { [from.min(to), from.max(to)] })
    };
    // The first triangle of glass at an edge, and the number of all triangles there.
    let mut at_edge: HashMap<Edge, (usize, usize)> = HashMap::new();
    let mut parent: Vec<usize> = (0..glass.len()).collect();
    for (own, &k) in glass.iter().enumerate() {
        for edge in edges(k) {
            let entry = at_edge.entry(edge).or_insert((own, 0));
            entry.1 += 1;
            let (a, b) = (root(&mut parent, entry.0), root(&mut parent, own));
            parent[a.max(b)] = a.min(b);
        }
    }
    if at_edge.values().all(|entry| entry.1 > 1) {
        return Vec::new();
    }
    // Other surfaces may close it.
    let all = glass.iter().flat_map(|&k| corners(k));
    let (low, high) = all
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let is_near = |k: usize| corners(k).iter().any(|p| p.cmpge(low).all() && p.cmple(high).all());
    let mut is_glass = glass.iter().copied().peekable();
    for k in 0..triangles {
        if is_glass.next_if_eq(&k).is_none() && is_near(k) {
            for edge in edges(k) {
                if let Some(entry) = at_edge.get_mut(&edge) {
                    entry.1 += 1;
                }
            }
        }
    }
    let mut is_open = vec![false; glass.len()];
    for &(own, count) in at_edge.values() {
        if count == 1 {
            is_open[root(&mut parent, own)] = true;
        }
    }
    let mut parts: HashMap<usize, Vec<usize>> = HashMap::new();
    for (own, &k) in glass.iter().enumerate() {
        let root = root(&mut parent, own);
        if is_open[root] {
            parts.entry(root).or_default().push(k);
        }
    }
    let mut parts: Vec<(usize, Vec<usize>)> = parts.into_iter().collect();
    parts.sort_unstable_by_key(|part| part.0);
    parts.into_iter().map(|part| part.1).collect()
}

fn root(parent: &mut [usize], mut at: usize) -> usize {
    while parent[at] != at {
        parent[at] = parent[parent[at]];
        at = parent[at];
    }
    at
}

/// Returns whether fewer than half of the rays from a part's faces inwards leave glass again.
fn is_sheet(part: &[usize], corners: &impl Fn(usize) -> [DVec3; 3], tree: &SheetTree) -> bool {
    let step = part.len().div_ceil(RAYS);
    let (mut sent, mut left) = (0, 0);
    for &triangle in part.iter().step_by(step) {
        let [a, b, c] = corners(triangle);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        if normal == DVec3::ZERO {
            continue;
        }
        sent += 1;
        let (from, size) = ((a + b + c) / 3.0, (b - a).length().max((c - a).length()));
        // Not its own plane again.
        let from = from - normal * size * 1e-6;
        left += usize::from(tree.leaves(from, -normal));
    }
    2 * left < sent
}

/// A node's box, and its triangles in order or its two halves.
struct SheetNode {
    low: DVec3,
    high: DVec3,
    first: usize,
    count: usize,
    /// The second half; 0 for leaves. The first half follows its node.
    second: usize,
}

/// A tree of boxes around triangles of glass.
struct SheetTree {
    nodes: Vec<SheetNode>,
    triangles: Vec<[DVec3; 3]>,
}

impl SheetTree {
    fn new(triangles: Vec<[DVec3; 3]>) -> SheetTree {
        let mut tree = SheetTree { nodes: Vec::new(), triangles };
        tree.add(0, tree.triangles.len(), 0);
        tree
    }

    fn add(&mut self, first: usize, count: usize, depth: usize) {
        let own = &mut self.triangles[first..first + count];
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in own.as_flattened() {
            (low, high) = (low.min(*corner), high.max(*corner));
        }
        let node = self.nodes.len();
        self.nodes.push(SheetNode { low, high, first, count, second: 0 });
        if count <= LEAF || depth == MAX_DEPTH {
            return;
        }
        let axis = (high - low).max_position();
        let middle = |t: &[DVec3; 3]| t[0][axis] + t[1][axis] + t[2][axis];
        own.select_nth_unstable_by(count / 2, |a, b| middle(a).total_cmp(&middle(b)));
        self.add(first, count / 2, depth + 1);
        self.nodes[node].second = self.nodes.len();
        self.add(first + count / 2, count - count / 2, depth + 1);
    }

    /// Returns whether the first triangle that a ray hits is hit from behind.
    fn leaves(&self, from: DVec3, direction: DVec3) -> bool {
        let mut nearest = (f64::INFINITY, false);
        let mut pending = vec![0];
        while let Some(index) = pending.pop() {
            let node = &self.nodes[index];
            let (a, b) = ((node.low - from) / direction, (node.high - from) / direction);
            let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
            // NaN, from a face of the box in the ray's own plane, counts as a hit.
            if near > far || far < 0.0 || near > nearest.0 {
                continue;
            }
            if node.second > 0 {
                pending.extend([index + 1, node.second]);
                continue;
            }
            for &[a, b, c] in &self.triangles[node.first..node.first + node.count] {
                if let Some(distance) = distance([a, b, c], from, direction)
                    && distance < nearest.0
                {
                    nearest = (distance, (b - a).cross(c - a).dot(direction) > 0.0);
                }
            }
        }
        nearest.1
    }
}

/// Returns the distance along a ray to a triangle (Möller & Trumbore 1997).
fn distance([a, b, c]: [DVec3; 3], from: DVec3, direction: DVec3) -> Option<f64> {
    let (along, up) = (b - a, c - a);
    let p = direction.cross(up);
    let determinant = along.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let to = from - a;
    let u = to.dot(p) / determinant;
    let q = to.cross(along);
    let v = direction.dot(q) / determinant;
    let distance = up.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}
