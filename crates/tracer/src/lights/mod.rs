//! Choosing points on lights, and the density with which a direction would have been chosen.
//!
//! Emitting triangles are the leaves of a tree (Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with
//! Adaptive Tree Splitting"; Pharr et al. 2023, §12.6) that is descended by what each branch may bring to the vertex that
//! is lit. The constant sky is one more light beside the tree.
//!
//! Always true: a light that could bring anything to the vertex has a probability, but for rounding at its horizon; one
//! that cannot has none. Choosing and [`Lights::probability`] agree to within the rounding of f32, which is enough since
//! what is computed in it is a ratio that both use alike. Cost grows with the logarithm of the number of lights.

mod build;
mod cone;
mod node;
mod triangle;

use std::f32::consts::PI;

use glam::Vec3;
use holo_scene::Scene;

use build::Emitter;
use node::{Child, Node, WIDTH};
pub(crate) use triangle::Aim;

/// Share of the sky and of the emitters, at least, where there are both: which of them a vertex sees is unknown.
const LEAST_SHARE: f32 = 0.1;

/// Radiance-weighted luminance as in Radiance's photopic weights.
pub(crate) fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.265 * r + 0.670 * g + 0.065 * b
}

/// What to sample: a tree over emitting triangles, and the sky.
#[derive(Debug)]
pub(crate) struct Lights {
    /// Ascending.
    triangles: Vec<u32>,
    nodes: Vec<Node>,
    /// Where each of `triangles` is.
    places: Vec<Child>,
    /// Irradiance of a surface that sees all of the sky, as luminance, in the unit of the tree's powers.
    sky: f32,
}

/// The lights as seen from one vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    pub point: Vec3,
    /// Normal of a surface that is lit from this side only; 0 if it is lit from everywhere.
    normal: Vec3,
    /// Probability of choosing the sky.
    pub sky: f32,
    root: [f32; WIDTH],
    total: f32,
}

/// A light that was chosen, and what is left of the random number: uniform in [0, 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Chosen {
    Sky { rest: f32 },
    Triangle { triangle: u32, probability: f32, rest: f32 },
}

impl Lights {
    pub(crate) fn new(scene: &Scene) -> Self {
        let strength: Vec<f32> = scene.materials.iter().map(|m| luminance(m.emission)).collect();
        let material = |t: u32| scene.material_ids[t as usize] as usize;
        let triangles: Vec<u32> = scene.emitters().filter(|&t| strength[material(t)] > 0.0).collect();
        let power = |t: u32| f64::from(strength[material(t)]) * scene.area(t);
        // As shares of the greatest, far from the ends of f32's range.
        let unit = triangles.iter().map(|&t| power(t)).fold(0.0, f64::max);
        let emitters = triangles
            .iter()
            .map(|&t| {
                let power = power(t) / unit;
                Emitter::new(scene.corners(t), scene.normal(t), power, scene.materials[material(t)].two_sided_emission)
            })
            .collect();
        let (nodes, places) = build::tree(emitters);
        Self {
            triangles,
            nodes,
            places,
            sky: (f64::from(PI * luminance(scene.sky)) / if unit > 0.0 { unit } else { 1.0 }) as f32,
        }
    }

    /// Whether there is anything to sample.
    pub(crate) fn any(&self) -> bool {
        self.sky > 0.0 || !self.nodes.is_empty()
    }

    /// The lights as seen from `point`, by a surface that light reaches only on the side of `normal`, or from everywhere if
    /// that is 0.
    #[inline]
    pub(crate) fn seen(&self, point: Vec3, normal: Vec3) -> Seen {
        let Some(root) = self.nodes.first() else {
            return Seen { point, normal, sky: if self.sky > 0.0 { 1.0 } else { 0.0 }, root: [0.0; WIDTH], total: 0.0 };
        };
        let root = root.importances(point, normal);
        let total = root.iter().sum::<f32>();
        let sky = if self.sky == 0.0 {
            0.0
        } else if total == 0.0 {
            1.0
        } else {
            (self.sky / (self.sky + total)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE)
        };
        Seen { point, normal, sky, root, total }
    }

    /// A light by a uniform number in [0, 1). `None` if the descent ends where nothing can arrive from.
    #[inline]
    pub(crate) fn choose(&self, seen: &Seen, uniform: f64) -> Option<Chosen> {
        let sky = f64::from(seen.sky);
        if uniform < sky {
            return Some(Chosen::Sky { rest: below_one(uniform / sky) });
        }
        let mut rest = (uniform - sky) / (1.0 - sky);
        let mut probability = 1.0 - seen.sky;
        let (mut importances, mut total) = (seen.root, seen.total);
        let mut node = self.nodes.first()?;
        loop {
            if total <= 0.0 {
                return None;
            }
            let i = pick(&importances, total, &mut rest);
            probability *= importances[i] / total;
            match node.child(i) {
                Ok(next) => {
                    node = self.nodes.get(next)?;
                    importances = node.importances(seen.point, seen.normal);
                    total = importances.iter().sum();
                }
                Err(emitter) => {
                    let triangle = self.triangles[emitter];
                    return Some(Chosen::Triangle { triangle, probability, rest: below_one(rest) });
                }
            }
        }
    }

    /// Probability with which [`choose`](Self::choose) gives a triangle.
    #[inline]
    pub(crate) fn probability(&self, seen: &Seen, triangle: u32) -> f32 {
        let Ok(emitter) = self.triangles.binary_search(&triangle) else { return 0.0 };
        let mut place = self.places[emitter];
        let mut probability = 1.0 - seen.sky;
        while place.node != 0 {
            let node = &self.nodes[place.node as usize];
            let importances = node.importances(seen.point, seen.normal);
            let total: f32 = importances.iter().sum();
            if total <= 0.0 {
                return 0.0;
            }
            probability *= importances[place.slot as usize] / total;
            place = node.parent;
        }
        if seen.total > 0.0 { probability * (seen.root[place.slot as usize] / seen.total) } else { 0.0 }
    }
}

/// A child by importance; the number becomes uniform again in the child's interval.
#[inline]
fn pick(importances: &[f32; WIDTH], total: f32, uniform: &mut f64) -> usize {
    let target = *uniform * f64::from(total);
    let (mut sum, mut chosen, mut start) = (0.0, 0, 0.0);
    // Rounding may leave the target beyond the last child's end: that child then.
    for (i, &importance) in importances.iter().enumerate() {
        if importance > 0.0 && sum <= target {
            (chosen, start) = (i, sum);
        }
        sum += f64::from(importance);
    }
    *uniform = ((target - start) / f64::from(importances[chosen])).clamp(0.0, ONE_BELOW);
    chosen
}

const ONE_BELOW: f64 = 1.0 - f64::EPSILON;

fn below_one(x: f64) -> f32 {
    (x as f32).min(1.0 - f32::EPSILON / 2.0)
}

#[cfg(test)]
mod tests;
