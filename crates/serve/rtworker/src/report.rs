//! Reports of a worker while it loads, to people or to the program that started it.

use std::{
    fmt,
    time::{Duration, Instant},
};

use holo_progress::{HumanBytes, Meter};

/// Interval between reports to the program that started this one.
const REPORT_EVERY: Duration = Duration::from_millis(200);

/// One line on the standard output of a worker that another program has started.
#[derive(Clone, Debug, PartialEq)]
pub enum ReportState {
    /// The worker is loading the scene.
    Loading {
        /// Finished share of this step, 0 to 1.
        share: f64,
        /// Name of this step, for people.
        text: String,
    },
    /// The worker is ready to trace.
    Ready,
}

impl fmt::Display for ReportState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ReportState::Loading { share, text } => write!(f, "loading {share:.3} {text}"),
            ReportState::Ready => f.write_str("ready"),
        }
    }
}

impl ReportState {
    /// Parses a line; `None` for any other line.
    pub fn parse(line: &str) -> Option<ReportState> {
        if line == "ready" {
            return Some(ReportState::Ready);
        }
        let (share, text) = line.strip_prefix("loading ")?.split_once(' ')?;
        Some(ReportState::Loading { share: share.parse().ok()?, text: text.to_owned() })
    }
}

/// The receiver of reports.
#[derive(Debug)]
pub enum Reporter {
    /// To people: a bar, or lines on standard error.
    People(Box<Meter>),
    /// To the program that started this one: lines on standard output.
    Parent {
        /// Time of the last report.
        last: Option<Instant>,
    },
}

impl Reporter {
    /// Returns a reporter. With `quiet`, nothing is reported to people.
    pub fn new(with_parent: bool, quiet: bool) -> Reporter {
        if with_parent {
            Reporter::Parent { last: None }
        } else {
            Reporter::People(Box::new(Meter::new(quiet)))
        }
    }

    /// Reports that `share` of a step of loading is done (0 to 1).
    pub fn loading(&mut self, share: f64, text: &str) {
        match self {
            Reporter::People(meter) => meter.show(share, text),
            Reporter::Parent { last } => {
                if last.is_none_or(|last| last.elapsed() >= REPORT_EVERY) {
                    *last = Some(Instant::now());
                    holo_progress::print_line!(
                        "{}",
                        ReportState::Loading { share, text: text.to_owned() }
                    );
                }
            }
        }
    }

    /// Reports that tracing can begin.
    pub fn ready(&mut self) {
        match self {
            Reporter::People(meter) => meter.finish(),
            Reporter::Parent { .. } => holo_progress::print_line!("{}", ReportState::Ready),
        }
    }
}

/// Returns the text for a transfer of `done` of `total` bytes since `start`.
pub fn transfer_text(done: u64, total: u64, start: Instant) -> String {
    let rate = done as f64 / start.elapsed().as_secs_f64().max(1e-3);
    format!(
        "fetching the scene: {} of {}, {}/s",
        HumanBytes(done),
        HumanBytes(total),
        HumanBytes(rate as u64)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_of_a_worker_can_be_parsed_by_its_parent() {
        let loading =
            ReportState::Loading { share: 0.25, text: "fetching: 1 MiB of 4 MiB".to_owned() };
        for report in [loading, ReportState::Ready] {
            assert_eq!(ReportState::parse(&report.to_string()), Some(report));
        }
        for other in ["", "readiness", "loading", "loading much of it", "a panic"] {
            assert_eq!(ReportState::parse(other), None, "{other}");
        }
    }
}
