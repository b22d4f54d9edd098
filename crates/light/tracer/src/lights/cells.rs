//! The lights that each part of a scene really receives light from.
//!
//! The tree's importances ignore walls. With ninety lamps in six rooms, most lamps are hidden. For
//! a group that reaches to the vertex, importances consider only its centre. This module divides
//! space into cells, and each cell by the axis that surfaces face. A cell chooses among at most
//! [`CLUSTERS`] subtrees, by the light that probes on its surfaces received from each. Within a
//! subtree the importances decide. A cell is estimated with shadow rays when a path first reaches
//! it.
//!
//! Invariant: a cell is a function of the scene and its number, no matter which thread makes it,
//! or when. Every cluster keeps a share ([`UNSEEN`]), even if no probe saw it.

use std::sync::{Arc, OnceLock};

use glam::{IVec3, Vec3};
use holo_raycast::{Ray, Raycaster, SurfacePoint, spawn};

use super::build::Emission;
use super::node::{Child, LightNode, WIDTH};
use super::point::PreparedPoint;
use super::tree::{LightTree, ONE_BELOW, Weights, below_one};
use super::triangle::Aim;
use crate::geometry::{ShadingFrame, cosine_hemisphere, cosine_pdf};
use crate::luminance::luminance;
use crate::panes::Panes;
use crate::sampler::{NumberPurpose, Sampler};
use crate::sky::PreparedSky;

/// Most subtrees that a cell chooses among.
const CLUSTERS: usize = 64;
/// Variants of a cell, by the axis and sign that a surface faces; one more for light from
/// everywhere.
const FACINGS: usize = 7;
/// Points of a cell that estimate its lights.
const PROBES: usize = 4;
/// Approximate number of shadow rays for a cell.
const LOOKS: usize = 128;
/// Nodes of clusters that are weighed anew for every vertex.
const SEEN_NODES: usize = 2;
/// Attempts to place the probes on surfaces.
const ATTEMPTS: usize = 16;
/// Rays per probe that test the sky.
const SKY_RAYS: usize = 4;
/// Share of samples that follows the light that would arrive without obstacles. With less, a lamp
/// that no probe of a cell saw makes bright dots.
const UNSEEN: f32 = 0.25;
/// Distance in cell sides below which a cluster differs within the cell: what probes see may not
/// hold for all of it.
const NEAR: f32 = 1.5;
/// Least share of its importance that such a cluster keeps.
const LEAST_NEAR: f32 = 0.5;
/// Share of the samples without obstacles that follows power alone.
const BLIND: f32 = 0.01;
/// Least cosine of a light: the surfaces of a cell do not all face as its probes do.
const LEAST_COSINE: f32 = 0.1;
/// Margin of the grid around the box of the emitters, over the box's longest side.
const MARGIN: f32 = 0.25;

/// The light that the surfaces of a cell receive.
#[derive(Debug)]
pub(super) struct LightCell {
    /// From all emitters: approximate irradiance, in the unit of the tree's powers.
    pub total: f32,
    /// The same from the sky.
    pub sky: f32,
    /// Cumulative shares of the clusters, the same for the whole cell.
    sums: Box<[f32]>,
    /// The clusters that probes saw or that are near, weighed anew for every vertex. Their power is
    /// scaled by the share that reached the probes.
    pub seen: Box<[LightNode]>,
    /// The cluster of each slot of `seen`.
    seen_clusters: [u8; SEEN_NODES * WIDTH],
    /// The slot of each cluster in `seen`; `u8::MAX` if it has none.
    seen_as: Box<[u8]>,
}

/// The grid of cells.
#[derive(Debug)]
pub(super) struct LightGrid {
    raycaster: Arc<Raycaster>,
    panes: Arc<Panes>,
    /// Luminance of the irradiance of a surface that sees all of the sky, in the unit of the tree's
    /// powers.
    sky: f32,
    prepared_sky: Arc<PreparedSky>,
    low: Vec3,
    side: f32,
    size: IVec3,
    clusters: Vec<Child>,
    /// The cluster of each emitter.
    cluster_of: Vec<u16>,
    cells: Box<[OnceLock<LightCell>]>,
}

impl LightCell {
    /// Picks a cluster by a uniform number and makes the number uniform again.
    #[inline]
    fn pick(&self, seen: &Weights, uniform: &mut f64) -> usize {
        if seen.total() > 0.0 {
            let blind = f64::from(UNSEEN);
            if *uniform >= blind {
                *uniform = ((*uniform - blind) / (1.0 - blind)).min(ONE_BELOW);
                return usize::from(self.seen_clusters[seen.pick(uniform)]);
            }
            *uniform /= blind;
        }
        let i =
            self.sums.partition_point(|&sum| f64::from(sum) <= *uniform).min(self.sums.len() - 1);
        *uniform = ((*uniform - f64::from(self.before(i))) / f64::from(self.share(i)))
            .clamp(0.0, ONE_BELOW);
        i
    }

    #[inline]
    fn before(&self, i: usize) -> f32 {
        if i == 0 { 0.0 } else { self.sums[i - 1] }
    }

    #[inline]
    fn share(&self, i: usize) -> f32 {
        self.sums[i] - self.before(i)
    }

    /// Returns the probability of a cluster.
    #[inline]
    fn probability(&self, seen: &Weights, i: usize) -> f32 {
        if seen.total() > 0.0 {
            UNSEEN * self.share(i) + (1.0 - UNSEEN) * seen.share(usize::from(self.seen_as[i]))
        } else {
            self.share(i)
        }
    }
}

impl LightGrid {
    /// Divides space into at most about `most` cells, for a tree and the irradiance of its sky.
    /// `None` if the tree is too small to need them.
    pub(super) fn new(
        most: f32,
        tree: &LightTree,
        (sky, prepared_sky): (f32, Arc<PreparedSky>),
        raycaster: &Arc<Raycaster>,
        panes: &Arc<Panes>,
    ) -> Option<Self> {
        if tree.nodes.len() < 2 {
            return None;
        }
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let corners = tree.triangles.iter().flat_map(|&t| raycaster.vertices(t));
        for corner in corners.chain(tree.points.iter().map(|point| point.position)) {
            (low, high) = (low.min(corner), high.max(corner));
        }
        let margin = (high - low).max_element() * MARGIN;
        let (low, extent) = (low - margin, high - low + 2.0 * margin);
        let side = (extent.x * extent.y * extent.z / most).cbrt();
        if !(side > 0.0 && side.is_finite()) {
            return None;
        }
        let size = (extent / side).ceil().as_ivec3().max(IVec3::ONE);
        let clusters = cut(&tree.nodes, side * side);
        let mut cluster_of = vec![0; tree.emissions.len()];
        for (emitter, cluster_of) in cluster_of.iter_mut().enumerate() {
            let mut place = tree.places[emitter];
            loop {
                if let Some(i) = clusters.iter().position(|&c| c == place) {
                    *cluster_of = i as u16;
                    break;
                }
                if place.node == 0 {
                    break;
                }
                place = tree.nodes[place.node as usize].parent;
            }
        }
        let count = size.x as usize * size.y as usize * size.z as usize * FACINGS;
        let cells = (0..count).map(|_| OnceLock::new()).collect();
        Some(Self {
            raycaster: raycaster.clone(),
            panes: panes.clone(),
            sky,
            prepared_sky,
            low,
            side,
            size,
            clusters,
            cluster_of,
            cells,
        })
    }

    /// Returns the number of the cell of a point and normal; `None` outside of the grid.
    #[inline]
    pub(super) fn find(&self, point: Vec3, normal: Vec3) -> Option<u32> {
        let at = ((point - self.low) / self.side).floor();
        // NaN is outside too.
        if !(at.cmpge(Vec3::ZERO).all() && at.cmplt(self.size.as_vec3()).all()) {
            return None;
        }
        let at = at.as_ivec3();
        let cell = (at.z * self.size.y + at.y) * self.size.x + at.x;
        Some(cell as u32 * FACINGS as u32 + facing(normal))
    }

    #[inline]
    pub(super) fn get(&self, tree: &LightTree, number: u32) -> &LightCell {
        self.cells[number as usize].get_or_init(|| self.probe(tree, number))
    }

    /// Picks a cluster by a uniform number; returns it and its probability.
    #[inline]
    pub(super) fn pick(&self, cell: &LightCell, seen: &Weights, uniform: &mut f64) -> (Child, f32) {
        let i = cell.pick(seen, uniform);
        (self.clusters[i], cell.probability(seen, i))
    }

    /// Returns the cluster of an emitter and its probability.
    #[inline]
    pub(super) fn share(&self, cell: &LightCell, seen: &Weights, emitter: usize) -> (Child, f32) {
        let i = usize::from(self.cluster_of[emitter]);
        (self.clusters[i], cell.probability(seen, i))
    }

    /// Estimates a cell: probes send shadow rays to all clusters.
    #[cold]
    fn probe(&self, tree: &LightTree, number: u32) -> LightCell {
        let (cell, facing) = (number / FACINGS as u32, number % FACINGS as u32);
        let (x, y) = (self.size.x as u32, self.size.y as u32);
        let corner = Vec3::new((cell % x) as f32, (cell / x % y) as f32, (cell / x / y) as f32);
        let mut sampler = Sampler::new(SEED, u64::from(number));
        let probes = self.probes(corner, facing, &mut sampler);
        let mut seen = vec![0.0_f32; self.clusters.len()];
        let mut open = vec![0.0_f32; self.clusters.len()];
        let mut sky = 0.0_f32;
        let repeats = (LOOKS / (PROBES * self.clusters.len())).clamp(1, 8);
        for (k, probe) in probes.iter().enumerate() {
            sampler.turn((1 + k) as u32, NumberPurpose::Light);
            for (i, &cluster) in self.clusters.iter().enumerate() {
                for _ in 0..repeats {
                    let (value, passed) = self.look(tree, probe, facing, cluster, &mut sampler);
                    open[i] += value;
                    seen[i] += value * passed;
                }
            }
            if self.sky > 0.0 {
                sampler.turn((1 + k) as u32, NumberPurpose::Scatter);
                let frame =
                    ShadingFrame::new(if facing == EVERYWHERE { Vec3::Z } else { probe.normal });
                for _ in 0..SKY_RAYS {
                    let (direction, value) = self.sky_ray(&frame, &mut sampler);
                    if value > 0.0 {
                        let origin = spawn(probe.point, probe.error, probe.normal, direction);
                        let ray = Ray::new(origin, direction);
                        let is_hidden = self.raycaster.occluded_from(&ray, probe.triangle);
                        sky += if is_hidden { 0.0 } else { value };
                    }
                }
            }
        }
        let power = |c: &Child| tree.nodes[c.node as usize].power(c.slot as usize);
        let all_power: f32 = self.clusters.iter().map(power).sum();
        let (all_seen, all_open): (f32, f32) = (seen.iter().sum(), open.iter().sum());
        let share = |i: usize| {
            let by_power = power(&self.clusters[i]) / all_power;
            let by_open = if all_open > 0.0 { open[i] / all_open } else { by_power };
            BLIND * by_power + (1.0 - BLIND) * by_open
        };
        let center = self.low + (corner + 0.5) * self.side;
        let near: Vec<bool> = self
            .clusters
            .iter()
            .map(|c| {
                let (middle, radius) = tree.nodes[c.node as usize].sphere(c.slot as usize);
                middle.distance(center) < radius + NEAR * self.side
            })
            .collect();
        let mut order: Vec<usize> = (0..seen.len()).filter(|&i| seen[i] > 0.0 || near[i]).collect();
        order.sort_by(|&a, &b| near[b].cmp(&near[a]).then(seen[b].total_cmp(&seen[a])));
        order.truncate(SEEN_NODES * WIDTH);
        let mut nodes = vec![LightNode::new(Child::default()); order.len().div_ceil(WIDTH)];
        let mut seen_clusters = [0; SEEN_NODES * WIDTH];
        let mut seen_as = vec![u8::MAX; seen.len()].into_boxed_slice();
        for (place, &i) in order.iter().enumerate() {
            let Child { node, slot } = self.clusters[i];
            nodes[place / WIDTH].copy(place % WIDTH, &tree.nodes[node as usize], slot as usize, i);
            seen_as[i] = place as u8;
            seen_clusters[place] = i as u8;
        }
        // Scale powers so that importances at the probes equal what arrived there.
        let mut expected = [0.0_f32; SEEN_NODES * WIDTH];
        for probe in &probes {
            let normal = if facing == EVERYWHERE { Vec3::ZERO } else { probe.normal };
            for (node, expected) in nodes.iter().zip(expected.chunks_mut(WIDTH)) {
                expected
                    .iter_mut()
                    .zip(node.importances(probe.point, normal))
                    .for_each(|(sum, x)| *sum += x);
            }
        }
        for (place, &i) in order.iter().enumerate() {
            let least = if near[i] { LEAST_NEAR } else { 0.0 };
            let share = if expected[place] > 0.0 {
                seen[i] / (repeats as f32 * expected[place])
            } else {
                0.0
            };
            let share = if share.is_finite() { share } else { 1.0 };
            nodes[place / WIDTH].scale(place % WIDTH, share.max(least));
        }
        let mut sum = 0.0;
        let mut sums: Box<[f32]> = (0..self.clusters.len())
            .map(|i| {
                sum += share(i);
                sum
            })
            .collect();
        if sum > 0.0 && sum.is_finite() {
            sums.iter_mut().for_each(|s| *s /= sum);
        } else {
            // The sum exceeds the range of f32: share evenly.
            let count = sums.len() as f32;
            sums.iter_mut().zip(1_u8..).for_each(|(s, i)| *s = f32::from(i) / count);
        }
        let sky = self.sky * sky / (PROBES * SKY_RAYS) as f32;
        LightCell {
            total: all_seen / (PROBES * repeats) as f32,
            sky,
            sums,
            seen: nodes.into(),
            seen_clusters,
            seen_as,
        }
    }

    /// Returns the direction of a ray that tests the sky, and an estimate of the irradiance from
    /// the sky without obstacles, relative to that of an even sky of the same mean.
    fn sky_ray(&self, frame: &ShadingFrame, sampler: &mut Sampler) -> (Vec3, f32) {
        let mut uniform = sampler.two();
        let aimed = self.prepared_sky.aim(&mut uniform);
        let direction = aimed.unwrap_or_else(|| frame.to_world(cosine_hemisphere(uniform)));
        if self.prepared_sky.is_even() {
            return (direction, 1.0);
        }
        let cosine = cosine_pdf(direction.dot(frame.n));
        let density = self.prepared_sky.mixed(direction, 1.0, cosine);
        let radiance = luminance(self.prepared_sky.along(direction).to_array());
        let value = radiance / self.prepared_sky.mean() * cosine / density;
        (direction, if value.is_finite() { value } else { 0.0 })
    }

    /// Returns points on surfaces that face the cell's way; if there are too few, points in the
    /// cell.
    fn probes(&self, corner: Vec3, facing: u32, sampler: &mut Sampler) -> [SurfacePoint; PROBES] {
        let axis = axis(facing);
        let nowhere = |point| SurfacePoint {
            point,
            error: Vec3::ZERO,
            normal: axis,
            triangle: holo_raycast::NO_TRIANGLE,
        };
        let mut probes = [nowhere(Vec3::ZERO); PROBES];
        let mut count = 0;
        sampler.turn(0, NumberPurpose::Light);
        for attempt in 0..ATTEMPTS {
            let [x, y] = sampler.two();
            let place = self.low + (corner + Vec3::new(x, y, sampler.one())) * self.side;
            let mut found = nowhere(place);
            let mut on_surface = false;
            if facing != EVERYWHERE {
                let down = Ray { t_max: self.side, ..Ray::new(place, -axis) };
                if let Some(hit) = self.raycaster.nearest(&down) {
                    found = self.raycaster.surface(hit.triangle, hit.u, hit.v);
                    if found.normal.dot(axis) < 0.0 {
                        found.normal = -found.normal;
                    }
                    on_surface = true;
                }
            }
            // The last attempts are taken as they are.
            if on_surface || ATTEMPTS - attempt <= PROBES - count {
                probes[count] = found;
                count += 1;
                if count == PROBES {
                    break;
                }
            }
        }
        probes
    }

    /// Returns one sample of what a cluster brings to a probe without obstacles, and the share of
    /// it that arrives.
    fn look(
        &self,
        tree: &LightTree,
        probe: &SurfacePoint,
        facing: u32,
        cluster: Child,
        sampler: &mut Sampler,
    ) -> (f32, f32) {
        let (first, second) = sampler.pairs(1).at(0);
        let mut rest = first;
        let Some((emitter, probability)) =
            tree.descend(cluster, probe.point, Vec3::ZERO, 1.0, &mut rest)
        else {
            return (0.0, 0.0);
        };
        if let Some(point) = tree.point(emitter) {
            let radiance = tree.emissions[emitter].radiance / probability;
            return self.look_at_point(probe, facing, point, radiance);
        }
        let triangle = tree.triangles[emitter];
        let aim = Aim::new(probe.point, self.raycaster.vertices(triangle));
        let (u, v) = aim.sample([below_one(rest), second]);
        let light = self.raycaster.surface(triangle, u, v);
        let towards = light.point - probe.point;
        let distance2 = towards.length_squared();
        let cosine = -towards.dot(light.normal) / distance2.sqrt();
        let Emission { radiance, side } = tree.emissions[emitter];
        let shining = if side == 0.0 { cosine.abs() } else { cosine * side };
        if !(distance2 > 0.0 && shining > 0.0) || triangle == probe.triangle {
            return (0.0, 0.0);
        }
        let arriving =
            if facing == EVERYWHERE { 1.0 } else { towards.dot(probe.normal) / distance2.sqrt() };
        let away = -towards / distance2.sqrt();
        let share = tree.luminaire(emitter).map_or(1.0, |luminaire| luminaire.share(away));
        let value = radiance * share * arriving.max(LEAST_COSINE)
            / (probability * aim.density(distance2, shining));
        if value.is_finite() {
            (value, luminance(self.panes.between(&self.raycaster, probe, &light).to_array()))
        } else {
            (0.0, 0.0)
        }
    }

    /// Returns what a point of this greatest intensity brings to a probe without obstacles, and the
    /// share of it that arrives.
    fn look_at_point(
        &self,
        probe: &SurfacePoint,
        facing: u32,
        point: &PreparedPoint,
        intensity: f32,
    ) -> (f32, f32) {
        let towards = point.position - probe.point;
        let distance2 = towards.length_squared();
        let Some(direction) = towards.try_normalize() else { return (0.0, 0.0) };
        let share = luminance(point.intensity(-direction).to_array()) / point.strength();
        let arriving = if facing == EVERYWHERE { 1.0 } else { direction.dot(probe.normal) };
        let value = intensity * share * arriving.max(LEAST_COSINE) / distance2;
        if value > 0.0 && value.is_finite() {
            let passed = self.panes.between(&self.raycaster, probe, &point.place());
            (value, luminance(passed.to_array()))
        } else {
            (0.0, 0.0)
        }
    }
}

/// Seed of the cells; any number will do.
const SEED: u64 = 0xCE11;
/// The facing of vertices that are lit from all sides.
const EVERYWHERE: u32 = 6;

#[inline]
fn facing(normal: Vec3) -> u32 {
    if normal == Vec3::ZERO {
        return EVERYWHERE;
    }
    let size = normal.abs();
    let axis =
        if size.x >= size.y && size.x >= size.z { 0 } else { 1 + u32::from(size.z > size.y) };
    2 * axis + u32::from(normal[axis as usize] < 0.0)
}

fn axis(facing: u32) -> Vec3 {
    let sign = if facing % 2 == 1 { -1.0 } else { 1.0 };
    [Vec3::X, Vec3::Y, Vec3::Z].get(facing as usize / 2).map_or(Vec3::Z, |axis| *axis * sign)
}

/// Returns subtrees that together contain every emitter once. The largest, weighed by power, are
/// divided first.
fn cut(nodes: &[LightNode], least_radius2: f32) -> Vec<Child> {
    let slots = |node: usize| {
        (0..nodes[node].used()).map(move |slot| Child { node: node as u32, slot: slot as u32 })
    };
    let mut clusters: Vec<Child> = slots(0).collect();
    loop {
        let extent = |c: &Child| nodes[c.node as usize].extent(c.slot as usize);
        let divisible = clusters.iter().enumerate().filter_map(|(i, c)| {
            let next = nodes[c.node as usize].child(c.slot as usize).ok()?;
            let large = nodes[c.node as usize].radius2(c.slot as usize) > least_radius2;
            (large && clusters.len() - 1 + nodes[next].used() <= CLUSTERS).then_some((
                i,
                next,
                extent(c),
            ))
        });
        let Some((i, next, _)) = divisible.max_by(|a, b| a.2.total_cmp(&b.2)) else {
            return clusters;
        };
        clusters.swap_remove(i);
        clusters.extend(slots(next));
    }
}
