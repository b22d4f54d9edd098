//! Builds the hierarchy: obvhs makes a binary tree, which is then collapsed to eight children a
//! node.
//!
//! Invariants: every triangle is in a leaf. Every box contains its triangles with a margin of
//! [`PAD`] times the scene's reach. A traversal needs at most [`LARGE_STACK`] stack entries,
//! because a balanced tree replaces a tree that is too deep.

use std::borrow::Cow;
use std::hash::BuildHasher;

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, reinsertion::ReinsertionOptimizer};
use obvhs::ploc::{PlocBuilder, PlocSearchDistance};
use obvhs::splits::split_aabbs_preset;
use obvhs::triangle::Triangle;

use rayon::prelude::*;
use rustc_hash::FxBuildHasher;

use crate::facet::Facet;
use crate::node::{
    Hierarchy, LANES, LARGE_STACK, LEAF, SmallScene, TriangleBlock, WIDTH, WideNode,
};
use crate::tree::BinaryTree;

/// Padding of boxes, as a share of the greatest coordinate.
///
/// The triangle test rounds vertices twice: when the ray's origin is subtracted, and when they are
/// sheared. The error is at most 5 · 2⁻²⁴ of the distance, which is within 3 reaches. Spatial
/// splits end boxes at points that were interpolated in f32. The stretch in the box test covers the
/// first error too; this padding does not rely on it.
pub(crate) const PAD: f32 = 1.0 / (1 << 19) as f32;

/// Least padding. A scene whose vertices are all 0 still needs boxes that are not empty, and the
/// padding must exceed the least step of a [`WideNode`].
pub(crate) const LEAST_PAD: f32 = 1e-25;

/// Number of boxes up to which the preset is followed. Beyond it, pairs are searched for less far,
/// and the share of reinsertions falls as the number grows. Both would delay the opening of a scene
/// for little gain (docs/notes/ray-casting.md).
const LARGE: usize = 200_000;

/// Fewest triangles of a node and of a block on average. Scenes whose triangles were split may have
/// fewer, and their memory grows.
const FACETS_OF_NODE: usize = 8;
const FACETS_OF_BLOCK: usize = 3;

/// Most equal boxes that obvhs joins. It joins one pair of them at a time, and looks at all others
/// for each: 8192 equal triangles took 3 s.
const MANY_EQUAL: usize = 64;

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
    let hierarchy = collapse(&tree_of(facets), facets, pad);
    match hierarchy.stack_need > LARGE_STACK {
        true => collapse(&BinaryTree::balanced(&boxes(facets)), facets, pad),
        false => hierarchy,
    }
}

/// Builds a hierarchy over boxes, at least one. Leaves are references to single boxes: [`LEAF`] and
/// the index.
pub(crate) fn over_boxes(boxes: &[Aabb], pad: f32) -> Hierarchy {
    let collapse = |tree: &BinaryTree| {
        let mut nodes = Vec::new();
        let stack_need = collapse_to(&mut nodes, tree, 1, pad, |index| index[0]);
        Hierarchy { nodes: nodes.into(), stack_need, ..Hierarchy::default() }
    };
    let hierarchy = collapse(&joined(boxes, |chosen| {
        let boxes = of(boxes, chosen);
        agglomerated(&boxes, (0..boxes.len() as u32).collect())
    }));
    match hierarchy.stack_need > LARGE_STACK {
        true => collapse(&BinaryTree::balanced(boxes)),
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

/// Builds a binary tree over facets.
fn tree_of(facets: &[Facet]) -> BinaryTree {
    joined(&boxes(facets), |chosen| binary(&of(facets, chosen)))
}

/// Returns the items of these numbers; all without numbers.
fn of<'a, T: Copy>(items: &'a [T], numbers: Option<&[u32]>) -> Cow<'a, [T]> {
    match numbers {
        None => Cow::Borrowed(items),
        Some(numbers) => numbers.iter().map(|&i| items[i as usize]).collect(),
    }
}

/// Builds a binary tree over boxes. `build` joins the boxes of these numbers, or all. It refers to
/// them by their positions in the list. Of many equal boxes it gets one.
fn joined(boxes: &[Aabb], build: impl FnOnce(Option<&[u32]>) -> Bvh2) -> BinaryTree {
    let groups = equal_boxes(boxes);
    if groups.is_empty() {
        return BinaryTree::from_obvhs(&build(None));
    }
    let mut is_chosen = vec![true; boxes.len()];
    groups.iter().flat_map(|group| &group[1..]).for_each(|&i| is_chosen[i as usize] = false);
    let chosen: Vec<u32> = (0..boxes.len() as u32).filter(|&i| is_chosen[i as usize]).collect();
    let mut bvh = build(Some(&chosen));
    bvh.primitive_indices.iter_mut().for_each(|i| *i = chosen[*i as usize]);
    let mut tree = BinaryTree::from_obvhs(&bvh);
    tree.add_equal(&groups);
    tree
}

/// Returns all groups of more than [`MANY_EQUAL`] equal boxes.
fn equal_boxes(boxes: &[Aabb]) -> Vec<Vec<u32>> {
    let bits = |i: u32| {
        let Aabb { min, max } = boxes[i as usize];
        [min, max].map(|corner| corner.to_array().map(f32::to_bits))
    };
    let key = |i: u32| u64::from(FxBuildHasher.hash_one(bits(i)) as u32) << 32 | u64::from(i);
    let mut keys: Vec<u64> = (0..boxes.len() as u32).into_par_iter().map(key).collect();
    keys.par_sort_unstable();
    let mut groups = Vec::new();
    for run in keys.chunk_by(|a, b| a >> 32 == b >> 32).filter(|run| run.len() > MANY_EQUAL) {
        // Boxes of equal hashes may differ. Then they are joined as all others.
        let group: Vec<u32> = run.iter().map(|&key| key as u32).collect();
        if group.iter().all(|&i| bits(i) == bits(group[0])) {
            groups.push(group);
        }
    }
    groups
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

fn collapse(tree: &BinaryTree, facets: &[Facet], pad: f32) -> Hierarchy {
    // Large pages: a million triangles exceed the translation cache by far.
    let mut nodes = holo_cpu::reserved(facets.len() / FACETS_OF_NODE);
    let mut blocks = holo_cpu::reserved(facets.len() / FACETS_OF_BLOCK);
    let stack_need = collapse_to(&mut nodes, tree, LANES, pad, |triangles| {
        blocks.push(block(triangles, facets));
        (blocks.len() - 1) as u32
    });
    Hierarchy { nodes: nodes.into(), blocks: blocks.into(), few: None, stack_need }
}

/// Makes the nodes of a tree. `leaf` returns the reference to a leaf of at most `lanes` triangles.
/// Returns the most entries that a traversal puts on its stack.
fn collapse_to(
    nodes: &mut Vec<WideNode>,
    tree: &BinaryTree,
    lanes: usize,
    pad: f32,
    mut leaf: impl FnMut(&[u32]) -> u32,
) -> usize {
    let mut stack_need = 0;
    nodes.push(WideNode::EMPTY);
    // Depth first, so that a subtree is contiguous in memory.
    let mut pending = vec![(0_u32, 0_usize, 1_usize)];
    let (mut children, mut boxes) = (Vec::with_capacity(WIDTH), Vec::with_capacity(WIDTH));
    let (mut below, mut triangles) = (Vec::new(), Vec::with_capacity(LANES));
    while let Some((root, index, depth)) = pending.pop() {
        stack_need = stack_need.max(depth * (WIDTH - 1) + WIDTH);
        boxes.clear();
        tree.children(root, lanes, &mut children);
        for (slot, &child) in children.iter().enumerate() {
            let source = &tree.nodes[child as usize];
            let reference = if source.references as usize <= lanes {
                tree.triangles(child, &mut below, &mut triangles);
                LEAF | leaf(&triangles)
            } else {
                nodes.push(WideNode::EMPTY);
                let node = nodes.len() - 1;
                pending.push((child, node, depth + 1));
                node as u32
            };
            nodes[index].children[slot] = reference;
            boxes.push(((source.min - pad).to_array(), (source.max + pad).to_array()));
        }
        nodes[index].set_boxes(&boxes);
    }
    stack_need
}

fn block(triangles: &[u32], facets: &[Facet]) -> TriangleBlock {
    let mut block = TriangleBlock::EMPTY;
    for (lane, &triangle) in triangles.iter().enumerate() {
        block.set(lane, triangle, facets[triangle as usize].vertices.map(|v| v.to_array()));
    }
    block
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};

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
        for tree in [tree_of(&facets), BinaryTree::balanced(&boxes(&facets))] {
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

    /// obvhs alone takes minutes for them.
    #[test]
    fn many_equal_triangles_are_joined_soon_and_all_are_there() {
        let facets: Vec<Facet> = chain(200).iter().cycle().take(40_000).copied().collect();
        assert_eq!(equal_boxes(&boxes(&facets)).len(), 200);
        let equal = [&facets[..1].repeat(60_000), &chain(300)[..]].concat();
        for facets in [facets, equal] {
            let h = hierarchy(&facets, 1.0);
            assert_eq!(references(&h), (0..facets.len() as u32).collect::<Vec<_>>());
            assert!(h.stack_need <= LARGE_STACK);
        }
        let boxes: Vec<Aabb> = [boxes(&chain(1)).repeat(60_000), boxes(&chain(300))].concat();
        let h = over_boxes(&boxes, 1e-6);
        let children = h.nodes.iter().flat_map(|node| node.children);
        let mut found: Vec<u32> = children.filter(|c| c & LEAF != 0).map(|c| c & !LEAF).collect();
        found.sort_unstable();
        found.dedup();
        assert!((0..60_300).all(|i| found.binary_search(&i).is_ok()));
    }

    #[test]
    fn a_balanced_tree_never_exceeds_the_stack() {
        let facets = chain(3000);
        let h = collapse(&BinaryTree::balanced(&boxes(&facets)), &facets, 1e-6);
        assert_eq!(references(&h).len(), 3000);
        // There are 3000 / 4 leaves, and a node opens at least two levels of a balanced tree.
        assert!(h.stack_need <= (WIDTH - 1) * 12 + 1, "{}", h.stack_need);
        let unbalanced = collapse(&tree_of(&facets), &facets, 1e-6);
        let built = hierarchy(&facets, 1.0);
        assert!(
            built.stack_need <= LARGE_STACK
                && built.stack_need <= unbalanced.stack_need.max(h.stack_need)
        );
    }
}
