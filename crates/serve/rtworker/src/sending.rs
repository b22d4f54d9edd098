//! Sends results to the server: finished packets, and records of indirect light.

use std::{sync::Arc, time::Duration};

use holo_light::Store;
use holo_net::Outbox;
use holo_proto::{
    ProtoError,
    bulk::{Light, LiveResults, Results},
    frame::FrameKind,
};
use tokio::sync::mpsc;

use crate::pool::PoolResult;

/// Most packets in one message: 5,000 samples, some milliseconds of work.
const MAX_RESULTS: usize = 256;

/// Time for which finished packets wait for others, unless there are many.
const GATHER: Duration = Duration::from_millis(1);

/// Interval at which new records of light are sent. Meanwhile, another worker may make the same
/// record.
const SHARE_EVERY: Duration = Duration::from_millis(5);

/// Most records in one message: a megabyte.
const SHARED_RECORDS: usize = 1 << 13;

/// Sends finished packets until the pool is gone. Packets that finish in quick succession share a
/// message. Records of light go before the packets that they were made for.
pub async fn send_results(
    mut results: mpsc::UnboundedReceiver<PoolResult>,
    outbox: Outbox,
    mut light: Option<NewLight>,
) {
    let mut batch = Vec::with_capacity(MAX_RESULTS);
    loop {
        // A packet in a place without records takes long, and other packets can use its records
        // before it ends.
        let wait = if light.is_some() { SHARE_EVERY } else { Duration::MAX };
        let received = tokio::time::timeout(wait, results.recv_many(&mut batch, MAX_RESULTS)).await;
        if let Some(light) = &mut light
            && light.send(&outbox).is_err()
        {
            return;
        }
        match received {
            Err(_) => continue,
            Ok(0) => return,
            Ok(_) => {}
        }
        if batch.len() < MAX_RESULTS / 4 {
            tokio::time::sleep(GATHER).await;
            while batch.len() < MAX_RESULTS
                && let Ok(finished) = results.try_recv()
            {
                batch.push(finished);
            }
        }
        if send_batch(&mut batch, &outbox).is_err() {
            return;
        }
    }
}

/// Sends packets. 256 packets of 21 samples are far below a frame's limit.
fn send_batch(batch: &mut Vec<PoolResult>, outbox: &Outbox) -> Result<(), ProtoError> {
    let (mut stored, mut live) = (Results::default(), LiveResults::default());
    for finished in batch.drain(..) {
        match finished {
            PoolResult::Traced(traced, samples) => {
                stored.packets.push(traced);
                stored.samples.extend_from_slice(&samples);
            }
            PoolResult::Unseen(id) => stored.unseen.push(id),
            PoolResult::Live(traced, hits) => {
                live.packets.push(traced);
                live.hits.extend(hits);
            }
        }
    }
    if !live.packets.is_empty() {
        outbox.send(FrameKind::LiveResults, &live.encode())?;
    }
    if !stored.packets.is_empty() || !stored.unseen.is_empty() {
        outbox.send(FrameKind::Results, &stored.encode())?;
    }
    Ok(())
}

/// Records of light that the server may lack: those made before the connection, because the server
/// may have lost them, and those made since.
pub struct NewLight {
    store: Arc<Store>,
    before: usize,
    next: usize,
}

impl NewLight {
    /// Returns all records of the store, including those to come.
    pub fn new(store: Arc<Store>) -> NewLight {
        let before = store.len();
        NewLight { store, before, next: 0 }
    }

    fn send(&mut self, outbox: &Outbox) -> Result<(), ProtoError> {
        while self.next < self.store.len() {
            let (records, next) = if self.next < self.before {
                let next = self.before.min(self.next + SHARED_RECORDS);
                ((self.next..next).filter_map(|index| self.store.get(index)).collect(), next)
            } else {
                self.store.made_since(self.next, SHARED_RECORDS)
            };
            self.next = next;
            if !records.is_empty() {
                outbox.send(FrameKind::Light, &Light { records }.encode())?;
            }
        }
        Ok(())
    }
}
