//! How many rays records need: by how much those of pilots differ, this one's and all others'.

use std::sync::atomic::{AtomicU64, Ordering};

use holo_light::Record;

/// Standard deviation of a record's rays, over their mean, that is reckoned with at least, over that of records so far: where few rays
/// tell that they differ by much less than elsewhere, they may have missed what is bright.
const LEAST_DEVIATION: f32 = 0.7;

/// What is reckoned with before there are records, as if there were so many; and what one counts at most.
const FIRST_DEVIATION: f32 = 1.0;
const FIRST_RECORDS: f32 = 8.0;
const MOST_DEVIATION: f32 = 16.0;

/// Unit of [`Deviations`].
const DEVIATION_STEPS: f32 = 1024.0;

/// By how much the rays of a scene's records differ, as their pilots tell.
#[derive(Debug, Default)]
pub(crate) struct Deviations {
    /// Sum of standard deviations over means, in steps.
    sum: AtomicU64,
    pilots: AtomicU64,
}

impl Deviations {
    /// Standard deviation of a record's rays over their mean, by those of its pilot and of all pilots before it.
    pub fn take_in(&self, pilot: &Record) -> f32 {
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
    fn a_pilot_that_missed_what_is_bright_is_reckoned_with_as_others_were() {
        let near = |found: f32, expected: f32| {
            assert!((found - expected).abs() < 1e-3 * expected, "{found} {expected}")
        };
        let deviations = Deviations::default();
        near(deviations.take_in(&pilot(0.0, 64)), LEAST_DEVIATION * FIRST_DEVIATION);
        let deviations = Deviations::default();
        (0..1992).for_each(|_| near(deviations.take_in(&pilot(3.0 / 8.0, 64)), 3.0));
        // As the mean of 1992 of 3 and of what is reckoned with at first.
        let usual = (1992.0 * 3.0 + FIRST_RECORDS * FIRST_DEVIATION) / 2000.0;
        near(deviations.take_in(&pilot(0.0, 32)), LEAST_DEVIATION * usual);
        // Its own counts in full, but no more than others to those after it, whatever it is.
        near(deviations.take_in(&pilot(5.0, 64)), 40.0);
        deviations.take_in(&pilot(f32::INFINITY, 64));
        deviations.take_in(&pilot(f32::NAN, 64));
        let usual =
            (1992.0 * 3.0 + 3.0 * MOST_DEVIATION + FIRST_RECORDS * FIRST_DEVIATION) / 2004.0;
        near(deviations.take_in(&pilot(0.0, 64)), LEAST_DEVIATION * usual);
    }
}
