//! Subtrees of the light tree, for callers that take many samples from one point and know which
//! subtrees matter.

use glam::Vec3;

use super::Lights;
use super::node::{Child, Node};
use super::tree::below_one;

/// A subtree is divided while its radius exceeds this share of its distance.
const OPEN: f32 = 0.2;
/// Most subtrees waiting to be divided; beyond that they stay whole.
const WAITING: usize = 256;

/// A subtree as seen from a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Subtree {
    child: Child,
    /// Centre of a sphere around the subtree.
    pub center: Vec3,
    /// Approximate irradiance that it may bring, in the unit of the tree's powers.
    pub importance: f32,
}

impl Lights {
    /// Returns the subtrees that `point`, lit on the side of `normal`, may receive light from.
    /// Leaves out subtrees whose bounding sphere `visible` rejects.
    pub(crate) fn subtrees(
        &self,
        point: Vec3,
        normal: Vec3,
        visible: impl Fn(Vec3, f32) -> bool,
    ) -> Vec<Subtree> {
        let mut subtrees = Vec::new();
        let is_empty = self.tree.triangles.is_empty();
        let mut waiting: Vec<usize> = if is_empty { Vec::new() } else { vec![0] };
        while let Some(at) = waiting.pop() {
            let node: &Node = &self.tree.nodes[at];
            let importances = node.importances(point, normal);
            for (slot, &importance) in importances.iter().enumerate().take(node.used()) {
                let (center, radius) = node.sphere(slot);
                if importance <= 0.0 || !visible(center, radius) {
                    continue;
                }
                match node.child(slot) {
                    Ok(next)
                        if radius > OPEN * center.distance(point) && waiting.len() < WAITING =>
                    {
                        waiting.push(next)
                    }
                    _ => subtrees.push(Subtree {
                        child: Child { node: at as u32, slot: slot as u32 },
                        center,
                        importance,
                    }),
                }
            }
        }
        subtrees
    }

    /// Chooses a triangle of a subtree by a uniform number in [0, 1). Returns it, its probability
    /// and what remains of the number. `None` if the descent ends at a point, or at a node that
    /// contributes nothing.
    pub(crate) fn choose_in(
        &self,
        subtree: &Subtree,
        point: Vec3,
        normal: Vec3,
        uniform: f64,
    ) -> Option<(u32, f32, f32)> {
        let mut rest = uniform;
        let (emitter, probability) =
            self.tree.descend(subtree.child, point, normal, 1.0, &mut rest)?;
        Some((*self.tree.triangles.get(emitter)?, probability, below_one(rest)))
    }

    /// Returns which of the subtrees contains a triangle, and the probability with which
    /// [`choose_in`](Self::choose_in) gives the triangle there.
    pub(crate) fn find_in(
        &self,
        subtrees: &[Subtree],
        point: Vec3,
        normal: Vec3,
        triangle: u32,
    ) -> Option<(usize, f32)> {
        let emitter = self.tree.triangles.binary_search(&triangle).ok()?;
        let mut probability = 1.0;
        let mut place = self.tree.places[emitter];
        loop {
            if let Some(subtree) = subtrees.iter().position(|subtree| subtree.child == place) {
                return Some((subtree, probability));
            }
            if place.node == 0 {
                return None;
            }
            let node = &self.tree.nodes[place.node as usize];
            let importances = node.importances(point, normal);
            let total: f32 = importances.iter().sum();
            if total <= 0.0 {
                return None;
            }
            probability *= importances[place.slot as usize] / total;
            place = node.parent;
        }
    }
}
