//! Limits the number of connections that have not identified themselves yet.
//!
//! Invariant: at most [`MAX_UNFINISHED`] are open. One more ends the oldest one of the address that
//! has most of them. So a peer that opens many connections and stays silent ends only its own.

use parking_lot::{Mutex, MutexGuard};
use std::{collections::HashMap, net::IpAddr, sync::Arc};
use tokio::task::AbortHandle;

/// Most unfinished handshakes. Each costs a socket and the bytes of a hello.
const MAX_UNFINISHED: usize = 128;

/// Handshakes under way.
#[derive(Clone, Debug, Default)]
pub struct Handshakes(Arc<Mutex<HandshakeState>>);

#[derive(Debug, Default)]
struct HandshakeState {
    last: u64,
    /// The oldest first.
    open: Vec<Open>,
}

#[derive(Debug)]
struct Open {
    number: u64,
    from: IpAddr,
    task: AbortHandle,
}

impl Handshakes {
    /// Starts a handshake with whoever connects from this address. `start` gets the handshake's
    /// number, and returns its task.
    pub fn begin(&self, from: IpAddr, start: impl FnOnce(u64) -> AbortHandle) {
        let mut state = self.lock();
        if state.open.len() >= MAX_UNFINISHED
            && let Some(at) = state.victim()
        {
            state.open.remove(at).task.abort();
        }
        state.last += 1;
        let number = state.last;
        // The task cannot finish before it is listed, because the list is locked.
        let task = start(number);
        state.open.push(Open { number, from, task });
    }

    /// Takes note that a handshake is over. Its task goes on.
    pub fn finish(&self, number: u64) {
        self.lock().open.retain(|open| open.number != number);
    }

    fn lock(&self) -> MutexGuard<'_, HandshakeState> {
        // Each change is whole before anything can panic.
        self.0.lock()
    }
}

impl HandshakeState {
    /// Returns the place of the oldest handshake of the address that has most of them.
    fn victim(&self) -> Option<usize> {
        let mut counts: HashMap<IpAddr, usize> = HashMap::new();
        for open in &self.open {
            *counts.entry(open.from).or_default() += 1;
        }
        let most = counts.values().copied().max()?;
        self.open.iter().position(|open| counts.get(&open.from) == Some(&most))
    }
}

#[cfg(test)]
mod tests {
    use std::future::pending;

    use super::*;

    #[tokio::test]
    async fn a_flood_ends_its_own_oldest_handshakes_and_nobody_elses() {
        let handshakes = Handshakes::default();
        let mut tasks = Vec::new();
        let mut begin = |last_byte: u8| {
            let task = tokio::spawn(pending::<()>());
            handshakes.begin(IpAddr::from([192, 0, 2, last_byte]), |_| task.abort_handle());
            tasks.push(task);
        };
        (0..3).for_each(|_| begin(1));
        (0..1000).for_each(|_| begin(2));
        begin(3);
        let mut ended = Vec::new();
        for (at, task) in tasks.iter_mut().enumerate() {
            // An aborted task is over once the runtime has run.
            tokio::task::yield_now().await;
            if task.is_finished() {
                ended.push(at);
            }
        }
        let expected: Vec<usize> = (3..3 + 1001 + 3 - MAX_UNFINISHED).collect();
        assert_eq!(ended, expected);
        assert_eq!(handshakes.lock().open.len(), MAX_UNFINISHED);
        handshakes.finish(1);
        assert_eq!(handshakes.lock().open.len(), MAX_UNFINISHED - 1);
    }
}
