//! Where children are: levels follow each other, and siblings stand together in the order of their
//! parents. So the number of a node's first child is 1 plus the children of all nodes before it.
//! The file has that sum for each chunk, and no pointers.

use crate::{PackedNode, format::CHUNK_NODES};

/// Nodes for each stored sum.
const STEP: usize = 64;

/// Sums of the children of a chunk's nodes.
pub(crate) struct ChildSums {
    /// Children of all nodes of the chunk before each group of [`STEP`] nodes.
    sums: [u16; CHUNK_NODES / STEP],
}

// A chunk's nodes have at most 4 children each.
const _: () = assert!(CHUNK_NODES * 4 <= u16::MAX as usize);

impl ChildSums {
    /// Adds up the children of a chunk's nodes.
    pub fn new(nodes: &[PackedNode]) -> ChildSums {
        let mut sums = [0; CHUNK_NODES / STEP];
        let mut sum = 0;
        for (group, place) in nodes.chunks(STEP).zip(&mut sums) {
            *place = sum;
            sum += count(group);
        }
        ChildSums { sums }
    }

    /// Returns the number of children of the chunk's nodes before the node at `place`.
    pub fn before(&self, nodes: &[PackedNode], place: usize) -> u64 {
        let group = place / STEP;
        u64::from(self.sums[group]) + u64::from(count(&nodes[group * STEP..place]))
    }
}

/// Returns the number of children of these nodes.
pub(crate) fn count(nodes: &[PackedNode]) -> u16 {
    nodes.iter().map(|node| node.children() as u16).sum()
}
