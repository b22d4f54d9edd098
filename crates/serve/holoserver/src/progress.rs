//! Counts what a server does, and shows it to people.

use std::{collections::VecDeque, time::Duration};

use holo_beamfile::Stats;
use holo_progress::{HumanBytes, Meter};
use holo_proto::control::Status;
use tokio::time::Instant;
use tracing::error;

use crate::schedule::Schedule;

/// The time over which rates are measured: shorter ones jump, longer ones lag.
const WINDOW: Duration = Duration::from_secs(3);

/// The time over which the file's growth is measured: it comes in blocks, twice a second.
const GROWTH_WINDOW: Duration = Duration::from_secs(10);

/// What a server has done.
#[derive(Clone, Copy, Debug)]
pub struct Totals {
    /// Samples added.
    pub added: u64,
    /// Samples traced again with more paths.
    pub better: u64,
    /// The file's growth over the last ten seconds.
    pub bytes_per_hour: f64,
    /// Seconds since tracing began.
    pub seconds: f64,
}

/// Counts samples and shows them.
#[derive(Debug)]
pub struct SampleProgress {
    before: u64,
    added: u64,
    better: u64,
    traced: Rate,
    bytes: Rate,
    meter: Meter,
    last_error: Option<String>,
}

impl SampleProgress {
    /// Returns a count of 0 for a file in its present state. With `quiet`, nothing is shown.
    pub fn new(file: &Stats, quiet: bool) -> SampleProgress {
        SampleProgress {
            before: file.samples,
            added: 0,
            better: 0,
            traced: Rate::new(WINDOW, 0),
            bytes: Rate::new(GROWTH_WINDOW, file.file_bytes),
            meter: Meter::new(quiet),
            last_error: None,
        }
    }

    /// Counts new samples.
    pub fn add(&mut self, samples: u64) {
        self.added += samples;
    }

    /// Counts samples that took the places of others.
    pub fn add_better(&mut self, samples: u64) {
        self.better += samples;
    }

    /// Returns the samples traced since the start, better ones included.
    pub fn traced(&self) -> u64 {
        self.added + self.better
    }

    /// Returns what was done. `elapsed` is the time since tracing began.
    pub fn totals(&mut self, file: &Stats, elapsed: Duration) -> Totals {
        Totals {
            added: self.added,
            better: self.better,
            bytes_per_hour: 3600.0 * self.bytes.per_second(file.file_bytes),
            seconds: elapsed.as_secs_f64(),
        }
    }

    /// Returns the samples in the file.
    pub fn total(&self) -> u64 {
        self.before + self.added
    }

    /// Returns the samples traced per second, lately.
    pub fn rate(&mut self) -> f64 {
        self.traced.per_second(self.traced())
    }

    /// Prints a line for people, unless they want none.
    pub fn say(&self, text: &str) {
        self.meter.say(text);
    }

    /// Shows how far a server with a goal is.
    ///
    /// An error of the disk is printed once, even with `quiet`.
    pub fn show(&mut self, status: &Status, schedule: &Schedule, file: &Stats) {
        let error = file.last_error.as_deref();
        if error != self.last_error.as_deref() {
            if let Some(error) = error {
                error!(error, "samples wait in memory");
                eprintln!("samples wait in memory, because they cannot be stored: {error}");
            }
            self.last_error = error.map(str::to_owned);
        }
        let goal = schedule.goal;
        // Without a goal there is no share to show; while workers load, they say so themselves.
        if !goal.is_some() || !schedule.has_begun() {
            return;
        }
        let elapsed = schedule.elapsed().as_secs_f64();
        let by_time = goal.time.map_or(0.0, |time| elapsed / time.as_secs_f64().max(1e-9));
        let by_samples =
            goal.samples.map_or(0.0, |samples| self.traced() as f64 / samples.max(1) as f64);
        let by_disk = goal.disk.map_or(0.0, |disk| file.file_bytes as f64 / disk.max(1) as f64);
        let per_hour = self.bytes.per_second(file.file_bytes) * 3600.0;
        let text = format!("{}, {}", status.words(), growth_words(per_hour, file));
        self.meter.show(by_time.max(by_samples).max(by_disk), &text);
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.meter.finish();
    }
}

/// Returns the bytes of a file's samples that better ones have replaced.
pub fn superseded_bytes(stats: &Stats) -> u64 {
    stats.superseded * size_of::<holo_section::Sample>() as u64
}

/// Returns a file's length, its growth, and its superseded bytes, for people.
fn growth_words(per_hour: f64, file: &Stats) -> String {
    let mut words =
        format!("{}, growing by {}/h", HumanBytes(file.file_bytes), HumanBytes(per_hour as u64));
    if file.superseded > 0 {
        words += &format!(" ({} superseded)", HumanBytes(superseded_bytes(file)));
    }
    words
}

/// How fast a count grows.
#[derive(Debug)]
struct Rate {
    window: Duration,
    history: VecDeque<(Instant, u64)>,
}

impl Rate {
    fn new(window: Duration, count: u64) -> Rate {
        Rate { window, history: VecDeque::from([(Instant::now(), count)]) }
    }

    /// Returns the growth per second over the window, with `count` as the present count.
    fn per_second(&mut self, count: u64) -> f64 {
        let now = Instant::now();
        self.history.push_back((now, count));
        while self.history.len() > 2 && now - self.history[1].0 > self.window {
            self.history.pop_front();
        }
        let (then, before) = self.history[0];
        count.saturating_sub(before) as f64 / (now - then).as_secs_f64().max(1e-3)
    }
}
