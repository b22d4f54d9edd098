//! Operations on many boxes or triangles at once, for each instruction set.
//!
//! Invariants: [`Simd::edge_signs`] and its variants give the same bits everywhere.
//! [`Simd::enter`] need not: it is conservative in any rounding, and entering more boxes than
//! necessary does not change a result.

use crate::node::{LANES, ROW, TriangleBlock, TriangleRow, WIDTH, WideNode};
use crate::prepared::Prepared;

/// Rays of a packet, rounded up to the bits of a mask.
pub(crate) const RAYS: usize = 32;

/// Factor for far distances: 1 + 2 γ₃ in f32.
pub(crate) const STRETCH: f32 = 1.0 + 6.0 * f32::EPSILON;

/// Distances of the eight children.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct ChildDistances(pub [f32; WIDTH]);

/// One byte per ray of a packet.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct RayBytes(pub [u8; RAYS]);

/// Farthest distances that still matter, by ray.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct RayLimits(pub [f32; RAYS]);

/// The triangles that a ray may meet, one bit per lane.
#[derive(Clone, Copy)]
pub(crate) struct EdgeSigns {
    /// All edge functions have one sign or are 0.
    pub inside: u32,
    /// Some edge function is 0: more digits are needed.
    pub on_edge: u32,
}

/// Packs a child and the distance of its box, which is not negative. Entries sort as integers by
/// distance.
#[inline(always)]
pub(crate) fn entry(child: u32, near: f32) -> u64 {
    u64::from(near.to_bits()) << 32 | u64::from(child)
}

/// Unpacks an [`entry`].
#[inline(always)]
pub(crate) fn unpack(entry: u64) -> (u32, f32) {
    (entry as u32, f32::from_bits((entry >> 32) as u32))
}

/// Implements [`Simd::stack`] one child at a time; usually there are two or three.
#[inline(always)]
pub(crate) fn stack_scalar<const SORTED: bool>(
    children: &[u32; WIDTH],
    near: &ChildDistances,
    mut mask: u32,
    stack: &mut [u64; WIDTH],
) {
    let mut count = 0;
    while mask != 0 {
        let next = mask.trailing_zeros() as usize % WIDTH;
        mask &= mask - 1;
        let new = entry(children[next], near.0[next]);
        let mut at = count;
        while SORTED && at > 0 && stack[(at - 1) % WIDTH] < new {
            stack[at % WIDTH] = stack[(at - 1) % WIDTH];
            at -= 1;
        }
        stack[at % WIDTH] = new;
        count += 1;
    }
}

/// The operations of one instruction set.
pub(crate) trait Simd: Copy {
    /// Returns the distances at which the ray enters the eight boxes, and one bit per box that it
    /// enters between `t_min` and `t_max`.
    fn enter(
        self,
        node: &WideNode,
        ray: &Prepared,
        t_min: f32,
        t_max: f32,
    ) -> (ChildDistances, u32);

    /// Returns the signs of the edge functions of four triangles.
    fn edge_signs(self, block: &TriangleBlock, ray: &Prepared) -> EdgeSigns;

    /// The same for sixteen triangles, with the same roundings.
    fn edge_signs_of_row(self, row: &TriangleRow, ray: &Prepared) -> EdgeSigns;

    /// The same for one triangle and sixteen rays of one origin, with the same roundings. `corners`
    /// is indexed by vertex; corners are relative to the origin, along the axes of the rays'
    /// shears.
    fn edge_signs_of_rays(
        self,
        corners: &[[f32; 3]; 3],
        shear_x: &[f32; ROW],
        shear_y: &[f32; ROW],
    ) -> EdgeSigns;

    /// Stores the children in `mask` with their distances at the start of `stack`, farthest first
    /// if `SORTED`. The rest of `stack` is undefined.
    fn stack<const SORTED: bool>(
        self,
        children: &[u32; WIDTH],
        near: &ChildDistances,
        mask: u32,
        stack: &mut [u64; WIDTH],
    );

    /// Lowers the distances that are in `mask` to those of `near`.
    fn least(self, so_far: &mut ChildDistances, near: &ChildDistances, mask: u32);

    /// Returns one bit per ray whose limit is at least `near`.
    fn at_least(self, limits: &RayLimits, near: f32) -> u32;

    /// Turns one bit per child for each ray into one bit per ray for each child.
    fn transpose(self, masks: &RayBytes) -> [u32; WIDTH];

    /// Prefetches memory that will be needed soon.
    fn prefetch_node(self, node: &WideNode);
    /// Prefetches memory that will be needed soon.
    fn prefetch_block(self, block: &TriangleBlock);
}

/// Code for any processor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

impl Simd for Portable {
    #[inline(always)]
    fn enter(
        self,
        node: &WideNode,
        ray: &Prepared,
        t_min: f32,
        t_max: f32,
    ) -> (ChildDistances, u32) {
        let max = |a: f32, b: f32| if a > b { a } else { b };
        let min = |a: f32, b: f32| if a < b { a } else { b };
        let mut near = [t_min; WIDTH];
        let mut far = [t_max; WIDTH];
        for axis in 0..3 {
            let base = (node.origin[axis] - ray.origin[axis]) * ray.inverse[axis];
            let step = node.step[axis] * ray.inverse[axis];
            let first = ray.reversed[axis] & 1;
            let (nearer, farther) = (&node.bounds[axis][first], &node.bounds[axis][first + 1]);
            for i in 0..WIDTH {
                near[i] = max(near[i], f32::from(nearer[i]) * step + base);
                far[i] = min(far[i], f32::from(farther[i]) * step + base);
            }
        }
        let mut mask = 0;
        for i in 0..WIDTH {
            mask |= u32::from(near[i] <= far[i] * STRETCH) << i;
        }
        (ChildDistances(near), mask)
    }

    #[inline(always)]
    fn edge_signs(self, block: &TriangleBlock, ray: &Prepared) -> EdgeSigns {
        let [kx, ky, kz] = ray.axes;
        let (rx, ry, rz) =
            (&block.vertices[kx % 3], &block.vertices[ky % 3], &block.vertices[kz % 3]);
        let (ox, oy, oz) = (ray.sheared_origin[0], ray.sheared_origin[1], ray.sheared_origin[2]);
        let mut p = [[[0.0; LANES]; 2]; 3];
        for (vertex, sheared) in p.iter_mut().enumerate() {
            for i in 0..LANES {
                let z = rz[vertex][i] - oz;
                sheared[0][i] = (rx[vertex][i] - ox) - ray.shear[0] * z;
                sheared[1][i] = (ry[vertex][i] - oy) - ray.shear[1] * z;
            }
        }
        let [a, b, c] = &p;
        let (mut inside, mut on_edge) = (0, 0);
        for i in 0..LANES {
            let u = c[0][i] * b[1][i] - c[1][i] * b[0][i];
            let v = a[0][i] * c[1][i] - a[1][i] * c[0][i];
            let w = b[0][i] * a[1][i] - b[1][i] * a[0][i];
            let same =
                ((u >= 0.0) & (v >= 0.0) & (w >= 0.0)) | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0));
            inside |= u32::from(same) << i;
            on_edge |= u32::from((u == 0.0) | (v == 0.0) | (w == 0.0)) << i;
        }
        EdgeSigns { inside, on_edge }
    }

    #[inline(always)]
    fn edge_signs_of_row(self, row: &TriangleRow, ray: &Prepared) -> EdgeSigns {
        let [kx, ky, kz] = ray.axes;
        let (rx, ry, rz) = (&row.vertices[kx % 3], &row.vertices[ky % 3], &row.vertices[kz % 3]);
        let [ox, oy, oz] = ray.sheared_origin;
        let (mut inside, mut on_edge) = (0, 0);
        for i in 0..ROW {
            let sheared = |vertex: usize| {
                let z = rz[vertex][i] - oz;
                [(rx[vertex][i] - ox) - ray.shear[0] * z, (ry[vertex][i] - oy) - ray.shear[1] * z]
            };
            let (a, b, c) = (sheared(0), sheared(1), sheared(2));
            let u = c[0] * b[1] - c[1] * b[0];
            let v = a[0] * c[1] - a[1] * c[0];
            let w = b[0] * a[1] - b[1] * a[0];
            let same =
                ((u >= 0.0) & (v >= 0.0) & (w >= 0.0)) | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0));
            inside |= u32::from(same) << i;
            on_edge |= u32::from((u == 0.0) | (v == 0.0) | (w == 0.0)) << i;
        }
        EdgeSigns { inside, on_edge }
    }

    #[inline(always)]
    fn edge_signs_of_rays(
        self,
        corners: &[[f32; 3]; 3],
        shear_x: &[f32; ROW],
        shear_y: &[f32; ROW],
    ) -> EdgeSigns {
        let (mut inside, mut on_edge) = (0, 0);
        for i in 0..ROW {
            let [a, b, c] = corners.map(|[x, y, z]| [x - shear_x[i] * z, y - shear_y[i] * z]);
            let u = c[0] * b[1] - c[1] * b[0];
            let v = a[0] * c[1] - a[1] * c[0];
            let w = b[0] * a[1] - b[1] * a[0];
            let same =
                ((u >= 0.0) & (v >= 0.0) & (w >= 0.0)) | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0));
            inside |= u32::from(same) << i;
            on_edge |= u32::from((u == 0.0) | (v == 0.0) | (w == 0.0)) << i;
        }
        EdgeSigns { inside, on_edge }
    }

    #[inline(always)]
    fn stack<const SORTED: bool>(
        self,
        children: &[u32; WIDTH],
        near: &ChildDistances,
        mask: u32,
        stack: &mut [u64; WIDTH],
    ) {
        stack_scalar::<SORTED>(children, near, mask, stack);
    }

    #[inline(always)]
    fn least(self, so_far: &mut ChildDistances, near: &ChildDistances, mask: u32) {
        for i in 0..WIDTH {
            if mask >> i & 1 != 0 && near.0[i] < so_far.0[i] {
                so_far.0[i] = near.0[i];
            }
        }
    }

    #[inline(always)]
    fn at_least(self, limits: &RayLimits, near: f32) -> u32 {
        limits
            .0
            .iter()
            .enumerate()
            .fold(0, |bits, (ray, &limit)| bits | u32::from(limit >= near) << ray)
    }

    #[inline(always)]
    fn transpose(self, masks: &RayBytes) -> [u32; WIDTH] {
        let mut turned = [0; WIDTH];
        for (child, turned) in turned.iter_mut().enumerate() {
            for (ray, mask) in masks.0.iter().enumerate() {
                *turned |= u32::from(mask >> child & 1) << ray;
            }
        }
        turned
    }

    #[inline(always)]
    fn prefetch_node(self, _: &WideNode) {}
    #[inline(always)]
    fn prefetch_block(self, _: &TriangleBlock) {}
}
