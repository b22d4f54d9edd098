//! Estimates of light from sums, with their standard errors.

use crate::light_store::{Sums, luminance};
use glam::Vec3;

/// Weight of a prior variance, in samples: a measured variance counts for more from here on.
const RELIABLE: f32 = 16.0;

/// Least variance of samples, relative to their squared mean, because a few may be alike by chance.
const LEAST_VARIANCE: f32 = 0.2;

/// Number of standard errors beyond which samples are taken to show other light than the estimate.
const SIGNIFICANT: f32 = 3.0;

/// Sums over the samples of a square or of its neighbourhood, in fixed-point steps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LightSums {
    pub light: Vec3,
    pub count: f32,
    /// Sum of squared luminance.
    pub square: f32,
}

/// The light of a square, and the standard error of its luminance. If the error is infinite,
/// nothing is known.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Estimate {
    pub light: Vec3,
    pub error: f32,
    /// The variance of one sample's luminance.
    pub variance: f32,
}

impl Estimate {
    /// Marks a square of which nothing is known.
    pub const UNKNOWN: Estimate =
        Estimate { light: Vec3::ZERO, error: f32::INFINITY, variance: 0.0 };

    /// Returns an estimate without any sample: its error is as large as the light.
    pub fn guessed(light: Vec3) -> Estimate {
        let error = luminance(light.to_array());
        Estimate { light, error, variance: error * error }
    }

    /// Adds another estimate, multiplied by `share`.
    pub fn add(&mut self, share: f32, other: &Estimate) {
        self.light += share * other.light;
        self.error += share * other.error;
        self.variance += share * other.variance;
    }

    /// Replaces a share of this estimate by the light of samples whose standard error is `error`.
    pub fn approach(&mut self, samples: &LightSums, error: f32, share: f32) {
        if samples.count > 0.0 {
            self.light += share * (samples.mean() - self.light);
            self.error += share * (error - self.error);
        }
    }

    /// Returns this estimate without light below 0, which noise may leave behind panes.
    pub fn at_least_black(self) -> Estimate {
        Estimate { light: self.light.max(Vec3::ZERO), ..self }
    }

    /// Returns a weighted sum divided by its total weight.
    pub fn divided(self, total: f32) -> Estimate {
        let Estimate { light, error, variance } = self;
        Estimate { light: light / total, error: error / total, variance: variance / total }
    }

    /// Returns this estimate improved by samples of the same light. `spread` is the expected
    /// relative difference between that light and the estimate, besides the estimate's error.
    pub fn improved(&self, sums: &Sums, spread: f32) -> Estimate {
        if sums.count == 0 {
            return *self;
        }
        let lit = LightSums::new(sums);
        let (bright, own) = (luminance(self.light.to_array()), luminance(lit.mean().to_array()));
        let differs = (own - bright) * (own - bright);
        // The variance of few samples is unreliable, so a prior counts as well.
        let spread_out = (lit.square - lit.count * own * own).max(0.0);
        let usual = RELIABLE * (self.variance + differs);
        let variance = (spread_out + usual) / (lit.count + RELIABLE);
        let noise = variance / lit.count;
        // A difference beyond three standard errors means other light, so the estimate counts less.
        let before = (self.error * self.error + spread * spread * bright * bright)
            .max(differs - SIGNIFICANT * SIGNIFICANT * noise)
            .max(0.0);
        let share =
            if before.is_finite() { before / (before + noise).max(f32::MIN_POSITIVE) } else { 1.0 };
        let light = self.light + share * (lit.mean() - self.light);
        Estimate { light, error: (share * noise).sqrt(), variance }
    }
}

impl From<[f32; 5]> for LightSums {
    fn from([r, g, b, count, square]: [f32; 5]) -> LightSums {
        LightSums { light: Vec3::new(r, g, b), count, square }
    }
}

impl LightSums {
    /// Returns the light's channels, the count and the square.
    pub fn to_array(self) -> [f32; 5] {
        let [r, g, b] = self.light.to_array();
        [r, g, b, self.count, self.square]
    }

    pub fn new(sums: &Sums) -> LightSums {
        let count = sums.paths as f32;
        LightSums { light: count * sums.mean(), count, square: count * sums.mean_square() }
    }

    pub fn mean(&self) -> Vec3 {
        self.light / self.count.max(1e-9)
    }

    /// Returns the variance of one sample's luminance in a wide neighbourhood.
    pub fn variance_around(&self) -> f32 {
        let bright = luminance(self.mean().to_array());
        let least = LEAST_VARIANCE * bright * bright * RELIABLE / (RELIABLE + self.count);
        (self.square / self.count.max(1e-9) - bright * bright).max(least)
    }

    /// Returns the variance of the mean. The variance of few samples is unreliable, so `around`,
    /// the variance of one sample in a wide neighbourhood, counts as well.
    pub fn variance(&self, around: f32) -> f32 {
        let own = luminance(self.mean().to_array());
        let own = (self.square - self.count * own * own).max(0.0);
        (own + RELIABLE * around) / (self.count + RELIABLE) / self.count.max(0.3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light_store::SampleLight;

    const BRIGHT: f32 = 1e6;

    /// An estimate of 1 with this error and variance, in units of [`BRIGHT`].
    fn estimate(error: f32, variance: f32) -> Estimate {
        let light = Vec3::splat(BRIGHT);
        Estimate { light, error: error * BRIGHT, variance: variance * BRIGHT * BRIGHT }
    }

    fn improved(by: &[f32]) -> f32 {
        let mut sums = Sums::default();
        for light in by {
            sums.add(&Sums::of(SampleLight::new([light * BRIGHT; 3], 1)));
        }
        estimate(0.0, 0.5).improved(&sums, 0.1).light.y / BRIGHT
    }

    #[test]
    fn samples_that_agree_hardly_change_an_estimate() {
        assert_eq!(improved(&[]), 1.0);
        let little = improved(&[1.5, 0.7]);
        assert!((1.0..1.01).contains(&little), "{little}");
    }

    #[test]
    fn many_samples_of_another_light_replace_it_and_one_does_not() {
        let many = improved(&[3.0; 100]);
        assert!((many - 3.0).abs() < 0.1, "{many}");
        let one = improved(&[100.0]);
        assert!(one < 1.1, "{one}");
    }

    #[test]
    fn without_an_estimate_samples_decide_alone() {
        let mut sums = Sums::default();
        sums.add(&Sums::of(SampleLight::new([BRIGHT; 3], 1)));
        let known = Estimate::UNKNOWN.improved(&sums, 0.5);
        assert!(known.error.is_finite() && (known.light.y / BRIGHT - 1.0).abs() < 1e-3);
    }
}
