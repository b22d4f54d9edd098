//! A binary tree over boxes, from which the hierarchy is collapsed.

use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};
use rustc_hash::FxHashMap;

use crate::node::WIDTH;

/// A binary tree. Children come after their parents.
pub(crate) struct BinaryTree {
    pub nodes: Vec<TreeNode>,
}

#[derive(Clone, Copy)]
pub(crate) struct TreeNode {
    pub min: Vec3,
    pub max: Vec3,
    /// `Ok`: the first of two adjacent children. `Err`: a triangle.
    pub content: Result<u32, u32>,
    /// Number of triangle references in the subtree.
    pub references: u32,
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

impl BinaryTree {
    pub fn from_obvhs(bvh: &Bvh2) -> Self {
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
    pub fn balanced(boxes: &[Aabb]) -> Self {
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

    /// Adds groups of equal boxes, of each of which the first is in the tree.
    pub fn add_equal(&mut self, groups: &[Vec<u32>]) {
        let groups: FxHashMap<u32, &[u32]> =
            groups.iter().map(|group| (group[0], &group[..])).collect();
        for leaf in 0..self.nodes.len() {
            let Err(triangle) = self.nodes[leaf].content else { continue };
            let Some(&group) = groups.get(&triangle) else { continue };
            // A balanced tree: nodes whose part of the group is not divided yet.
            let mut pending = vec![(leaf, group)];
            while let Some((node, part)) = pending.pop() {
                let TreeNode { min, max, .. } = self.nodes[node];
                let content = match part {
                    [only] => Err(*only),
                    _ => Ok(self.nodes.len() as u32),
                };
                self.nodes[node] = TreeNode { min, max, content, references: 1 };
                if let Ok(first) = content {
                    self.nodes.extend([self.nodes[node]; 2]);
                    let (left, right) = part.split_at(part.len() / 2);
                    pending.extend([(first as usize, left), (first as usize + 1, right)]);
                }
            }
        }
        self.count();
    }

    fn counted(nodes: Vec<TreeNode>) -> Self {
        let mut tree = Self { nodes };
        tree.count();
        tree
    }

    /// Counts the triangle references of all subtrees. Leaves have one each.
    fn count(&mut self) {
        let nodes = &mut self.nodes;
        for i in (0..nodes.len()).rev() {
            if let Ok(first) = nodes[i].content {
                let first = first as usize;
                nodes[i].references =
                    nodes[first].references.saturating_add(nodes[first + 1].references);
            }
        }
    }

    /// Collects the triangles of a subtree, each once, because a split triangle may be there twice.
    /// Both lists are reused, because allocating them takes longer than a leaf.
    pub fn triangles(&self, root: u32, pending: &mut Vec<u32>, found: &mut Vec<u32>) {
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
    pub fn children(&self, root: u32, lanes: usize, children: &mut Vec<u32>) {
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
