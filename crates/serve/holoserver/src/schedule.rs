//! When a server ends by itself, and whether it is ending.

use std::time::Duration;

use tokio::time::Instant;

/// Dealing stops this long before the time is up, so that packets under way are finished.
const LAST_DEAL: Duration = Duration::from_millis(100);

/// Longest time that the end waits for packets under way. A person who ends a server waits no
/// longer than two seconds. The remaining packets are traced next time.
const LAST_PACKETS: Duration = Duration::from_millis(1500);

/// When a server ends by itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct Goal {
    /// The longest time of tracing, from the moment that the first worker is ready.
    pub time: Option<Duration>,
    /// The number of samples traced, better ones included.
    pub samples: Option<u64>,
    /// The length of the file, bytes.
    pub disk: Option<u64>,
}

impl Goal {
    /// Returns whether there is any.
    pub fn is_some(&self) -> bool {
        self.time.is_some() || self.samples.is_some() || self.disk.is_some()
    }
}

/// A goal and the clock that runs towards it.
#[derive(Debug)]
pub struct Schedule {
    /// The goal.
    pub goal: Goal,
    began: Option<Instant>,
    ending: Option<Instant>,
}

impl Schedule {
    /// Returns a schedule whose clock stands still.
    pub fn new(goal: Goal) -> Schedule {
        Schedule { goal, began: None, ending: None }
    }

    /// Starts the clock, unless it runs: a worker is ready to trace.
    pub fn begin(&mut self) {
        self.began.get_or_insert_with(Instant::now);
    }

    /// Returns how long ago tracing began; 0 if it has not.
    pub fn elapsed(&self) -> Duration {
        self.began.map_or(Duration::ZERO, |began| began.elapsed())
    }

    /// Returns whether tracing has begun.
    pub fn has_begun(&self) -> bool {
        self.began.is_some()
    }

    /// Returns whether the goal's time, samples or file length are reached.
    pub fn is_reached(&self, traced: u64, bytes: u64) -> bool {
        let time = self.goal.time.filter(|_| self.has_begun());
        time.is_some_and(|time| self.elapsed() + LAST_DEAL >= time)
            || self.goal.samples.is_some_and(|samples| traced >= samples)
            || self.goal.disk.is_some_and(|disk| bytes >= disk)
    }

    /// Begins the end: no new work is given out from now on.
    pub fn end(&mut self) {
        self.ending.get_or_insert_with(Instant::now);
    }

    /// Returns whether the end has begun.
    pub fn is_ending(&self) -> bool {
        self.ending.is_some()
    }

    /// Returns whether the end has waited long enough for packets under way.
    pub fn is_overdue(&self) -> bool {
        self.ending.is_some_and(|since| since.elapsed() > LAST_PACKETS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_counts_from_the_first_worker_that_is_ready() {
        let mut schedule = Schedule::new(Goal { time: Some(Duration::ZERO), ..Goal::default() });
        assert!(!schedule.is_reached(0, 0), "nobody traces yet: the scene may still be loading");
        schedule.begin();
        assert!(schedule.is_reached(0, 0));
    }

    #[test]
    fn whichever_part_of_a_goal_comes_first_ends_it() {
        let time = Some(Duration::from_secs(3600));
        let mut schedule = Schedule::new(Goal { time, samples: Some(5), disk: Some(1000) });
        schedule.begin();
        assert!(!schedule.is_reached(4, 999));
        assert!(schedule.is_reached(5, 0) && schedule.is_reached(0, 1000));
    }
}
