//! The light tree: its emitters, and the choice of one by a descent.
//!
//! Invariant: a choice leaves a random number uniform, so that it can be used again.

use std::sync::Arc;

use glam::Vec3;
use holo_scene::Luminaire;

use super::build::{self, Emission, Emitter};
use super::node::{Child, LightNode, WIDTH};
use super::point::PreparedPoint;

/// A tree of emitting triangles and points.
#[derive(Debug)]
pub(super) struct LightTree {
    /// The triangles of the first emitters, ascending.
    pub triangles: Vec<u32>,
    /// The other emitters.
    pub points: Vec<PreparedPoint>,
    /// Greatest radius of a point's sphere.
    pub greatest_radius: f32,
    pub nodes: Vec<LightNode>,
    /// The leaf of each emitter.
    pub places: Vec<Child>,
    /// Indexed by emitter.
    pub emissions: Vec<Emission>,
    /// The luminaires of triangles; empty if there are none.
    luminaires: Vec<Option<Arc<Luminaire>>>,
    /// For each node a luminaire that shines as all of its emitters do, if there is one.
    common: Vec<Option<Arc<Luminaire>>>,
}

/// Share of its light that a luminaire keeps in directions into which its middle gives none: its
/// rim may.
const LEAST_OF_LUMINAIRE: f32 = 0.25;

/// Squared ratio of a group's radius to its distance from which its emitters are seen in directions
/// that differ too much for one of them to stand for all.
const WIDE2: f32 = 0.1;

impl LightTree {
    /// Makes a tree of the given triangles (ascending) and points, with one emitter for each.
    pub(super) fn new(
        triangles: Vec<u32>,
        points: Vec<PreparedPoint>,
        emitters: Vec<Emitter>,
    ) -> Self {
        let emissions = emitters.iter().map(Emitter::emission).collect();
        let (nodes, places) = build::tree(emitters);
        let greatest_radius = points.iter().fold(0.0, |most: f32, point| most.max(point.radius));
        let (luminaires, common) = (Vec::new(), Vec::new());
        Self { triangles, points, greatest_radius, nodes, places, emissions, luminaires, common }
    }

    /// Gives its triangles their luminaires.
    pub(super) fn with_luminaires(mut self, of: impl Fn(u32) -> Option<Arc<Luminaire>>) -> Self {
        let luminaires: Vec<_> = self.triangles.iter().map(|&triangle| of(triangle)).collect();
        if luminaires.iter().any(Option::is_some) {
            self.luminaires = luminaires;
            self.common = vec![None; self.nodes.len()];
            // Children come after their node.
            for node in (0..self.nodes.len()).rev() {
                let mut children =
                    (0..self.nodes[node].used()).map(|slot| self.shining(node, slot));
                let first = children.next().flatten();
                let is_alike = |other: Option<&Arc<Luminaire>>| {
                    first.zip(other).is_some_and(|(a, b)| {
                        Arc::ptr_eq(a, b) || (Arc::ptr_eq(&a.web, &b.web) && a.axes == b.axes)
                    })
                };
                self.common[node] = children.all(is_alike).then(|| first.cloned()).flatten();
            }
        }
        self
    }

    /// Returns a luminaire that shines as all emitters of a child do.
    #[inline]
    fn shining(&self, node: usize, slot: usize) -> Option<&Arc<Luminaire>> {
        match self.nodes[node].child(slot) {
            Ok(child) => self.common[child].as_ref(),
            Err(emitter) => self.luminaires.get(emitter)?.as_ref(),
        }
    }

    /// Returns the luminaire that an emitter is a face of.
    #[inline]
    pub(super) fn luminaire(&self, emitter: usize) -> Option<&Luminaire> {
        self.luminaires.get(emitter)?.as_deref()
    }

    /// Returns the light that each child of a node may bring to a point, as
    /// [`LightNode::importances`] does, with the directions into which luminaires shine.
    #[inline]
    pub(super) fn importances(&self, number: usize, p: Vec3, normal: Vec3) -> [f32; WIDTH] {
        let node = &self.nodes[number];
        let mut importances = node.importances(p, normal);
        if !self.luminaires.is_empty() {
            for (slot, importance) in importances.iter_mut().enumerate().take(node.used()) {
                if *importance > 0.0 {
                    *importance *= self.share_of_child(number, slot, p) + LEAST_OF_LUMINAIRE;
                }
            }
        }
        importances
    }

    /// Returns the radiance of a child's luminaires towards a point over that of even lamps; 1 if
    /// its emitters are not alike or are seen in too many directions.
    fn share_of_child(&self, node: usize, slot: usize, p: Vec3) -> f32 {
        let away = p - self.nodes[node].sphere(slot).0;
        let is_wide = self.nodes[node].radius2(slot) > WIDE2 * away.length_squared();
        match self.shining(node, slot) {
            Some(luminaire) if !is_wide => luminaire.share(away.normalize_or_zero()),
            _ => 1.0,
        }
    }

    /// Returns the point that an emitter is; `None` for a triangle.
    #[inline]
    pub(super) fn point(&self, emitter: usize) -> Option<&PreparedPoint> {
        self.points.get(emitter.wrapping_sub(self.triangles.len()))
    }

    /// Chooses an emitter below `from` by importance. Returns it and its probability times
    /// `probability`. `None` if the descent ends at a node that contributes nothing.
    #[inline]
    pub(super) fn descend(
        &self,
        from: Child,
        point: Vec3,
        normal: Vec3,
        mut probability: f32,
        rest: &mut f64,
    ) -> Option<(usize, f32)> {
        let mut place = self.nodes.get(from.node as usize)?.child(from.slot as usize);
        loop {
            match place {
                Err(emitter) => return Some((emitter, probability)),
                Ok(next) => {
                    let node = self.nodes.get(next)?;
                    let importances = self.importances(next, point, normal);
                    let total: f32 = importances.iter().sum();
                    if total <= 0.0 {
                        return None;
                    }
                    let slot = pick(&importances, total, rest);
                    probability *= importances[slot] / total;
                    place = node.child(slot);
                }
            }
        }
    }
}

/// Importances of the root's children, or of a cell's clusters.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Weights {
    rows: [[f32; WIDTH]; 2],
    totals: [f32; 2],
}

impl Weights {
    #[inline]
    pub(super) fn set(&mut self, row: usize, importances: [f32; WIDTH]) {
        self.totals[row] = importances.iter().sum();
        self.rows[row] = importances;
    }

    #[inline]
    pub(super) fn total(&self) -> f32 {
        self.totals[0] + self.totals[1]
    }

    /// Returns the probability of a child; 0 for unused ones, and if all importances are 0.
    #[inline]
    pub(super) fn share(&self, place: usize) -> f32 {
        let total = self.total();
        let importance = self.rows.get(place / WIDTH).map_or(0.0, |row| row[place % WIDTH]);
        if total > 0.0 { importance / total } else { 0.0 }
    }

    /// Picks a child by importance and makes the number uniform again. Some importance must be
    /// positive.
    #[inline]
    pub(super) fn pick(&self, uniform: &mut f64) -> usize {
        if self.totals[1] == 0.0 {
            return pick(&self.rows[0], self.totals[0], uniform);
        }
        let first = f64::from(self.totals[0]) / f64::from(self.total());
        let second = *uniform >= first;
        *uniform = if second { (*uniform - first) / (1.0 - first) } else { *uniform / first };
        *uniform = uniform.clamp(0.0, ONE_BELOW);
        let row = usize::from(second);
        row * WIDTH + pick(&self.rows[row], self.totals[row], uniform)
    }
}

/// Picks a child by importance and makes the number uniform again within the child's interval.
#[inline]
fn pick(importances: &[f32; WIDTH], total: f32, uniform: &mut f64) -> usize {
    let target = *uniform * f64::from(total);
    let (mut sum, mut chosen, mut start) = (0.0, 0, 0.0);
    // Rounding may put the target beyond the last child's end: the last child is taken then.
    for (i, &importance) in importances.iter().enumerate() {
        if importance > 0.0 && sum <= target {
            (chosen, start) = (i, sum);
        }
        sum += f64::from(importance);
    }
    *uniform = ((target - start) / f64::from(importances[chosen])).clamp(0.0, ONE_BELOW);
    chosen
}

/// A number just below 1.
pub(super) const ONE_BELOW: f64 = 1.0 - f64::EPSILON;

/// Returns a number of [0, 1) with fewer bits, below 1 still.
#[inline]
pub(super) fn below_one(x: f64) -> f32 {
    (x as f32).min(1.0 - f32::EPSILON / 2.0)
}
