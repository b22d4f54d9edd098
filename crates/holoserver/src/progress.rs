//! What a server tells people: a bar with rate and time left on a terminal, plain lines otherwise.

use std::{
    collections::VecDeque,
    io::IsTerminal,
    time::{Duration, Instant},
};

use indicatif::{HumanCount, ProgressBar, ProgressStyle};

use crate::coordinator::Goal;

/// Rates are over so long: shorter ones jump, longer ones lag.
const WINDOW: Duration = Duration::from_secs(3);

/// How often a plain line is printed.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// Counts samples and shows how it goes.
#[derive(Debug)]
pub struct Progress {
    before: u64,
    added: u64,
    history: VecDeque<(Instant, u64)>,
    bar: Option<ProgressBar>,
    quiet: bool,
    last_line: Instant,
    last_error: Option<String>,
}

impl Progress {
    /// For a file that holds `before` samples. With `report`, a bar or lines appear on standard error.
    pub fn new(before: u64, report: bool, quiet: bool) -> Progress {
        let bar = (report && !quiet && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::new(1000);
            // Only a fixed template is parsed, so the fallback is never seen.
            let style = ProgressStyle::with_template("[{elapsed_precise}] {bar:30} {msg}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        let now = Instant::now();
        let quiet = quiet || !report;
        let history = VecDeque::from([(now, 0)]);
        Progress { before, added: 0, history, bar, quiet, last_line: now, last_error: None }
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
        match &self.bar {
            Some(bar) => bar.println(text),
            None if !self.quiet => eprintln!("{text}"),
            None => {}
        }
    }

    /// Shows where things are; an error of the disk is said once, loudly, even to those who want quiet.
    pub fn show(&mut self, workers: u32, elapsed: Duration, goal: &Goal, error: Option<&str>) {
        if error != self.last_error.as_deref() {
            if let Some(error) = error {
                eprintln!("samples cannot be stored at the moment, they wait in memory: {error}");
            }
            self.last_error = error.map(str::to_owned);
        }
        let rate = self.rate();
        let (share, left) = self.share_and_left(rate, elapsed, goal);
        let workers = if workers == 1 { "1 worker".to_owned() } else { format!("{workers} workers") };
        let left = left.map_or(String::new(), |left| format!(", {:.0} s left", left.as_secs_f64()));
        let text = format!("{} samples, {}/s, {workers}{left}", HumanCount(self.total()), HumanCount(rate as u64));
        if let Some(bar) = &self.bar {
            bar.set_position((share * 1000.0) as u64);
            bar.set_message(text);
        } else if !self.quiet && self.last_line.elapsed() >= LINE_EVERY {
            self.last_line = Instant::now();
            eprintln!("{text}");
        }
    }

    fn share_and_left(&self, rate: f64, elapsed: Duration, goal: &Goal) -> (f64, Option<Duration>) {
        if let Some(time) = goal.time {
            let share = elapsed.as_secs_f64() / time.as_secs_f64().max(1e-9);
            return (share.min(1.0), Some(time.saturating_sub(elapsed)));
        }
        let Some(samples) = goal.samples else { return (0.0, None) };
        let left = samples.saturating_sub(self.added) as f64 / rate.max(1e-9);
        let share = self.added as f64 / samples.max(1) as f64;
        (share.min(1.0), Duration::try_from_secs_f64(left).ok().filter(|_| rate > 0.0))
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
