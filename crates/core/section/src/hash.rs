//! Integer hashes: the only source of randomness in this crate.

use crate::BeamId;

/// The finaliser of SplitMix64 (Steele et al. 2014, variant 13 of Stafford). It is a bijection.
/// Each input bit flips each output bit with probability ½.
pub(crate) fn mix64(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Combines a running hash with one more word.
pub(crate) fn combine(hash: u64, word: u64) -> u64 {
    mix64(hash.rotate_left(23) ^ mix64(word.wrapping_add(0x9e37_79b9_7f4a_7c15)))
}

/// A bijection of 32-bit words with good avalanche (Wellons 2018, "lowbias32").
pub(crate) fn mix32(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Returns the seed of one sample's random numbers, for tracers.
///
/// It depends on (section, beam, sample number) alone, so that a packet traced again after a
/// failure gives the same radiances.
pub fn seed(section_index: u16, beam: BeamId, sample_number: u32) -> u64 {
    combine(combine(beam.0, u64::from(section_index)), u64::from(sample_number))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn neighbouring_samples_have_distinct_seeds_whose_bits_are_balanced() {
        let mut seen = HashSet::new();
        let mut ones = [0u32; 64];
        let mut n = 0u32;
        for section in 0..4u16 {
            for beam in 0..100u64 {
                for number in 0..100u32 {
                    let s = seed(section, BeamId(beam), number);
                    assert!(seen.insert(s), "seeds collide at {section} {beam} {number}");
                    for (bit, count) in ones.iter_mut().enumerate() {
                        *count += (s >> bit & 1) as u32;
                    }
                    n += 1;
                }
            }
        }
        // Binomial(n, ½): 5 standard deviations, over 64 bits a false alarm in about 1 in 27,000
        // constructions.
        let allowed = 5.0 * (f64::from(n) / 4.0).sqrt();
        for count in ones {
            assert!((f64::from(count) - f64::from(n) / 2.0).abs() < allowed, "{count} of {n}");
        }
    }
}
