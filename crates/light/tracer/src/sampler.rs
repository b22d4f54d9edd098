//! Random numbers of one path: Owen-scrambled Sobol points, indexed by path number. Each pair of
//! dimensions is scrambled and shuffled independently ([`SobolPair`]).
//!
//! A number is identified by the vertex of the path, a [`NumberPurpose`], and its position among
//! the numbers of that vertex and purpose.
//!
//! | purpose | points |
//! | --- | --- |
//! | [`NumberPurpose::Light`] | one pair for each light sample. The first number chooses in the light tree, and what remains of it chooses one coordinate on the light; the second number is the other coordinate. Light sample j of n has point n·path + j, so that the samples of one path are stratified, and those of all paths too |
//! | [`NumberPurpose::Scatter`] | lobe and direction, in the order in which the material asks |
//! | [`NumberPurpose::Roulette`] | whether the path survives |
//! | [`NumberPurpose::Teach`] | whether a path that could end in a cell continues to teach it |
//! | [`NumberPurpose::Aim`] | one pair: whether to aim at a secondary source or a caustic, at which, and where |
//! | [`NumberPurpose::Sun`] | which sun, and one pair: where on it |
//!
//! If a path branches, branch j of n uses the numbers of path n·path + j.
//!
//! Invariant: a number depends only on (seed, path, branch, vertex, purpose, position). So a path
//! that ends earlier has the same numbers up to its end. Take any aligned block of 2^k paths of one
//! seed, and divide a pair's square into 2^k strata of any shape. Each stratum then contains
//! exactly one point. The point of a single path is uniform. Points of different seeds, vertices,
//! purposes and positions are independent.

use holo_sobol::{STEP, SobolPair, mix, unit};

/// The purpose of a number. Each purpose has its own dimensions at every vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NumberPurpose {
    Scatter = 0,
    Light = 1,
    Roulette = 2,
    Aim = 3,
    /// The remaining purposes have numbers beyond those of all vertices.
    Teach = 1 << 20,
    Sun = 1 << 22,
}

/// The random numbers of one path.
#[derive(Clone, Debug)]
pub struct Sampler {
    /// Hash of the seed and of the bits of the path number that the sequence does not cover.
    base: u64,
    state: u64,
    /// Index in the sequence.
    index: u32,
    /// The same with its bits reversed.
    reversed: u32,
}

impl Sampler {
    /// Returns the numbers of path `path` of sample `seed`, at the path's beginning. Paths of one
    /// seed are stratified; different seeds, neighbouring ones too, are independent.
    #[must_use]
    pub fn new(seed: u64, path: u64) -> Self {
        let base = mix(seed ^ mix((path >> 32).wrapping_add(STEP)));
        let index = path as u32;
        Self { base, state: base, index, reversed: index.reverse_bits() }
    }

    /// Returns the numbers of one of `count` branches of this path; `branch` is below `count`. They
    /// are those of path number `count` · `path` + `branch`, so that the branches of all paths are
    /// stratified together. `is_apart`: those of another seed.
    #[inline]
    pub(crate) fn branch(&self, count: u32, branch: u32, is_apart: bool) -> Self {
        let index = self.index.wrapping_mul(count).wrapping_add(branch);
        let base = if is_apart { mix(self.base.wrapping_add(1)) } else { self.base };
        Self { base, index, reversed: index.reverse_bits(), ..*self }
    }

    /// Moves to the numbers of a vertex and purpose.
    #[inline]
    pub(crate) fn turn(&mut self, vertex: u32, purpose: NumberPurpose) {
        self.state = mix(self.base
            ^ u64::from(vertex * 4 + purpose as u32 + 1).wrapping_mul(0xD6E8_FEB8_6659_FD93));
    }

    #[inline]
    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(STEP);
        mix(self.state)
    }

    /// Returns a number that is uniform in [0, 1).
    #[inline]
    pub fn one(&mut self) -> f32 {
        let [x, _] = SobolPair { keys: self.next() }.point(self.reversed);
        unit(x)
    }

    /// Returns a point that is uniform in the unit square.
    #[inline]
    pub fn two(&mut self) -> [f32; 2] {
        SobolPair { keys: self.next() }.point(self.reversed).map(unit)
    }

    /// Returns the pairs of `count` light samples.
    #[inline]
    pub(crate) fn pairs(&mut self, count: u32) -> Pairs {
        // If the index overflows, the sequence starts again; aligned blocks stay blocks.
        Pairs { pair: SobolPair { keys: self.next() }, first: self.index.wrapping_mul(count) }
    }
}

/// Points of consecutive indices in one pair of dimensions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pairs {
    pair: SobolPair,
    first: u32,
}

impl Pairs {
    /// Returns point `j`. Its first number has 53 bits: enough to choose among many lights and to
    /// use the remainder for something else.
    #[inline]
    pub(crate) fn at(self, j: u32) -> (f64, f32) {
        let index = self.first.wrapping_add(j);
        let [x, y] = self.pair.point(index.reverse_bits());
        // The bits below those of the sequence are arbitrary.
        let low = mix(self.pair.keys ^ u64::from(index)) >> 43;
        let fine = (u64::from(x) << 21 | low) as f64 * (1.0 / (1_u64 << 53) as f64);
        (fine, unit(y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn different_seeds_and_dimensions_are_uniform_and_uncorrelated() {
        // 2^16 streams of one path, or one stream of 2^16 paths. Each mean is 1/2 with standard
        // error at most 1/sqrt(12 n). Each product of deviations of different dimensions or seeds
        // is 0 with standard error 1/(12 sqrt n). A few dozen statistics at 4.5 standard errors
        // fail by chance once in thousands of runs; the seeds are fixed.
        let n = 1 << 16;
        for by_path in [false, true] {
            let mut sums = [[0.0; 6]; 6];
            let mut means = [0.0; 6];
            let (mut neighbours, mut last) = (0.0, 0.0);
            for i in 0..n {
                let mut s = if by_path { Sampler::new(9, i) } else { Sampler::new(i, 0) };
                let mut x = [0.0; 6];
                s.turn(0, NumberPurpose::Scatter);
                (x[0], x[1]) = (s.one(), s.two()[1]);
                s.turn(0, NumberPurpose::Light);
                let (a, b) = s.pairs(2).at(1);
                (x[2], x[3]) = (a as f32, b);
                s.turn(1, NumberPurpose::Scatter);
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
                // The variance is 1/12; the variance of its estimate is 1/180 n.
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
        // Half of the points are drawn one after the other, half from one seed each.
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
                            s.turn(2, NumberPurpose::Scatter);
                            let [x, y] = s.two();
                            by_two[(x * across as f32) as usize * up + (y * up as f32) as usize] +=
                                1;
                            s.turn(0, NumberPurpose::Light);
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
