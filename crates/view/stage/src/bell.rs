//! Wakes a thread that waits.

use std::{
    sync::{Condvar, Mutex, PoisonError},
    time::Instant,
};

/// A bell that one thread waits for and others ring.
#[derive(Default)]
pub struct Bell {
    has_rung: Mutex<bool>,
    changed: Condvar,
}

impl Bell {
    /// Ends the wait, or the next one if no thread waits.
    pub fn ring(&self) {
        *self.has_rung.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.changed.notify_one();
    }

    /// Waits until the bell rings, or until `end`.
    pub fn wait(&self, end: Instant) {
        let mut has_rung = self.has_rung.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            let left = end.saturating_duration_since(Instant::now());
            if std::mem::take(&mut *has_rung) || left.is_zero() {
                return;
            }
            let waited = self.changed.wait_timeout(has_rung, left);
            has_rung = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}
