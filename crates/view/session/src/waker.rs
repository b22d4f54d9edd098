//! Wakes a session that waits.

use std::sync::mpsc;

use super::incoming::Incoming;

/// Ends a session's wait, from any thread.
#[derive(Clone)]
pub struct Waker(pub(super) mpsc::Sender<Incoming>);

impl Waker {
    /// Ends the wait, or the next one if the session does not wait.
    pub fn wake(&self) {
        // If the session is over, nothing waits.
        let _ = self.0.send(Incoming::Wake);
    }
}
