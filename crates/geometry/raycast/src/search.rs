//! Searches hierarchies for leaves in given boxes.

use glam::DVec3;

use crate::node::{Hierarchy, LANES, LEAF, WIDTH};

/// Returns whether `met` is true for a leaf in boxes for which `enters` is true.
pub(crate) fn find(
    hierarchy: &Hierarchy,
    enters: impl Fn(DVec3, DVec3) -> bool,
    met: impl Fn(u32) -> bool,
) -> bool {
    // The root is node 0.
    let mut stack: Vec<u32> = (0..hierarchy.nodes.len().min(1) as u32).collect();
    while let Some(child) = stack.pop() {
        if child & LEAF == 0 {
            let entered = children(hierarchy, child).filter(|(low, high, _)| enters(*low, *high));
            stack.extend(entered.map(|(.., child)| child));
        } else if met(child & !LEAF) {
            return true;
        }
    }
    false
}

/// Returns the boxes of a node's children, and references to their contents.
fn children(hierarchy: &Hierarchy, node: u32) -> impl Iterator<Item = (DVec3, DVec3, u32)> {
    let node = &hierarchy.nodes[node as usize];
    (0..WIDTH)
        .filter_map(|slot| node.child_box(slot).map(|(low, high)| (low, high, node.children[slot])))
}

/// Returns the triangles of a leaf.
pub(crate) fn triangles(hierarchy: &Hierarchy, leaf: u32) -> impl Iterator<Item = u32> {
    let block = &hierarchy.blocks[leaf as usize];
    (0..LANES).filter_map(|lane| block.used(lane))
}
