//! Frames of a wall: all screens show one frame, and the next one only once all have shown it.
//!
//! A *round* is one frame on all screens. It ends when every client has shown the frame, or after
//! [`MOST_WAIT`], so that a client that hangs does not stop the others.

use std::{
    collections::BTreeSet,
    sync::Arc,
    time::{Duration, Instant},
};

use holo_stage::PublishedFrame;
use parking_lot::Mutex;
use tokio::sync::watch;

/// Longest time that screens wait for another one.
const MOST_WAIT: Duration = Duration::from_secs(2);

/// The frame that all clients show.
#[derive(Default)]
pub struct FrameRounds {
    round: Mutex<Round>,
    /// Changes when a client may take another frame.
    ended: watch::Sender<u64>,
}

#[derive(Default)]
struct Round {
    frame: Option<(Arc<PublishedFrame>, Instant)>,
    /// The clients that take part.
    clients: BTreeSet<u32>,
    /// Those of them that have not shown the frame yet.
    waits_for: BTreeSet<u32>,
}

impl FrameRounds {
    /// Returns the frame that a client shows when the stage's latest one is `latest`. The client
    /// takes part from now on. If it is new, the round waits for it too.
    pub fn frame(&self, client: u32, latest: Arc<PublishedFrame>) -> Arc<PublishedFrame> {
        let mut round = self.round.lock();
        if round.clients.insert(client) {
            round.waits_for.insert(client);
        }
        if let Some((frame, since)) = &round.frame {
            let is_over = round.waits_for.is_empty() || since.elapsed() >= MOST_WAIT;
            if !is_over || frame.number >= latest.number {
                return Arc::clone(frame);
            }
        }
        round.frame = Some((Arc::clone(&latest), Instant::now()));
        round.waits_for = round.clients.clone();
        drop(round);
        self.next();
        latest
    }

    /// Records that a client shows a frame.
    pub fn shown(&self, client: u32, frame: u64) {
        let mut round = self.round.lock();
        let is_of_round = round.frame.as_ref().is_some_and(|(now, _)| now.number == frame);
        if is_of_round && round.waits_for.remove(&client) && round.waits_for.is_empty() {
            drop(round);
            self.next();
        }
    }

    /// Removes a client, which shows no more frames.
    pub fn leave(&self, client: u32) {
        let mut round = self.round.lock();
        round.clients.remove(&client);
        if round.waits_for.remove(&client) && round.waits_for.is_empty() {
            drop(round);
            self.next();
        }
    }

    /// Returns a receiver that changes when a client may take another frame.
    pub fn ended(&self) -> watch::Receiver<u64> {
        self.ended.subscribe()
    }

    fn next(&self) {
        self.ended.send_modify(|rounds| *rounds += 1);
    }
}
