//! Who may come in from other machines, and for how long: holders of a token, until it is revoked.

use std::{collections::BTreeSet, future::pending, time::Duration};

use holo_net::Identity;
use tokio::{sync::watch, task::spawn_blocking, time::sleep};

/// Interval at which the tokens are read again. A connection outlives its token by two readings at
/// most.
const READ_EVERY: Duration = Duration::from_millis(500);

/// A server's identity, and the tokens that hold.
pub struct Guard {
    pub identity: Identity,
    /// The names of the tokens, as last read.
    names: watch::Receiver<BTreeSet<String>>,
}

impl Guard {
    /// Returns a guard, and starts the task that reads the tokens. The task ends with the server
    /// and its last connection.
    pub fn new(identity: Identity) -> Guard {
        let (sender, names) = watch::channel(BTreeSet::new());
        tokio::spawn(read(identity.clone(), sender));
        Guard { identity, names }
    }

    /// Waits until the token of this name is revoked. It was proven before this call.
    pub async fn revoked(&self, token: &str) {
        let mut names = self.names.clone();
        // The next reading may have begun before the token was made, so it says nothing.
        names.mark_unchanged();
        let mut reading = names.changed().await;
        while reading.is_ok() {
            reading = names.changed().await;
            if reading.is_ok() && !names.borrow_and_update().contains(token) {
                return;
            }
        }
        pending().await
    }
}

/// Reads the tokens until no receiver is left.
async fn read(identity: Identity, names: watch::Sender<BTreeSet<String>>) {
    while !names.is_closed() {
        sleep(READ_EVERY).await;
        let identity = identity.clone();
        // If the disk cannot be read, no token is revoked, and none is admitted either.
        if let Ok(Ok(tokens)) = spawn_blocking(move || identity.tokens()).await {
            names.send_replace(tokens.iter().map(|(token, _)| token.name()).collect());
        }
    }
}
