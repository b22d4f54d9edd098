//! What a server counts and tells people.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use holo_beamfile::Stats;
use holo_progress::{HumanBytes, Meter};
use holo_proto::control::Status;

use crate::{coordinator::Goal, superseded_bytes};

/// Rates are over so long: shorter ones jump, longer ones lag.
const WINDOW: Duration = Duration::from_secs(3);

/// The file's growth is over so long: it comes in blocks, twice a second.
const GROWTH_WINDOW: Duration = Duration::from_secs(10);

/// What a server has done.
#[derive(Clone, Copy, Debug)]
pub struct Done {
    /// Samples added.
    pub added: u64,
    /// Samples traced again with more paths.
    pub better: u64,
    /// How fast the file grew lately.
    pub bytes_per_hour: f64,
}

/// Counts samples and shows how it goes.
#[derive(Debug)]
pub struct Progress {
    before: u64,
    added: u64,
    better: u64,
    traced: Lately,
    bytes: Lately,
    meter: Meter,
    last_error: Option<String>,
}

impl Progress {
    /// For a file as it is before; with `quiet`, nothing is shown.
    pub fn new(file: &Stats, quiet: bool) -> Progress {
        let traced = Lately::new(WINDOW, 0);
        let bytes = Lately::new(GROWTH_WINDOW, file.file_bytes);
        Progress {
            before: file.samples,
            added: 0,
            better: 0,
            traced,
            bytes,
            meter: Meter::new(quiet),
            last_error: None,
        }
    }

    /// Samples were stored.
    pub fn add(&mut self, samples: u64) {
        self.added += samples;
    }

    /// Samples were stored in the places of others.
    pub fn add_better(&mut self, samples: u64) {
        self.better += samples;
    }

    /// Samples traced since the start, better ones included.
    pub fn traced(&self) -> u64 {
        self.added + self.better
    }

    /// What was done, the file being as it is now.
    pub fn done(&mut self, file: &Stats) -> Done {
        Done {
            added: self.added,
            better: self.better,
            bytes_per_hour: 3600.0 * self.bytes.rate(file.file_bytes),
        }
    }

    /// Samples in the file.
    pub fn total(&self) -> u64 {
        self.before + self.added
    }

    /// Samples per second, lately.
    pub fn rate(&mut self) -> f64 {
        self.traced.rate(self.traced())
    }

    /// A line for people, unless they want none.
    pub fn say(&self, text: &str) {
        self.meter.say(text);
    }

    /// Shows where things are; an error of the disk is said once, loudly, even to those who want quiet.
    pub fn show(&mut self, status: &Status, elapsed: Duration, goal: &Goal, file: &Stats) {
        let error = file.last_error.as_deref();
        if error != self.last_error.as_deref() {
            if let Some(error) = error {
                eprintln!("samples cannot be stored at the moment, they wait in memory: {error}");
            }
            self.last_error = error.map(str::to_owned);
        }
        let by_time = goal.time.map(|time| elapsed.as_secs_f64() / time.as_secs_f64().max(1e-9));
        let by_samples = goal.samples.map(|samples| self.traced() as f64 / samples.max(1) as f64);
        let share = by_time.unwrap_or(0.0).max(by_samples.unwrap_or(0.0));
        let per_hour = self.bytes.rate(file.file_bytes) * 3600.0;
        // A server that serves until it is told to end has nothing to measure itself by; who comes and goes it says.
        if by_time.or(by_samples).is_some() {
            let text = format!("{}, {}", status.words(), growth_words(per_hour, file));
            self.meter.show(share, &text);
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.meter.finish();
    }
}

/// A file's length, its growth, and what of it nobody reads, for people.
fn growth_words(per_hour: f64, file: &Stats) -> String {
    let mut words =
        format!("{} and {} more an hour", HumanBytes(file.file_bytes), HumanBytes(per_hour as u64));
    if file.superseded > 0 {
        words += &format!(" ({} superseded)", HumanBytes(superseded_bytes(file)));
    }
    words
}

/// How fast a count has grown lately.
#[derive(Debug)]
struct Lately {
    window: Duration,
    history: VecDeque<(Instant, u64)>,
}

impl Lately {
    fn new(window: Duration, count: u64) -> Lately {
        Lately { window, history: VecDeque::from([(Instant::now(), count)]) }
    }

    /// Growth per second over the window, `count` being the count now.
    fn rate(&mut self, count: u64) -> f64 {
        let now = Instant::now();
        self.history.push_back((now, count));
        while self.history.len() > 2 && now - self.history[1].0 > self.window {
            self.history.pop_front();
        }
        let (then, before) = self.history[0];
        count.saturating_sub(before) as f64 / (now - then).as_secs_f64().max(1e-3)
    }
}
