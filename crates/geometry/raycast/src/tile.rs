//! Traces rays of one eye through neighbouring pixels. Boxes and triangles are tested against the
//! pyramid around all rays; remaining triangles are tested with sixteen rays at a time.
//!
//! Invariants: each ray's result has the same bits as if the ray were traced alone. The pyramid is
//! wider than its rays by more than the rounding of the tests. It excludes no box or triangle that
//! a ray may meet. Triangles are tested by the same operations with the same roundings.

use crate::bundle::{ROWS, SLACK, greater};
use crate::node::{Hierarchy, LANES, LEAF, ROW, TriangleBlock, WIDTH};
use crate::prepared::Prepared;
use crate::simd::{Simd, unpack};
use crate::triangle::{Located, consider, inside_exactly, locate_row};
use crate::{Hit, NO_TRIANGLE};

pub(crate) use crate::bundle::Bundle;

/// Number of candidate rays in a row from which their hits are computed together.
const MANY: u32 = 3;

/// The nearest hits so far, as a structure of arrays. Without a hit there is no triangle, and `t`
/// is the end of the ray.
struct Best {
    t: [[f32; ROW]; ROWS],
    triangle: [[u32; ROW]; ROWS],
    u: [[f32; ROW]; ROWS],
    v: [[f32; ROW]; ROWS],
    /// Distance along the main axis up to which hits count; 0 for unused rays.
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

    /// Returns the depth beyond which nothing counts for any ray.
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

/// Finds the nearest hits of a bundle's rays.
#[inline(always)]
pub(crate) fn traverse_tile<S: Simd, const STACK: usize>(
    simd: S,
    hierarchy: &Hierarchy,
    bundle: &Bundle,
    hits: &mut [Option<Hit>],
) {
    let hierarchy = hierarchy.slices();
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
            let (child, near) = unpack(stack[top]);
            if near <= limit * (1.0 + SLACK) + bundle.slack {
                current = child;
                break;
            }
        }
    }
}

/// Tests one triangle against all rays; returns whether any ray hits it.
#[inline(always)]
fn meet<S: Simd>(
    simd: S,
    bundle: &Bundle,
    block: &TriangleBlock,
    lane: usize,
    corners: &[[f32; 3]; 3],
    nearest: f32,
    best: &mut Best,
) -> bool {
    let (triangle, id) = (block.triangle(lane), block.id(lane));
    let mut found = false;
    for (row, rays) in bundle.rays.chunks(ROW).enumerate() {
        let row = row % ROWS;
        let signs = simd.edge_signs_of_rays(corners, &bundle.shear[0][row], &bundle.shear[1][row]);
        let there = u32::MAX >> (u32::BITS as usize - rays.len());
        let mut candidates = (signs.inside | signs.on_edge) & there;
        let mut on_edge = signs.on_edge & there;
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

/// Tests one triangle against one ray that may hit it.
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

/// Tests one triangle against the rays of a row that may hit it: computes their distances together.
///
/// The rays of a tile mostly meet the same few triangles. One by one, this step took two thirds of
/// the time of all rays of a picture.
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
        // The condition of `replace`.
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

    /// Returns a room of large triangles with small ones in it. Narrow pyramids lie wholly inside
    /// large ones.
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
    fn tiles_give_the_same_picture_as_single_rays() {
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
