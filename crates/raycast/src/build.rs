//! Builds the hierarchy: obvhs makes a binary tree, which is then collapsed to eight children a
//! node.
//!
//! Invariants: every triangle is in a leaf. Every box contains its triangles with a margin of
//! [`PAD`] times the scene's reach. A traversal needs at most [`LARGE_STACK`] stack entries,
//! because a balanced tree replaces a tree that is too deep.

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, node::Bvh2Node, reinsertion::ReinsertionOptimizer};
use obvhs::ploc::{PlocBuilder, PlocSearchDistance};
use obvhs::splits::split_aabbs_preset;
use obvhs::triangle::Triangle;

use crate::dispatch::LARGE_STACK;
use crate::facet::Facet;
use crate::node::{Block, Hierarchy, LANES, LEAF, Node, SmallScene, WIDTH};

/// Padding of boxes, as a share of the greatest coordinate.
///
/// The triangle test rounds vertices twice: when the ray's origin is subtracted, and when they are
/// sheared. The error is at most 5 · 2⁻²⁴ of the distance, which is within 3 reaches. Spatial
/// splits end boxes at points that were interpolated in f32. The stretch in the box test covers the
/// first error too; this padding does not rely on it.
pub(crate) const PAD: f32 = 1.0 / (1 << 19) as f32;

/// Least padding. A scene whose vertices are all 0 still needs boxes that are not empty, and the
/// padding must exceed the least step of a [`Node`].
pub(crate) const LEAST_PAD: f32 = 1e-25;

/// Number of boxes up to which the preset is followed. Beyond it, pairs are searched for less far,
/// and the share of reinsertions falls as the number grows. Both would delay the opening of a scene
/// for little gain (docs/notes/ray-casting.md).
const LARGE: usize = 200_000;

/// Fewest triangles of a node and of a block on average. Scenes whose triangles were split may have
/// fewer, and their memory grows.
const FACETS_OF_NODE: usize = 8;
const FACETS_OF_BLOCK: usize = 3;

/// Builds the hierarchy over facets whose coordinates are at most `reach`.
pub(crate) fn hierarchy(facets: &[Facet], reach: f32) -> Hierarchy {
    if facets.is_empty() {
        return Hierarchy::default();
    }
    let mut hierarchy = padded(facets, (reach * PAD).max(LEAST_PAD));
    hierarchy.few =
        SmallScene::new(facets.iter().map(|f| f.vertices.map(|v| v.to_array())).collect());
    hierarchy
}

/// Builds the hierarchy over facets, at least one, with boxes padded by `pad`.
pub(crate) fn padded(facets: &[Facet], pad: f32) -> Hierarchy {
    let hierarchy = collapse(&Tree::from_obvhs(&binary(facets)), facets, pad);
    match hierarchy.stack_need > LARGE_STACK {
        true => collapse(&Tree::balanced(&boxes(facets)), facets, pad),
        false => hierarchy,
    }
}

/// Builds a hierarchy over boxes, at least one. Leaves are references to single boxes: [`LEAF`] and
/// the index.
pub(crate) fn over_boxes(boxes: &[Aabb], pad: f32) -> Hierarchy {
    let collapse = |tree: &Tree| {
        let mut hierarchy = Hierarchy::default();
        collapse_to(&mut hierarchy, tree, 1, pad, |_, index| index[0]);
        hierarchy
    };
    let indices = (0..boxes.len() as u32).collect();
    let hierarchy = collapse(&Tree::from_obvhs(&agglomerated(boxes, indices)));
    match hierarchy.stack_need > LARGE_STACK {
        true => collapse(&Tree::balanced(boxes)),
        false => hierarchy,
    }
}

fn boxes(facets: &[Facet]) -> Vec<Aabb> {
    facets.iter().map(bounds).collect()
}

fn bounds(facet: &Facet) -> Aabb {
    let [a, b, c] = facet.vertices.map(Vec3A::from);
    Aabb::new(a.min(b).min(c), a.max(b).max(c))
}

/// Builds a binary tree by the steps of obvhs's slow preset, without its collapse and its debug
/// check of the whole tree. Other presets were tried: docs/notes/ray-casting.md.
fn binary(facets: &[Facet]) -> Bvh2 {
    let params = BvhBuildParams::slow_build();
    let mut boxes = boxes(facets);
    let mut indices: Vec<u32> = (0..facets.len() as u32).collect();
    if params.pre_split {
        let triangles: Vec<Triangle> = facets
            .iter()
            .map(|f| {
                let [v0, v1, v2] = f.vertices.map(Vec3A::from);
                Triangle { v0, v1, v2 }
            })
            .collect();
        let (sum, largest) = boxes.iter().fold((0.0, 0.0_f32), |(sum, largest), b| {
            let area = b.half_area();
            (sum + f64::from(area), largest.max(area))
        });
        let mean = (sum / boxes.len() as f64) as f32;
        split_aabbs_preset(&mut boxes, &mut indices, &triangles, mean, largest);
    }
    let mut bvh = agglomerated(&boxes, indices);
    bvh.uses_spatial_splits = params.pre_split;
    optimize(&mut bvh, boxes.len());
    bvh
}

/// Joins boxes that are near each other.
fn agglomerated(boxes: &[Aabb], indices: Vec<u32>) -> Bvh2 {
    let params = BvhBuildParams::slow_build();
    let is_large = boxes.len() > LARGE;
    let distance = if is_large { PlocSearchDistance::Low } else { params.ploc_search_distance };
    PlocBuilder::with_capacity(boxes.len()).build(
        distance,
        boxes,
        indices,
        params.sort_precision,
        params.search_depth_threshold,
    )
}

fn optimize(bvh: &mut Bvh2, boxes: usize) {
    let ratio = BvhBuildParams::slow_build().reinsertion_batch_ratio;
    let share = (LARGE as f32 / boxes as f32).min(1.0);
    ReinsertionOptimizer::default().run(bvh, ratio * share, None);
}

/// A binary tree. Children come after their parents.
struct Tree {
    nodes: Vec<TreeNode>,
}

#[derive(Clone, Copy)]
struct TreeNode {
    min: Vec3,
    max: Vec3,
    /// `Ok`: the first of two adjacent children. `Err`: a triangle.
    content: Result<u32, u32>,
    /// Number of triangle references in the subtree.
    references: u32,
}

impl TreeNode {
    fn new(bounds: Aabb, content: Result<u32, u32>) -> Self {
        Self { min: bounds.min.into(), max: bounds.max.into(), content, references: 1 }
    }

    fn half_area(&self) -> f32 {
        let d = self.max - self.min;
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

impl Tree {
    fn from_obvhs(bvh: &Bvh2) -> Self {
        let convert = |node: &Bvh2Node, first: u32| {
            let content = if node.is_leaf() {
                Err(bvh.primitive_indices[node.first_index as usize])
            } else {
                Ok(first)
            };
            TreeNode::new(*node.aabb(), content)
        };
        // Renumbered, because reinsertion leaves nodes in no particular order.
        let mut sources = vec![0_usize];
        let mut nodes = Vec::with_capacity(bvh.nodes.len());
        while let Some(&source) = sources.get(nodes.len()) {
            let node = &bvh.nodes[source];
            nodes.push(convert(node, sources.len() as u32));
            if !node.is_leaf() {
                sources.extend([node.first_index as usize, node.first_index as usize + 1]);
            }
        }
        Self::counted(nodes)
    }

    /// Builds a tree by halving the number of triangles along the widest axis of their centres. It
    /// is never deeper than log₂ of the number of triangles.
    fn balanced(boxes: &[Aabb]) -> Self {
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        let mut ranges = std::iter::once(0..boxes.len()).collect::<Vec<_>>();
        let mut nodes = Vec::with_capacity(2 * boxes.len());
        while let Some(range) = ranges.get(nodes.len()).cloned() {
            let mut whole = Aabb::empty();
            let mut centres = Aabb::empty();
            for &i in &order[range.clone()] {
                whole = whole.union(&boxes[i as usize]);
                centres.extend(boxes[i as usize].center());
            }
            if range.len() == 1 {
                nodes.push(TreeNode::new(whole, Err(order[range.start])));
                continue;
            }
            let axis = centres.largest_axis();
            let half = range.len() / 2;
            let key = |i: &u32| boxes[*i as usize].center_axis(axis);
            order[range.clone()].select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)));
            nodes.push(TreeNode::new(whole, Ok(ranges.len() as u32)));
            let middle = range.start + half;
            ranges.extend([range.start..middle, middle..range.end]);
        }
        Self::counted(nodes)
    }

    fn counted(mut nodes: Vec<TreeNode>) -> Self {
        for i in (0..nodes.len()).rev() {
            if let Ok(first) = nodes[i].content {
                let first = first as usize;
                nodes[i].references =
                    nodes[first].references.saturating_add(nodes[first + 1].references);
            }
        }
        Self { nodes }
    }

    /// Collects the triangles of a subtree, each once, because a split triangle may be there twice.
    /// Both lists are reused, because allocating them takes longer than a leaf.
    fn triangles(&self, root: u32, pending: &mut Vec<u32>, found: &mut Vec<u32>) {
        pending.push(root);
        found.clear();
        while let Some(node) = pending.pop() {
            match self.nodes[node as usize].content {
                Ok(first) => pending.extend([first + 1, first]),
                Err(triangle) if found.contains(&triangle) => {}
                Err(triangle) => found.push(triangle),
            }
        }
    }

    /// Collects up to eight subtrees that make up this one. The child of the greatest area is
    /// opened first; those of at most `lanes` triangles are not.
    fn children(&self, root: u32, lanes: usize, children: &mut Vec<u32>) {
        children.clear();
        children.push(root);
        while children.len() < WIDTH {
            let widest = (0..children.len())
                .filter(|&i| self.nodes[children[i] as usize].references as usize > lanes)
                .max_by(|&i, &j| {
                    let area = |i: usize| self.nodes[children[i] as usize].half_area();
                    area(i).total_cmp(&area(j))
                });
            let Some(widest) = widest else { break };
            let Ok(first) = self.nodes[children[widest] as usize].content else { break };
            children[widest] = first;
            children.push(first + 1);
        }
    }
}

fn collapse(tree: &Tree, facets: &[Facet], pad: f32) -> Hierarchy {
    // Large pages: a million triangles exceed the translation cache by far.
    let mut hierarchy = Hierarchy {
        nodes: holo_cpu::reserved(facets.len() / FACETS_OF_NODE),
        blocks: holo_cpu::reserved(facets.len() / FACETS_OF_BLOCK),
        ..Hierarchy::default()
    };
    collapse_to(&mut hierarchy, tree, LANES, pad, |blocks, triangles| {
        blocks.push(block(triangles, facets));
        (blocks.len() - 1) as u32
    });
    hierarchy
}

/// Fills a hierarchy with the nodes of a tree. `leaf` returns the reference to a leaf of at most
/// `lanes` triangles.
fn collapse_to(
    hierarchy: &mut Hierarchy,
    tree: &Tree,
    lanes: usize,
    pad: f32,
    leaf: impl Fn(&mut Vec<Block>, &[u32]) -> u32,
) {
    hierarchy.nodes.push(Node::EMPTY);
    // Depth first, so that a subtree is contiguous in memory.
    let mut pending = vec![(0_u32, 0_usize, 1_usize)];
    let (mut children, mut boxes) = (Vec::with_capacity(WIDTH), Vec::with_capacity(WIDTH));
    let (mut below, mut triangles) = (Vec::new(), Vec::with_capacity(LANES));
    while let Some((root, index, depth)) = pending.pop() {
        hierarchy.stack_need = hierarchy.stack_need.max(depth * (WIDTH - 1) + WIDTH);
        boxes.clear();
        tree.children(root, lanes, &mut children);
        for (slot, &child) in children.iter().enumerate() {
            let source = &tree.nodes[child as usize];
            let reference = if source.references as usize <= lanes {
                tree.triangles(child, &mut below, &mut triangles);
                LEAF | leaf(&mut hierarchy.blocks, &triangles)
            } else {
                hierarchy.nodes.push(Node::EMPTY);
                let node = hierarchy.nodes.len() - 1;
                pending.push((child, node, depth + 1));
                node as u32
            };
            hierarchy.nodes[index].children[slot] = reference;
            boxes.push(((source.min - pad).to_array(), (source.max + pad).to_array()));
        }
        hierarchy.nodes[index].set_boxes(&boxes);
    }
}

fn block(triangles: &[u32], facets: &[Facet]) -> Block {
    let mut block = Block::EMPTY;
    for (lane, &triangle) in triangles.iter().enumerate() {
        block.set(lane, triangle, facets[triangle as usize].vertices.map(|v| v.to_array()));
    }
    block
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Returns facets whose centres crowd towards one point, which agglomeration makes into a
    /// chain.
    fn chain(count: usize) -> Vec<Facet> {
        let facet = |i: usize| {
            let x = 0.8_f32.powi(i as i32);
            let vertices = [Vec3::new(x, 0.0, 0.0), Vec3::new(x, x, 0.0), Vec3::new(x, 0.0, x)];
            Facet { vertices, normal: Vec3::X, margin: 0.0 }
        };
        (0..count).map(facet).collect()
    }

    fn references(hierarchy: &Hierarchy) -> Vec<u32> {
        let mut ids: Vec<u32> = hierarchy
            .blocks
            .iter()
            .flat_map(|b| (0..LANES).filter_map(|lane| b.used(lane)))
            .collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }

    #[test]
    fn every_triangle_is_in_a_leaf_and_inside_the_boxes_above_it() {
        let facets = chain(300);
        for tree in [Tree::from_obvhs(&binary(&facets)), Tree::balanced(&boxes(&facets))] {
            let h = collapse(&tree, &facets, 1e-6);
            assert_eq!(references(&h), (0..300).collect::<Vec<_>>());
            // Split triangles extend beyond their boxes; these are too small to be split.
            let mut pending = vec![(0_u32, DVec3::NEG_INFINITY, DVec3::INFINITY)];
            while let Some((node, low, high)) = pending.pop() {
                let node = &h.nodes[node as usize];
                for (slot, (min, max)) in
                    (0..WIDTH).filter_map(|slot| Some((slot, node.child_box(slot)?)))
                {
                    // Boxes are rounded outwards to a grid of 255 steps of their parent.
                    let slack = Vec3::from(node.step).as_dvec3();
                    assert!((min + slack).cmpge(low).all() && (max - slack).cmple(high).all());
                    let child = node.children[slot];
                    if child & LEAF == 0 {
                        pending.push((child, min, max));
                        continue;
                    }
                    let block = &h.blocks[(child & !LEAF) as usize];
                    let ids = (0..LANES).filter_map(|lane| block.used(lane));
                    for vertex in
                        ids.flat_map(|i| facets[i as usize].vertices.map(|v| v.as_dvec3()))
                    {
                        assert!(vertex.cmpge(min).all() && vertex.cmple(max).all());
                    }
                }
            }
        }
    }

    #[test]
    fn a_balanced_tree_never_exceeds_the_stack() {
        let facets = chain(3000);
        let h = collapse(&Tree::balanced(&boxes(&facets)), &facets, 1e-6);
        assert_eq!(references(&h).len(), 3000);
        // There are 3000 / 4 leaves, and a node opens at least two levels of a balanced tree.
        assert!(h.stack_need <= (WIDTH - 1) * 12 + 1, "{}", h.stack_need);
        let unbalanced = collapse(&Tree::from_obvhs(&binary(&facets)), &facets, 1e-6);
        let built = hierarchy(&facets, 1.0);
        assert!(
            built.stack_need <= LARGE_STACK
                && built.stack_need <= unbalanced.stack_need.max(h.stack_need)
        );
    }
}
