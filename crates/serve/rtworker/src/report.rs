//! Reports of a worker while it loads, to people or to the program that started it.

use std::{
    io,
    time::{Duration, Instant},
};

use holo_net::ParentLink;
use holo_progress::{HumanBytes, Meter};
use serde::{Deserialize, Serialize};

use crate::WorkerConfig;

/// Interval between reports to the program that started this one.
const REPORT_EVERY: Duration = Duration::from_millis(200);

/// A report of a worker to the program that started it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum WorkerProgress {
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

/// The receiver of reports.
#[derive(Debug)]
pub enum Reporter {
    /// To people: a bar, or lines on standard error.
    People(Box<Meter>),
    /// To a script: a line on standard output once the worker is ready.
    Script,
    /// To the program that started this one.
    Parent {
        /// The link to it.
        link: ParentLink,
        /// Time of the last report.
        last: Option<Instant>,
    },
}

impl Reporter {
    /// Returns the reporter that the options ask for.
    ///
    /// # Errors
    /// If reports are wanted, and there is no link to the program that started this one.
    pub fn new(config: &WorkerConfig) -> io::Result<Reporter> {
        Ok(match (config.reports, config.with_parent) {
            (true, _) => Reporter::Parent { link: ParentLink::of_standard_input()?, last: None },
            (false, true) => Reporter::Script,
            (false, false) => Reporter::People(Box::new(Meter::new(config.quiet))),
        })
    }

    /// Reports that `share` of a step of loading is done (0 to 1).
    pub fn loading(&mut self, share: f64, text: &str) {
        match self {
            Reporter::People(meter) => meter.show(share, text),
            Reporter::Script => {}
            Reporter::Parent { link, last } => {
                if last.is_none_or(|last| last.elapsed() >= REPORT_EVERY) {
                    *last = Some(Instant::now());
                    link.report(&WorkerProgress::Loading { share, text: text.to_owned() });
                }
            }
        }
    }

    /// Reports that tracing can begin.
    pub fn ready(&mut self) {
        match self {
            Reporter::People(meter) => meter.finish(),
            Reporter::Script => holo_progress::print_line!("ready"),
            Reporter::Parent { link, .. } => link.report(&WorkerProgress::Ready),
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
