//! Random numbers as functions of a seed and an index, so that they repeat.

/// Returns 32 well mixed bits of a seed and an index (two rounds of a 32-bit finaliser; Wellons,
/// "lowbias32").
#[inline(always)]
pub fn mix(seed: u32, index: u32) -> u32 {
    finish(finish(index ^ 0x9e37_79b9).wrapping_add(seed.wrapping_mul(0x85eb_ca6b)))
}

#[inline(always)]
fn finish(mut bits: u32) -> u32 {
    bits ^= bits >> 16;
    bits = bits.wrapping_mul(0x7feb_352d);
    bits ^= bits >> 15;
    bits = bits.wrapping_mul(0x846c_a68b);
    bits ^ bits >> 16
}

/// Returns two uniform numbers in [0, 1), as a function of a seed and an index.
#[inline(always)]
pub fn pair(seed: u32, index: u32) -> (f32, f32) {
    // An f32 holds 24 bits, so each number takes a mix of its own.
    let unit = |bits: u32| (bits >> 8) as f32 / (1 << 24) as f32;
    let first = mix(seed, index);
    (unit(first), unit(finish(first ^ 0xa511_e9b3)))
}

/// Returns the `counter`-th number of SplitMix64 (Steele, Lea & Flood 2014): 64 well mixed bits.
#[inline]
pub fn split_mix(counter: u64) -> u64 {
    holo_sobol::mix(counter.wrapping_mul(holo_sobol::STEP))
}
