//! A wire between two ends in memory: late, and with faults.

use std::{future::pending, time::Duration};

use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, DuplexStream, ReadHalf, WriteHalf, duplex, split},
    sync::mpsc,
    time::{Instant, sleep_until},
};

use super::random::SplitMix;

/// Bytes that a wire takes at a time, as in a packet of a network.
const PIECE: usize = 1400;

/// Bytes that each end keeps for a reader that is slow.
const BUFFER: usize = 1 << 16;

/// Pieces that are under way at a time, at most.
const UNDER_WAY: usize = 1 << 10;

/// Time that it takes to send a lost piece again.
const SENT_AGAIN: Duration = Duration::from_millis(200);

/// How a wire behaves.
#[derive(Clone, Copy, Debug)]
pub struct Wire {
    /// The least time that a piece takes.
    pub latency: Duration,
    /// The share of pieces that must be sent again.
    pub loss: f64,
    /// When the wire stalls, and for how long. Data sent meanwhile arrives afterwards.
    pub stall: Option<(Duration, Duration)>,
    /// When it is cut, and how.
    pub cut: Option<(Duration, Cut)>,
}

/// How a wire is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Both ends are informed.
    Closed,
    /// Nothing arrives any more, and neither end is informed.
    Silent,
}

impl Wire {
    /// Returns the ends of a new wire.
    pub fn lay(self, random: &mut SplitMix) -> (DuplexStream, DuplexStream) {
        let (near, near_inside) = duplex(BUFFER);
        let (far, far_inside) = duplex(BUFFER);
        let (near_read, near_write) = split(near_inside);
        let (far_read, far_write) = split(far_inside);
        let there = self.carry(near_read, far_write, random.fork());
        let back = self.carry(far_read, near_write, random.fork());
        tokio::spawn(async move {
            let end = async {
                match self.cut {
                    Some((after, Cut::Closed)) => tokio::time::sleep(after).await,
                    _ => pending().await,
                }
            };
            tokio::select! {
                ((), ()) = async { tokio::join!(there, back) } => {}
                () = end => {}
            }
        });
        (near, far)
    }

    /// Carries bytes one way, until an end is gone.
    async fn carry(
        self,
        mut from: ReadHalf<DuplexStream>,
        mut to: WriteHalf<DuplexStream>,
        mut random: SplitMix,
    ) {
        let begin = Instant::now();
        let (sender, mut pieces) = mpsc::channel::<(Instant, Vec<u8>)>(UNDER_WAY);
        let send = async move {
            let mut due = begin;
            loop {
                let mut piece = vec![0; PIECE];
                match from.read(&mut piece).await {
                    Ok(0) | Err(_) => return,
                    Ok(length) => piece.truncate(length),
                }
                due = due.max(self.arrival(begin, &mut random));
                if sender.send((due, piece)).await.is_err() {
                    return;
                }
            }
        };
        let receive = async {
            while let Some((due, piece)) = pieces.recv().await {
                sleep_until(due).await;
                self.unless_silent(begin).await;
                if to.write_all(&piece).await.is_err() {
                    return;
                }
            }
            // The end of what was sent arrives, too.
            self.unless_silent(begin).await;
            let _ = to.shutdown().await;
        };
        tokio::join!(send, receive);
    }

    /// Returns when a piece arrives that is sent now.
    fn arrival(&self, begin: Instant, random: &mut SplitMix) -> Instant {
        let mut at = Instant::now() + self.latency.mul_f64(1.0 + random.unit());
        while random.unit() < self.loss {
            at += SENT_AGAIN;
        }
        match self.stall {
            Some((after, length)) if at > begin + after => at.max(begin + after + length),
            _ => at,
        }
    }

    /// Waits for ever if the wire is cut in silence; else returns at once.
    async fn unless_silent(&self, begin: Instant) {
        if self.cut.is_some_and(|(after, cut)| cut == Cut::Silent && begin.elapsed() >= after) {
            pending().await
        }
    }
}
