//! Boxes around the closed surfaces of solids. A point outside all of them is inside no solid, so
//! no ray must find that out.
//!
//! Invariant: a closed surface lies in one box, because surfaces that touch share a box. A scene
//! may repeat the corners of its triangles, so corners at one place count as one.

use glam::Vec3;
use rustc_hash::FxHashMap;

/// Most boxes. A point is compared with each of them, which then takes about 0.1 µs, much less than
/// a ray. If a scene has more solids, one box contains all of them.
const MAX_BOXES: usize = 256;

/// Most separate surfaces whose boxes are compared with each other.
const MAX_SURFACES: usize = 4096;

/// Width of gaps in a surface that do not divide it, as a share of the surface's extent.
const GAP: f32 = 1e-3;

/// An axis-aligned box, relative to the scene's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    const NOTHING: Bounds = Bounds { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    fn with(self, other: Bounds) -> Bounds {
        Bounds { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    fn touches(&self, other: &Bounds) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// Returns the box with a margin of [`GAP`] on each side.
    fn widened(self) -> Bounds {
        let margin = Vec3::splat((self.high - self.low).max_element() * GAP);
        Bounds { low: self.low - margin, high: self.high + margin }
    }
}

/// Boxes that contain all closed surfaces of solids.
#[derive(Debug)]
pub(super) struct Boxes(Vec<Bounds>);

impl Boxes {
    /// Makes the boxes of triangles, given by their corners.
    pub(super) fn new(triangles: impl Iterator<Item = [Vec3; 3]>) -> Boxes {
        let mut surfaces = surfaces(triangles);
        let all = surfaces.iter().copied().fold(Bounds::NOTHING, Bounds::with);
        if surfaces.len() <= MAX_SURFACES {
            merge_touching(&mut surfaces);
        }
        if surfaces.len() > MAX_BOXES {
            surfaces = vec![all];
        }
        Boxes(surfaces)
    }

    /// Returns whether there is no box.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns whether some box contains a point.
    pub(super) fn contain(&self, point: Vec3) -> bool {
        self.0.iter().any(|b| point.cmpge(b.low).all() && point.cmple(b.high).all())
    }
}

/// Returns the boxes of triangles that are connected by their corners.
fn surfaces(triangles: impl Iterator<Item = [Vec3; 3]>) -> Vec<Bounds> {
    let mut numbers = FxHashMap::default();
    let mut surfaces = Forest::default();
    let mut bounds: Vec<Bounds> = Vec::new();
    for corners in triangles {
        let [first, others @ ..] = corners.map(|corner| {
            // Adding 0 turns -0 into 0.
            let key = (corner + 0.0).to_array().map(f32::to_bits);
            *numbers.entry(key).or_insert_with(|| {
                bounds.push(Bounds { low: corner, high: corner });
                surfaces.add()
            })
        });
        others.into_iter().for_each(|other| surfaces.join(first, other));
    }
    let mut whole = vec![Bounds::NOTHING; bounds.len()];
    for (corner, bounds) in bounds.into_iter().enumerate() {
        let root = surfaces.root(corner);
        whole[root] = whole[root].with(bounds);
    }
    whole.retain(|bounds| *bounds != Bounds::NOTHING);
    whole.into_iter().map(Bounds::widened).collect()
}

/// Replaces boxes that touch by one box around them, until none touch.
fn merge_touching(boxes: &mut Vec<Bounds>) {
    let mut before = usize::MAX;
    // A box that grows may touch boxes that it was compared with before, so one pass may not do.
    while boxes.len() < before {
        before = boxes.len();
        let mut at = 0;
        while at < boxes.len() {
            match (at + 1..boxes.len()).find(|&other| boxes[at].touches(&boxes[other])) {
                Some(other) => boxes[at] = boxes[at].with(boxes.swap_remove(other)),
                None => at += 1,
            }
        }
    }
}

/// Disjoint sets of numbers, each a tree of parents.
#[derive(Default)]
struct Forest(Vec<usize>);

impl Forest {
    fn add(&mut self) -> usize {
        self.0.push(self.0.len());
        self.0.len() - 1
    }

    fn root(&mut self, mut at: usize) -> usize {
        while self.0[at] != at {
            // Halving the path makes later searches shorter.
            self.0[at] = self.0[self.0[at]];
            at = self.0[at];
        }
        at
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        self.0[one.max(other)] = one.min(other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the twelve triangles of a box.
    fn cuboid(low: Vec3, high: Vec3) -> Vec<[Vec3; 3]> {
        let corner = |bits: usize| {
            let pick = |axis: usize| if bits >> axis & 1 == 0 { low[axis] } else { high[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        };
        let sides =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let halves = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]];
        sides.into_iter().flat_map(halves).map(|side| side.map(corner)).collect()
    }

    #[test]
    fn separate_solids_have_separate_boxes() {
        let one = cuboid(Vec3::ZERO, Vec3::ONE);
        let other = cuboid(Vec3::splat(5.0), Vec3::splat(6.0));
        let boxes = Boxes::new(one.into_iter().chain(other));
        assert_eq!(boxes.0.len(), 2);
        assert!(boxes.contain(Vec3::splat(0.5)) && boxes.contain(Vec3::splat(5.5)));
        assert!(!boxes.contain(Vec3::splat(3.0)));
    }

    #[test]
    fn sides_that_share_no_corner_but_touch_have_one_box() {
        // One side is divided where its neighbours have no corner, and another ends just before
        // them.
        let mut sides = cuboid(Vec3::ZERO, Vec3::ONE);
        let [a, b, c] = sides[0];
        let middle = (b + c) / 2.0;
        sides[0] = [a, b, middle];
        sides.push([a, middle, c]);
        sides[2..4].iter_mut().flatten().for_each(|corner| corner.x = corner.x.clamp(1e-4, 0.9999));
        let boxes = Boxes::new(sides.into_iter());
        assert_eq!(boxes.0.len(), 1, "{boxes:?}");
        assert!(boxes.contain(Vec3::splat(0.5)));
    }

    #[test]
    fn a_solid_within_another_and_one_that_bridges_two_share_a_box() {
        let nested = [
            cuboid(Vec3::ZERO, Vec3::ONE),
            cuboid(Vec3::splat(2.0), Vec3::splat(3.0)),
            cuboid(Vec3::splat(0.4), Vec3::splat(0.6)),
            cuboid(Vec3::splat(0.9), Vec3::splat(2.1)),
        ];
        let boxes = Boxes::new(nested.into_iter().flatten());
        assert_eq!(boxes.0.len(), 1, "{boxes:?}");
    }

    #[test]
    fn very_many_solids_have_one_box_around_all() {
        let solids = (0..2 * MAX_BOXES)
            .map(|at| Vec3::X * 3.0 * at as f32)
            .flat_map(|low| cuboid(low, low + Vec3::ONE));
        let boxes = Boxes::new(solids);
        assert_eq!(boxes.0.len(), 1);
        assert!(boxes.contain(Vec3::new(2.0, 0.5, 0.5)));
    }

    #[test]
    fn no_triangles_make_no_box() {
        let boxes = Boxes::new(std::iter::empty());
        assert!(boxes.is_empty() && !boxes.contain(Vec3::ZERO));
    }
}
