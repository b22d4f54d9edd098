//! Wakes a thread that waits.

use std::time::Instant;

use parking_lot::{Condvar, Mutex};

/// A signal that one thread waits for and others raise.
#[derive(Default)]
pub struct ThreadSignal {
    is_raised: Mutex<bool>,
    changed: Condvar,
}

impl ThreadSignal {
    /// Ends the wait, or the next one if no thread waits.
    pub fn raise(&self) {
        *self.is_raised.lock() = true;
        self.changed.notify_one();
    }

    /// Waits until the signal is raised, or until `end`.
    pub fn wait(&self, end: Instant) {
        let mut is_raised = self.is_raised.lock();
        loop {
            if std::mem::take(&mut *is_raised) || Instant::now() >= end {
                return;
            }
            self.changed.wait_until(&mut is_raised, end);
        }
    }
}
