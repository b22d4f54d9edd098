//! Progress of long work: a bar on a terminal, a line every few seconds otherwise.

use std::{
    io::IsTerminal,
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};

/// Time between two plain lines, and before the first one.
const LINE_EVERY: Duration = Duration::from_secs(5);
const FIRST_LINE: Duration = Duration::from_secs(1);

/// Number of steps of the bar. No terminal has so many columns.
const STEPS: u64 = 1000;

/// Shows the progress of one piece of work.
#[derive(Debug)]
pub struct Meter {
    /// Time of the first report.
    start: Option<Instant>,
    /// Time from which the next plain line may be printed.
    next_line: Instant,
    output: Output,
}

#[derive(Debug)]
enum Output {
    Bar(ProgressBar),
    Lines,
    Nothing,
}

impl Meter {
    /// Starts a meter. With `quiet`, it prints nothing.
    pub fn new(quiet: bool) -> Meter {
        let output = match (quiet, std::io::stderr().is_terminal()) {
            (true, _) => Output::Nothing,
            (false, false) => Output::Lines,
            (false, true) => {
                let bar = ProgressBar::new(STEPS);
                // Only this fixed template is parsed, so the fallback is never seen.
                let style = ProgressStyle::with_template("[{elapsed_precise}] {bar:30} {msg}");
                Output::Bar(bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())))
            }
        };
        Meter { start: None, next_line: Instant::now() + FIRST_LINE, output }
    }

    /// Shows that `share` of the work (0 to 1) is done, with a text and the estimated time left.
    /// Frequent calls cost little.
    pub fn show(&mut self, share: f64, text: &str) {
        let share = share.clamp(0.0, 1.0);
        let left = self.start.map_or_else(String::new, |start| left(start.elapsed(), share));
        let is_first = self.start.replace(self.start.unwrap_or_else(Instant::now)).is_none();
        match &self.output {
            Output::Bar(bar) => {
                if is_first {
                    bar.reset_elapsed();
                }
                bar.set_position((share * STEPS as f64) as u64);
                bar.set_message(format!("{text}{left}"));
            }
            Output::Lines if Instant::now() >= self.next_line => {
                self.next_line = Instant::now() + LINE_EVERY;
                eprintln!("{text}{left}");
            }
            Output::Lines | Output::Nothing => {}
        }
    }

    /// Prints a line above the bar.
    pub fn say(&self, text: &str) {
        match &self.output {
            Output::Bar(bar) => bar.println(text),
            Output::Lines => eprintln!("{text}"),
            Output::Nothing => {}
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        if let Output::Bar(bar) = &self.output {
            bar.finish_and_clear();
        }
    }
}

/// Returns the time left as text; empty if no estimate is possible yet.
fn left(elapsed: Duration, share: f64) -> String {
    let left = elapsed.as_secs_f64() * (1.0 - share) / share;
    if left.is_finite() { format!(", {left:.0} s left") } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_follows_from_the_share() {
        let ten = Duration::from_secs(10);
        assert_eq!(left(ten, 0.25), ", 30 s left");
        assert_eq!(left(ten, 1.0), ", 0 s left");
        assert_eq!(left(ten, 0.0), "", "nothing is known yet");
    }
}
