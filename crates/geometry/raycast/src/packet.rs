//! Traces the rays of a beam together: a node is loaded once for all rays that enter it, and its
//! children are prefetched.
//!
//! Invariants: each ray's result has the same bits as if the ray were traced alone. The ray meets
//! the same boxes and triangles in the same tests. Only the order differs, and results do not
//! depend on it.
//!
//! Gains of tracing together are in docs/notes/ray-casting.md. On small scenes, rays in all
//! directions are faster alone.

use crate::Hit;
use crate::kernel::{Query, advance, prefetch};
use crate::node::{Hierarchy, HierarchySlices, LEAF, WIDTH};
use crate::simd::{ChildDistances, RAYS, RayBytes, RayLimits, STRETCH, Simd, entry, unpack};
use crate::triangle::intersect;

/// A subtree to visit and the rays that enter it.
#[derive(Clone, Copy)]
struct Pending {
    child: u32,
    /// One bit per ray.
    rays: u32,
    /// Least distance at which any of them enters.
    near: f32,
}

/// Number of rays from which a subtree is visited by all of them together. For fewer, testing a box
/// for many rays does not pay.
const SINGLE_RAYS: u32 = 4;
/// Rays that are traversed in turns, so that memory for one arrives while others compute.
const AT_ONCE: usize = 8;

/// The traversal of one ray.
#[derive(Clone, Copy)]
struct Lane {
    ray: usize,
    current: u32,
    top: usize,
}

/// Rays that are traversed alone, in turns.
struct SingleRays<const STACK: usize> {
    lanes: [Lane; AT_ONCE],
    count: usize,
    stacks: [[u64; STACK]; AT_ONCE],
}

impl<const STACK: usize> SingleRays<STACK> {
    #[inline(always)]
    fn add(&mut self, mut rays: u32, child: u32) {
        while rays != 0 {
            self.lanes[self.count % AT_ONCE] =
                Lane { ray: rays.trailing_zeros() as usize % RAYS, current: child, top: 0 };
            self.count += 1;
            rays &= rays - 1;
        }
    }

    #[inline(always)]
    fn run<S: Simd>(
        &mut self,
        simd: S,
        hierarchy: HierarchySlices,
        queries: &[Query],
        best: &mut [Hit; RAYS],
    ) {
        let mut active = (1_u32 << self.count) - 1;
        while active != 0 {
            let mut turn = active;
            while turn != 0 {
                let i = turn.trailing_zeros() as usize % AT_ONCE;
                turn &= turn - 1;
                let Lane { ray, current, top } = &mut self.lanes[i];
                let ray = *ray % RAYS;
                if advance::<S, false, false>(
                    simd,
                    hierarchy,
                    &queries[ray],
                    current,
                    top,
                    &mut self.stacks[i],
                    &mut best[ray],
                ) {
                    prefetch(simd, hierarchy, *current);
                } else {
                    active &= !(1 << i);
                }
            }
        }
    }
}

/// Finds the nearest hits of at most [`RAYS`] queries. `best` holds [`Query::nothing`] of each.
#[inline(always)]
pub(crate) fn traverse_many<S: Simd, const STACK: usize>(
    simd: S,
    hierarchy: &Hierarchy,
    queries: &[Query],
    best: &mut [Hit; RAYS],
) {
    const SLOTS: [u32; WIDTH] = [0, 1, 2, 3, 4, 5, 6, 7];
    let hierarchy = hierarchy.slices();
    let count = queries.len().min(RAYS);
    let mut limits = RayLimits([f32::NEG_INFINITY; RAYS]);
    for (limit, best) in limits.0[..count].iter_mut().zip(best.iter()) {
        *limit = best.t * STRETCH;
    }
    let mut stack = [Pending { child: 0, rays: 0, near: 0.0 }; STACK];
    stack[0].rays = ((1_u64 << count) - 1) as u32;
    let mut top = 1;
    let mut single = SingleRays::<STACK> {
        lanes: [Lane { ray: 0, current: 0, top: 0 }; AT_ONCE],
        count: 0,
        stacks: [[0; STACK]; AT_ONCE],
    };
    while top > 0 {
        top -= 1;
        let Pending { child, rays, near } = stack[top];
        let mut rays = rays & simd.at_least(&limits, near);
        if rays == 0 {
            continue;
        }
        if child & LEAF != 0 {
            let block = &hierarchy.blocks[(child & !LEAF) as usize];
            while rays != 0 {
                let ray = rays.trailing_zeros() as usize % RAYS;
                rays &= rays - 1;
                let query = &queries[ray];
                intersect(simd, block, &query.ray, query.t_min, query.skip, &mut best[ray]);
                limits.0[ray] = best[ray].t * STRETCH;
            }
            continue;
        }
        if rays.count_ones() <= SINGLE_RAYS {
            single.count = 0;
            single.add(rays, child);
            // Add further subtrees of few rays while these are other rays.
            let mut taken = rays;
            while top > 0 {
                let Pending { child, rays, near } = stack[top - 1];
                let rays = rays & simd.at_least(&limits, near);
                let room = single.count + rays.count_ones() as usize <= AT_ONCE;
                if child & LEAF != 0
                    || rays & taken != 0
                    || rays.count_ones() > SINGLE_RAYS
                    || !room
                {
                    break;
                }
                single.add(rays, child);
                taken |= rays;
                top -= 1;
            }
            single.run(simd, hierarchy, queries, best);
            while taken != 0 {
                let ray = taken.trailing_zeros() as usize % RAYS;
                taken &= taken - 1;
                limits.0[ray] = best[ray].t * STRETCH;
            }
            continue;
        }
        let node = &hierarchy.nodes[child as usize];
        let mut least = ChildDistances([f32::INFINITY; WIDTH]);
        let mut masks = RayBytes([0; RAYS]);
        let mut any = 0;
        while rays != 0 {
            let ray = rays.trailing_zeros() as usize % RAYS;
            rays &= rays - 1;
            let query = &queries[ray];
            let (near, mask) = simd.enter(node, &query.ray, query.t_min, best[ray].t);
            simd.least(&mut least, &near, mask);
            masks.0[ray] = mask as u8;
            any |= mask;
        }
        let entered = simd.transpose(&masks);
        let mut order = [entry(0, 0.0); WIDTH];
        simd.stack::<true>(&SLOTS, &least, any, &mut order);
        for &next in &order[..any.count_ones() as usize] {
            let (slot, near) = unpack(next);
            let slot = slot as usize % WIDTH;
            let child = node.children[slot];
            prefetch(simd, hierarchy, child);
            stack[top] = Pending { child, rays: entered[slot], near };
            top += 1;
        }
    }
}
