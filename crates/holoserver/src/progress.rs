//! What a server counts and tells people.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use holo_progress::Meter;
use holo_proto::control::Status;

use crate::coordinator::Goal;

/// Rates are over so long: shorter ones jump, longer ones lag.
const WINDOW: Duration = Duration::from_secs(3);

/// Counts samples and shows how it goes.
#[derive(Debug)]
pub struct Progress {
    before: u64,
    added: u64,
    history: VecDeque<(Instant, u64)>,
    meter: Meter,
    last_error: Option<String>,
}

impl Progress {
    /// For a file that holds `before` samples; with `quiet`, nothing is shown.
    pub fn new(before: u64, quiet: bool) -> Progress {
        let history = VecDeque::from([(Instant::now(), 0)]);
        Progress { before, added: 0, history, meter: Meter::new(quiet), last_error: None }
    }

    /// Samples were stored.
    pub fn add(&mut self, samples: u64) {
        self.added += samples;
    }

    /// Samples added since the start.
    pub fn added(&self) -> u64 {
        self.added
    }

    /// Samples in the file.
    pub fn total(&self) -> u64 {
        self.before + self.added
    }

    /// Samples per second, lately.
    pub fn rate(&mut self) -> f64 {
        let now = Instant::now();
        self.history.push_back((now, self.added));
        while self.history.len() > 2 && now - self.history[1].0 > WINDOW {
            self.history.pop_front();
        }
        let (then, before) = self.history[0];
        (self.added - before) as f64 / (now - then).as_secs_f64().max(1e-3)
    }

    /// A line for people, unless they want none.
    pub fn say(&self, text: &str) {
        self.meter.say(text);
    }

    /// Shows where things are; an error of the disk is said once, loudly, even to those who want quiet.
    pub fn show(&mut self, status: &Status, elapsed: Duration, goal: &Goal, error: Option<&str>) {
        if error != self.last_error.as_deref() {
            if let Some(error) = error {
                eprintln!("samples cannot be stored at the moment, they wait in memory: {error}");
            }
            self.last_error = error.map(str::to_owned);
        }
        let by_time = goal.time.map(|time| elapsed.as_secs_f64() / time.as_secs_f64().max(1e-9));
        let by_samples = goal.samples.map(|samples| self.added as f64 / samples.max(1) as f64);
        let share = by_time.unwrap_or(0.0).max(by_samples.unwrap_or(0.0));
        // A server that serves until it is told to end has nothing to measure itself by; who comes and goes it says.
        if by_time.or(by_samples).is_some() {
            self.meter.show(share, &status.words());
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.meter.finish();
    }
}
