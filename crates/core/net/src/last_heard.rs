//! When the other side of a connection was last heard.

use parking_lot::Mutex;
use std::sync::Arc;
use tokio::time::Instant;

use crate::SILENCE;

/// When bytes last arrived on a connection. Its reader notes it, and its writer asks.
#[derive(Clone, Debug)]
pub(crate) struct LastHeard(Arc<Mutex<Instant>>);

impl LastHeard {
    /// Begins now.
    pub(crate) fn new() -> LastHeard {
        LastHeard(Arc::new(Mutex::new(Instant::now())))
    }

    /// Notes that bytes have just arrived.
    pub(crate) fn note(&self) {
        *self.0.lock() = Instant::now();
    }

    /// Returns true if bytes have arrived within [`SILENCE`].
    pub(crate) fn is_recent(&self) -> bool {
        self.0.lock().elapsed() < SILENCE
    }
}
