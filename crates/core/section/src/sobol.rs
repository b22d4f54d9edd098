//! A four-dimensional Sobol sequence with Owen scrambling, by sample number.
//!
//! Direction numbers are those of Joe & Kuo (2008, new-joe-kuo-6). Scrambling is hash-based after
//! Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020, with Vegdahl's constants. The
//! order of points is not shuffled: every prefix is well spread, and a beam's samples continue
//! where they stopped.

use crate::hash::mix64;

/// The directions of one dimension: entry `bit` is xored in if that bit of the sample number is
/// set.
type Directions = [u32; 32];

/// Returns the directions of a primitive polynomial (degree, coefficients) and its first odd
/// numbers.
const fn directions(degree: usize, coefficients: u32, initial: [u32; 3]) -> Directions {
    let mut v = [0u32; 32];
    let mut i = 0;
    while i < 32 {
        v[i] = if degree == 0 {
            1 << (31 - i)
        } else if i < degree {
            initial[i] << (31 - i)
        } else {
            let mut value = v[i - degree] ^ (v[i - degree] >> degree);
            let mut k = 1;
            while k < degree {
                value ^= (coefficients >> (degree - 1 - k) & 1) * v[i - k];
                k += 1;
            }
            value
        };
        i += 1;
    }
    v
}

const DIMENSIONS: [Directions; 4] = [
    directions(0, 0, [0; 3]),
    directions(1, 0, [1, 0, 0]),
    directions(2, 1, [1, 3, 0]),
    directions(3, 1, [1, 3, 1]),
];

/// One scrambling of the sequence.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub(crate) struct ScrambledSobol {
    seeds: [u32; 4],
}

impl ScrambledSobol {
    pub(crate) fn new(seed: u64) -> Self {
        let words = [mix64(seed ^ 0x6a09_e667_f3bc_c908), mix64(seed ^ 0xbb67_ae85_84ca_a73b)];
        ScrambledSobol {
            seeds: [
                words[0] as u32,
                (words[0] >> 32) as u32,
                words[1] as u32,
                (words[1] >> 32) as u32,
            ],
        }
    }

    /// Returns point `number`, as fractions of 2³².
    pub(crate) fn point(&self, number: u32) -> [u32; 4] {
        let mut point = sobol(number);
        for (x, &seed) in point.iter_mut().zip(&self.seeds) {
            *x = owen_scramble(*x, seed);
        }
        point
    }
}

fn sobol(number: u32) -> [u32; 4] {
    let mut point = [0u32; 4];
    let mut rest = number;
    while rest != 0 {
        let bit = rest.trailing_zeros() as usize;
        for (x, directions) in point.iter_mut().zip(&DIMENSIONS) {
            *x ^= directions[bit];
        }
        rest &= rest - 1;
    }
    point
}

/// Flips each bit by a hash of the bits above it: a random element of Owen's nested permutations.
fn owen_scramble(x: u32, seed: u32) -> u32 {
    // With the bits reversed, each step lets lower bits change only higher ones (Laine & Karras
    // 2011).
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts of the first 2^k points in the elementary intervals of a shape (bits of each
    /// dimension).
    fn counts(points: &[[u32; 4]], shape: [u32; 4]) -> Vec<u32> {
        let mut counts = vec![0; 1 << shape.iter().sum::<u32>()];
        for point in points {
            let mut interval = 0u64;
            for (x, bits) in point.iter().zip(shape) {
                interval = interval << bits | u64::from(*x) >> (32 - bits);
            }
            counts[interval as usize] += 1;
        }
        counts
    }

    fn shapes(bits: u32) -> impl Iterator<Item = [u32; 4]> {
        (0..=bits).flat_map(move |a| {
            (0..=bits - a)
                .flat_map(move |b| (0..=bits - a - b).map(move |c| [a, b, c, bits - a - b - c]))
        })
    }

    #[test]
    fn the_first_points_are_those_of_joe_and_kuo() {
        let points: Vec<[f64; 4]> =
            [1, 3, 2, 6, 7].map(|n| sobol(n).map(|x| f64::from(x) / 4_294_967_296.0)).to_vec();
        // Their program's output, which counts in Gray code.
        assert_eq!(points[0], [0.5; 4]);
        assert_eq!(points[1], [0.75, 0.25, 0.25, 0.25]);
        assert_eq!(points[2], [0.25, 0.75, 0.75, 0.75]);
        assert_eq!(points[3], [0.375, 0.375, 0.625, 0.875]);
        assert_eq!(points[4], [0.875, 0.875, 0.125, 0.375]);
    }

    #[test]
    fn every_power_of_two_prefix_is_a_net_in_the_plane_of_each_cell() {
        for seed in 0..50 {
            let sequence = ScrambledSobol::new(seed);
            for bits in 0..=10 {
                let points: Vec<_> = (0..1 << bits).map(|n| sequence.point(n)).collect();
                for a in 0..=bits {
                    let shape = [a, bits - a, 0, 0];
                    assert!(
                        counts(&points, shape).iter().all(|&n| n == 1),
                        "entry cell, {shape:?}"
                    );
                }
                for dimension in 0..4 {
                    let mut shape = [0; 4];
                    shape[dimension] = bits;
                    assert!(
                        counts(&points, shape).iter().all(|&n| n == 1),
                        "dimension {dimension}, {bits} bits"
                    );
                }
                // The polynomials of the exit cell's dimensions have degrees 2 and 3, so t = 1 + 2.
                // Every interval of volume 2^(3-bits) then has exactly 8 points.
                if bits >= 3 {
                    for c in 0..=bits - 3 {
                        assert!(counts(&points, [0, 0, c, bits - 3 - c]).iter().all(|&n| n == 8));
                    }
                }
            }
        }
    }

    #[test]
    fn scrambling_keeps_the_counts_of_all_elementary_intervals() {
        // A nested permutation moves elementary intervals of a shape onto each other, so the sorted
        // counts stay the same.
        for bits in [3, 6, 8] {
            let plain: Vec<_> = (0..1 << bits).map(sobol).collect();
            for seed in 0..8 {
                let sequence = ScrambledSobol::new(seed);
                let scrambled: Vec<_> = (0..1 << bits).map(|n| sequence.point(n)).collect();
                for shape in shapes(bits) {
                    let (mut a, mut b) = (counts(&plain, shape), counts(&scrambled, shape));
                    a.sort_unstable();
                    b.sort_unstable();
                    assert_eq!(a, b, "{shape:?}");
                }
            }
        }
    }

    #[test]
    fn scrambling_is_nested() {
        // Numbers that share their top bits share them afterwards. Numbers that first differ in a
        // bit still first differ there.
        let mut x = 1u32;
        for seed in 0..2000u32 {
            x = crate::hash::mix32(x.wrapping_add(seed));
            for bit in 0..32 {
                let other = x ^ (1 << bit) ^ (crate::hash::mix32(seed) & ((1u32 << bit) - 1));
                let moved = owen_scramble(x, x ^ seed) ^ owen_scramble(other, x ^ seed);
                assert_eq!(31 - moved.leading_zeros(), bit);
            }
        }
    }
}
