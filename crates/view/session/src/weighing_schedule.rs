//! When the beams of a view at rest are weighed by the error of what is shown.

use std::time::{Duration, Instant};

/// Time from the request of a view until its beams are weighed first.
const FIRST: Duration = Duration::from_millis(1000);

/// Longest time between two such requests.
const LONGEST: Duration = Duration::from_secs(30);

/// When the beams of a view are weighed next.
#[derive(Clone, Copy, Debug)]
pub struct WeighingSchedule {
    due: Instant,
    interval: Duration,
}

impl WeighingSchedule {
    /// Returns the schedule of a view that was requested at `since`.
    pub fn new(since: Instant) -> WeighingSchedule {
        WeighingSchedule { due: since + FIRST, interval: FIRST }
    }

    /// Returns when the beams are weighed next.
    pub fn due(&self) -> Instant {
        self.due
    }

    /// Records that the beams are weighed now.
    pub fn advance(&mut self, now: Instant) {
        self.interval = (2 * self.interval).min(LONGEST);
        self.due = now + self.interval;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_is_weighed_after_a_second_and_then_ever_more_rarely() {
        let since = Instant::now();
        let mut schedule = WeighingSchedule::new(since);
        let mut seconds = Vec::new();
        while seconds.len() < 8 {
            let due = schedule.due();
            seconds.push((due - since).as_secs());
            schedule.advance(due);
        }
        assert_eq!(seconds, [1, 3, 7, 15, 31, 61, 91, 121]);
    }
}
