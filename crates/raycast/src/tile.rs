//! Rays of one eye through neighbouring pixels: boxes and triangles are held against the pyramid around all of them, and what is left of
//! the triangles is tested with sixteen rays at a time.
//!
//! Always true: each ray's result is the same, bit for bit, as if it were traced alone. The pyramid is wider than its rays by more than
//! the rounding of the tests, so that no box or triangle is left out that one of them may meet; the triangles are tested by the same
//! operations, in the same roundings.

use crate::kernel::Query;
use crate::node::{Block, Hierarchy, LANES, LEAF, Node, ROW, WIDTH};
use crate::simd::{Near, Simd, parts};
use crate::triangle::{Directions, Located, consider, inside_exactly, locate_row, replace};
use crate::{Hit, MAX_TILE, NO_TRIANGLE};

/// By what share of the scene's size, and of a distance, the pyramid is wider than its rays: some fifty roundings.
const SLACK: f32 = 4e-6;

/// A slope taken for 0: rays move by less than the slack.
const LEAST_SLOPE: f32 = 1e-7;

/// Rays of a row from which on it is faster to find together where they meet a triangle.
const MANY: u32 = 3;

/// A side of the pyramid against one side of a box: `(row * step + origin + shift) * factor` bounds the distances along the main axis at
/// which a ray may be in the box.
#[derive(Clone, Copy)]
struct Side {
    axis: usize,
    /// Of `Node::bounds`.
    row: usize,
    shift: f32,
    factor: f32,
    /// Whether it bounds them from below.
    is_lower: bool,
}

/// The rays, and the pyramid around them. Distances are along the main axis, in which the rays go farthest.
pub(crate) struct Bundle<'a> {
    queries: &'a [Query],
    /// The origin along the axes of the rays' shears.
    origin: [f32; 3],
    axes: [usize; 3],
    /// 1 or -1: which way the rays go along the main axis.
    sign: f32,
    /// Least and greatest slope along the other two axes.
    slopes: [(f32, f32); 2],
    sides: [Side; 6],
    slack: f32,
    /// Shears by axis, and rays in rows.
    shear: [[[f32; ROW]; MAX_TILE / ROW]; 2],
    /// How far along the main axis a ray gets in a unit of `t`.
    speed: [f32; MAX_TILE],
    directions: [Directions; MAX_TILE / ROW],
}

impl<'a> Bundle<'a> {
    /// `None` if the rays do not begin at one point or do not go one way.
    #[inline(always)]
    pub(crate) fn new(queries: &'a [Query], reach: f32) -> Option<Self> {
        let first = &queries.first()?.ray;
        let main = first.axes[2];
        let is_reversed = first.direction[main % 3] < 0.0;
        let sign = if is_reversed { -1.0 } else { 1.0 };
        let mut slopes = [(f32::INFINITY, f32::NEG_INFINITY); 2];
        let mut shear = [[[0.0; ROW]; MAX_TILE / ROW]; 2];
        let mut speed = [0.0; MAX_TILE];
        let mut directions = [Directions::NONE; MAX_TILE / ROW];
        let mut is_one = queries.len() <= MAX_TILE;
        for (i, query) in queries.iter().enumerate().take(MAX_TILE) {
            let ray = &query.ray;
            speed[i] = ray.direction[main % 3] * sign;
            directions[i / ROW].set(i, ray.direction);
            is_one &= ray.origin == first.origin && ray.axes[2] == main && speed[i] > 0.0;
            for (axis, (low, high)) in slopes.iter_mut().enumerate() {
                shear[axis][i / ROW][i % ROW] = ray.shear[axis];
                let slope = ray.shear[axis] * sign;
                (*low, *high) = (low.min(slope), high.max(slope));
            }
        }
        if !is_one {
            return None;
        }
        let slack = SLACK * reach;
        let along = |row: usize, shift: f32, is_lower: bool| Side { axis: main, row, shift, factor: sign, is_lower };
        let near = usize::from(is_reversed);
        let mut sides = [along(near, -slack * sign, true); 6];
        sides[1] = along(near + 1, slack * sign, false);
        for (other, &(low, high)) in slopes.iter().enumerate() {
            // Neither is 0: the pyramid becomes wider.
            let low = if low.abs() < LEAST_SLOPE { -LEAST_SLOPE } else { low };
            let high = if high.abs() < LEAST_SLOPE { LEAST_SLOPE } else { high };
            let axis = first.axes[other];
            // high * distance >= the box's least coordinate, low * distance <= its greatest.
            sides[2 + 2 * other] = Side { axis, row: 0, shift: -slack, factor: high.recip(), is_lower: high > 0.0 };
            sides[3 + 2 * other] = Side { axis, row: 1, shift: slack, factor: low.recip(), is_lower: low < 0.0 };
        }
        let (origin, axes) = (first.sheared_origin, first.axes);
        Some(Self { queries, origin, axes, sign, slopes, sides, slack, shear, speed, directions })
    }

    /// Distances at which the pyramid may enter the eight boxes, and a bit per box that it may enter before `limit`.
    #[inline(always)]
    fn enter(&self, node: &Node, limit: f32) -> (Near, u32) {
        let mut near = [0.0_f32; WIDTH];
        let mut far = [limit; WIDTH];
        let origin = &self.queries[0].ray.origin;
        for side in &self.sides {
            let axis = side.axis % 3;
            let base = (node.origin[axis] - origin[axis] + side.shift) * side.factor;
            let step = node.step[axis] * side.factor;
            let row = &node.bounds[axis][side.row % 3];
            let mut at = [0.0; WIDTH];
            for i in 0..WIDTH {
                at[i] = f32::from(row[i]) * step + base;
            }
            if side.is_lower {
                for i in 0..WIDTH {
                    near[i] = greater(at[i], near[i]);
                }
            } else {
                for i in 0..WIDTH {
                    far[i] = lesser(at[i], far[i]);
                }
            }
        }
        let mut mask = 0;
        for i in 0..WIDTH {
            near[i] *= 1.0 - SLACK;
            mask |= u32::from(near[i] <= far[i] * (1.0 + SLACK) + self.slack) << i;
        }
        (Near(near), mask)
    }

    /// The block's triangles, their corners relative to the origin, along the rays' axes.
    #[inline(always)]
    fn relative(&self, block: &Block) -> Corners {
        let mut corners = [[[0.0; LANES]; 3]; 3];
        for (axis, corners) in corners.iter_mut().enumerate() {
            let from = &block.vertices[self.axes[axis] % 3];
            for (vertex, lanes) in corners.iter_mut().enumerate() {
                for (lane, corner) in lanes.iter_mut().enumerate() {
                    *corner = from[vertex][lane] - self.origin[axis];
                }
            }
        }
        Corners(corners)
    }

    /// A bit per triangle that is not wholly outside the pyramid, nor beyond `limit`; and the nearest corner's distance of each.
    #[inline(always)]
    fn inside(&self, corners: &Corners, limit: f32) -> (u32, [f32; LANES]) {
        let Corners([across, up, along]) = corners;
        let mut nearest = [f32::INFINITY; LANES];
        let mut farthest = [f32::NEG_INFINITY; LANES];
        let mut beyond = [[f32::INFINITY; LANES]; 2];
        let mut before = [[f32::NEG_INFINITY; LANES]; 2];
        for vertex in 0..3 {
            for lane in 0..LANES {
                let z = along[vertex][lane] * self.sign;
                nearest[lane] = lesser(z, nearest[lane]);
                farthest[lane] = greater(z, farthest[lane]);
                for (axis, other) in [across, up].into_iter().enumerate() {
                    let (low, high) = self.slopes[axis];
                    beyond[axis][lane] = lesser(other[vertex][lane] - high * z, beyond[axis][lane]);
                    before[axis][lane] = greater(other[vertex][lane] - low * z, before[axis][lane]);
                }
            }
        }
        let mut mask = 0;
        for lane in 0..LANES {
            let is_in = (nearest[lane] <= limit + self.slack)
                & (farthest[lane] >= -self.slack)
                & (beyond[0][lane] <= self.slack)
                & (beyond[1][lane] <= self.slack)
                & (before[0][lane] >= -self.slack)
                & (before[1][lane] >= -self.slack);
            mask |= u32::from(is_in) << lane;
        }
        (mask, nearest)
    }
}

/// The second where the first is no number: one instruction, which `f32::min` is not.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The same of the greater.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Axis of the rays, vertex, lane.
struct Corners([[[f32; LANES]; 3]; 3]);

impl Corners {
    /// By vertex and axis.
    #[inline(always)]
    fn of(&self, lane: usize) -> [[f32; 3]; 3] {
        let lane = lane % LANES;
        [0, 1, 2].map(|vertex| [0, 1, 2].map(|axis: usize| self.0[axis][vertex][lane]))
    }
}

/// Nearest hits of a bundle's rays; `best` has [`Query::nothing`] of each.
#[inline(always)]
pub(crate) fn traverse_tile<S: Simd, const STACK: usize>(
    simd: S,
    hierarchy: &Hierarchy,
    bundle: &Bundle,
    best: &mut [Hit; MAX_TILE],
) {
    let count = bundle.queries.len().min(MAX_TILE);
    // How far along the main axis what a ray meets still counts; 0 for rays that are not there.
    let mut depth = [0.0_f32; MAX_TILE];
    for i in 0..count {
        depth[i] = best[i].t * bundle.speed[i];
    }
    let mut limit = f32::INFINITY;
    let mut stack = [0_u64; STACK];
    let (mut current, mut top) = (0_u32, 0);
    loop {
        if current & LEAF == 0 {
            let node = &hierarchy.nodes[current as usize];
            let (near, mask) = bundle.enter(node, limit);
            if mask != 0 {
                if let Some(free) = stack.get_mut(top..).and_then(|s| s.first_chunk_mut::<WIDTH>()) {
                    simd.stack::<true>(&node.children, &near, mask, free);
                }
                top += mask.count_ones() as usize;
            }
        } else {
            let block = &hierarchy.blocks[(current & !LEAF) as usize];
            let corners = bundle.relative(block);
            let (mut lanes, nearest) = bundle.inside(&corners, limit);
            let mut found = false;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize % LANES;
                lanes &= lanes - 1;
                found |= meet(simd, bundle, block, lane, &corners.of(lane), nearest[lane], &mut depth, best);
            }
            if found {
                limit = depth[..count].iter().fold(0.0, |most, &depth| greater(depth, most));
            }
        }
        loop {
            if top == 0 {
                return;
            }
            top -= 1;
            let (child, near) = parts(stack[top]);
            if near <= limit * (1.0 + SLACK) + bundle.slack {
                current = child;
                break;
            }
        }
    }
}

/// One triangle against all rays; whether any meets it.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "the state of one loop, which is inlined")]
fn meet<S: Simd>(
    simd: S,
    bundle: &Bundle,
    block: &Block,
    lane: usize,
    corners: &[[f32; 3]; 3],
    nearest: f32,
    depth: &mut [f32; MAX_TILE],
    best: &mut [Hit; MAX_TILE],
) -> bool {
    let (triangle, id) = (block.triangle(lane), block.id(lane));
    let count = bundle.queries.len().min(MAX_TILE);
    let mut found = false;
    for (row, first) in (0..count).step_by(ROW).enumerate() {
        let row = row % (MAX_TILE / ROW);
        let straddled = simd.straddled_rays(corners, &bundle.shear[0][row], &bundle.shear[1][row]);
        let mut candidates = straddled.inside | straddled.on_edge;
        if candidates.count_ones() >= MANY {
            found |= meet_row(bundle, (triangle, id), (first, candidates, straddled.on_edge), nearest, depth, best);
            continue;
        }
        while candidates != 0 {
            let bit = candidates.trailing_zeros() as usize;
            candidates &= candidates - 1;
            let i = (first + bit) % MAX_TILE;
            // Also rays that are not there.
            let Some(query) = bundle.queries.get(i) else { break };
            if nearest > depth[i] * (1.0 + SLACK) + bundle.slack || query.skip.contains(&id) {
                continue;
            }
            let on_edge = straddled.on_edge >> bit & 1 != 0;
            let before = best[i];
            consider(triangle, id, on_edge, &query.ray, query.t_min, &mut best[i]);
            if best[i].triangle != before.triangle && best[i].triangle != NO_TRIANGLE {
                depth[i] = best[i].t * bundle.speed[i];
                found = true;
            }
        }
    }
    found
}

/// One triangle that many rays of a row, from the `first` on, may meet: their distances are found together.
///
/// A tile's rays mostly meet the same few triangles. One by one, finding where took two thirds of the time of all a picture's rays.
#[inline(always)]
fn meet_row(
    bundle: &Bundle,
    (triangle, id): ([[f32; 3]; 3], u32),
    (first, mut candidates, on_edge): (usize, u32, u32),
    nearest: f32,
    depth: &mut [f32; MAX_TILE],
    best: &mut [Hit; MAX_TILE],
) -> bool {
    let Some(origin) = bundle.queries.first().map(|query| query.ray.origin) else { return false };
    let Located { t, u, v } = locate_row(triangle, origin, &bundle.directions[first / ROW % (MAX_TILE / ROW)]);
    let mut found = false;
    while candidates != 0 {
        let bit = candidates.trailing_zeros() as usize % ROW;
        candidates &= candidates - 1;
        let i = (first + bit) % MAX_TILE;
        // Also rays that are not there.
        let Some(query) = bundle.queries.get(i) else { break };
        if nearest > depth[i] * (1.0 + SLACK) + bundle.slack || query.skip.contains(&id) {
            continue;
        }
        if on_edge >> bit & 1 != 0 && !inside_exactly(triangle, &query.ray) {
            continue;
        }
        let before = best[i];
        replace(&mut best[i], Hit { t: t[bit], triangle: id, u: u[bit], v: v[bit] }, query.t_min);
        if best[i].triangle != before.triangle && best[i].triangle != NO_TRIANGLE {
            depth[i] = best[i].t * bundle.speed[i];
            found = true;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use crate::{MAX_TILE, Ray, Raycaster};
    use glam::{DVec3, Vec3};
    use holo_scene::{Material, Scene};
    use std::sync::Arc;

    /// A room of large triangles with small ones in it: narrow pyramids lie wholly within the large ones.
    fn room() -> Raycaster {
        let corner = |i: u32| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -4.0_f32 } else { 4.0 });
        let mut positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
        let quads = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let mut triangles: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        for i in 0..400_u32 {
            let at = Vec3::new((i % 8) as f32, (i / 8 % 8) as f32, (i / 64) as f32) * 0.9 - 3.0;
            let first = positions.len() as u32;
            positions.extend([at, at + Vec3::new(0.2, 0.05, 0.1), at + Vec3::new(0.0, 0.3, 0.1)].map(|p| p.to_array()));
            triangles.push([first, first + 1, first + 2]);
        }
        let materials = vec![0; triangles.len()];
        let scene = Scene::new(DVec3::ZERO, positions, triangles, materials, vec![Material::grey("m")], [0.0; 3]);
        Raycaster::build(Arc::new(scene.expect("valid"))).expect("built")
    }

    #[test]
    fn a_picture_is_the_same_by_tiles_as_ray_by_ray() {
        let raycaster = room();
        let (eye, side) = (Vec3::new(0.3, -3.7, 0.2), 8);
        let mut hits_of_small = 0;
        for (forward, spread) in [(Vec3::Y, 0.002), (Vec3::new(0.7, 0.7, 0.1), 0.004), (-Vec3::Z, 0.01), (Vec3::X, 0.1)]
        {
            for tile in 0..200 {
                let place = Vec3::new((tile % 20) as f32 - 10.0, (tile / 20) as f32 - 5.0, (tile % 7) as f32) * 0.08;
                let rays: Vec<Ray> = (0..MAX_TILE)
                    .map(|i| {
                        let (x, y) = ((i % side) as f32 * spread, (i / side) as f32 * spread);
                        Ray::new(eye, (forward + place + Vec3::new(x, y, x - y)).normalize())
                    })
                    .collect();
                let mut hits = vec![None; rays.len()];
                raycaster.nearest_tile(&rays, &mut hits);
                let alone: Vec<_> = rays.iter().map(|ray| raycaster.nearest(ray)).collect();
                assert_eq!(hits, alone, "{forward} {tile}");
                hits_of_small += alone.iter().flatten().filter(|hit| hit.triangle >= 12).count();
            }
        }
        assert!(hits_of_small > 1000, "{hits_of_small}");
    }
}
