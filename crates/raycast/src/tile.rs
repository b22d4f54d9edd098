//! Rays of one eye through neighbouring pixels: boxes and triangles are held against the pyramid around all of them, and what is left of
//! the triangles is tested with sixteen rays at a time.
//!
//! Always true: each ray's result is the same, bit for bit, as if it were traced alone. The pyramid is wider than its rays by more than
//! the rounding of the tests, so that no box or triangle is left out that one of them may meet; the triangles are tested by the same
//! operations, in the same roundings.

use crate::node::{Block, Hierarchy, LANES, LEAF, Node, ROW, WIDTH};
use crate::simd::{Near, Simd, parts};
use crate::triangle::{
    Directions, LENGTH_SQUARED, Located, Prepared, consider, inside_exactly, locate_row,
};
use crate::{Hit, MAX_TILE, NO_TRIANGLE, Ray};

/// By what share of the scene's size, and of a distance, the pyramid is wider than its rays: some fifty roundings.
const SLACK: f32 = 4e-6;

/// A slope taken for 0: rays move by less than the slack.
const LEAST_SLOPE: f32 = 1e-7;

/// Rays of a row from which on it is faster to find together where they meet a triangle.
const MANY: u32 = 3;

/// Rows of rays.
const ROWS: usize = MAX_TILE / ROW;

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
    rays: &'a [Ray],
    eye: [f32; 3],
    /// The eye along the axes of the rays' shears.
    origin: [f32; 3],
    axes: [usize; 3],
    /// 1 or -1: which way the rays go along the main axis.
    sign: f32,
    /// Least and greatest slope along the other two axes.
    slopes: [(f32, f32); 2],
    sides: [Side; 6],
    slack: f32,
    /// Shears by axis, and rays in rows.
    shear: [[[f32; ROW]; ROWS]; 2],
    /// How far along the main axis a ray gets in a unit of `t`.
    speed: [[f32; ROW]; ROWS],
    t_min: [[f32; ROW]; ROWS],
    directions: [Directions; ROWS],
}

/// The nearest hits so far, by what is known of each; no triangle, and `t` the end of the ray, if there is none.
struct Best {
    t: [[f32; ROW]; ROWS],
    triangle: [[u32; ROW]; ROWS],
    u: [[f32; ROW]; ROWS],
    v: [[f32; ROW]; ROWS],
    /// How far along the main axis what a ray meets still counts; 0 for rays that are not there.
    depth: [[f32; ROW]; ROWS],
}

impl Best {
    #[inline(always)]
    fn nothing(bundle: &Bundle) -> Self {
        let mut best = Self {
            t: [[0.0; ROW]; ROWS],
            triangle: [[NO_TRIANGLE; ROW]; ROWS],
            u: [[0.0; ROW]; ROWS],
            v: [[0.0; ROW]; ROWS],
            depth: [[0.0; ROW]; ROWS],
        };
        for (i, ray) in bundle.rays.iter().enumerate() {
            let (row, lane) = (i / ROW % ROWS, i % ROW);
            best.t[row][lane] = ray.t_max;
            best.depth[row][lane] = ray.t_max * bundle.speed[row][lane];
        }
        best
    }

    #[inline(always)]
    fn get(&self, row: usize, lane: usize) -> Hit {
        let (row, lane) = (row % ROWS, lane % ROW);
        Hit {
            t: self.t[row][lane],
            triangle: self.triangle[row][lane],
            u: self.u[row][lane],
            v: self.v[row][lane],
        }
    }

    /// The depth from which on nothing counts for any ray.
    #[inline(always)]
    fn limit(&self) -> f32 {
        let mut most = self.depth[0];
        for depth in &self.depth[1..] {
            for (most, depth) in most.iter_mut().zip(depth) {
                *most = greater(*depth, *most);
            }
        }
        most.into_iter().fold(0.0, greater)
    }
}

impl<'a> Bundle<'a> {
    /// `None` if the rays do not begin at one point near the scene or do not go one way, or if one of them cannot hit anything.
    #[inline(always)]
    pub(crate) fn new(rays: &'a [Ray], reach: f32) -> Option<Self> {
        let first = rays.first()?;
        let eye = first.origin.to_array();
        let Prepared { axes, sheared_origin: origin, direction, .. } =
            Prepared::new(first.origin, first.direction)?;
        let main = axes[2];
        let is_reversed = direction[main % 3] < 0.0;
        let sign = if is_reversed { -1.0 } else { 1.0 };
        let mut is_one = rays.len() <= MAX_TILE && first.origin.abs().max_element() <= 2.0 * reach;
        let mut towards = [[[0.0_f32; ROW]; ROWS]; 3];
        let mut t_min = [[0.0; ROW]; ROWS];
        for (i, ray) in rays.iter().enumerate().take(MAX_TILE) {
            let (row, lane) = (i / ROW, i % ROW);
            for (axis, towards) in towards.iter_mut().enumerate() {
                towards[row][lane] = ray.direction[axis];
            }
            t_min[row][lane] = ray.t_min.max(0.0);
            is_one &=
                (ray.origin == first.origin) & !ray.t_min.is_nan() & (t_min[row][lane] < ray.t_max);
        }
        // Rays that are not there go where the first one goes.
        for i in rays.len()..MAX_TILE {
            for (axis, towards) in towards.iter_mut().enumerate() {
                towards[i / ROW][i % ROW] = direction[axis];
            }
        }
        let mut slopes = [(f32::INFINITY, f32::NEG_INFINITY); 2];
        let mut shear = [[[0.0; ROW]; ROWS]; 2];
        let mut speed = [[0.0; ROW]; ROWS];
        let mut directions = [Directions::NONE; ROWS];
        for row in 0..ROWS {
            let [x, y, z] = [0, 1, 2].map(|axis: usize| &towards[axis][row]);
            let [across, up, along] = axes.map(|axis| &towards[axis % 3][row]);
            let mut fits = [true; ROW];
            for i in 0..ROW {
                let [a, b, c] = [x[i].abs(), y[i].abs(), z[i].abs()];
                let square = x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
                let goes_far = LENGTH_SQUARED.contains(&square);
                let is_main = [(a >= b) & (a >= c), (a < b) | (a < c), (a < b) | (a < c)][main % 3]
                    & [true, b >= c, b < c][main % 3];
                shear[0][row][i] = across[i] / along[i];
                shear[1][row][i] = up[i] / along[i];
                speed[row][i] = along[i] * sign;
                fits[i] = goes_far & is_main & (speed[row][i] > 0.0);
            }
            is_one &= fits.iter().all(|&fits| fits);
            directions[row] = Directions::new(x, y, z);
            for (axis, (low, high)) in slopes.iter_mut().enumerate() {
                for slope in shear[axis][row].map(|shear| shear * sign) {
                    (*low, *high) = (lesser(slope, *low), greater(slope, *high));
                }
            }
        }
        if !is_one {
            return None;
        }
        let slack = SLACK * reach;
        let along = |row: usize, shift: f32, is_lower: bool| Side {
            axis: main,
            row,
            shift,
            factor: sign,
            is_lower,
        };
        let near = usize::from(is_reversed);
        let mut sides = [along(near, -slack * sign, true); 6];
        sides[1] = along(near + 1, slack * sign, false);
        for (other, &(low, high)) in slopes.iter().enumerate() {
            // Neither is 0: the pyramid becomes wider.
            let low = if low.abs() < LEAST_SLOPE { -LEAST_SLOPE } else { low };
            let high = if high.abs() < LEAST_SLOPE { LEAST_SLOPE } else { high };
            let axis = axes[other];
            // high * distance >= the box's least coordinate, low * distance <= its greatest.
            sides[2 + 2 * other] =
                Side { axis, row: 0, shift: -slack, factor: high.recip(), is_lower: high > 0.0 };
            sides[3 + 2 * other] =
                Side { axis, row: 1, shift: slack, factor: low.recip(), is_lower: low < 0.0 };
        }
        Some(Self {
            rays,
            eye,
            origin,
            axes,
            sign,
            slopes,
            sides,
            slack,
            shear,
            speed,
            t_min,
            directions,
        })
    }

    /// Distances at which the pyramid may enter the eight boxes, and a bit per box that it may enter before `limit`.
    #[inline(always)]
    fn enter(&self, node: &Node, limit: f32) -> (Near, u32) {
        let mut near = [0.0_f32; WIDTH];
        let mut far = [limit; WIDTH];
        let origin = &self.eye;
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

/// Nearest hits of a bundle's rays.
#[inline(always)]
pub(crate) fn traverse_tile<S: Simd, const STACK: usize>(
    simd: S,
    hierarchy: &Hierarchy,
    bundle: &Bundle,
    hits: &mut [Option<Hit>],
) {
    let mut best = Best::nothing(bundle);
    let mut limit = f32::INFINITY;
    let mut stack = [0_u64; STACK];
    let (mut current, mut top) = (0_u32, 0);
    loop {
        if current & LEAF == 0 {
            let node = &hierarchy.nodes[current as usize];
            let (near, mask) = bundle.enter(node, limit);
            if mask != 0 {
                if let Some(free) = stack.get_mut(top..).and_then(|s| s.first_chunk_mut::<WIDTH>())
                {
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
                found |=
                    meet(simd, bundle, block, lane, &corners.of(lane), nearest[lane], &mut best);
            }
            if found {
                limit = best.limit();
            }
        }
        loop {
            if top == 0 {
                for (i, hit) in hits.iter_mut().enumerate().take(bundle.rays.len()) {
                    *hit =
                        Some(best.get(i / ROW, i % ROW)).filter(|hit| hit.triangle != NO_TRIANGLE);
                }
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
fn meet<S: Simd>(
    simd: S,
    bundle: &Bundle,
    block: &Block,
    lane: usize,
    corners: &[[f32; 3]; 3],
    nearest: f32,
    best: &mut Best,
) -> bool {
    let (triangle, id) = (block.triangle(lane), block.id(lane));
    let mut found = false;
    for (row, rays) in bundle.rays.chunks(ROW).enumerate() {
        let row = row % ROWS;
        let straddled = simd.straddled_rays(corners, &bundle.shear[0][row], &bundle.shear[1][row]);
        let there = u32::MAX >> (u32::BITS as usize - rays.len());
        let mut candidates = (straddled.inside | straddled.on_edge) & there;
        let mut on_edge = straddled.on_edge & there;
        if candidates.count_ones() < MANY {
            while candidates != 0 {
                let i = candidates.trailing_zeros() as usize % ROW;
                candidates &= candidates - 1;
                if nearest <= best.depth[row][i] * (1.0 + SLACK) + bundle.slack {
                    found |=
                        meet_one(bundle, (triangle, id), (row, i), on_edge >> i & 1 != 0, best);
                }
            }
            continue;
        }
        while on_edge != 0 {
            let i = on_edge.trailing_zeros() as usize % ROW;
            on_edge &= on_edge - 1;
            let is_inside = Prepared::new(rays[i].origin, rays[i].direction);
            if !is_inside.is_some_and(|ray| inside_exactly(triangle, &ray)) {
                candidates &= !(1 << i);
            }
        }
        found |= meet_row(bundle, (triangle, id), row, candidates, best);
    }
    found
}

/// One triangle that a ray may meet.
#[inline(always)]
fn meet_one(
    bundle: &Bundle,
    (triangle, id): ([[f32; 3]; 3], u32),
    (row, lane): (usize, usize),
    on_edge: bool,
    best: &mut Best,
) -> bool {
    let Some(ray) = bundle.rays.get(row * ROW + lane) else { return false };
    let Some(prepared) = Prepared::new(ray.origin, ray.direction) else { return false };
    let before = best.get(row, lane);
    let mut hit = before;
    consider(triangle, id, on_edge, &prepared, bundle.t_min[row][lane], &mut hit);
    if hit.triangle == before.triangle {
        return false;
    }
    (best.t[row][lane], best.triangle[row][lane]) = (hit.t, hit.triangle);
    (best.u[row][lane], best.v[row][lane]) = (hit.u, hit.v);
    best.depth[row][lane] = hit.t * bundle.speed[row][lane];
    true
}

/// One triangle that many rays of a row may meet: their distances are found together, and held against what they met before.
///
/// A tile's rays mostly meet the same few triangles. One by one, finding where took two thirds of the time of all a picture's rays.
#[inline(always)]
fn meet_row(
    bundle: &Bundle,
    (triangle, id): ([[f32; 3]; 3], u32),
    row: usize,
    candidates: u32,
    best: &mut Best,
) -> bool {
    let Located { t, u, v } = locate_row(triangle, bundle.eye, &bundle.directions[row]);
    let (speed, t_min) = (&bundle.speed[row], &bundle.t_min[row]);
    let (best_t, best_triangle) = (&mut best.t[row], &mut best.triangle[row]);
    let (best_u, best_v, depth) = (&mut best.u[row], &mut best.v[row], &mut best.depth[row]);
    let mut found = 0;
    for i in 0..ROW {
        // As `replace`, which see.
        let first = (best_triangle[i] != NO_TRIANGLE) & (id < best_triangle[i]);
        let nearer = (t[i] < best_t[i]) | ((t[i] == best_t[i]) & first);
        let takes = nearer & (t[i] > t_min[i]) & (candidates >> i & 1 != 0);
        best_t[i] = if takes { t[i] } else { best_t[i] };
        best_triangle[i] = if takes { id } else { best_triangle[i] };
        best_u[i] = if takes { u[i] } else { best_u[i] };
        best_v[i] = if takes { v[i] } else { best_v[i] };
        depth[i] = if takes { t[i] * speed[i] } else { depth[i] };
        found |= u32::from(takes);
    }
    found != 0
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
        let quads =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let mut triangles: Vec<[u32; 3]> =
            quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        for i in 0..400_u32 {
            let at = Vec3::new((i % 8) as f32, (i / 8 % 8) as f32, (i / 64) as f32) * 0.9 - 3.0;
            let first = positions.len() as u32;
            positions.extend(
                [at, at + Vec3::new(0.2, 0.05, 0.1), at + Vec3::new(0.0, 0.3, 0.1)]
                    .map(|p| p.to_array()),
            );
            triangles.push([first, first + 1, first + 2]);
        }
        let materials = vec![0; triangles.len()];
        let scene = Scene::new(
            DVec3::ZERO,
            positions,
            triangles,
            materials,
            vec![Material::grey("m")],
            [0.0; 3],
        );
        Raycaster::build(Arc::new(scene.expect("valid"))).expect("built")
    }

    #[test]
    fn a_picture_is_the_same_by_tiles_as_ray_by_ray() {
        let raycaster = room();
        let (eye, side) = (Vec3::new(0.3, -3.7, 0.2), 8);
        let mut hits_of_small = 0;
        for (forward, spread) in
            [(Vec3::Y, 0.002), (Vec3::new(0.7, 0.7, 0.1), 0.004), (-Vec3::Z, 0.01), (Vec3::X, 0.1)]
        {
            for tile in 0..200 {
                let place = Vec3::new(
                    (tile % 20) as f32 - 10.0,
                    (tile / 20) as f32 - 5.0,
                    (tile % 7) as f32,
                ) * 0.08;
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
