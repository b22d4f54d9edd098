//! Traversal: from the root, nearest child first, with a stack of fixed size.
//!
//! Always true: a box test is conservative. The computed far distance is stretched by the rounding that the three
//! operations of a slab may have (Ize 2013, "Robust BVH Ray Traversal"), and boxes were padded for the rounding of the
//! triangle test.

use crate::node::{Hierarchy, LEAF, WIDTH};
use crate::triangle::{LaneHit, Prepared, intersect};
use crate::{Hit, NO_TRIANGLE};

/// 1 + 2 γ₃ in f32.
const STRETCH: f32 = 1.0 + 6.0 * f32::EPSILON;

/// What one query asks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Query {
    pub ray: Prepared,
    pub t_min: f32,
    pub t_max: f32,
    /// Triangles that do not count: those that the ray begins and ends on.
    pub skip: [u32; 2],
}

#[derive(Clone, Copy)]
struct Entry {
    child: u32,
    near: f32,
}

/// Distances at which the ray enters the eight boxes, and a bit per box that it enters before `t_max`.
#[inline(always)]
fn enter(bounds: &[[f32; WIDTH]; 6], query: &Query, t_max: f32) -> ([f32; WIDTH], u32) {
    let ray = &query.ray;
    let [ox, oy, oz] = ray.origin;
    let [ix, iy, iz] = ray.inverse;
    let [nx, ny, nz] = ray.near;
    // `near` is 0..6 by construction; the remainder tells the compiler, which then leaves out the bounds checks.
    let row = |i: usize| &bounds[i % 6];
    let (near_x, far_x) = (row(nx), row(nx + 3));
    let (near_y, far_y) = (row(ny), row(ny + 3));
    let (near_z, far_z) = (row(nz), row(nz + 3));
    let max = |a: f32, b: f32| if a > b { a } else { b };
    let min = |a: f32, b: f32| if a < b { a } else { b };
    let mut near = [0.0; WIDTH];
    let mut hit = [0_u32; WIDTH];
    for i in 0..WIDTH {
        let first = max(max((near_x[i] - ox) * ix, (near_y[i] - oy) * iy), max((near_z[i] - oz) * iz, query.t_min));
        let last = min(min((far_x[i] - ox) * ix, (far_y[i] - oy) * iy), (far_z[i] - oz) * iz) * STRETCH;
        near[i] = first;
        hit[i] = u32::from(first <= min(last, t_max)) << i;
    }
    (near, hit.iter().fold(0, |mask, bit| mask | bit))
}

/// Nearest hit, or with `ANY` some hit.
#[inline(always)]
pub(crate) fn traverse<const STACK: usize, const ANY: bool>(hierarchy: &Hierarchy, query: &Query) -> Option<Hit> {
    if hierarchy.nodes.is_empty() {
        return None;
    }
    let mut stack = [Entry { child: 0, near: 0.0 }; STACK];
    let mut top = 0;
    let mut current = Entry { child: 0, near: query.t_min };
    let mut best = LaneHit { t: query.t_max, id: NO_TRIANGLE, u: 0.0, v: 0.0 };
    loop {
        if current.near <= best.t {
            if current.child & LEAF != 0 {
                let block = &hierarchy.blocks[(current.child & !LEAF) as usize];
                intersect(block, &query.ray, query.t_min, best.t, |hit| {
                    if !query.skip.contains(&hit.id) {
                        best = hit;
                    }
                    best.t
                });
                if ANY && best.id != NO_TRIANGLE {
                    break;
                }
            } else {
                let node = &hierarchy.nodes[current.child as usize];
                let (near, mut mask) = enter(&node.bounds, query, best.t);
                if mask != 0 {
                    let first = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    current = Entry { child: node.children[first], near: near[first] };
                    let base = top;
                    while mask != 0 {
                        let next = mask.trailing_zeros() as usize;
                        mask &= mask - 1;
                        let mut entry = Entry { child: node.children[next], near: near[next] };
                        if !ANY {
                            if entry.near < current.near {
                                std::mem::swap(&mut entry, &mut current);
                            }
                            // Insertion sort, farthest at the bottom: two or three entries as a rule.
                            let mut at = top;
                            while at > base && stack[at - 1].near < entry.near {
                                stack[at] = stack[at - 1];
                                at -= 1;
                            }
                            stack[at] = entry;
                        } else {
                            stack[top] = entry;
                        }
                        top += 1;
                    }
                    continue;
                }
            }
        }
        if top == 0 {
            break;
        }
        top -= 1;
        current = stack[top];
    }
    (best.id != NO_TRIANGLE).then_some(Hit { t: best.t, triangle: best.id, u: best.u, v: best.v })
}
