//! Finds sheets of solid glass that enclose nothing.
//!
//! The inside of solid glass is behind its faces. A single sheet with open edges would put all that
//! lies behind it inside glass, where radiance is greater by the square of the index. A part that
//! has open edges counts as a sheet if rays from its faces inwards do not leave it again. So solids
//! with cracks, and windows of two sheets without a rim, stay solids.

use glam::DVec3;

/// Most rays that are sent from one part.
const RAYS: usize = 8;

/// Triangles in a leaf of the tree.
const LEAF: usize = 4;

/// Deepest tree: 2²⁸ triangles in halves.
const MAX_DEPTH: usize = 32;

/// Returns whether fewer than half of the rays from a part's faces inwards leave glass again.
pub(crate) fn is_sheet(
    part: &[usize],
    corners: &impl Fn(usize) -> [DVec3; 3],
    tree: &SheetTree,
) -> bool {
    let step = part.len().div_ceil(RAYS);
    let (mut sent, mut left) = (0, 0);
    for &triangle in part.iter().step_by(step) {
        let [a, b, c] = corners(triangle);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        if normal == DVec3::ZERO {
            continue;
        }
        sent += 1;
        let (from, size) = ((a + b + c) / 3.0, (b - a).length().max((c - a).length()));
        // Not its own plane again.
        let from = from - normal * size * 1e-6;
        left += usize::from(tree.leaves(from, -normal));
    }
    2 * left < sent
}

/// A node's box, and its triangles in order or its two halves.
struct SheetNode {
    low: DVec3,
    high: DVec3,
    first: usize,
    count: usize,
    /// The second half; 0 for leaves. The first half follows its node.
    second: usize,
}

/// A tree of boxes around triangles of glass.
pub(crate) struct SheetTree {
    nodes: Vec<SheetNode>,
    triangles: Vec<[DVec3; 3]>,
}

impl SheetTree {
    pub(crate) fn new(triangles: Vec<[DVec3; 3]>) -> SheetTree {
        let mut tree = SheetTree { nodes: Vec::new(), triangles };
        tree.add(0, tree.triangles.len(), 0);
        tree
    }

    fn add(&mut self, first: usize, count: usize, depth: usize) {
        let own = &mut self.triangles[first..first + count];
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in own.as_flattened() {
            (low, high) = (low.min(*corner), high.max(*corner));
        }
        let node = self.nodes.len();
        self.nodes.push(SheetNode { low, high, first, count, second: 0 });
        if count <= LEAF || depth == MAX_DEPTH {
            return;
        }
        let axis = (high - low).max_position();
        let middle = |t: &[DVec3; 3]| t[0][axis] + t[1][axis] + t[2][axis];
        own.select_nth_unstable_by(count / 2, |a, b| middle(a).total_cmp(&middle(b)));
        self.add(first, count / 2, depth + 1);
        self.nodes[node].second = self.nodes.len();
        self.add(first + count / 2, count - count / 2, depth + 1);
    }

    /// Returns whether the first triangle that a ray hits is hit from behind.
    fn leaves(&self, from: DVec3, direction: DVec3) -> bool {
        let mut nearest = (f64::INFINITY, false);
        let mut pending = vec![0];
        while let Some(index) = pending.pop() {
            let node = &self.nodes[index];
            let (a, b) = ((node.low - from) / direction, (node.high - from) / direction);
            let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
            // NaN, from a face of the box in the ray's own plane, counts as a hit.
            if near > far || far < 0.0 || near > nearest.0 {
                continue;
            }
            if node.second > 0 {
                pending.extend([index + 1, node.second]);
                continue;
            }
            for &[a, b, c] in &self.triangles[node.first..node.first + node.count] {
                if let Some(distance) = distance([a, b, c], from, direction)
                    && distance < nearest.0
                {
                    nearest = (distance, (b - a).cross(c - a).dot(direction) > 0.0);
                }
            }
        }
        nearest.1
    }
}

/// Returns the distance along a ray to a triangle (Möller & Trumbore 1997).
fn distance([a, b, c]: [DVec3; 3], from: DVec3, direction: DVec3) -> Option<f64> {
    let (along, up) = (b - a, c - a);
    let p = direction.cross(up);
    let determinant = along.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let to = from - a;
    let u = to.dot(p) / determinant;
    let q = to.cross(along);
    let v = direction.dot(q) / determinant;
    let distance = up.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}
