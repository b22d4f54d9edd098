//! The first pass: each square uses the narrowest neighbourhood with little enough noise.

use super::sums::{SCALES, Sum};
use crate::estimate::{Estimate, LightSums};
use crate::light_store::luminance;
use crate::likely::Likely;
use crate::planes::{Square, SquareLayout, SquarePlanes};
use glam::Vec3;
use rayon::prelude::*;

/// Relative standard errors at which a neighbourhood begins to count and at which it counts fully,
/// in the first pass.
pub(super) const FIRST: [f32; 2] = [0.35, 0.1];

/// The same for the light of half of the squares. It may have √2 times as much noise.
pub(super) const HALF: [f32; 2] = [0.5, 0.14];

/// Weight of the likely light of a surface in the widest neighbourhood, in samples.
const LIKELY_WEIGHT: f32 = 2.0;

/// Weight of the expected variance of a sample beside that of the samples themselves, in samples.
/// The expected variance is the square of the mean light of the picture around.
const PRIOR_WEIGHT: f32 = 4.0;

/// Finds the widest neighbourhood of each square. Both passes begin with it.
#[derive(Clone, Copy)]
pub(super) struct Choice<'a> {
    pub layout: &'a SquareLayout,
    /// Sums of the neighbourhood that judges noise.
    pub wide: &'a Sum,
    /// Likely light of squares with few samples, as [`Likely::to_array`] returns it. It is 0 if it
    /// is unknown or there are enough samples.
    pub likely: &'a SquarePlanes<4>,
}

/// Light of the widest neighbourhood, and what narrower ones are compared with.
#[derive(Clone, Copy)]
pub(super) struct Widest {
    pub estimate: Estimate,
    /// The luminance around. Errors are compared with it.
    pub bright: f32,
    /// Samples of the widest neighbourhood.
    pub count: f32,
}

impl Choice<'_> {
    /// Returns the light of all squares. `sums` returns those of a scale at a square. The narrowest
    /// scale with little enough noise counts. `noise` are the relative standard errors at which a
    /// neighbourhood begins to count and at which it counts fully.
    pub fn lights(
        &self,
        sums: impl Fn(usize, Square) -> [f32; 5] + Sync,
        noise: [f32; 2],
    ) -> Vec<Estimate> {
        let (width, height) = self.layout.size;
        let mut lights = vec![Estimate::UNKNOWN; width * height];
        lights.par_chunks_mut(width).enumerate().for_each(|(row, lights)| {
            for at in self.layout.squares(row) {
                lights[at.column] = self.light(at, |scale| sums(scale, at), noise);
            }
        });
        lights
    }

    fn light(
        &self,
        at: Square,
        sums: impl Fn(usize) -> [f32; 5],
        [high, low]: [f32; 2],
    ) -> Estimate {
        let Widest { mut estimate, bright, .. } = match self.widest(at, sums(SCALES)) {
            Ok(widest) => widest,
            Err(likely) => return likely,
        };
        // A black neighbourhood has the range of the least float, so that nothing is divided by 0.
        let range = (high - low) * bright.max(f32::MIN_POSITIVE);
        for scale in (0..SCALES).rev() {
            let lit = LightSums::from(sums(scale));
            let own = lit.variance(estimate.variance).sqrt();
            estimate.approach(&lit, own, ((high * bright - own) / range).clamp(0.0, 1.0));
        }
        estimate.at_least_black()
    }

    /// Returns the light of a square's widest neighbourhood, which has these sums, or its likely
    /// light if there is no sample.
    pub fn widest(&self, at: Square, sums: [f32; 5]) -> Result<Widest, Estimate> {
        let last = LightSums::from(sums);
        let likely = Likely::from(self.likely.at(at));
        if last.count <= 0.0 {
            return Err(if likely.light == Vec3::ZERO {
                Estimate::UNKNOWN
            } else {
                Estimate::guessed(likely.light)
            });
        }
        let wide = LightSums::from(self.wide.at(at));
        let wide = if wide.count > 0.0 { wide } else { last };
        let bright = luminance(wide.mean().to_array());
        let variance = wide.variance_around();
        let mut light = last.mean();
        if likely.light != Vec3::ZERO {
            light += share_of_likely(&likely, &last) * (likely.light - light);
        }
        let estimate = Estimate { light, error: last.variance(variance).sqrt(), variance };
        Ok(Widest { estimate, bright, count: last.count })
    }
}

/// Returns the share that likely light has beside these samples.
///
/// The light of the picture around may be many times that of a surface, as between leaves in front
/// of a wall. Its standard error is therefore taken to be as large as itself. It and the mean of
/// the samples count in inverse proportion to their variances, so a few dark samples outweigh it.
fn share_of_likely(likely: &Likely, samples: &LightSums) -> f32 {
    if !likely.is_around {
        return LIKELY_WEIGHT / (samples.count + LIKELY_WEIGHT);
    }
    let (bright, own) = (luminance(likely.light.to_array()), luminance(samples.mean().to_array()));
    let expected = bright * bright;
    let spread = (samples.square - samples.count * own * own).max(0.0);
    let variance = (spread + PRIOR_WEIGHT * expected) / (samples.count + PRIOR_WEIGHT);
    // Not divided by the count, because weights may make it as small as any float.
    variance / (variance + samples.count * expected).max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of likely light of 1 beside samples of these lights.
    fn share_beside(samples: &[f32], is_around: bool) -> f32 {
        let sum = |of: fn(f32) -> f32| samples.iter().map(|&light| of(light)).sum::<f32>();
        let samples = LightSums {
            light: Vec3::splat(sum(|light| light)),
            count: samples.len() as f32,
            square: sum(|light| light * light),
        };
        share_of_likely(&Likely { light: Vec3::ONE, is_around }, &samples)
    }

    #[test]
    fn light_around_counts_by_its_variance_and_other_likely_light_as_two_samples() {
        for count in [1, 2, 4, 12, 60] {
            // Black samples: both variances follow from the expected one alone.
            let of = count as f32;
            for (is_around, expected) in
                [(true, 4.0 / (of + 2.0).powi(2)), (false, 2.0 / (of + 2.0))]
            {
                let share = share_beside(&vec![0.0; count], is_around);
                assert!((share - expected).abs() < 1e-6, "{count} {is_around}: {share}");
            }
        }
        // Samples of 0 and 2: their own variance is the expected one.
        let share = share_beside(&[0.0, 2.0, 0.0, 2.0], true);
        assert!((share - 1.0 / 5.0).abs() < 1e-6, "{share}");
    }

    #[test]
    fn the_share_of_likely_light_is_finite_beside_any_samples() {
        let likely = |light: f32| Likely { light: Vec3::splat(light), is_around: true };
        for (light, sample) in [(0.0, 0.0), (1e-30, 1e-30), (1e9, 0.0), (1e-30, 1e9), (1e9, 1e9)] {
            for count in [1e-30, 1e-3, 1.0, 1e6] {
                let samples = LightSums {
                    light: Vec3::splat(sample * count),
                    count,
                    square: sample * sample * count,
                };
                let share = share_of_likely(&likely(light), &samples);
                assert!((0.0..=1.0).contains(&share), "{light} {sample} {count}: {share}");
            }
        }
    }
}
