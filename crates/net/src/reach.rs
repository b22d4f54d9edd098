//! Reaching a server that is not there yet, or has just gone: with growing pauses.

use std::time::Duration;

use holo_proto::{control::Welcome, hello::Role};
use tokio::time::{Instant, sleep};

use crate::{Destination, Inbox, NetError, Outbox, connect};

/// The pause after the first attempt. A server that is being started is there soon.
const FIRST_PAUSE: Duration = Duration::from_millis(250);

/// The longest pause: long enough that 256 peers of a server that is gone are no burden.
const LONGEST_PAUSE: Duration = Duration::from_secs(8);

/// Connects as [`connect`] does. While nobody answers, it tries again for `patience`, with pauses
/// that double. Calls `waiting` before each pause.
///
/// # Errors
/// As [`connect`]. A server that answers and refuses is not asked again.
pub async fn reach(
    server: &Destination,
    role: Role,
    name: &str,
    patience: Duration,
    mut waiting: impl FnMut(&NetError, Duration),
) -> Result<(Inbox, Outbox, Welcome), NetError> {
    let start = Instant::now();
    let mut pause = FIRST_PAUSE;
    loop {
        let error = match connect(server.clone(), role, name).await {
            Err(error @ (NetError::Io(_) | NetError::Closed | NetError::Handshake)) => error,
            connected => return connected,
        };
        let left = patience.saturating_sub(start.elapsed());
        if left.is_zero() {
            return Err(error);
        }
        // The last attempt comes when patience ends.
        let next = pause.min(left);
        waiting(&error, next);
        sleep(next).await;
        pause = (2 * pause).min(LONGEST_PAUSE);
    }
}
