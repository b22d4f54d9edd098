//! Measures how fast a worker returns work by the server's clock, and determines when a packet is
//! overdue.
//!
//! A worker says itself how long its packets took. A broken or hostile one may say anything, so
//! deadlines follow from what has come back and when.

use std::time::Duration;

use tokio::time::Instant;

/// The deadline of a packet while nothing has come back: long enough for the first rays of a slow
/// scene.
const FIRST_DEADLINE: Duration = Duration::from_secs(10);

/// The least deadline. A machine that swaps may stall for a second.
const LEAST_DEADLINE: Duration = Duration::from_secs(2);

/// The greatest deadline. It limits the cost of a worker that answers ever more slowly.
const GREATEST_DEADLINE: Duration = Duration::from_secs(60);

/// Factor on the expected time that a packet may take. The costs of rays differ by about this
/// factor.
const PATIENCE: f64 = 8.0;

/// Time after which a measurement has half of its weight.
const HALF_LIFE: f64 = 2.0;

/// The work that a worker returns per second while it has any.
#[derive(Debug, Default)]
pub struct WorkerPace {
    work: f64,
    seconds: f64,
    /// When the worker last returned something, or got work after having had none.
    since: Option<Instant>,
}

impl WorkerPace {
    /// Takes note that the worker gets work.
    pub fn begin(&mut self, now: Instant) {
        self.since.get_or_insert(now);
    }

    /// Takes note that the worker has returned so much work. `is_idle` says that it has no more.
    pub fn returned(&mut self, work: f64, is_idle: bool, now: Instant) {
        let seconds = self.since.map_or(0.0, |since| (now - since).as_secs_f64());
        let keep = 0.5_f64.powf(seconds / HALF_LIFE);
        self.work = self.work * keep + work;
        self.seconds = self.seconds * keep + seconds;
        self.since = (!is_idle).then_some(now);
    }

    /// Returns the work per second; `None` before anything was measured.
    pub fn rate(&self) -> Option<f64> {
        (self.seconds > 0.0).then(|| self.work / self.seconds)
    }

    /// Returns how long a packet may take. `ahead` is the work that the worker has, up to and
    /// including the packet.
    pub fn deadline(&self, ahead: f64) -> Duration {
        let Some(rate) = self.rate() else { return FIRST_DEADLINE };
        let expected = PATIENCE * ahead / rate.max(1e-9);
        let greatest = GREATEST_DEADLINE - LEAST_DEADLINE;
        LEAST_DEADLINE + greatest.min(Duration::try_from_secs_f64(expected).unwrap_or(greatest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(start: Instant, seconds: f64) -> Instant {
        start + Duration::from_secs_f64(seconds)
    }

    #[test]
    fn the_rate_is_that_of_the_time_in_which_there_was_work() {
        let start = Instant::now();
        let mut pace = WorkerPace::default();
        assert_eq!((pace.rate(), pace.deadline(1.0)), (None, FIRST_DEADLINE));
        for round in 0..20 {
            // Half a second of work, then ten seconds without any.
            let from = 10.5 * f64::from(round);
            pace.begin(after(start, from));
            pace.returned(50.0, false, after(start, from + 0.25));
            pace.returned(50.0, true, after(start, from + 0.5));
        }
        assert!((pace.rate().unwrap() - 200.0).abs() < 1e-6, "{:?}", pace.rate());
    }

    #[test]
    fn a_deadline_follows_from_the_rate_and_has_bounds() {
        let start = Instant::now();
        let mut pace = WorkerPace::default();
        pace.begin(start);
        pace.returned(100.0, false, after(start, 1.0));
        assert_eq!(pace.deadline(0.0), LEAST_DEADLINE);
        assert_eq!(pace.deadline(100.0), LEAST_DEADLINE + Duration::from_secs_f64(PATIENCE));
        assert_eq!(pace.deadline(1e9), GREATEST_DEADLINE);
        // It becomes ten times as slow: the deadline soon becomes ten times as long.
        for second in 2..20 {
            pace.returned(10.0, false, after(start, f64::from(second)));
        }
        let expected = pace.deadline(10.0) - LEAST_DEADLINE;
        assert!((expected.as_secs_f64() / PATIENCE - 1.0).abs() < 0.05, "{expected:?}");
    }
}
