//! The limit on the size of files that a user may write (`ulimit -f`).

use std::io;

use tokio::signal::unix::{SignalKind, signal};

/// Makes writes beyond the limit fail, as writes to a full disk do.
///
/// Without it, the signal SIGXFSZ ends the process, and the samples in its memory are lost. Must be
/// called within a tokio runtime.
///
/// # Errors
/// The system's, if the signal cannot be handled.
pub fn outlive_file_size_limit() -> io::Result<()> {
    // The handler stays until the process ends, although nothing reads its stream.
    signal(SignalKind::from_raw(rustix::process::Signal::XFSZ.as_raw())).map(drop)
}
