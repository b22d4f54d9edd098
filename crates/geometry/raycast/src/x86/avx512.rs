//! The operations of [`Simd`] for AVX-512.
#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::Avx512;
use crate::node::{ROW, TriangleBlock, TriangleRow, WIDTH, WideNode};
use crate::prepared::Prepared;
use crate::simd::{ChildDistances, EdgeSigns, RayBytes, RayLimits, STRETCH, Simd};

// There are no closures, for the reason given in the parent module.

impl Simd for Avx512 {
    /// Puts near distances in the lower half of a register and negated far ones in the upper half,
    /// so that one maximum serves both.
    #[inline(always)]
    fn enter(
        self,
        node: &WideNode,
        ray: &Prepared,
        t_min: f32,
        t_max: f32,
    ) -> (ChildDistances, u32) {
        const UPPER: u16 = 0xff00;
        // SAFETY: `self` proves AVX-512. Sixteen bytes are read at row 0 or 1 of the three rows of
        // eight; `ChildDistances` is aligned.
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
            let mut out = ChildDistances([0.0; WIDTH]);
            _mm256_store_ps(out.0.as_mut_ptr(), near);
            (out, u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(near, far)))
        }
    }

    /// Puts the three vertices of the four triangles in one register, and the three edge functions
    /// in another.
    #[inline(always)]
    fn edge_signs(self, block: &TriangleBlock, ray: &Prepared) -> EdgeSigns {
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
            // From vertices a, b, c: c, a, b and b, c, a.
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
            EdgeSigns { inside: inside & 15, on_edge: (on | on >> 4 | on >> 8) & 15 }
        }
    }

    #[inline(always)]
    fn edge_signs_of_row(self, row: &TriangleRow, ray: &Prepared) -> EdgeSigns {
        // SAFETY: `self` proves AVX-512. Loads read the 64 bytes of a vertex, aligned to 64.
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
    fn edge_signs_of_rays(
        self,
        corners: &[[f32; 3]; 3],
        shear_x: &[f32; ROW],
        shear_y: &[f32; ROW],
    ) -> EdgeSigns {
        // SAFETY: `self` proves AVX-512. Loads read sixteen numbers.
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

    /// Sorts by a bitonic network of six steps, whose time does not depend on the input. Insertion
    /// sort was as fast within the noise.
    #[inline(always)]
    fn stack<const SORTED: bool>(
        self,
        children: &[u32; WIDTH],
        near: &ChildDistances,
        mask: u32,
        stack: &mut [u64; WIDTH],
    ) {
        // SAFETY: `self` proves AVX-512; `ChildDistances` is aligned to 32 bytes, the others are
        // read and written unaligned.
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
                // The usual case.
                let two = _mm512_castsi512_si128(_mm512_maskz_compress_epi64(mask as u8, entries));
                let swapped = _mm_shuffle_epi32::<0b01_00_11_10>(two);
                let sorted = _mm_mask_min_epu64(_mm_max_epu64(two, swapped), 0b10, two, swapped);
                _mm_storeu_si128(stack.as_mut_ptr().cast(), sorted);
                return;
            }
            // Entries outside the mask become 0 and sort last.
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
    fn least(self, so_far: &mut ChildDistances, near: &ChildDistances, mask: u32) {
        // SAFETY: `self` proves AVX-512; `ChildDistances` is aligned to 32 bytes.
        unsafe {
            let old = _mm256_load_ps(so_far.0.as_ptr());
            let less = _mm256_mask_min_ps(old, mask as u8, old, _mm256_load_ps(near.0.as_ptr()));
            _mm256_store_ps(so_far.0.as_mut_ptr(), less);
        }
    }

    #[inline(always)]
    fn at_least(self, limits: &RayLimits, near: f32) -> u32 {
        // SAFETY: `self` proves AVX-512; `RayLimits` is two rows of sixteen, aligned.
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
    fn prefetch_node(self, node: &WideNode) {
        self.0.prefetch_node(node);
    }

    #[inline(always)]
    fn prefetch_block(self, block: &TriangleBlock) {
        self.0.prefetch_block(block);
    }
}

/// Returns the signs of the edge functions of sixteen triangles or rays, from the sheared vertices.
///
/// # Safety
/// The processor has AVX-512 F and DQ.
#[inline(always)]
unsafe fn signs512(x: [__m512; 3], y: [__m512; 3]) -> EdgeSigns {
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
        EdgeSigns { inside: u32::from(inside), on_edge: u32::from(on_edge) }
    }
}
