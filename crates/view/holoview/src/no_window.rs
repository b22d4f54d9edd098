//! What a program without the feature `window` answers to a wish for a window.

use std::path::PathBuf;

use anyhow::{Result, bail};
use holo_net::Shutdown;

use crate::Config;

/// The main thread's part of showing windows: nothing.
pub struct WindowHost;

/// A wish for a window, which is always refused.
pub struct WindowRequest;

/// Returns the two ends of the channel to the main thread.
pub fn desk() -> (WindowRequest, WindowHost) {
    (WindowRequest, WindowHost)
}

impl WindowHost {
    /// Returns at once, because there are no windows to show.
    pub fn serve(self) {}
}

/// Refuses every window.
///
/// # Errors
/// Always, with what to do instead.
pub fn check_desktop() -> Result<()> {
    bail!(
        "this program was built without windows: leave out --window to walk in a browser, or build \
         it with the feature `window`"
    )
}

/// Refuses to show a holodeck in a window.
///
/// # Errors
/// Always, as [`check_desktop`].
pub async fn run_in_window(
    _: Config,
    _: Option<PathBuf>,
    _: Shutdown,
    _: WindowRequest,
) -> Result<()> {
    check_desktop()
}
