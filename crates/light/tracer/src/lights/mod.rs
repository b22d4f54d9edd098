//! Light sampling: choosing points on lights, and the density with which a direction would have
//! been chosen.
//!
//! Emitting triangles and punctual lights are the leaves of a tree (Pharr et al. 2023, §12.6; Conty
//! Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting").
//! Sampling descends it by the light that each branch may bring to the vertex. The sky is one more
//! light beside the tree.
//!
//! Invariant: a light that could bring anything to the vertex has a positive probability, except
//! by rounding at its horizon. A light that cannot has probability 0, unless it is the only one.
//! Choosing and [`Lights::probability`] agree within f32 rounding. The cost grows with the
//! logarithm of the number of lights.

mod build;
mod cells;
mod cone;
mod node;
mod point;
mod spheres;
mod tree;
mod triangle;

use std::collections::{HashMap, HashSet};
use std::f32::consts::PI;
use std::sync::Arc;

use glam::Vec3;
use holo_raycast::Raycaster;
use holo_scene::{Luminaire, Scene};

pub(crate) use build::Emitter;
use cells::{LightCell, LightGrid};
use node::Child;
pub(crate) use point::PreparedPoint;
use tree::{LightTree, Weights, below_one};
pub(crate) use triangle::Aim;

use crate::luminance::luminance;
use crate::panes::Panes;
use crate::sky::PreparedSky;

/// Least share of samples for the sky and for the emitters, if a scene has both: which of them a
/// vertex sees is unknown.
const LEAST_SHARE: f32 = 0.1;

/// Least share of samples for the sky in a cell, which knows more.
const LEAST_SKY_OF_CELL: f32 = 0.02;

/// Approximate number of cells in the grids of a scene's lights: for surfaces that eyes see
/// directly, and for all others. Paths come to many cells beyond the surfaces that eyes see. With a
/// fine grid there, estimating cells took most of the first second in a new place. Measurements:
/// docs/notes/path-tracing.md.
pub(crate) const GRIDS: [f32; 2] = [8192.0, 1024.0];

/// Number of scatterings of a vertex that an eye does not see directly.
pub(crate) const LATER: u32 = 2;

/// The lights of a scene: a tree of emitting triangles and points, and the sky.
#[derive(Debug)]
pub(crate) struct Lights {
    tree: LightTree,
    /// Grids of cells, the finest first.
    cells: Vec<LightGrid>,
    /// Luminance of the irradiance of a surface that sees all of the sky, in the unit of the tree's
    /// powers.
    sky: f32,
    prepared_sky: Arc<PreparedSky>,
    /// Set if all light comes from one triangle or flat quad: the share of its first triangle. Both
    /// halves look alike from nearly everywhere, so power alone decides between them.
    quad: Option<f32>,
}

/// The lights as one vertex sees them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VertexLights {
    pub point: Vec3,
    /// Normal of a surface that is lit from this side only; 0 if it is lit from everywhere.
    normal: Vec3,
    /// Probability of choosing the sky.
    pub sky: f32,
    first: Weights,
    /// Grid and number of the cell that decides instead of the root; `None` outside of the cells.
    cell: Option<(u8, u32)>,
}

/// A light that was chosen. `rest` is what remains of the random number, uniform in [0, 1).
#[derive(Clone, Copy, Debug)]
pub(crate) enum ChosenLight {
    Sky { rest: f32 },
    Triangle { triangle: u32, probability: f32, rest: f32 },
    Point { point: PreparedPoint, probability: f32 },
}

/// Least cosine between the normals of the halves of a flat quad.
const FLAT: f32 = 0.999_999;

/// Removes the emitters that a triangle of lower index with the same corners hides. Rays meet the
/// lower index, and a lamp that no ray can meet must not emit.
fn visible(scene: &Scene, mut emitters: Vec<u32>) -> Vec<u32> {
    let between = |triangle: u32| {
        // Adding 0 turns -0 into 0.
        let mut corners =
            scene.corners(triangle).map(|c| (c + Vec3::ZERO).to_array().map(f32::to_bits));
        corners.sort_unstable();
        corners
    };
    let first_emitters: HashMap<_, u32> = emitters.iter().rev().map(|&t| (between(t), t)).collect();
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for corner in emitters.iter().flat_map(|&t| scene.corners(t)) {
        (low, high) = (low.min(corner), high.max(corner));
    }
    let last = emitters.last().copied().unwrap_or(0);
    let hidden: HashSet<_> = (0..last)
        // Only triangles within the bounds of the lamps need a look-up.
        .filter(|&t| scene.corners(t).iter().all(|c| c.cmpge(low).all() && c.cmple(high).all()))
        .map(|t| (between(t), t))
        .filter(|(corners, t)| first_emitters.get(corners).is_some_and(|first| t < first))
        .map(|(corners, _)| corners)
        .collect();
    emitters.retain(|&t| {
        let corners = between(t);
        first_emitters.get(&corners) == Some(&t) && !hidden.contains(&corners)
    });
    emitters
}

/// Returns the mean luminance of a lamp's texture over its triangle, relative to that of white; 1
/// without a texture. It is never 0, so that no part of a lamp is left to chance.
fn mean_of_texture(scene: &Scene, triangle: u32) -> f64 {
    const STEPS: u32 = 4;
    const LEAST: f64 = 1e-3;
    // Middles of the 4 × 4 triangles of a subdivision; their widths overlap.
    let width = (scene.area(triangle).sqrt() / f64::from(STEPS)) as f32;
    let (mut sum, mut count) = (0.0, 0);
    for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS - i).map(move |j| (i, j))) {
        for third in [1.0 / 3.0, 2.0 / 3.0] {
            let [u, v] = [i, j].map(|k| (k as f32 + third) / STEPS as f32);
            if u + v < 1.0 {
                let Some(texture) = scene.emission_texture(triangle, u, v, width) else {
                    return 1.0;
                };
                sum += f64::from(luminance(texture));
                count += 1;
            }
        }
    }
    let white = f64::from(luminance([1.0; 3]));
    (sum / f64::from(count) / white).max(LEAST)
}

/// Returns the first triangle's share of the area, if the triangles are one, or the halves of a
/// flat quad of one material.
fn first_of_quad(scene: &Scene, triangles: &[u32]) -> Option<f32> {
    match *triangles {
        [_] => Some(1.0),
        [a, b] => {
            let corners = scene.corners(b);
            let common = scene.corners(a).iter().filter(|c| corners.contains(c)).count();
            let is_flat = scene.normal(a).dot(scene.normal(b)) > FLAT;
            let is_even = scene.material_id(a) == scene.material_id(b)
                && [a, b].iter().all(|&t| mean_of_texture(scene, t) == 1.0);
            let (first, second) = (scene.area(a), scene.area(b));
            let share = (first / (first + second)) as f32;
            (common == 2 && is_flat && is_even && share > 0.0 && share < 1.0).then_some(share)
        }
        _ => None,
    }
}

impl Lights {
    pub(crate) fn new(scene: &Scene, prepared_sky: &Arc<PreparedSky>) -> Self {
        let strength: Vec<f32> = scene.materials.iter().map(|m| luminance(m.emission)).collect();
        let material = |t: u32| scene.material_id(t) as usize;
        let triangles =
            visible(scene, scene.emitters().filter(|&t| strength[material(t)] > 0.0).collect());
        let power =
            |t: u32| f64::from(strength[material(t)]) * scene.area(t) * mean_of_texture(scene, t);
        // Relative to the greatest, far from the limits of f32.
        let points = scene.punctual_lights.iter().map(PreparedPoint::new);
        let points: Vec<PreparedPoint> = points.filter(|point| point.strength() > 0.0).collect();
        let of_points = points.iter().map(|point| f64::from(point.strength()));
        let unit = triangles.iter().map(|&t| power(t)).chain(of_points).fold(0.0, f64::max);
        let of_triangles = triangles.iter().map(|&t| {
            let power = power(t) / unit;
            Emitter::new(
                scene.corners(t),
                scene.normal(t),
                power,
                scene.materials[material(t)].two_sided_emission,
            )
        });
        let of_points = points.iter().map(|point| point.emitter(unit));
        let emitters = of_triangles.chain(of_points).collect();
        let sky =
            (f64::from(PI * prepared_sky.mean()) / if unit > 0.0 { unit } else { 1.0 }) as f32;
        let is_alone = sky == 0.0 && points.is_empty();
        let quad = is_alone.then(|| first_of_quad(scene, &triangles)).flatten();
        let luminaires: Vec<Option<Arc<Luminaire>>> = (0..scene.materials.len() as u32)
            .map(|id| scene.luminaire_of(id).cloned().map(Arc::new))
            .collect();
        let tree = LightTree::new(triangles, points, emitters)
            .with_luminaires(|t| luminaires[material(t)].clone());
        Self { tree, cells: Vec::new(), sky, prepared_sky: Arc::clone(prepared_sky), quad }
    }

    /// Makes a tree of the given triangles (ascending), with one emitter for each.
    pub(crate) fn over(triangles: Vec<u32>, emitters: Vec<Emitter>) -> Self {
        let tree = LightTree::new(triangles, Vec::new(), emitters);
        let prepared_sky = Arc::new(PreparedSky::Even(Vec3::ZERO));
        Self { tree, cells: Vec::new(), sky: 0.0, prepared_sky, quad: None }
    }

    /// Adds cells: where there are many lights, choices follow what each part of the scene receives
    /// through these panes. Each grid has about so many cells. The first one is for surfaces that
    /// eyes see directly, mirrored or through glass; the last one is for all others.
    pub(crate) fn with_cells(
        mut self,
        grids: &[f32],
        raycaster: &Arc<Raycaster>,
        panes: &Arc<Panes>,
    ) -> Self {
        let grid = |most: &f32| {
            let sky = (self.sky, Arc::clone(&self.prepared_sky));
            LightGrid::new(*most, &self.tree, sky, raycaster, panes)
        };
        self.cells = grids.iter().filter_map(grid).collect();
        self
    }

    /// Returns the punctual lights.
    pub(crate) fn points(&self) -> &[PreparedPoint] {
        &self.tree.points
    }

    /// Returns the triangles, ascending.
    pub(crate) fn triangles(&self) -> &[u32] {
        &self.tree.triangles
    }

    /// Returns whether the scene has any light to sample.
    pub(crate) fn any(&self) -> bool {
        self.sky > 0.0 || !self.tree.nodes.is_empty()
    }

    /// Returns whether all light comes from one flat quad, triangle or point, or the scene has no
    /// light.
    pub(crate) fn is_one(&self) -> bool {
        let is_point = self.sky == 0.0 && self.tree.emissions.len() == 1;
        self.quad.is_some() || is_point || !self.any()
    }

    /// Returns the lights as seen from `point`. `normal` is the only side on which the surface is
    /// lit, or 0 if light reaches it from everywhere. `scatterings` counts the surfaces of a path
    /// that scatter light, with this one.
    #[inline]
    pub(crate) fn at_vertex(&self, point: Vec3, normal: Vec3, scatterings: u32) -> VertexLights {
        let mut seen =
            VertexLights { point, normal, sky: 0.0, first: Weights::default(), cell: None };
        if self.quad.is_some() {
            return seen;
        }
        if self.tree.nodes.is_empty() {
            seen.sky = if self.sky > 0.0 { 1.0 } else { 0.0 };
            return seen;
        }
        if let Some((grid, number)) = self.find_cell(point, normal, scatterings) {
            let cell = self.cells[usize::from(grid)].get(&self.tree, number);
            seen.sky = self.sky_share(cell.sky, cell.total, LEAST_SKY_OF_CELL);
            for (i, node) in cell.seen.iter().enumerate().take(2) {
                seen.first.set(i, node.importances(point, normal));
            }
            seen.cell = Some((grid, number));
        } else {
            seen.first.set(0, self.tree.importances(0, point, normal));
            let total = seen.first.total();
            seen.sky = if total == 0.0 && self.sky > 0.0 {
                1.0
            } else {
                self.sky_share(self.sky, total, LEAST_SHARE)
            };
        }
        seen
    }

    /// Returns whether such a surface may receive light from the triangles. A quick test that does
    /// not weigh them.
    #[inline]
    pub(crate) fn reaches(&self, point: Vec3, normal: Vec3) -> bool {
        match self.find_cell(point, normal, LATER) {
            Some((grid, number)) => {
                !self.cells[usize::from(grid)].get(&self.tree, number).seen.is_empty()
            }
            None => self.quad.is_some() || self.at_vertex(point, normal, LATER).first.total() > 0.0,
        }
    }

    /// Returns the grid and the number of the cell of a vertex, as in
    /// [`at_vertex`](Self::at_vertex). `None` outside of the grid.
    #[inline]
    fn find_cell(&self, point: Vec3, normal: Vec3, scatterings: u32) -> Option<(u8, u32)> {
        let last = self.cells.len().checked_sub(1)?;
        let grid = usize::from(scatterings >= LATER).min(last);
        Some((grid as u8, self.cells[grid].find(point, normal)?))
    }

    /// Returns the probability of choosing the sky, from the irradiance of the sky and of the
    /// emitters.
    #[inline]
    fn sky_share(&self, sky: f32, total: f32, least: f32) -> f32 {
        if self.sky == 0.0 {
            0.0
        } else if sky + total > 0.0 {
            (sky / (sky + total)).clamp(least, 1.0 - LEAST_SHARE)
        } else {
            0.5
        }
    }

    /// Returns the cell that a vertex uses, if any.
    #[inline]
    fn cell(&self, seen: &VertexLights) -> Option<(&LightGrid, &LightCell)> {
        let (grid, number) = seen.cell?;
        let cells = &self.cells[usize::from(grid)];
        Some((cells, cells.get(&self.tree, number)))
    }

    /// Chooses a light with a uniform number in [0, 1). `None` if the descent ends at a node that
    /// contributes nothing.
    #[inline]
    pub(crate) fn choose(&self, seen: &VertexLights, uniform: f64) -> Option<ChosenLight> {
        if let Some(share) = self.quad {
            return Some(self.choose_half(share, uniform));
        }
        let sky = f64::from(seen.sky);
        if uniform < sky {
            return Some(ChosenLight::Sky { rest: below_one(uniform / sky) });
        }
        let mut rest = (uniform - sky) / (1.0 - sky);
        let probability = 1.0 - seen.sky;
        let (emitter, probability) = if let Some((cells, cell)) = self.cell(seen) {
            let (cluster, share) = cells.pick(cell, &seen.first, &mut rest);
            self.tree.descend(cluster, seen.point, seen.normal, probability * share, &mut rest)?
        } else if seen.first.total() > 0.0 {
            let slot = seen.first.pick(&mut rest);
            let probability = probability * seen.first.share(slot);
            let from = Child { node: 0, slot: slot as u32 };
            self.tree.descend(from, seen.point, seen.normal, probability, &mut rest)?
        } else {
            return None;
        };
        Some(match self.tree.point(emitter) {
            Some(&point) => ChosenLight::Point { point, probability },
            None => ChosenLight::Triangle {
                triangle: self.tree.triangles[emitter],
                probability,
                rest: below_one(rest),
            },
        })
    }

    /// Chooses a triangle of the only quad. `share` is the probability of the first.
    #[inline]
    fn choose_half(&self, share: f32, uniform: f64) -> ChosenLight {
        let first = f64::from(share);
        let is_second = uniform >= first && share < 1.0;
        let (triangle, probability, rest) = match is_second {
            false => (self.tree.triangles[0], share, uniform / first),
            true => (self.tree.triangles[1], 1.0 - share, (uniform - first) / (1.0 - first)),
        };
        ChosenLight::Triangle { triangle, probability, rest: below_one(rest) }
    }

    /// Returns the probability with which [`choose`](Self::choose) gives a triangle.
    #[inline]
    pub(crate) fn probability(&self, seen: &VertexLights, triangle: u32) -> f32 {
        let Ok(emitter) = self.tree.triangles.binary_search(&triangle) else { return 0.0 };
        if let Some(share) = self.quad {
            return if emitter == 0 { share } else { 1.0 - share };
        }
        let mut probability = 1.0 - seen.sky;
        let mut end = None;
        if let Some((cells, cell)) = self.cell(seen) {
            let (cluster, share) = cells.share(cell, &seen.first, emitter);
            (probability, end) = (probability * share, Some(cluster));
        }
        let mut place = self.tree.places[emitter];
        while Some(place) != end && (end.is_some() || place.node != 0) {
            let node = &self.tree.nodes[place.node as usize];
            let importances = self.tree.importances(place.node as usize, seen.point, seen.normal);
            let total: f32 = importances.iter().sum();
            if total <= 0.0 {
                return 0.0;
            }
            probability *= importances[place.slot as usize] / total;
            place = node.parent;
        }
        if end.is_some() {
            probability
        } else {
            probability * seen.first.share(place.slot as usize)
        }
    }
}

#[cfg(test)]
mod tests;
