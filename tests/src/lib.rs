//! Whole-system tests: they run the built `holodeck` program as a person does, in separate
//! processes.
//!
//! The tests under `tests/` share this library. Invariants:
//! - Every process started here is killed by its id and waited for when its [`Process`] is dropped.
//!   It also ends by itself if the test's own process is gone.
//! - Every wait has a limit. A test that exceeds it fails with the output of the process.
//! - Nothing outside a test's temporary folder is read or written, including the user's cache of
//!   scenes.

// This library is for tests alone, so a panic in it is a failed test.
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

pub use chromium::{Chromium, Modifier};
pub use files::{Stored, beam, stored};
pub use link::{Link, Quality, State};
pub use network::Network;
pub use place::{CORNELL_SMALL_SECTION, Place, Server, listen_address};
pub use process::{Ended, Process};
pub use program::{cargo, program, workspace};
pub use xvfb::Desktop;

use std::time::{Duration, Instant};

/// The limit of every wait. Even on a busy machine, only a hang reaches it.
pub const LIMIT: Duration = Duration::from_secs(120);

/// Waits until `condition` gives a value.
///
/// # Panics
/// After [`LIMIT`], with `what` in the message.
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

/// Calls `attempt` with 1 second, then 2, 4 … until its result is good, and returns the last
/// result.
///
/// It serves programs with a time limit, because a busy machine needs longer for the same work. A
/// wrong program is still wrong after 64 seconds.
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
