//! Parts of the tree for one who takes many samples of it from one place, and knows which parts are worth any.

use glam::Vec3;

use super::{Child, Lights, Node, below_one, descend};

/// A part is divided while its radius is more than this share of its distance.
const OPEN: f32 = 0.2;
/// Subtrees waiting to be divided, at most: with more, they stay whole.
const WAITING: usize = 256;

/// A subtree as seen from a place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    child: Child,
    /// Of the sphere around it.
    pub center: Vec3,
    /// What it may bring, about as irradiance, in the unit of the tree's powers.
    pub importance: f32,
}

impl Lights {
    /// Subtrees that `point`, lit on the side of `normal`, may get light from, as far as `shown` says of the spheres around them.
    pub(crate) fn parts(
        &self,
        point: Vec3,
        normal: Vec3,
        shown: impl Fn(Vec3, f32) -> bool,
    ) -> Vec<Part> {
        let mut parts = Vec::new();
        let mut waiting: Vec<usize> = if self.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(at) = waiting.pop() {
            let node: &Node = &self.nodes[at];
            let importances = node.importances(point, normal);
            for (slot, &importance) in importances.iter().enumerate().take(node.used()) {
                let (center, radius) = node.sphere(slot);
                if importance <= 0.0 || !shown(center, radius) {
                    continue;
                }
                match node.child(slot) {
                    Ok(next)
                        if radius > OPEN * center.distance(point) && waiting.len() < WAITING =>
                    {
                        waiting.push(next)
                    }
                    _ => parts.push(Part {
                        child: Child { node: at as u32, slot: slot as u32 },
                        center,
                        importance,
                    }),
                }
            }
        }
        parts
    }

    /// A triangle of a part by a uniform number in [0, 1), its probability, and what is left of the number. `None` if the descent
    /// ends where nothing can arrive from.
    pub(crate) fn choose_in(
        &self,
        part: &Part,
        point: Vec3,
        normal: Vec3,
        uniform: f64,
    ) -> Option<(u32, f32, f32)> {
        let mut rest = uniform;
        let (emitter, probability) =
            descend(&self.nodes, part.child, point, normal, 1.0, &mut rest)?;
        Some((self.triangles[emitter], probability, below_one(rest)))
    }

    /// Which of the parts holds a triangle, and with what probability [`choose_in`](Self::choose_in) gives it there.
    pub(crate) fn find_in(
        &self,
        parts: &[Part],
        point: Vec3,
        normal: Vec3,
        triangle: u32,
    ) -> Option<(usize, f32)> {
        let emitter = self.triangles.binary_search(&triangle).ok()?;
        let mut probability = 1.0;
        let mut place = self.places[emitter];
        loop {
            if let Some(part) = parts.iter().position(|part| part.child == place) {
                return Some((part, probability));
            }
            if place.node == 0 {
                return None;
            }
            let node = &self.nodes[place.node as usize];
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
