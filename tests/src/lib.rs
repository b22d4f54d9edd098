//! Whole-system tests: the built `holodeck` program is run as a person runs it, in processes of its
//! own.
//!
//! This library is what the tests under `tests/` share. Invariants:
//! - every process started here is killed by its id and waited for when its [`Process`] is dropped,
//!   and ends by itself if the test's own process is gone;
//! - every wait has a limit, and a test that passes one fails with what the process has said;
//! - nothing outside a test's temporary folder is read or written, the user's cache of scenes
//!   included.

// A library for tests alone: what goes wrong in it is a failed test.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

pub mod analytic;
mod chromium;
mod files;
mod link;
mod network;
mod place;
mod process;
mod program;
mod xvfb;

pub use chromium::Chromium;
pub use files::{Stored, beam, stored};
pub use link::{Link, Quality, State};
pub use network::Network;
pub use place::{CORNELL_SMALL_SECTION, Place, Server, listen_address};
pub use process::{Ended, Process};
pub use program::{cargo, program, workspace};
pub use xvfb::Desktop;

use std::time::{Duration, Instant};

/// The limit of every wait. Only a hang reaches it, however busy the machine is.
pub const LIMIT: Duration = Duration::from_secs(120);

/// Waits until `condition` gives a value.
///
/// # Panics
/// After [`LIMIT`], saying `what` was waited for.
#[track_caller]
pub fn wait_until<T>(what: &str, mut condition: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(value) = condition() {
            return value;
        }
        assert!(start.elapsed() < LIMIT, "waited {LIMIT:?} in vain: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Gives `attempt` 1 second, then 2, 4 … until its result is good, and returns the last result.
///
/// For programs that are told how long to work: a busy machine needs longer for the same work. A
/// program that is wrong stays wrong after 64 seconds.
pub fn patiently<T>(mut attempt: impl FnMut(u32) -> T, is_good: impl Fn(&T) -> bool) -> T {
    let mut seconds = 1;
    loop {
        let result = attempt(seconds);
        if seconds == 64 || is_good(&result) {
            return result;
        }
        seconds *= 2;
    }
}
