//! Estimates how many rays a record needs, from its own pilot rays and those of all earlier
//! records.

use std::sync::atomic::{AtomicU64, Ordering};

use holo_light::Record;

/// Least relative standard deviation of a record's rays that is assumed, over the mean of all
/// records so far. Few pilot rays that agree much better than elsewhere may have missed something
/// bright.
const LEAST_DEVIATION: f32 = 0.7;

/// Relative standard deviation assumed before there are records.
const FIRST_DEVIATION: f32 = 1.0;
/// Number of records that this assumption counts as.
const FIRST_RECORDS: f32 = 8.0;
/// Most that one record contributes to the mean.
const MOST_DEVIATION: f32 = 16.0;

/// Unit of [`Deviations::sum`].
const DEVIATION_STEPS: f32 = 1024.0;

/// Statistics of how much the rays of a scene's records differ.
#[derive(Debug, Default)]
pub(crate) struct Deviations {
    /// Sum of relative standard deviations, in steps.
    sum: AtomicU64,
    pilots: AtomicU64,
}

impl Deviations {
    /// Returns the standard deviation of a record's rays over their mean, estimated from its pilot
    /// and all earlier pilots. Adds the pilot to the statistics.
    pub fn add(&self, pilot: &Record) -> f32 {
        let own = pilot.error * (pilot.rays as f32).sqrt();
        let sum = self
            .sum
            .fetch_add((own.min(MOST_DEVIATION) * DEVIATION_STEPS) as u64, Ordering::Relaxed);
        let count = self.pilots.fetch_add(1, Ordering::Relaxed);
        let first = FIRST_RECORDS * FIRST_DEVIATION;
        let usual = (sum as f32 / DEVIATION_STEPS + first) / (count as f32 + FIRST_RECORDS);
        own.max(LEAST_DEVIATION * usual)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn pilot(error: f32, rays: u32) -> Record {
        Record { error, rays, ..Record::zeroed() }
    }

    #[test]
    fn a_pilot_that_missed_bright_light_is_assumed_to_vary_as_others_did() {
        let near = |found: f32, expected: f32| {
            assert!((found - expected).abs() < 1e-3 * expected, "{found} {expected}")
        };
        let deviations = Deviations::default();
        near(deviations.add(&pilot(0.0, 64)), LEAST_DEVIATION * FIRST_DEVIATION);
        let deviations = Deviations::default();
        (0..1992).for_each(|_| near(deviations.add(&pilot(3.0 / 8.0, 64)), 3.0));
        // The mean of 1992 deviations of 3 and of the initial assumption.
        let usual = (1992.0 * 3.0 + FIRST_RECORDS * FIRST_DEVIATION) / 2000.0;
        near(deviations.add(&pilot(0.0, 32)), LEAST_DEVIATION * usual);
        // A record's own deviation counts in full for itself, and at most MOST_DEVIATION for later
        // ones.
        near(deviations.add(&pilot(5.0, 64)), 40.0);
        deviations.add(&pilot(f32::INFINITY, 64));
        deviations.add(&pilot(f32::NAN, 64));
        let usual =
            (1992.0 * 3.0 + 3.0 * MOST_DEVIATION + FIRST_RECORDS * FIRST_DEVIATION) / 2004.0;
        near(deviations.add(&pilot(0.0, 64)), LEAST_DEVIATION * usual);
    }
}
