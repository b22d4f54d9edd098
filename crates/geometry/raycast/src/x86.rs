//! The operations of [`Simd`] for AVX2 and AVX-512.
//!
//! Invariants: [`Avx2`] and [`Avx512`] exist only if the processor has these instructions.
//! Products and sums of edge functions are rounded one by one, as in
//! [`Portable`](crate::simd::Portable). Box tests may use fused operations.
//!
//! Rates of the three instruction sets are in docs/notes/ray-casting.md.
#![allow(unsafe_code)]

mod avx512;

use std::arch::x86_64::*;

use holo_cpu::Instructions;

use crate::node::{ROW, TriangleBlock, TriangleRow, WIDTH, WideNode};
use crate::prepared::Prepared;
use crate::simd::{
    ChildDistances, EdgeSigns, RAYS, RayBytes, RayLimits, STRETCH, Simd, stack_scalar,
};

// The functions below have no closures. A closure lacks the target features of its function, so its
// instructions become calls, which is three times slower.

/// Proof that the processor has AVX2, FMA, BMI1 and BMI2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Avx2(());

impl Avx2 {
    pub(crate) fn detect() -> Option<Self> {
        Instructions::Avx2.is_available().then_some(Self(()))
    }
}

/// Proof that the processor also has AVX-512 F, VL, BW and DQ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Avx512(Avx2);

impl Avx512 {
    pub(crate) fn detect() -> Option<Self> {
        Instructions::Avx512.is_available().then_some(Self(Avx2(())))
    }
}

impl Simd for Avx2 {
    #[inline(always)]
    fn enter(
        self,
        node: &WideNode,
        ray: &Prepared,
        t_min: f32,
        t_max: f32,
    ) -> (ChildDistances, u32) {
        // SAFETY: `self` proves AVX2 and FMA. Rows are read 8 bytes at a time at `axis`, `0..=2`,
        // within `bounds`; `ChildDistances` is aligned to 32 bytes.
        unsafe {
            let mut near = _mm256_set1_ps(t_min);
            let mut far = _mm256_set1_ps(t_max);
            for axis in 0..3 {
                let inverse = ray.inverse[axis];
                let base = _mm256_set1_ps((node.origin[axis] - ray.origin[axis]) * inverse);
                let step = _mm256_set1_ps(node.step[axis] * inverse);
                let first = ray.reversed[axis] & 1;
                let nearer = _mm_loadl_epi64(node.bounds[axis][first].as_ptr().cast());
                let farther = _mm_loadl_epi64(node.bounds[axis][first + 1].as_ptr().cast());
                let nearer =
                    _mm256_fmadd_ps(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(nearer)), step, base);
                let farther =
                    _mm256_fmadd_ps(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(farther)), step, base);
                near = _mm256_max_ps(nearer, near);
                far = _mm256_min_ps(farther, far);
            }
            let hit =
                _mm256_cmp_ps::<_CMP_LE_OQ>(near, _mm256_mul_ps(far, _mm256_set1_ps(STRETCH)));
            let mut out = ChildDistances([0.0; WIDTH]);
            _mm256_store_ps(out.0.as_mut_ptr(), near);
            (out, _mm256_movemask_ps(hit) as u32)
        }
    }

    #[inline(always)]
    fn edge_signs(self, block: &TriangleBlock, ray: &Prepared) -> EdgeSigns {
        // SAFETY: `self` proves AVX2. Every load reads four lanes of one vertex.
        unsafe {
            let [kx, ky, kz] = ray.axes;
            let (rx, ry, rz) =
                (&block.vertices[kx % 3], &block.vertices[ky % 3], &block.vertices[kz % 3]);
            let [ox, oy, oz] = ray.sheared_origin;
            let (ox, oy, oz) = (_mm_set1_ps(ox), _mm_set1_ps(oy), _mm_set1_ps(oz));
            let (sx, sy) = (_mm_set1_ps(ray.shear[0]), _mm_set1_ps(ray.shear[1]));
            let mut x = [_mm_setzero_ps(); 3];
            let mut y = x;
            for vertex in 0..3 {
                let z = _mm_sub_ps(_mm_load_ps(rz[vertex].as_ptr()), oz);
                let across = _mm_sub_ps(_mm_load_ps(rx[vertex].as_ptr()), ox);
                let up = _mm_sub_ps(_mm_load_ps(ry[vertex].as_ptr()), oy);
                x[vertex] = _mm_sub_ps(across, _mm_mul_ps(sx, z));
                y[vertex] = _mm_sub_ps(up, _mm_mul_ps(sy, z));
            }
            let u = _mm_sub_ps(_mm_mul_ps(x[2], y[1]), _mm_mul_ps(y[2], x[1]));
            let v = _mm_sub_ps(_mm_mul_ps(x[0], y[2]), _mm_mul_ps(y[0], x[2]));
            let w = _mm_sub_ps(_mm_mul_ps(x[1], y[0]), _mm_mul_ps(y[1], x[0]));
            let zero = _mm_setzero_ps();
            let above = _mm_and_ps(
                _mm_and_ps(_mm_cmpge_ps(u, zero), _mm_cmpge_ps(v, zero)),
                _mm_cmpge_ps(w, zero),
            );
            let below = _mm_and_ps(
                _mm_and_ps(_mm_cmple_ps(u, zero), _mm_cmple_ps(v, zero)),
                _mm_cmple_ps(w, zero),
            );
            let on = _mm_or_ps(
                _mm_or_ps(_mm_cmpeq_ps(u, zero), _mm_cmpeq_ps(v, zero)),
                _mm_cmpeq_ps(w, zero),
            );
            EdgeSigns {
                inside: _mm_movemask_ps(_mm_or_ps(above, below)) as u32,
                on_edge: _mm_movemask_ps(on) as u32,
            }
        }
    }

    #[inline(always)]
    fn edge_signs_of_row(self, row: &TriangleRow, ray: &Prepared) -> EdgeSigns {
        // SAFETY: `self` proves AVX2. Loads read lanes 0 to 7 and 8 to 15 of a vertex, aligned to
        // 32 bytes.
        unsafe {
            let [kx, ky, kz] = ray.axes;
            let (rx, ry, rz) =
                (&row.vertices[kx % 3], &row.vertices[ky % 3], &row.vertices[kz % 3]);
            let [ox, oy, oz] = ray.sheared_origin;
            let (ox, oy, oz) = (_mm256_set1_ps(ox), _mm256_set1_ps(oy), _mm256_set1_ps(oz));
            let (sx, sy) = (_mm256_set1_ps(ray.shear[0]), _mm256_set1_ps(ray.shear[1]));
            let (mut inside, mut on_edge) = (0, 0);
            for half in 0..2 {
                let mut x = [_mm256_setzero_ps(); 3];
                let mut y = x;
                for vertex in 0..3 {
                    let z = _mm256_sub_ps(_mm256_load_ps(rz[vertex].as_ptr().add(8 * half)), oz);
                    let across =
                        _mm256_sub_ps(_mm256_load_ps(rx[vertex].as_ptr().add(8 * half)), ox);
                    let up = _mm256_sub_ps(_mm256_load_ps(ry[vertex].as_ptr().add(8 * half)), oy);
                    x[vertex] = _mm256_sub_ps(across, _mm256_mul_ps(sx, z));
                    y[vertex] = _mm256_sub_ps(up, _mm256_mul_ps(sy, z));
                }
                let (within, on) = signs256(x, y);
                inside |= within << (8 * half);
                on_edge |= on << (8 * half);
            }
            EdgeSigns { inside, on_edge }
        }
    }

    #[inline(always)]
    fn edge_signs_of_rays(
        self,
        corners: &[[f32; 3]; 3],
        shear_x: &[f32; ROW],
        shear_y: &[f32; ROW],
    ) -> EdgeSigns {
        // SAFETY: `self` proves AVX2. Loads read the first and the last eight of sixteen numbers.
        unsafe {
            let (mut inside, mut on_edge) = (0, 0);
            for half in 0..2 {
                let sx = _mm256_loadu_ps(shear_x.as_ptr().add(8 * half));
                let sy = _mm256_loadu_ps(shear_y.as_ptr().add(8 * half));
                let mut x = [_mm256_setzero_ps(); 3];
                let mut y = x;
                for (vertex, &[across, up, z]) in corners.iter().enumerate() {
                    let z = _mm256_set1_ps(z);
                    x[vertex] = _mm256_sub_ps(_mm256_set1_ps(across), _mm256_mul_ps(sx, z));
                    y[vertex] = _mm256_sub_ps(_mm256_set1_ps(up), _mm256_mul_ps(sy, z));
                }
                let (within, on) = signs256(x, y);
                inside |= within << (8 * half);
                on_edge |= on << (8 * half);
            }
            EdgeSigns { inside, on_edge }
        }
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
        // SAFETY: `self` proves AVX2; `ChildDistances` is aligned to 32 bytes.
        unsafe {
            let bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let chosen =
                _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bit), bit);
            let old = _mm256_load_ps(so_far.0.as_ptr());
            let less = _mm256_min_ps(old, _mm256_load_ps(near.0.as_ptr()));
            _mm256_store_ps(
                so_far.0.as_mut_ptr(),
                _mm256_blendv_ps(old, less, _mm256_castsi256_ps(chosen)),
            );
        }
    }

    #[inline(always)]
    fn at_least(self, limits: &RayLimits, near: f32) -> u32 {
        // SAFETY: `self` proves AVX2; `RayLimits` is four rows of eight, aligned.
        unsafe {
            let near = _mm256_set1_ps(near);
            let mut bits = 0;
            for row in 0..RAYS / 8 {
                let limits = _mm256_load_ps(limits.0.as_ptr().add(8 * row));
                bits |= (_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(limits, near)) as u32)
                    << (8 * row);
            }
            bits
        }
    }

    #[inline(always)]
    fn transpose(self, masks: &RayBytes) -> [u32; WIDTH] {
        const _: () = assert!(RAYS == 32);
        // SAFETY: `self` proves AVX2; `RayBytes` is 32 bytes aligned to 32.
        unsafe {
            let bytes = _mm256_load_si256(masks.0.as_ptr().cast());
            // Shifts bit c of each byte to the top. Bits from the neighbouring byte land below it.
            [
                _mm256_movemask_epi8(_mm256_slli_epi64::<7>(bytes)) as u32,
                _mm256_movemask_epi8(_mm256_slli_epi64::<6>(bytes)) as u32,
                _mm256_movemask_epi8(_mm256_slli_epi64::<5>(bytes)) as u32,
                _mm256_movemask_epi8(_mm256_slli_epi64::<4>(bytes)) as u32,
                _mm256_movemask_epi8(_mm256_slli_epi64::<3>(bytes)) as u32,
                _mm256_movemask_epi8(_mm256_slli_epi64::<2>(bytes)) as u32,
                _mm256_movemask_epi8(_mm256_slli_epi64::<1>(bytes)) as u32,
                _mm256_movemask_epi8(bytes) as u32,
            ]
        }
    }

    #[inline(always)]
    fn prefetch_node(self, node: &WideNode) {
        let start: *const WideNode = node;
        // SAFETY: prefetching has no effect on memory, and both lines belong to the node.
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(start.cast());
            _mm_prefetch::<_MM_HINT_T0>(start.cast::<i8>().add(64));
        }
    }

    #[inline(always)]
    fn prefetch_block(self, block: &TriangleBlock) {
        let start: *const TriangleBlock = block;
        // SAFETY: prefetching has no effect on memory, and the three lines belong to the block.
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(start.cast());
            _mm_prefetch::<_MM_HINT_T0>(start.cast::<i8>().add(64));
            _mm_prefetch::<_MM_HINT_T0>(start.cast::<i8>().add(128));
        }
    }
}

/// Returns two masks of eight triangles or rays, from the sheared vertices. In the first, all edge
/// functions have one sign or are 0. In the second, some edge function is 0.
///
/// # Safety
/// The processor has AVX2.
#[inline(always)]
unsafe fn signs256(x: [__m256; 3], y: [__m256; 3]) -> (u32, u32) {
    // SAFETY: as the caller promises.
    unsafe {
        let zero = _mm256_setzero_ps();
        let u = _mm256_sub_ps(_mm256_mul_ps(x[2], y[1]), _mm256_mul_ps(y[2], x[1]));
        let v = _mm256_sub_ps(_mm256_mul_ps(x[0], y[2]), _mm256_mul_ps(y[0], x[2]));
        let w = _mm256_sub_ps(_mm256_mul_ps(x[1], y[0]), _mm256_mul_ps(y[1], x[0]));
        let above = _mm256_and_ps(
            _mm256_and_ps(
                _mm256_cmp_ps::<_CMP_GE_OQ>(u, zero),
                _mm256_cmp_ps::<_CMP_GE_OQ>(v, zero),
            ),
            _mm256_cmp_ps::<_CMP_GE_OQ>(w, zero),
        );
        let below = _mm256_and_ps(
            _mm256_and_ps(
                _mm256_cmp_ps::<_CMP_LE_OQ>(u, zero),
                _mm256_cmp_ps::<_CMP_LE_OQ>(v, zero),
            ),
            _mm256_cmp_ps::<_CMP_LE_OQ>(w, zero),
        );
        let on = _mm256_or_ps(
            _mm256_or_ps(
                _mm256_cmp_ps::<_CMP_EQ_OQ>(u, zero),
                _mm256_cmp_ps::<_CMP_EQ_OQ>(v, zero),
            ),
            _mm256_cmp_ps::<_CMP_EQ_OQ>(w, zero),
        );
        (_mm256_movemask_ps(_mm256_or_ps(above, below)) as u32, _mm256_movemask_ps(on) as u32)
    }
}
