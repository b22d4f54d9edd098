//! The same for AVX2 and for AVX-512.
//!
//! Always true: [`Avx2`] and [`Avx512`] exist only after the processor said that it has these instructions. Products and sums of
//! edge functions are rounded one by one, as in [`Portable`](crate::simd::Portable); boxes may use fused operations.
//!
//! Measured on Zen 5, one ray at a time, 960 triangles: portable 4.2, AVX2 5.5, AVX-512 5.7 M rays/s. A visit takes some 20 ns for a few
//! dozen instructions: probably mispredicted branches and the chain from a box test to the next node's address, not arithmetic.
#![allow(unsafe_code)]

use std::arch::x86_64::*;

use holo_cpu::Instructions;

use crate::node::{Block, Node, ROW, Row, WIDTH};
use crate::packet::Limits;
use crate::simd::{Near, RAYS, RayBytes, STRETCH, Simd, Straddled, stack_scalar};
use crate::triangle::Prepared;

// No closures below: a closure has no target features of its own, and the instructions in it become calls (three times slower).

/// Proof that the processor has AVX2, FMA, BMI1 and BMI2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Avx2(());

impl Avx2 {
    pub(crate) fn detect() -> Option<Self> {
        Instructions::Avx2.is_available().then_some(Self(()))
    }
}

/// Proof that the processor has AVX-512 F, VL, BW and DQ as well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Avx512(Avx2);

impl Avx512 {
    pub(crate) fn detect() -> Option<Self> {
        Instructions::Avx512.is_available().then_some(Self(Avx2(())))
    }
}

impl Simd for Avx2 {
    #[inline(always)]
    fn enter(self, node: &Node, ray: &Prepared, t_min: f32, t_max: f32) -> (Near, u32) {
        // SAFETY: `self` proves AVX2 and FMA. Rows are read 8 bytes at a time at `axis`, `0..=2`, within `bounds`; `Near` is
        // aligned to 32 bytes.
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
            let mut out = Near([0.0; WIDTH]);
            _mm256_store_ps(out.0.as_mut_ptr(), near);
            (out, _mm256_movemask_ps(hit) as u32)
        }
    }

    #[inline(always)]
    fn straddled(self, block: &Block, ray: &Prepared) -> Straddled {
        // SAFETY: `self` proves AVX2. Every load is of four lanes of one vertex.
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
            Straddled {
                inside: _mm_movemask_ps(_mm_or_ps(above, below)) as u32,
                on_edge: _mm_movemask_ps(on) as u32,
            }
        }
    }

    #[inline(always)]
    fn straddled_row(self, row: &Row, ray: &Prepared) -> Straddled {
        // SAFETY: `self` proves AVX2. Loads are of lanes 0 to 7 and 8 to 15 of a vertex, aligned to 32 bytes.
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
            Straddled { inside, on_edge }
        }
    }

    #[inline(always)]
    fn straddled_rays(
        self,
        corners: &[[f32; 3]; 3],
        shear_x: &[f32; ROW],
        shear_y: &[f32; ROW],
    ) -> Straddled {
        // SAFETY: `self` proves AVX2. Loads are of the first and the last eight of sixteen numbers.
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
            Straddled { inside, on_edge }
        }
    }

    #[inline(always)]
    fn stack<const SORTED: bool>(
        self,
        children: &[u32; WIDTH],
        near: &Near,
        mask: u32,
        stack: &mut [u64; WIDTH],
    ) {
        stack_scalar::<SORTED>(children, near, mask, stack);
    }

    #[inline(always)]
    fn least(self, so_far: &mut Near, near: &Near, mask: u32) {
        // SAFETY: `self` proves AVX2; `Near` is aligned to 32 bytes.
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
    fn at_least(self, limits: &Limits, near: f32) -> u32 {
        // SAFETY: `self` proves AVX2; `Limits` is four rows of eight, aligned.
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
            // Bit c of each byte becomes the topmost one; what crosses into the neighbour lands below it.
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
    fn prefetch_node(self, node: &Node) {
        let start: *const Node = node;
        // SAFETY: prefetching has no effect on memory, and both lines are of the node.
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(start.cast());
            _mm_prefetch::<_MM_HINT_T0>(start.cast::<i8>().add(64));
        }
    }

    #[inline(always)]
    fn prefetch_block(self, block: &Block) {
        let start: *const Block = block;
        // SAFETY: prefetching has no effect on memory, and the three lines are of the block.
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(start.cast());
            _mm_prefetch::<_MM_HINT_T0>(start.cast::<i8>().add(64));
            _mm_prefetch::<_MM_HINT_T0>(start.cast::<i8>().add(128));
        }
    }
}

impl Simd for Avx512 {
    /// Near distances in the lower half of a register and negated far ones in the upper, so that one maximum serves both.
    #[inline(always)]
    fn enter(self, node: &Node, ray: &Prepared, t_min: f32, t_max: f32) -> (Near, u32) {
        const UPPER: u16 = 0xff00;
        // SAFETY: `self` proves AVX-512. Sixteen bytes are read at row 0 or 1 of the three rows of eight; `Near` is aligned.
        unsafe {
            let limits = _mm512_mask_mov_ps(_mm512_set1_ps(t_min), UPPER, _mm512_set1_ps(-t_max));
            let sign = _mm512_castsi512_ps(_mm512_maskz_set1_epi32(UPPER, i32::MIN));
            let mut rows = [limits; 3];
            for (axis, row) in rows.iter_mut().enumerate() {
                let inverse = _mm512_xor_ps(_mm512_set1_ps(ray.inverse[axis]), sign);
                let from = _mm512_sub_ps(
                    _mm512_set1_ps(node.origin[axis]),
                    _mm512_set1_ps(ray.origin[axis]),
                );
                let step = _mm512_mul_ps(_mm512_set1_ps(node.step[axis]), inverse);
                let bytes =
                    node.bounds[axis].as_ptr().cast::<u8>().add(WIDTH * (ray.reversed[axis] & 1));
                let bytes = _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(_mm_loadu_si128(bytes.cast())));
                *row = _mm512_fmadd_ps(bytes, step, _mm512_mul_ps(from, inverse));
            }
            let limits =
                _mm512_max_ps(_mm512_max_ps(rows[0], rows[1]), _mm512_max_ps(rows[2], limits));
            let near = _mm512_castps512_ps256(limits);
            let far = _mm256_mul_ps(_mm512_extractf32x8_ps::<1>(limits), _mm256_set1_ps(-STRETCH));
            let mut out = Near([0.0; WIDTH]);
            _mm256_store_ps(out.0.as_mut_ptr(), near);
            (out, u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(near, far)))
        }
    }

    /// The three vertices of the four triangles in one register, the three edge functions in another.
    #[inline(always)]
    fn straddled(self, block: &Block, ray: &Prepared) -> Straddled {
        // SAFETY: `self` proves AVX-512. A row of a block is 64 bytes, aligned to 64.
        unsafe {
            let [kx, ky, kz] = ray.axes;
            let [ox, oy, oz] = ray.sheared_origin;
            let z = _mm512_sub_ps(
                _mm512_load_ps(block.vertices[kz % 3].as_ptr().cast()),
                _mm512_set1_ps(oz),
            );
            let x = _mm512_sub_ps(
                _mm512_load_ps(block.vertices[kx % 3].as_ptr().cast()),
                _mm512_set1_ps(ox),
            );
            let y = _mm512_sub_ps(
                _mm512_load_ps(block.vertices[ky % 3].as_ptr().cast()),
                _mm512_set1_ps(oy),
            );
            let x = _mm512_sub_ps(x, _mm512_mul_ps(_mm512_set1_ps(ray.shear[0]), z));
            let y = _mm512_sub_ps(y, _mm512_mul_ps(_mm512_set1_ps(ray.shear[1]), z));
            // Of vertices a, b, c: c, a, b and b, c, a.
            let (x1, y1) = (
                _mm512_shuffle_f32x4::<0b11_01_00_10>(x, x),
                _mm512_shuffle_f32x4::<0b11_01_00_10>(y, y),
            );
            let (x2, y2) = (
                _mm512_shuffle_f32x4::<0b11_00_10_01>(x, x),
                _mm512_shuffle_f32x4::<0b11_00_10_01>(y, y),
            );
            let edges = _mm512_sub_ps(_mm512_mul_ps(x1, y2), _mm512_mul_ps(y1, x2));
            let zero = _mm512_setzero_ps();
            let above = u32::from(_mm512_cmp_ps_mask::<_CMP_GE_OQ>(edges, zero));
            let below = u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(edges, zero));
            let on = above & below;
            let inside = (above & above >> 4 & above >> 8) | (below & below >> 4 & below >> 8);
            Straddled { inside: inside & 15, on_edge: (on | on >> 4 | on >> 8) & 15 }
        }
    }

    #[inline(always)]
    fn straddled_row(self, row: &Row, ray: &Prepared) -> Straddled {
        // SAFETY: `self` proves AVX-512. Loads are of the 64 bytes of a vertex, aligned to them.
        unsafe {
            let [kx, ky, kz] = ray.axes;
            let (rx, ry, rz) =
                (&row.vertices[kx % 3], &row.vertices[ky % 3], &row.vertices[kz % 3]);
            let [ox, oy, oz] = ray.sheared_origin;
            let (ox, oy, oz) = (_mm512_set1_ps(ox), _mm512_set1_ps(oy), _mm512_set1_ps(oz));
            let (sx, sy) = (_mm512_set1_ps(ray.shear[0]), _mm512_set1_ps(ray.shear[1]));
            let mut x = [_mm512_setzero_ps(); 3];
            let mut y = x;
            for vertex in 0..3 {
                let z = _mm512_sub_ps(_mm512_load_ps(rz[vertex].as_ptr()), oz);
                let across = _mm512_sub_ps(_mm512_load_ps(rx[vertex].as_ptr()), ox);
                let up = _mm512_sub_ps(_mm512_load_ps(ry[vertex].as_ptr()), oy);
                x[vertex] = _mm512_sub_ps(across, _mm512_mul_ps(sx, z));
                y[vertex] = _mm512_sub_ps(up, _mm512_mul_ps(sy, z));
            }
            signs512(x, y)
        }
    }

    #[inline(always)]
    fn straddled_rays(
        self,
        corners: &[[f32; 3]; 3],
        shear_x: &[f32; ROW],
        shear_y: &[f32; ROW],
    ) -> Straddled {
        // SAFETY: `self` proves AVX-512. Loads are of sixteen numbers.
        unsafe {
            let (sx, sy) = (_mm512_loadu_ps(shear_x.as_ptr()), _mm512_loadu_ps(shear_y.as_ptr()));
            let mut x = [_mm512_setzero_ps(); 3];
            let mut y = x;
            for (vertex, &[across, up, z]) in corners.iter().enumerate() {
                let z = _mm512_set1_ps(z);
                x[vertex] = _mm512_sub_ps(_mm512_set1_ps(across), _mm512_mul_ps(sx, z));
                y[vertex] = _mm512_sub_ps(_mm512_set1_ps(up), _mm512_mul_ps(sy, z));
            }
            signs512(x, y)
        }
    }

    /// A bitonic network of six steps, whose time does not depend on what is to be sorted. Insertion was as fast within the noise.
    #[inline(always)]
    fn stack<const SORTED: bool>(
        self,
        children: &[u32; WIDTH],
        near: &Near,
        mask: u32,
        stack: &mut [u64; WIDTH],
    ) {
        // SAFETY: `self` proves AVX-512; `Near` is aligned to 32 bytes, the others are read and written unaligned.
        unsafe {
            let near = _mm512_cvtepu32_epi64(_mm256_load_si256(near.0.as_ptr().cast()));
            let child = _mm512_cvtepu32_epi64(_mm256_loadu_si256(children.as_ptr().cast()));
            let entries = _mm512_or_si512(_mm512_slli_epi64::<32>(near), child);
            if !SORTED {
                _mm512_storeu_si512(
                    stack.as_mut_ptr().cast(),
                    _mm512_maskz_compress_epi64(mask as u8, entries),
                );
                return;
            }
            if mask.count_ones() == 2 {
                // As a rule.
                let two = _mm512_castsi512_si128(_mm512_maskz_compress_epi64(mask as u8, entries));
                let swapped = _mm_shuffle_epi32::<0b01_00_11_10>(two);
                let sorted = _mm_mask_min_epu64(_mm_max_epu64(two, swapped), 0b10, two, swapped);
                _mm_storeu_si128(stack.as_mut_ptr().cast(), sorted);
                return;
            }
            // What is not in the mask becomes 0 and goes last.
            let v = _mm512_maskz_mov_epi64(mask as u8, entries);
            let s = _mm512_permutex_epi64::<0b10_11_00_01>(v);
            let v = _mm512_mask_min_epu64(_mm512_max_epu64(v, s), 0b1010_1010, v, s);
            let s = _mm512_permutex_epi64::<0b00_01_10_11>(v);
            let v = _mm512_mask_min_epu64(_mm512_max_epu64(v, s), 0b1100_1100, v, s);
            let s = _mm512_permutex_epi64::<0b10_11_00_01>(v);
            let v = _mm512_mask_min_epu64(_mm512_max_epu64(v, s), 0b1010_1010, v, s);
            let s = _mm512_permutexvar_epi64(_mm512_setr_epi64(7, 6, 5, 4, 3, 2, 1, 0), v);
            let v = _mm512_mask_min_epu64(_mm512_max_epu64(v, s), 0b1111_0000, v, s);
            let s = _mm512_permutex_epi64::<0b01_00_11_10>(v);
            let v = _mm512_mask_min_epu64(_mm512_max_epu64(v, s), 0b1100_1100, v, s);
            let s = _mm512_permutex_epi64::<0b10_11_00_01>(v);
            let v = _mm512_mask_min_epu64(_mm512_max_epu64(v, s), 0b1010_1010, v, s);
            _mm512_storeu_si512(stack.as_mut_ptr().cast(), v);
        }
    }

    #[inline(always)]
    fn least(self, so_far: &mut Near, near: &Near, mask: u32) {
        // SAFETY: `self` proves AVX-512; `Near` is aligned to 32 bytes.
        unsafe {
            let old = _mm256_load_ps(so_far.0.as_ptr());
            let less = _mm256_mask_min_ps(old, mask as u8, old, _mm256_load_ps(near.0.as_ptr()));
            _mm256_store_ps(so_far.0.as_mut_ptr(), less);
        }
    }

    #[inline(always)]
    fn at_least(self, limits: &Limits, near: f32) -> u32 {
        // SAFETY: `self` proves AVX-512; `Limits` is two rows of sixteen, aligned.
        unsafe {
            let near = _mm512_set1_ps(near);
            let low = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(_mm512_load_ps(limits.0.as_ptr()), near);
            let high =
                _mm512_cmp_ps_mask::<_CMP_GE_OQ>(_mm512_load_ps(limits.0.as_ptr().add(16)), near);
            u32::from(low) | u32::from(high) << 16
        }
    }

    #[inline(always)]
    fn transpose(self, masks: &RayBytes) -> [u32; WIDTH] {
        self.0.transpose(masks)
    }

    #[inline(always)]
    fn prefetch_node(self, node: &Node) {
        self.0.prefetch_node(node);
    }

    #[inline(always)]
    fn prefetch_block(self, block: &Block) {
        self.0.prefetch_block(block);
    }
}

/// Which of eight triangles' or rays' edge functions have one sign, and of which one is 0, from the sheared vertices.
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

/// The same of sixteen.
///
/// # Safety
/// The processor has AVX-512 F and DQ.
#[inline(always)]
unsafe fn signs512(x: [__m512; 3], y: [__m512; 3]) -> Straddled {
    // SAFETY: as the caller promises.
    unsafe {
        let zero = _mm512_setzero_ps();
        let u = _mm512_sub_ps(_mm512_mul_ps(x[2], y[1]), _mm512_mul_ps(y[2], x[1]));
        let v = _mm512_sub_ps(_mm512_mul_ps(x[0], y[2]), _mm512_mul_ps(y[0], x[2]));
        let w = _mm512_sub_ps(_mm512_mul_ps(x[1], y[0]), _mm512_mul_ps(y[1], x[0]));
        let above = [
            _mm512_cmp_ps_mask::<_CMP_GE_OQ>(u, zero),
            _mm512_cmp_ps_mask::<_CMP_GE_OQ>(v, zero),
            _mm512_cmp_ps_mask::<_CMP_GE_OQ>(w, zero),
        ];
        let below = [
            _mm512_cmp_ps_mask::<_CMP_LE_OQ>(u, zero),
            _mm512_cmp_ps_mask::<_CMP_LE_OQ>(v, zero),
            _mm512_cmp_ps_mask::<_CMP_LE_OQ>(w, zero),
        ];
        let inside = (above[0] & above[1] & above[2]) | (below[0] & below[1] & below[2]);
        let on_edge = (above[0] & below[0]) | (above[1] & below[1]) | (above[2] & below[2]);
        Straddled { inside: u32::from(inside), on_edge: u32::from(on_edge) }
    }
}
