//! The noise of one path, estimated from samples that met the same surface in the same pixel.
//!
//! A stored sample states its number of paths but not its noise. Two samples of one place differ by
//! their noise alone, unless the light has changed or an edge runs through the pixel. Both are rare
//! among many pairs, so the median of the differences is the noise.
//!
//! Invariant: the estimate depends only on the sequence of pairs.

/// Pairs before the estimate is used.
const LEAST_PAIRS: u32 = 64;

/// Smallest step of the running median, as a share of it. The last 1/`LEAST_STEP` pairs count most.
const LEAST_STEP: f32 = 0.01;

/// Standard deviation over the median of absolute values of a normal distribution.
const NORMAL: f32 = 1.4826;

/// Smallest and largest estimate. Above, samples say nothing about change.
const RANGE: [f32; 2] = [1e-4, 4.0];

/// A running estimate of the noise of one path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathNoise {
    /// Median of the differences of pairs, as a share of the light, for one path in each.
    median: f32,
    pairs: u32,
}

impl Default for PathNoise {
    fn default() -> Self {
        Self { median: 1.0, pairs: 0 }
    }
}

impl PathNoise {
    /// Compares two radiances of one place, which average so many paths.
    pub fn compare(&mut self, (one, paths): ([f32; 3], f32), (other, others): ([f32; 3], f32)) {
        let [one, other] = [one, other].map(largest);
        let mean = 0.5 * (one + other);
        if mean <= 0.0 || paths < 1.0 || others < 1.0 {
            return;
        }
        let difference = (one - other).abs() / mean / (1.0 / paths + 1.0 / others).sqrt();
        self.pairs = self.pairs.saturating_add(1);
        let step = (4.0 / self.pairs as f32).clamp(LEAST_STEP, 0.5);
        let factor = if difference > self.median { 1.0 + step } else { 1.0 / (1.0 + step) };
        self.median = (self.median * factor).clamp(RANGE[0], RANGE[1]);
    }

    /// Returns the expected standard deviation of the largest channel of a sample. It is infinite
    /// while it is unknown, and for a black sample, which does not show how much light other paths
    /// find.
    pub fn of(&self, radiance: [f32; 3], paths: f32) -> f32 {
        let light = largest(radiance);
        if self.pairs < LEAST_PAIRS || light <= 0.0 {
            return f32::INFINITY;
        }
        NORMAL * self.median * light / paths.max(1.0).sqrt()
    }
}

fn largest(radiance: [f32; 3]) -> f32 {
    radiance.into_iter().fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use holo_display::pair;

    use super::*;

    /// Returns an approximately normal number: mean 0, standard deviation 1.
    fn normal(number: u32) -> f32 {
        let sum: f32 = (0..6)
            .map(|part| {
                let (a, b) = pair(number, part);
                a + b
            })
            .sum();
        sum - 6.0
    }

    #[test]
    fn the_estimate_is_the_noise_of_a_path_whatever_paths_the_samples_have() {
        for (paths, deviation) in [(1.0, 0.2), (16.0, 0.2), (64.0, 1.0), (16.0, 0.01)] {
            let mut noise = PathNoise::default();
            assert_eq!(noise.of([1.0; 3], paths), f32::INFINITY, "nothing is known");
            for number in 0..4000 {
                let light = |number| 3.0 * (1.0 + deviation * normal(number) / f32::sqrt(paths));
                let mean = (0..8).map(|part| light(10 * number + part)).sum::<f32>() / 8.0;
                noise.compare(([light(10 * number + 9); 3], paths), ([mean; 3], 8.0 * paths));
                if number % 20 == 0 {
                    // An edge or a change of light.
                    noise.compare(([3.0; 3], paths), ([30.0; 3], 8.0 * paths));
                }
            }
            let found = noise.of([0.5, 3.0, 1.0], paths);
            let expected = 3.0 * deviation / paths.sqrt();
            assert!((found / expected - 1.0).abs() < 0.2, "{found}, {expected} expected");
            assert_eq!(noise.of([0.0; 3], paths), f32::INFINITY);
        }
    }
}
