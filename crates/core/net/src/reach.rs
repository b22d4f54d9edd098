//! Connects to a server that is not running yet, or has just ended, with growing pauses between
//! attempts.

use std::time::Duration;

use holo_proto::{control::Welcome, hello::Role};
use tokio::time::{Instant, sleep};

use crate::{Destination, Inbox, MachineKey, NetError, Outbox, connect_as};

/// Pause after the first attempt. A server that is just starting is ready soon.
const FIRST_PAUSE: Duration = Duration::from_millis(250);

/// Longest pause. 256 peers of a server that is gone are then no burden.
const LONGEST_PAUSE: Duration = Duration::from_secs(8);

/// Longest time that a server takes to start again, about. It reads the directory of a large file,
/// and writes a large scene.
pub const RETURN_TIME: Duration = Duration::from_secs(300);

/// Connects as [`connect_as`] does. If no server answers, tries again for `patience`, with pauses
/// that double. Calls `waiting` before each pause.
///
/// # Errors
/// As [`connect_as`]. If a server answers and refuses, there is no other attempt.
pub async fn reach(
    server: &Destination,
    role: Role,
    name: &str,
    machine: Option<&MachineKey>,
    patience: Duration,
    mut waiting: impl FnMut(&NetError, Duration),
) -> Result<(Inbox, Outbox, Welcome), NetError> {
    let start = Instant::now();
    let mut pause = FIRST_PAUSE;
    loop {
        let error = match connect_as(server.clone(), role, name, machine).await {
            Err(error @ (NetError::Io(_) | NetError::Closed | NetError::Handshake)) => error,
            connected => return connected,
        };
        let left = patience.saturating_sub(start.elapsed());
        if left.is_zero() {
            return Err(error);
        }
        // The last attempt is made when `patience` ends.
        let next = pause.min(left);
        waiting(&error, next);
        sleep(next).await;
        pause = (2 * pause).min(LONGEST_PAUSE);
    }
}
