//! Photons by place: a tree whose leaves hold photons that lie side by side.
//!
//! Invariant: [`Leaf::density`] is the density of [`Leaf::choose`], per solid angle, and has the
//! integral 1 over all directions.

use std::f32::consts::{PI, TAU};

use glam::Vec3;
use holo_scene::Scene;

use super::photons::Photon;
use crate::geometry::ShadingFrame;
use crate::lights::PreparedPoint;
use crate::luminance::luminance;

/// Most photons of a leaf.
const MOST: usize = 32;
/// Fewest photons of a leaf, because fewer do not show where light comes from.
const LEAST: usize = 8;
/// The cone of a photon reaches to the direction of its neighbour of this rank.
const NEIGHBOUR: usize = 3;
/// Greatest squared chord between the middle and the edge of a cone: that of 30°.
const WIDEST: f32 = 0.268;
/// Margin of a leaf around the box of its photons, as a share of the box.
const MARGIN: f32 = 0.15;
/// Further margin of a leaf, as a share of the scene.
const THICKNESS: f32 = 1e-3;
/// Added to the sides of that box to compute its area, as a multiple of the scene's margin.
const THINNEST: f32 = 0.01;
/// Greatest share of samples that are aimed (docs/notes/path-tracing.md).
const GREATEST_SHARE: f32 = 0.3;
/// Sides of surfaces: positive and negative along each axis.
const FACINGS: usize = 6;

/// A tree of leaves for each way that surfaces face.
#[derive(Debug)]
pub(super) struct LeafTree {
    nodes: Vec<LeafNode>,
    roots: [Option<LeafChild>; FACINGS],
    leaves: Vec<Leaf>,
}

/// The scene around a leaf.
struct LeafSurroundings {
    /// Margin of all leaves.
    thickness: f32,
    /// Mean irradiance of the scene's surfaces by lamps and sky.
    ambient: f32,
}

/// Two halves of space. The first is below `split`.
#[derive(Debug)]
struct LeafNode {
    axis: usize,
    split: f32,
    halves: [Option<LeafChild>; 2],
}

#[derive(Clone, Copy, Debug)]
enum LeafChild {
    Node(u32),
    Leaf(u32),
}

/// Photons that lie side by side, as cones of directions.
#[derive(Debug)]
pub(super) struct Leaf {
    low: Vec3,
    high: Vec3,
    /// Share of samples that are aimed: the caustic's share of the irradiance.
    pub share: f32,
    count: usize,
    /// Where the photons seem to come from, by coordinate.
    from: [[f32; MOST]; 3],
    /// Squared chord between the middle and the edge of each cone, on the unit sphere. The cosine
    /// of a sun's radius has too few digits.
    chords2: [f32; MOST],
    /// Probability of each cone over its solid angle.
    densities: [f32; MOST],
    /// Sums of the probabilities up to each cone.
    sums: [f32; MOST],
}

impl LeafTree {
    /// Sorts photons into leaves. `None` if there are too few.
    pub(super) fn new(photons: Vec<Photon>, scene: &Scene) -> Option<Self> {
        let mut by_facing: [Vec<Photon>; FACINGS] = Default::default();
        photons.into_iter().for_each(|photon| by_facing[facing(photon.normal)].push(photon));
        let (low, high) = scene.bounds();
        let around = LeafSurroundings {
            thickness: THICKNESS * (high - low).length() as f32,
            ambient: ambient(scene),
        };
        let mut tree = Self { nodes: Vec::new(), roots: [None; FACINGS], leaves: Vec::new() };
        for (facing, photons) in by_facing.iter_mut().enumerate() {
            tree.roots[facing] = tree.divide(photons, &around);
        }
        (!tree.leaves.is_empty()).then_some(tree)
    }

    fn divide(&mut self, photons: &mut [Photon], around: &LeafSurroundings) -> Option<LeafChild> {
        if photons.len() < LEAST {
            return None;
        }
        if photons.len() <= MOST {
            self.leaves.push(Leaf::new(photons, around)?);
            return Some(LeafChild::Leaf(self.leaves.len() as u32 - 1));
        }
        let (low, high) = bounds(photons);
        let axis = (high - low).max_position();
        let middle = photons.len() / 2;
        photons.select_nth_unstable_by(middle, |a, b| a.point[axis].total_cmp(&b.point[axis]));
        let split = photons[middle].point[axis];
        let at = self.nodes.len();
        self.nodes.push(LeafNode { axis, split, halves: [None; 2] });
        let (below, above) = photons.split_at_mut(middle);
        self.nodes[at].halves = [self.divide(below, around), self.divide(above, around)];
        Some(LeafChild::Node(at as u32))
    }

    /// Returns the leaf that contains a surface point. `None` if no photons are near.
    #[inline]
    pub(super) fn find(&self, point: Vec3, normal: Vec3) -> Option<&Leaf> {
        let mut child = self.roots[facing(normal)]?;
        loop {
            match child {
                LeafChild::Leaf(leaf) => {
                    let leaf = &self.leaves[leaf as usize];
                    return leaf.contains(point).then_some(leaf);
                }
                LeafChild::Node(node) => {
                    let node = &self.nodes[node as usize];
                    child = node.halves[usize::from(point[node.axis] >= node.split)]?;
                }
            }
        }
    }
}

impl Leaf {
    /// Makes a leaf. `None` if the photons' flux is beyond the range of f32.
    fn new(photons: &[Photon], around: &LeafSurroundings) -> Option<Self> {
        let (low, high) = bounds(photons);
        let margin = (high - low) * MARGIN + around.thickness;
        let middle = photons.iter().map(|p| p.point).sum::<Vec3>() / photons.len() as f32;
        let directions: Vec<Vec3> =
            photons.iter().map(|p| (p.from - middle).normalize_or_zero()).collect();
        let whole: f32 = photons.iter().map(|p| p.flux).sum();
        if !(whole > 0.0 && whole.is_finite()) {
            return None;
        }
        let mut extents = (high - low + THINNEST * around.thickness).to_array();
        extents.sort_by(f32::total_cmp);
        let irradiance = whole / (extents[1] * extents[2]);
        let mut leaf = Self {
            low: low - margin,
            high: high + margin,
            share: (irradiance / (irradiance + around.ambient)).min(GREATEST_SHARE),
            count: photons.len(),
            from: [[0.0; MOST]; 3],
            chords2: [-1.0; MOST],
            densities: [0.0; MOST],
            sums: [0.0; MOST],
        };
        let mut sum = 0.0;
        for (i, (photon, direction)) in photons.iter().zip(&directions).enumerate() {
            let mut near: Vec<f32> =
                directions.iter().map(|d| d.distance_squared(*direction)).collect();
            // The first is the photon itself.
            let rank = NEIGHBOUR.min(near.len() - 1);
            near.select_nth_unstable_by(rank, f32::total_cmp);
            let chord2 = near[rank].max(photon.least_chord2).min(WIDEST);
            let probability = photon.flux / whole;
            sum += probability;
            (0..3).for_each(|axis| leaf.from[axis][i] = photon.from[axis]);
            leaf.chords2[i] = chord2;
            leaf.densities[i] = probability / (PI * chord2);
            leaf.sums[i] = sum;
        }
        Some(leaf)
    }

    #[inline]
    fn contains(&self, point: Vec3) -> bool {
        point.cmpge(self.low).all() && point.cmple(self.high).all()
    }

    /// Returns a direction from two uniform numbers.
    #[inline]
    pub(super) fn choose(&self, point: Vec3, first: f64, second: f32) -> Option<Vec3> {
        let first = first as f32 * self.sums[self.count - 1];
        let chosen = self.sums[..self.count - 1].partition_point(|&sum| sum <= first);
        let before = if chosen == 0 { 0.0 } else { self.sums[chosen - 1] };
        let width = (self.sums[chosen] - before).max(f32::MIN_POSITIVE);
        let rest = ((first - before) / width).clamp(0.0, 1.0);
        let axis = (Vec3::from(self.from.map(|row| row[chosen])) - point).try_normalize()?;
        let depth = 0.5 * rest * self.chords2[chosen];
        let (sin, cos) = (TAU * second).sin_cos();
        let radius = (depth * (2.0 - depth)).sqrt();
        Some(ShadingFrame::new(axis).to_world(Vec3::new(radius * cos, radius * sin, 1.0 - depth)))
    }

    /// Returns the density of a direction.
    #[inline]
    pub(super) fn density(&self, point: Vec3, direction: Vec3) -> f32 {
        let mut density = 0.0;
        for i in 0..MOST {
            let (x, y, z) =
                (self.from[0][i] - point.x, self.from[1][i] - point.y, self.from[2][i] - point.z);
            let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
            let (x, y, z) =
                (x * inverse - direction.x, y * inverse - direction.y, z * inverse - direction.z);
            let is_within = x * x + y * y + z * z <= self.chords2[i];
            density += if is_within { self.densities[i] } else { 0.0 };
        }
        density
    }
}

/// Returns the mean irradiance of a scene's surfaces, by luminance. A sun lights a quarter of the
/// surface of a convex body on average.
fn ambient(scene: &Scene) -> f32 {
    let (mut power, mut area) = (0.0, 0.0);
    for t in scene.triangles() {
        let material = scene.material(t);
        let sides = if material.two_sided_emission { 2.0 } else { 1.0 };
        power += sides * f64::from(luminance(material.emission)) * scene.area(t);
        area += scene.area(t);
    }
    for point in scene.punctual_lights.iter().map(PreparedPoint::new) {
        power += f64::from(point.extent() * point.strength());
    }
    let suns: f32 = scene.all_suns().map(|sun| luminance(sun.irradiance)).sum();
    PI * ((power / area) as f32 + luminance(scene.sky.mean())) + 0.25 * suns
}

fn bounds(photons: &[Photon]) -> (Vec3, Vec3) {
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    photons.iter().fold(empty, |(low, high), p| (low.min(p.point), high.max(p.point)))
}

/// Returns the axis that a surface faces, and whether along or against it.
#[inline]
fn facing(normal: Vec3) -> usize {
    let axis = normal.abs().max_position();
    2 * axis + usize::from(normal[axis] < 0.0)
}
