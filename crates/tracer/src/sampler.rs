//! Random numbers of one path: Owen-scrambled Sobol points by path number (Burley 2020, "Practical Hash-based Owen
//! Scrambling", JCGT 9(4)), in pairs of dimensions that are scrambled and shuffled independently of each other.
//!
//! The plan: what a number drives is said by the vertex of the path and by a [`Purpose`], and within these by a count.
//!
//! | purpose | points |
//! | --- | --- |
//! | [`Purpose::Light`] | one pair for each light sample: along the light tree (and what is left of it, across the light), and across the light. Light sample j of n has point n·path + j, so that the samples of one path are stratified among each other, and those of all paths too |
//! | [`Purpose::Scatter`] | lobe and direction, in the order in which the material asks |
//! | [`Purpose::Roulette`] | whether the path goes on |
//! | [`Purpose::Record`] | whether a coarse record of indirect light is made |
//! | [`Purpose::Aim`] | one pair: whether to aim at a secondary source, which one, and where on it |
//!
//! Where a path forks, branch j of n goes on with the numbers of path n·path + j.
//!
//! Always true: the numbers are a function of (seed, path, branch, vertex, purpose, count) alone; a path that is cut off earlier
//! has the same numbers up to there. Any aligned block of 2^k paths of one seed has one point in each of its 2^k
//! strata of every pair, of whatever shape. The point of one path alone is uniform, and those of different
//! seeds, vertices, purposes and counts are independent.

/// The golden ratio in 64 bits: SplitMix64's step (Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators").
const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// What numbers are for. Each has its own dimensions at every vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    Scatter = 0,
    Light = 1,
    Roulette = 2,
    Aim = 3,
    /// Beyond those of all vertices.
    Record = 1 << 20,
    Image = 1 << 21,
}

/// Draws the numbers of one path.
#[derive(Clone, Debug)]
pub struct Sampler {
    /// Of the seed, and of the bits of the path number beyond the sequence.
    base: u64,
    state: u64,
    /// Number in the sequence, and the same with its bits reversed.
    index: u32,
    reversed: u32,
}

impl Sampler {
    /// The numbers of path `path` of sample `seed`, at the path's beginning. Neighbouring seeds are independent; the paths of
    /// one seed are stratified.
    #[must_use]
    pub fn new(seed: u64, path: u64) -> Self {
        let base = mix(seed ^ mix((path >> 32).wrapping_add(STEP)));
        let index = path as u32;
        Self { base, state: base, index, reversed: index.reverse_bits() }
    }

    /// The numbers of one of `count` branches of this path, for branches below `count`: those of path `count` times this one's number, and
    /// on, so that branches of all paths are stratified together.
    #[inline]
    pub(crate) fn branch(&self, count: u32, branch: u32) -> Self {
        let index = self.index.wrapping_mul(count).wrapping_add(branch);
        Self { index, reversed: index.reverse_bits(), ..*self }
    }

    /// The numbers of one of the ways on of a path that goes all of them; the first has this one's own.
    #[inline]
    pub(crate) fn way(&self, way: u32) -> Self {
        Self {
            base: if way == 0 { self.base } else { mix(self.base.wrapping_add(u64::from(way))) },
            ..*self
        }
    }

    /// Turns to the numbers of a vertex and purpose.
    #[inline]
    pub(crate) fn turn(&mut self, vertex: u32, purpose: Purpose) {
        self.state = mix(self.base
            ^ u64::from(vertex * 4 + purpose as u32 + 1).wrapping_mul(0xD6E8_FEB8_6659_FD93));
    }

    #[inline]
    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(STEP);
        mix(self.state)
    }

    /// Uniform in [0, 1).
    #[inline]
    pub fn one(&mut self) -> f32 {
        let [x, _] = Pair { keys: self.next() }.point(self.reversed);
        unit(x)
    }

    /// Uniform in the unit square.
    #[inline]
    pub fn two(&mut self) -> [f32; 2] {
        Pair { keys: self.next() }.point(self.reversed).map(unit)
    }

    /// The pairs of `count` light samples, for sample numbers below `count`.
    #[inline]
    pub(crate) fn pairs(&mut self, count: u32) -> Pairs {
        // A sequence that is too long begins again: its blocks stay what they are.
        Pairs { pair: Pair { keys: self.next() }, first: self.index.wrapping_mul(count) }
    }
}

/// Points of consecutive numbers in one pair of dimensions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pairs {
    pair: Pair,
    first: u32,
}

impl Pairs {
    /// Point `j`: the first number has 53 bits, for choices among many that leave enough for another use.
    #[inline]
    pub(crate) fn at(self, j: u32) -> (f64, f32) {
        let index = self.first.wrapping_add(j);
        let [x, y] = self.pair.point(index.reverse_bits());
        // Below the sequence's own bits, any will do.
        let low = mix(self.pair.keys ^ u64::from(index)) >> 43;
        let fine = (u64::from(x) << 21 | low) as f64 * (1.0 / (1_u64 << 53) as f64);
        (fine, unit(y))
    }
}

/// One pair of dimensions: a Sobol sequence (0,2) in base 2, shuffled and scrambled by these keys.
#[derive(Clone, Copy, Debug)]
struct Pair {
    keys: u64,
}

impl Pair {
    #[inline]
    fn point(self, reversed: u32) -> [u32; 2] {
        let index = shuffle(reversed, self.keys as u32);
        let more = mix(self.keys.wrapping_add(STEP));
        // The scrambling alone does not make the low bits of single points uniform: a shift of digits, which keeps all strata, does.
        let shift = (more >> 32) as u32;
        [
            scramble(index, (self.keys >> 32) as u32) ^ shift,
            scramble(pascal(index), more as u32) ^ shift.rotate_left(16).wrapping_mul(0x9E37_79B1),
        ]
    }
}

/// Owen's shuffle of a number whose bits are reversed: numbers of one aligned block of 2^k stay in one.
#[inline]
fn shuffle(reversed: u32, key: u32) -> u32 {
    nested(reversed, key).reverse_bits()
}

/// Owen's scrambling of a fraction whose bits are reversed.
#[inline]
fn scramble(reversed: u32, key: u32) -> u32 {
    nested(reversed, key).reverse_bits()
}

/// Every bit is flipped or not by a hash of the bits below it (Laine and Karras 2011, with the constants of Vegdahl 2021).
#[inline]
fn nested(mut x: u32, key: u32) -> u32 {
    x ^= x.wrapping_mul(0x3D20_ADEA);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6C56);
    x ^ x.wrapping_mul(0x53A2_2864)
}

/// Sobol's second dimension of a number, with its bits reversed: the product with Pascal's triangle modulo 2, in the five steps
/// that its self-similarity allows (Ahmed 2024, "An Implementation Algorithm of 2D Sobol Sequence Fast, Elegant, and Compact").
#[inline]
fn pascal(mut x: u32) -> u32 {
    x ^= (x & 0xAAAA_AAAA) >> 1;
    x ^= (x & 0xCCCC_CCCC) >> 2;
    x ^= (x & 0xF0F0_F0F0) >> 4;
    x ^= (x & 0xFF00_FF00) >> 8;
    x ^ (x >> 16)
}

/// SplitMix64's finalizer: a bijection whose every output bit depends on every input bit.
#[inline]
pub(crate) fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// 24 bits, so that 1 is never reached by rounding.
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn different_seeds_and_dimensions_are_uniform_and_uncorrelated() {
        // 2^16 streams of one path, or one stream of 2^16: each mean is 1/2 with standard error at most 1/sqrt(12 n), each
        // product of deviations of different dimensions or seeds 0 with 1/(12 sqrt n). Few dozen statistics at 4.5 standard
        // errors fail by chance once in thousands of runs; the seeds are fixed.
        let n = 1 << 16;
        for by_path in [false, true] {
            let mut sums = [[0.0; 6]; 6];
            let mut means = [0.0; 6];
            let (mut neighbours, mut last) = (0.0, 0.0);
            for i in 0..n {
                let mut s = if by_path { Sampler::new(9, i) } else { Sampler::new(i, 0) };
                let mut x = [0.0; 6];
                s.turn(0, Purpose::Scatter);
                (x[0], x[1]) = (s.one(), s.two()[1]);
                s.turn(0, Purpose::Light);
                let (a, b) = s.pairs(2).at(1);
                (x[2], x[3]) = (a as f32, b);
                s.turn(1, Purpose::Scatter);
                [x[4], x[5]] = s.two();
                let x = x.map(|x| f64::from(x) - 0.5);
                for (j, (row, a)) in sums.iter_mut().zip(x).enumerate() {
                    means[j] += a;
                    row.iter_mut().zip(x).for_each(|(sum, b)| *sum += a * b);
                }
                neighbours += x[0] * last;
                last = x[0];
            }
            let root = (n as f64).sqrt();
            for j in 0..6 {
                assert!((means[j] / root * 12.0_f64.sqrt()).abs() < 4.5, "{by_path} {j}");
                for (k, sum) in sums[j][..j].iter().enumerate() {
                    assert!((sum / root * 12.0).abs() < 4.5, "{by_path} {j} {k}");
                }
                // Variance 1/12; that of its estimate is 1/180 n.
                assert!(
                    (sums[j][j] - n as f64 / 12.0).abs() / root * 180.0_f64.sqrt() < 4.5,
                    "{by_path} {j}"
                );
            }
            if !by_path {
                assert!((neighbours / root * 12.0).abs() < 4.5);
            }
        }
    }

    #[test]
    fn first_points_of_many_keys_fill_the_square_evenly_to_the_last_bits() {
        let n = 1 << 19;
        let (mut cells, mut low) = (vec![0_u32; 1024], vec![0_u32; 512]);
        let mut count = |[x, y]: [f32; 2]| {
            cells[(x * 32.0) as usize * 32 + (y * 32.0) as usize] += 1;
            low[((x * 65536.0).fract() * 256.0) as usize] += 1;
            low[256 + ((y * 65536.0).fract() * 256.0) as usize] += 1;
        };
        // Half of them drawn one after the other, half from one seed each.
        let mut s = Sampler::new(3, 0);
        for i in 0..n / 2 {
            count(s.two());
            count(Sampler::new(i, 0).two());
        }
        for (counts, expected) in [(cells, n as f64 / 1024.0), (low, n as f64 / 256.0)] {
            let chi2: f64 =
                counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
            // Wilson and Hilferty 1931.
            let degrees = counts.len() as f64 - 1.0;
            let v = 2.0 / (9.0 * degrees);
            let z = ((chi2 / degrees).cbrt() - (1.0 - v)) / v.sqrt();
            assert!(z.abs() < 4.5, "chi² {chi2} of {degrees}");
        }
    }

    #[test]
    fn the_second_dimension_is_sobol_s() {
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
    fn every_block_of_paths_has_one_point_in_each_stratum_of_any_shape() {
        for seed in 0..20 {
            for block in [0_u64, 3, 1000] {
                for log in 0..=6 {
                    let n = 1_u64 << log;
                    for shape in 0..=log {
                        let (across, up) = (1 << shape, 1 << (log - shape));
                        let mut by_two = vec![0; n as usize];
                        let mut by_light = vec![0; 4 * n as usize];
                        for path in block * n..(block + 1) * n {
                            let mut s = Sampler::new(seed, path);
                            s.turn(2, Purpose::Scatter);
                            let [x, y] = s.two();
                            by_two[(x * across as f32) as usize * up + (y * up as f32) as usize] +=
                                1;
                            s.turn(0, Purpose::Light);
                            let pairs = s.pairs(4);
                            for j in 0..4 {
                                let (x, y) = pairs.at(j);
                                by_light[(x * f64::from(2 * across)) as usize * 2 * up
                                    + (y * 2.0 * up as f32) as usize] += 1;
                            }
                        }
                        assert!(
                            by_two.iter().all(|&c| c == 1),
                            "{seed} {block} {log} {shape}: {by_two:?}"
                        );
                        assert!(
                            by_light.iter().all(|&c| c == 1),
                            "{seed} {block} {log} {shape}: {by_light:?}"
                        );
                    }
                }
            }
        }
    }
}
