//! Building the light tree. Groups are split where the surface-area-orientation heuristic is least
//! (Conty Estevez and Kulla 2018, §4.4), into up to eight at a time.
//!
//! Invariant: every emitter is in exactly one leaf. The tree has at most about 60 levels, because
//! groups deep in the tree are halved by number.

use std::f32::consts::PI;

use glam::Vec3;

use super::cone::Cone;
use super::node::{Bound, Child, LightNode, WIDTH};

/// Number of intervals per axis between which splits are considered.
const BUCKETS: usize = 12;
/// Least depth at which groups are halved by number, so that no scene makes a deep tree.
const HALVING_DEPTH: usize = 24;
/// Relative amount that a plane is lowered, to allow for rounding.
const SLACK: f32 = 4e-6;

/// The emission of one triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Emission {
    /// Luminance, in the unit of the tree's powers; of a point, its greatest intensity.
    pub radiance: f32,
    /// The side of the triangle's normal that emits: 1 or -1, or 0 for both.
    pub side: f32,
}

/// A triangle or point that emits, or a group of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Emitter {
    low: Vec3,
    high: Vec3,
    /// For a single emitter, its centroid.
    center: Vec3,
    /// For a single emitter: squared radius of a sphere around `center`.
    radius2: f32,
    normals: Cone,
    /// Least cosine between a normal and the directions into which it emits.
    edge: f32,
    /// Least `axis · p`.
    plane: f32,
    two_sided: bool,
    power: f64,
    emission: Emission,
}

impl Emitter {
    pub(crate) fn new(corners: [Vec3; 3], normal: Vec3, power: f64, two_sided: bool) -> Self {
        let [a, b, c] = corners;
        let center = (a + b + c) / 3.0;
        let reach = corners.iter().fold(0.0_f32, |m, v| m.max(v.abs().max_element()));
        let across = (b - a).as_dvec3().cross((c - a).as_dvec3());
        let radiance = (2.0 * power / across.length()) as f32;
        let side = if two_sided { 0.0 } else { across.dot(normal.as_dvec3()).signum() as f32 };
        let plane = corners.iter().fold(f32::INFINITY, |m, v| m.min(v.dot(normal))) - SLACK * reach;
        Self {
            low: a.min(b).min(c),
            high: a.max(b).max(c),
            center,
            radius2: corners.iter().fold(0.0_f32, |m, v| m.max(v.distance_squared(center))),
            normals: Cone { axis: normal, angle: 0.0 },
            edge: 0.0,
            plane: if two_sided { f32::NEG_INFINITY } else { plane },
            two_sided,
            power,
            emission: Emission { radiance, side },
        }
    }

    /// Makes the emitter of a light at a point. `cone` has its axis and the cosine of its edge; it
    /// is `None` for light in all directions. `power` is the greatest intensity.
    pub(crate) fn point(position: Vec3, cone: Option<(Vec3, f32)>, power: f64) -> Self {
        let (axis, edge) = cone.unwrap_or((Vec3::Z, 0.0));
        // A cone wider than a hemisphere counts as light in all directions.
        let angle = if cone.is_some() && edge > 0.0 { 0.0 } else { PI };
        Self {
            low: position,
            high: position,
            center: position,
            radius2: 0.0,
            normals: Cone { axis, angle },
            edge: edge.max(0.0),
            plane: f32::NEG_INFINITY,
            two_sided: false,
            power,
            emission: Emission { radiance: power as f32, side: 0.0 },
        }
    }

    /// Returns the emission of a single emitter.
    pub(crate) fn emission(&self) -> Emission {
        self.emission
    }

    fn union(self, other: Self) -> Self {
        let mut second = other.normals;
        if self.two_sided && other.two_sided && self.normals.axis.dot(second.axis) < 0.0 {
            // Two-sided emitters have no front.
            second.axis = -second.axis;
        }
        let flat = self.normals == other.normals && self.normals.angle == 0.0;
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            center: self.center,
            radius2: self.radius2,
            normals: self.normals.union(second),
            edge: self.edge.min(other.edge),
            plane: if flat { self.plane.min(other.plane) } else { f32::NEG_INFINITY },
            two_sided: self.two_sided || other.two_sided,
            power: self.power + other.power,
            emission: self.emission,
        }
    }

    /// Returns the cost of the heuristic: power times the spread in space and in direction.
    fn cost(self) -> f64 {
        let size = self.high - self.low;
        let area =
            f64::from(size.x) * f64::from(size.y + size.z) + f64::from(size.y) * f64::from(size.z);
        self.power * area * f64::from(self.normals.measure())
    }

    fn bound(self, single: bool) -> Bound {
        let center = if single { self.center } else { self.low * 0.5 + self.high * 0.5 };
        let half = (self.high - center).max(center - self.low);
        let radius2 = if single { self.radius2 } else { half.length_squared() };
        Bound {
            center,
            half,
            radius2,
            axis: self.normals.axis,
            angle: self.normals.angle,
            edge: self.edge,
            plane: self.plane,
            two_sided: self.two_sided,
            power: self.power as f32,
        }
    }
}

/// Builds the tree. Returns the nodes, the root first, and the leaf of each emitter. Without
/// emitters there are no nodes.
pub(crate) fn tree(emitters: Vec<Emitter>) -> (Vec<LightNode>, Vec<Child>) {
    let mut builder = Builder { nodes: Vec::new(), places: vec![Child::default(); emitters.len()] };
    let mut items: Vec<(u32, Emitter)> = (0..).zip(emitters).collect();
    if !items.is_empty() {
        builder.node(&mut items, Child::default(), 0);
    }
    (builder.nodes, builder.places)
}

struct Builder {
    nodes: Vec<LightNode>,
    places: Vec<Child>,
}

impl Builder {
    fn node(&mut self, items: &mut [(u32, Emitter)], parent: Child, depth: usize) -> usize {
        let index = self.nodes.len();
        self.nodes.push(LightNode::new(parent));
        let all = whole(items);
        let mut groups: Vec<(&mut [(u32, Emitter)], Emitter)> = vec![(items, all)];
        while groups.len() < WIDTH {
            let costliest = (0..groups.len())
                .filter(|&g| groups[g].0.len() > 1)
                .max_by(|&a, &b| groups[a].1.cost().total_cmp(&groups[b].1.cost()));
            let Some(costliest) = costliest else { break };
            let (group, _) = groups.swap_remove(costliest);
            let at = split(group, depth >= HALVING_DEPTH);
            let (left, right) = group.split_at_mut(at);
            let (first, second) = (whole(left), whole(right));
            groups.extend([(left, first), (right, second)]);
        }
        for (slot, (group, whole)) in groups.into_iter().enumerate() {
            let place = Child { node: index as u32, slot: slot as u32 };
            let single = group.len() == 1;
            let bound = whole.bound(single);
            let child = if single {
                self.places[group[0].0 as usize] = place;
                Err(group[0].0 as usize)
            } else {
                Ok(self.node(group, place, depth + 1))
            };
            self.nodes[index].set(slot, &bound, child);
        }
        index
    }
}

fn whole(group: &[(u32, Emitter)]) -> Emitter {
    group[1..].iter().fold(group[0].1, |sum, &(_, e)| sum.union(e))
}

/// Reorders a group of at least two for its best split. Returns the size of the first part, which
/// is neither 0 nor all.
fn split(group: &mut [(u32, Emitter)], halve: bool) -> usize {
    let (low, high) = group.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), (_, e)| {
        (l.min(e.center), h.max(e.center))
    });
    let size = high - low;
    let half = group.len() / 2;
    if !halve {
        let mut best = (f64::INFINITY, 0, 0);
        for axis in 0..3 {
            if size[axis] <= 0.0 {
                continue;
            }
            let mut buckets: [Option<Emitter>; BUCKETS] = [None; BUCKETS];
            for (_, e) in group.iter() {
                let bucket = &mut buckets[bucket(e, low, size, axis)];
                *bucket = Some(bucket.map_or(*e, |sum| sum.union(*e)));
            }
            let add = |sum: Option<Emitter>, e: Option<Emitter>| {
                sum.map_or(e, |s| Some(e.map_or(s, |e| s.union(e))))
            };
            let mut above = [None; BUCKETS];
            for i in (1..BUCKETS).rev() {
                above[i - 1] = add(buckets[i], above[i]);
            }
            // Long thin groups illuminate unevenly from their sides (Conty Estevez and Kulla's Kr).
            let stretch = f64::from(size.max_element() / size[axis]);
            let mut below = None;
            for i in 0..BUCKETS - 1 {
                below = add(below, buckets[i]);
                if let (Some(below), Some(above)) = (below, above[i]) {
                    let cost = stretch * (below.cost() + above.cost());
                    if cost < best.0 {
                        best = (cost, axis, i);
                    }
                }
            }
        }
        if best.0 < f64::INFINITY {
            let (_, axis, last) = best;
            group.sort_by_key(|(_, e)| bucket(e, low, size, axis) > last);
            return group.iter().filter(|(_, e)| bucket(e, low, size, axis) <= last).count();
        }
    }
    let axis = size.max_position();
    group.select_nth_unstable_by(half, |(_, a), (_, b)| a.center[axis].total_cmp(&b.center[axis]));
    half
}

fn bucket(e: &Emitter, low: Vec3, size: Vec3, axis: usize) -> usize {
    (((e.center[axis] - low[axis]) / size[axis] * BUCKETS as f32) as usize).min(BUCKETS - 1)
}
