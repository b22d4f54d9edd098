//! How long work shows itself: a bar on a terminal, plain lines otherwise.
//!
//! What always holds: everything goes to standard error, so that results on standard output stay clean.

use std::{
    io::IsTerminal,
    time::{Duration, Instant},
};

pub use indicatif::{HumanBytes, HumanCount};
use indicatif::{ProgressBar, ProgressStyle};

/// How often a plain line is printed.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// Steps of the bar: finer than any terminal is wide.
const STEPS: u64 = 1000;

/// Shows one piece of long work.
#[derive(Debug)]
pub struct Meter {
    start: Instant,
    last_line: Instant,
    shown: Shown,
}

#[derive(Debug)]
enum Shown {
    Bar(ProgressBar),
    Lines,
    Nothing,
}

impl Meter {
    /// Starts now; with `quiet`, shows nothing and says nothing.
    pub fn new(quiet: bool) -> Meter {
        let shown = match (quiet, std::io::stderr().is_terminal()) {
            (true, _) => Shown::Nothing,
            (false, false) => Shown::Lines,
            (false, true) => {
                let bar = ProgressBar::new(STEPS);
                // Only this fixed template is parsed, so the fallback is never seen.
                let style = ProgressStyle::with_template("[{elapsed_precise}] {bar:30} {msg}");
                Shown::Bar(bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())))
            }
        };
        let now = Instant::now();
        Meter { start: now, last_line: now, shown }
    }

    /// Shows where things are: `share` of the work is done (0 to 1), `text` says how it goes. The time left follows from
    /// the share. Call it as often as you like.
    pub fn show(&mut self, share: f64, text: &str) {
        let share = share.clamp(0.0, 1.0);
        if let Shown::Bar(bar) = &self.shown {
            bar.set_position((share * STEPS as f64) as u64);
            bar.set_message(format!("{text}{}", self.left(share)));
        } else if matches!(self.shown, Shown::Lines) && self.last_line.elapsed() >= LINE_EVERY {
            self.last_line = Instant::now();
            eprintln!("{text}{}", self.left(share));
        }
    }

    fn left(&self, share: f64) -> String {
        let left = self.start.elapsed().as_secs_f64() * (1.0 - share) / share;
        if left.is_finite() { format!(", {left:.0} s left") } else { String::new() }
    }

    /// A line that stays.
    pub fn say(&self, text: &str) {
        match &self.shown {
            Shown::Bar(bar) => bar.println(text),
            Shown::Lines => eprintln!("{text}"),
            Shown::Nothing => {}
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}
