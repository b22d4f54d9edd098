//! Sixteen records of sixteen words become sixteen rows of one word each, and back: records lie together where they are kept, and are worked
//! on side by side.
//!
//! Written with the processor's own instructions where there are any: 64 shuffles with AVX-512. Of the same loop over places the compiler, in
//! large kernels, makes moves of single words.
//!
//! Always true: the same words, whichever instructions move them.

use super::isa::{Instructions, Isa};

/// Records side by side, and words of each.
pub(crate) const WORDS: usize = 16;
/// A word of each record.
pub(crate) type Words = [u32; WORDS];

impl Isa {
    /// The words of sixteen records by their place: row after row, a word of each record.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn transpose(self, records: [&Words; WORDS], rows: &mut [Words; WORDS]) {
        match self.instructions() {
            // SAFETY: the value proves that the processor has AVX-512 F.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => unsafe { x86::transpose_16(records, rows) },
            // SAFETY: the value proves that the processor has AVX2.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => unsafe { x86::transpose_8(records, rows) },
            _ => {
                for (word, row) in rows.iter_mut().enumerate() {
                    row.iter_mut().zip(records).for_each(|(place, record)| *place = record[word]);
                }
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{WORDS, Words};
    use bytemuck::cast;
    use std::arch::x86_64::*;

    /// Words, then pairs of them, within quarters of a row, then the quarters themselves.
    #[inline]
    #[target_feature(enable = "avx512f")]
    pub fn transpose_16(records: [&Words; WORDS], rows: &mut [Words; WORDS]) {
        let mut all = [_mm512_setzero_si512(); WORDS];
        for at in 0..WORDS {
            all[at] = cast(*records[at]);
        }
        let mut fours = all;
        for at in (0..WORDS).step_by(4) {
            let low = _mm512_unpacklo_epi32(all[at], all[at + 1]);
            let high = _mm512_unpackhi_epi32(all[at], all[at + 1]);
            let low_more = _mm512_unpacklo_epi32(all[at + 2], all[at + 3]);
            let high_more = _mm512_unpackhi_epi32(all[at + 2], all[at + 3]);
            fours[at] = _mm512_unpacklo_epi64(low, low_more);
            fours[at + 1] = _mm512_unpackhi_epi64(low, low_more);
            fours[at + 2] = _mm512_unpacklo_epi64(high, high_more);
            fours[at + 3] = _mm512_unpackhi_epi64(high, high_more);
        }
        for at in 0..4 {
            let low = _mm512_shuffle_i32x4::<0b01_00_01_00>(fours[at], fours[at + 4]);
            let low_more = _mm512_shuffle_i32x4::<0b01_00_01_00>(fours[at + 8], fours[at + 12]);
            let high = _mm512_shuffle_i32x4::<0b11_10_11_10>(fours[at], fours[at + 4]);
            let high_more = _mm512_shuffle_i32x4::<0b11_10_11_10>(fours[at + 8], fours[at + 12]);
            rows[at] = cast(_mm512_shuffle_i32x4::<0b10_00_10_00>(low, low_more));
            rows[at + 4] = cast(_mm512_shuffle_i32x4::<0b11_01_11_01>(low, low_more));
            rows[at + 8] = cast(_mm512_shuffle_i32x4::<0b10_00_10_00>(high, high_more));
            rows[at + 12] = cast(_mm512_shuffle_i32x4::<0b11_01_11_01>(high, high_more));
        }
    }

    /// The same of halves of eight records.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub fn transpose_8(records: [&Words; WORDS], rows: &mut [Words; WORDS]) {
        let mut halves = [[[0_u32; 8]; 2]; WORDS];
        for half in 0..2 {
            for first in [0, 8] {
                let mut all = [_mm256_setzero_si256(); 8];
                for at in 0..8 {
                    let record: [[u32; 8]; 2] = cast(*records[first + at]);
                    all[at] = cast(record[half]);
                }
                let mut fours = all;
                for at in (0..8).step_by(4) {
                    let low = _mm256_unpacklo_epi32(all[at], all[at + 1]);
                    let high = _mm256_unpackhi_epi32(all[at], all[at + 1]);
                    let low_more = _mm256_unpacklo_epi32(all[at + 2], all[at + 3]);
                    let high_more = _mm256_unpackhi_epi32(all[at + 2], all[at + 3]);
                    fours[at] = _mm256_unpacklo_epi64(low, low_more);
                    fours[at + 1] = _mm256_unpackhi_epi64(low, low_more);
                    fours[at + 2] = _mm256_unpacklo_epi64(high, high_more);
                    fours[at + 3] = _mm256_unpackhi_epi64(high, high_more);
                }
                for at in 0..4 {
                    let low = _mm256_permute2x128_si256::<0x20>(fours[at], fours[at + 4]);
                    let high = _mm256_permute2x128_si256::<0x31>(fours[at], fours[at + 4]);
                    halves[8 * half + at][first / 8] = cast(low);
                    halves[8 * half + at + 4][first / 8] = cast(high);
                }
            }
        }
        for at in 0..WORDS {
            rows[at] = cast(halves[at]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_change_places_with_records_with_all_instructions() {
        let records: [Words; WORDS] =
            std::array::from_fn(|record| std::array::from_fn(|word| (100 * record + word) as u32));
        for isa in [Instructions::Portable, Instructions::Avx2, Instructions::Avx512]
            .into_iter()
            .filter_map(Isa::new)
        {
            let mut rows = [[0; WORDS]; WORDS];
            isa.transpose(records.each_ref(), &mut rows);
            for (word, row) in rows.iter().enumerate() {
                for (record, found) in row.iter().enumerate() {
                    assert_eq!(*found, (100 * record + word) as u32, "{isa:?}");
                }
            }
        }
    }
}
