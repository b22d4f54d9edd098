//! Wakes a thread that waits.

use std::{
    sync::{Condvar, Mutex, PoisonError},
    time::Instant,
};

/// A signal that one thread waits for and others raise.
#[derive(Default)]
pub struct ThreadSignal {
    is_raised: Mutex<bool>,
    changed: Condvar,
}

impl ThreadSignal {
    /// Ends the wait, or the next one if no thread waits.
    pub fn raise(&self) {
        *self.is_raised.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.changed.notify_one();
    }

    /// Waits until the signal is raised, or until `end`.
    pub fn wait(&self, end: Instant) {
        let mut is_raised = self.is_raised.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            let left = end.saturating_duration_since(Instant::now());
            if std::mem::take(&mut *is_raised) || left.is_zero() {
                return;
            }
            let waited = self.changed.wait_timeout(is_raised, left);
            is_raised = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}
