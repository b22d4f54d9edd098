//! Owen-scrambled Sobol points in pairs of dimensions (Burley 2020, "Practical Hash-based Owen
//! Scrambling", JCGT 9(4)): the numbers of everything that estimates light by rays.
//!
//! Invariants:
//! - A point depends only on the pair's keys and on its index.
//! - Take any aligned block of 2^k indices, and divide the square into 2^k strata of any shape.
//!   Each stratum contains exactly one point. The point of a single index is uniform over all keys.

/// The golden ratio in 64 bits: the step of SplitMix64 (Steele, Lea, Flood 2014, "Fast splittable
/// pseudorandom number generators").
pub const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// One pair of dimensions: a Sobol (0,2)-sequence in base 2, shuffled and scrambled by `keys`.
#[derive(Clone, Copy, Debug)]
pub struct SobolPair {
    /// Each key has its own shuffle and scrambling.
    pub keys: u64,
}

impl SobolPair {
    /// Returns a point, as fractions of 2³². `reversed` is its index with its bits reversed.
    #[inline]
    #[must_use]
    pub fn point(self, reversed: u32) -> [u32; 2] {
        let index = shuffle(reversed, self.keys as u32);
        let more = mix(self.keys.wrapping_add(STEP));
        // Scrambling alone does not make the low bits of a single point uniform. A digital shift
        // does, and it keeps all strata.
        let shift = (more >> 32) as u32;
        [
            scramble(index, (self.keys >> 32) as u32) ^ shift,
            scramble(pascal(index), more as u32) ^ shift.rotate_left(16).wrapping_mul(0x9E37_79B1),
        ]
    }
}

/// Owen-shuffles an index whose bits are reversed: indices of an aligned block of 2^k stay in one
/// block.
#[inline]
fn shuffle(reversed: u32, key: u32) -> u32 {
    nested(reversed, key).reverse_bits()
}

/// Owen-scrambles a fraction whose bits are reversed.
#[inline]
fn scramble(reversed: u32, key: u32) -> u32 {
    nested(reversed, key).reverse_bits()
}

/// Flips each bit or not, by a hash of the bits below it (Laine and Karras 2011, with the constants
/// of Vegdahl 2021).
#[inline]
fn nested(mut x: u32, key: u32) -> u32 {
    x ^= x.wrapping_mul(0x3D20_ADEA);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6C56);
    x ^ x.wrapping_mul(0x53A2_2864)
}

/// Returns Sobol's second dimension of an index, with reversed bits: the product with Pascal's
/// triangle modulo 2. Five steps suffice because the triangle is self-similar (Ahmed 2024, "An
/// Implementation Algorithm of 2D Sobol Sequence Fast, Elegant, and Compact").
#[inline]
fn pascal(mut x: u32) -> u32 {
    x ^= (x & 0xAAAA_AAAA) >> 1;
    x ^= (x & 0xCCCC_CCCC) >> 2;
    x ^= (x & 0xF0F0_F0F0) >> 4;
    x ^= (x & 0xFF00_FF00) >> 8;
    x ^ (x >> 16)
}

/// Returns SplitMix64's finalizer of `z`: a bijection whose output bits each depend on all input
/// bits.
#[inline]
#[must_use]
pub fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Returns a float in [0, 1) from 24 bits; more bits could round to 1.
#[inline]
#[must_use]
pub fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_dimension_is_that_of_sobol() {
        // Direction numbers of the polynomial x + 1.
        let mut directions = [1_u32 << 31; 32];
        for k in 1..32 {
            directions[k] = directions[k - 1] ^ (directions[k - 1] >> 1);
        }
        for i in (0..1000).chain((0..1000).map(|i| u32::MAX - 7919 * i)) {
            let expected = (0..32).filter(|k| i >> k & 1 == 1).fold(0, |y, k| y ^ directions[k]);
            assert_eq!(pascal(i).reverse_bits(), expected, "{i}");
        }
    }

    #[test]
    fn every_aligned_block_has_one_point_in_each_stratum_of_any_shape() {
        for keys in (0..20).map(mix) {
            for block in [0_u32, 3, 1000] {
                for log in 0..=6 {
                    for shape in 0..=log {
                        let (across, up) = (1_u32 << shape, 1_u32 << (log - shape));
                        let mut found = vec![0; 1 << log];
                        for index in block << log..(block + 1) << log {
                            let [x, y] = SobolPair { keys }.point(index.reverse_bits()).map(unit);
                            let (column, row) =
                                ((x * across as f32) as u32, (y * up as f32) as u32);
                            found[(column * up + row) as usize] += 1;
                        }
                        assert!(found.iter().all(|&count| count == 1), "{keys} {log}: {found:?}");
                    }
                }
            }
        }
    }
}
