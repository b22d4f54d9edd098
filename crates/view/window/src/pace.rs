//! Measures frame rate and latency at the window.

use std::{
    collections::{BTreeMap, VecDeque},
    time::{Duration, Instant},
};

/// Period over which frames are counted.
const COUNTED: Duration = Duration::from_secs(1);

/// Number of latencies that the median covers.
const LATENCIES: usize = 60;

/// Most inputs that wait for their frame. A further one replaces the oldest.
const MOST_WAITING: usize = 500;

/// Frames shown and inputs sent.
#[derive(Debug, Default)]
pub struct WindowPace {
    sent: BTreeMap<u64, Instant>,
    latencies: VecDeque<Duration>,
    shown: VecDeque<Instant>,
    moved: Option<Instant>,
}

impl WindowPace {
    /// Records that an input that changes the view was sent.
    pub fn sent(&mut self, number: u64, now: Instant) {
        self.sent.insert(number, now);
        if self.sent.len() > MOST_WAITING {
            self.sent.pop_first();
        }
    }

    /// Records that a new frame is shown: the last input that it shows, and whether the eye rests.
    pub fn shown(&mut self, input: u64, is_at_rest: bool, now: Instant) {
        if let Some(sent) = self.sent.get(&input) {
            self.latencies.push_back(now.saturating_duration_since(*sent));
            if self.latencies.len() > LATENCIES {
                self.latencies.pop_front();
            }
        }
        self.sent = self.sent.split_off(&(input + 1));
        if !is_at_rest {
            self.moved = Some(now);
        }
        self.shown.push_back(now);
        while self.shown.front().is_some_and(|&at| at + COUNTED < now) {
            self.shown.pop_front();
        }
    }

    /// Returns the time since the last frame of a moving eye was shown.
    pub fn since_moved(&self, now: Instant) -> Option<Duration> {
        self.moved.map(|moved| now.saturating_duration_since(moved))
    }

    /// Returns the number of frames in the last second, if the eye moved in it.
    pub fn frames_per_second(&self, now: Instant) -> Option<usize> {
        let frames = self.shown.iter().filter(|&&at| at + COUNTED >= now).count();
        let moves = self.since_moved(now).is_some_and(|since| since < COUNTED);
        (moves && frames > 3).then_some(frames)
    }

    /// Returns when the result of [`frames_per_second`](Self::frames_per_second) becomes `None`.
    pub fn until(&self, now: Instant) -> Option<Instant> {
        self.moved.map(|moved| moved + COUNTED).filter(|&end| end > now)
    }

    /// Returns the median time from an input to its frame.
    pub fn latency(&self) -> Option<Duration> {
        let mut sorted: Vec<Duration> = self.latencies.iter().copied().collect();
        sorted.sort_unstable();
        sorted.get(sorted.len() / 2).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn latency_is_from_an_input_to_the_first_frame_that_shows_it() {
        let (mut pace, start) = (WindowPace::default(), Instant::now());
        let at = |milliseconds| start + Duration::from_millis(milliseconds);
        assert_eq!(pace.latency(), None);
        pace.sent(1, at(0));
        pace.sent(2, at(10));
        pace.sent(3, at(50));
        pace.shown(2, false, at(40));
        assert_eq!(pace.latency(), Some(Duration::from_millis(30)));
        // A second frame for the same input adds no latency.
        pace.shown(2, false, at(60));
        pace.shown(3, true, at(70));
        assert_eq!(pace.latencies, [30, 20].map(Duration::from_millis));
    }

    #[test]
    fn frames_are_counted_while_the_eye_moves() {
        let (mut pace, start) = (WindowPace::default(), Instant::now());
        let at = |milliseconds| start + Duration::from_millis(milliseconds);
        (0..50).for_each(|frame| pace.shown(0, true, at(40 * frame)));
        assert_eq!(pace.frames_per_second(at(1960)), None, "the eye rests");
        (50..100).for_each(|frame| pace.shown(0, false, at(40 * frame)));
        assert_eq!(pace.frames_per_second(at(3960)), Some(26));
        assert_eq!(pace.until(at(3960)), Some(at(4960)));
        assert_eq!(pace.frames_per_second(at(4960)), None);
    }
}
