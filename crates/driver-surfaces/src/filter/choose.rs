//! The choice between neighbourhoods: the narrowest one with little enough noise.

use super::Sum;
use crate::cell::luminance;
use crate::estimate::{Estimate, Lit};
use crate::likely::Likely;
use crate::planes::{Layout, Planes, Square, Weights};
use glam::Vec3;
use rayon::prelude::*;

/// Relative standard errors at which a neighbourhood begins to count and at which it counts fully,
/// in the first pass.
pub(super) const FIRST: [f32; 2] = [0.35, 0.1];

/// The same for the light of half of the squares. It may have √2 times as much noise.
pub(super) const HALF: [f32; 2] = [0.5, 0.14];

/// The same in the second pass.
pub(super) const SECOND: [f32; 2] = [0.1, 0.03];

/// Weight of the likely light of a surface in the widest neighbourhood, in samples.
const LIKELY_WEIGHT: f32 = 2.0;

/// Weight of the expected variance of a sample beside that of the samples themselves, in samples. The
/// expected variance is the square of the mean light of the picture around.
const PRIOR_WEIGHT: f32 = 4.0;

/// What the light of squares is chosen by.
pub(super) struct Choice<'a> {
    pub layout: &'a Layout,
    /// Sums of the neighbourhood that judges noise.
    pub wide: &'a Sum,
    /// Likely light of squares with few samples, as [`Likely::to_array`] returns it. It is 0 if it
    /// is unknown or there are enough samples.
    pub likely: &'a Planes<4>,
}

impl Choice<'_> {
    /// Returns the light of all squares from their sums on all scales. `noise` are the relative
    /// standard errors at which a neighbourhood begins to count and at which it counts fully.
    /// Without `details`, noise alone decides.
    pub fn lights(&self, scales: &[Sum], noise: [f32; 2], details: &[Planes<2>]) -> Vec<Estimate> {
        let (width, height) = self.layout.size;
        let mut lights = vec![Estimate::UNKNOWN; width * height];
        lights.par_chunks_mut(width).enumerate().for_each(|(row, lights)| {
            for at in self.layout.squares(row) {
                lights[at.column] = self.light(at, scales, noise, details);
            }
        });
        lights
    }

    /// Returns the light of a square from its sums on all scales. The narrowest scale with little
    /// enough noise counts, as far as its detail is significant. Without `details`, noise alone
    /// decides.
    fn light(
        &self,
        at: Square,
        scales: &[Sum],
        [high, low]: [f32; 2],
        details: &[Planes<2>],
    ) -> Estimate {
        let lit = |scale: &Sum| Lit::from(scale.at(at));
        let last = scales.last().map(lit).unwrap_or_default();
        let likely = Likely::from(self.likely.at(at));
        if last.count <= 0.0 {
            return if likely.light == Vec3::ZERO {
                Estimate::UNKNOWN
            } else {
                Estimate::guessed(likely.light)
            };
        }
        let wide = Lit::from(self.wide.at(at));
        let wide = if wide.count > 0.0 { wide } else { last };
        let bright = luminance(wide.mean().to_array());
        let variance = wide.variance_around();
        let mut light = last.mean();
        if likely.light != Vec3::ZERO {
            light += share_of_likely(&likely, &last) * (likely.light - light);
        }
        let mut estimate = Estimate { light, error: last.variance(variance).sqrt(), variance };
        // The squared error from not using the narrowest scale.
        let mut blur = 0.0;
        for (number, scale) in scales[..scales.len() - 1].iter().enumerate().rev() {
            let lit = lit(scale);
            let own = lit.variance(variance).sqrt();
            // A black neighbourhood has the range of the least float, so that nothing is divided by 0.
            let range = (high - low) * bright.max(f32::MIN_POSITIVE);
            let mut share = ((high * bright - own) / range).clamp(0.0, 1.0);
            if let Some([difference, noise]) = details.get(number).map(|details| details.at(at)) {
                let detail = Detail { difference, noise };
                share *= detail.share();
                blur = (1.0 - share) * (1.0 - share) * (blur + detail.real());
            }
            if lit.count > 0.0 {
                estimate.light += share * (lit.mean() - estimate.light);
                estimate.error += share * (own - estimate.error);
            }
        }
        estimate.error = (estimate.error * estimate.error + blur).sqrt();
        // Behind panes, noise may leave less than nothing.
        estimate.light = estimate.light.max(Vec3::ZERO);
        estimate
    }

    /// Returns the detail of every square for each scale except the widest: a weighted mean over the
    /// square and the 8 around it.
    pub fn details(&self, scales: &[Sum], weights: &[Weights]) -> Vec<Planes<2>> {
        let Choice { layout, wide, .. } = self;
        let variances = layout.planes(|at| [Lit::from(wide.at(at)).variance_around()]);
        let of_scale = |scale: usize| {
            let own = layout.planes(|at| {
                let [narrow, wider] = [0, 1].map(|more| scales[scale + more].at(at).into());
                let [variance] = variances.at(at);
                let Detail { difference, noise } = Detail::new(&narrow, &wider, variance);
                [difference, noise, f32::from(u8::from(noise > 0.0))]
            });
            let sums = layout.widened(&own, 1 << scale, &weights[scale], None);
            layout.planes(|at| {
                let [difference, noise, total] = sums.at(at);
                let total = total.max(f32::MIN_POSITIVE);
                [difference / total, noise / total]
            })
        };
        (0..weights.len()).map(of_scale).collect()
    }
}

/// Returns the share that likely light has beside these samples.
///
/// The light of the picture around may be many times that of a surface, as between leaves in front
/// of a wall. Its standard error is therefore taken to be as large as itself. It and the mean of the
/// samples count in inverse proportion to their variances, so a few dark samples outweigh it.
fn share_of_likely(likely: &Likely, samples: &Lit) -> f32 {
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

/// The difference between the light of a scale and that of the next wider one.
#[derive(Clone, Copy, Debug, Default)]
struct Detail {
    /// The square of the difference.
    difference: f32,
    /// The expected square of the difference if it were noise alone.
    noise: f32,
}

impl Detail {
    /// Returns a square's own detail. `around` is the variance of one sample nearby. The detail is
    /// 0 if the neighbourhood is too dark to judge noise. The wider sums contain the narrow ones.
    fn new(narrow: &Lit, wider: &Lit, around: f32) -> Detail {
        if narrow.count <= 0.0 || wider.count <= narrow.count {
            return Detail::default();
        }
        let differs = luminance((narrow.mean() - wider.mean()).to_array());
        let noise = narrow.variance(around) * (1.0 - narrow.count / wider.count);
        if noise > 0.0 {
            Detail { difference: differs * differs, noise }
        } else {
            Detail::default()
        }
    }

    /// Returns the part of the squared difference that noise does not explain.
    fn real(&self) -> f32 {
        (self.difference - self.noise).max(0.0)
    }

    /// Returns the share of the difference that has the least expected error (Wiener's filter).
    fn share(&self) -> f32 {
        self.real() / (self.real() + self.noise).max(f32::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_beside_darkness_has_a_finite_share() {
        let lit = |light: f32, count: f32| Lit {
            light: Vec3::splat(light * count),
            count,
            square: light * light * count,
        };
        for (narrow, wider) in [(1e6, 0.0), (1e6, 1e6), (0.0, 0.0), (0.0, 1e6), (1e-30, 0.0)] {
            for wide in [0.0, 1e-30, 1e6] {
                for count in [1e-9, 1.0, 1e6] {
                    let own = lit(narrow, count);
                    let around = lit(narrow + wider, 2.0 * count);
                    let detail = Detail::new(&own, &around, lit(wide, 1.0).variance_around());
                    assert!((0.0..=1.0).contains(&detail.share()), "{detail:?}");
                    assert!(detail.noise > 0.0 || detail.difference == 0.0, "{detail:?}");
                }
            }
        }
    }

    /// The share of likely light of 1 beside samples of these lights.
    fn share_beside(samples: &[f32], is_around: bool) -> f32 {
        let sum = |of: fn(f32) -> f32| samples.iter().map(|&light| of(light)).sum::<f32>();
        let samples = Lit {
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
                let samples = Lit {
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
