//! The log of a server, for programs: one JSON object in each line, with the time, the event and
//! its facts. It does not contain what people read on standard error.

use std::{fs::OpenOptions, path::Path};

use anyhow::{Context, Result};
use tracing_appender::non_blocking::{self, WorkerGuard};

/// Starts to append this process's events to a file. A thread writes them: an event waits for no
/// disk. Everything is written once the result is dropped.
///
/// # Errors
/// If the file cannot be opened, or this process has a log already.
pub fn start(path: &Path) -> Result<WorkerGuard> {
    let file = OpenOptions::new().append(true).create(true).open(path);
    let file = file.with_context(|| format!("opening the log {}", path.display()))?;
    let (writer, guard) = non_blocking::NonBlocking::new(file);
    let subscriber = tracing_subscriber::fmt().json().flatten_event(true).with_target(false);
    subscriber
        .with_writer(writer)
        .try_init()
        .map_err(|error| anyhow::anyhow!("the log {}: {error}", path.display()))?;
    Ok(guard)
}
