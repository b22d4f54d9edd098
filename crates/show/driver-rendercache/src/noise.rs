//! The noise of recent samples, and the weight that the wide filter gets from it.
//!
//! The papers' samples have no noise: 3×3 pixels are enough to smooth over. Samples of one path
//! each need more (docs/notes/render-cache.md).
//!
//! Invariant: without stated noise, no bit of a picture changes.

use crate::RayResult;

/// Least noise for which the wide filter has its full weight: standard deviation over the largest
/// channel.
const FULL: f32 = 0.1;

/// The running mean of the noise that samples state, over about as many samples as points.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MeanNoise {
    sum: f32,
    count: f32,
}

impl MeanNoise {
    /// Adds the noise of new samples for a cache of `capacity` points.
    pub fn take(&mut self, samples: &[RayResult], capacity: usize) {
        let kept = 1.0 - (samples.len() as f32 / capacity as f32).min(1.0);
        (self.sum, self.count) = (self.sum * kept, self.count * kept);
        for sample in samples {
            let largest = sample.radiance.into_iter().fold(0.0, f32::max);
            // Unknown noise counts as much as the light.
            let relative =
                if sample.noise.is_finite() { sample.noise.max(0.0) / largest } else { 1.0 };
            // A black sample without noise says nothing about the noise of others.
            if relative.is_finite() {
                self.sum += relative.min(1.0);
                self.count += 1.0;
            }
        }
    }

    /// Returns the variance of a sample over the square of its light, at most 1.
    pub fn variance(&self) -> f32 {
        if self.sum > 0.0 { (self.sum / self.count).powi(2) } else { 0.0 }
    }

    /// Returns the weight of the wide filter beside the 3×3 filter: `full` if the noise is a tenth
    /// or more, and less in proportion below. In the 3×3 filter, the weights sum to 16.
    pub fn weight(&self, full: f32) -> f32 {
        if self.sum > 0.0 { full * (self.sum / (self.count * FULL)).min(1.0) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::Place;

    fn samples(noise: f32, count: usize) -> Vec<RayResult> {
        vec![RayResult { noise, ..RayResult::new(Place::At(DVec3::ONE), [0.5, 1.0, 0.2]) }; count]
    }

    #[test]
    fn the_wide_filter_weighs_by_the_noise_of_recent_samples() {
        let mut noise = MeanNoise::default();
        assert_eq!(noise.weight(8.0), 0.0);
        noise.take(&samples(0.0, 500), 1000);
        assert_eq!(noise.weight(8.0), 0.0);
        noise.take(&samples(0.05, 1000), 1000);
        assert!((noise.weight(8.0) - 4.0).abs() < 0.01);
        noise.take(&samples(f32::INFINITY, 1000), 1000);
        assert_eq!(noise.weight(8.0), 8.0);
        noise.take(&samples(f32::NAN, 10), 1000);
        assert_eq!(noise.weight(8.0), 8.0);
        // Forgotten once the cache holds others.
        for _ in 0..20 {
            noise.take(&samples(0.0, 1000), 1000);
        }
        assert_eq!(noise.weight(8.0), 0.0);
    }
}
