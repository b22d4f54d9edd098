//! A session in a window.

use std::path::PathBuf;

use anyhow::Result;
use holo_net::Shutdown;
use holo_options::ViewArgs;

use crate::Config;

pub use holo_window::{WindowHost, WindowRequest, check_desktop, desk};

/// Shows a server's holodeck in a window until the window is closed or `shutdown` is triggered.
/// Closing the window triggers `shutdown`.
///
/// If the session fails, the window shows the reason and stays until it is closed.
///
/// # Errors
/// If no window can be opened, or the server cannot be reached or is lost.
pub async fn run_in_window(
    config: Config,
    record: Option<PathBuf>,
    shutdown: Shutdown,
    screen: WindowRequest,
) -> Result<()> {
    check_desktop()?;
    config.check()?;
    let look = config.look.look().map_err(anyhow::Error::msg)?;
    let size = config.view.size.unwrap_or(holo_window::SIZE);
    let view = ViewArgs { size: Some(size), ..config.view };
    let stage = Config { view, ..config }.stage(record, shutdown.clone()).await?;
    let closing = shutdown.clone();
    let closed = Box::new(move || closing.trigger());
    let ended = async move { shutdown.wait().await };
    holo_window::run(stage, look, size, closed, ended, screen).await
}
