//! Sends finished packets to the server.

use std::time::Duration;

use holo_net::Outbox;
use holo_proto::{
    ProtoError,
    bulk::{LiveResults, Results},
    frame::FrameKind,
};
use tokio::sync::mpsc;

use crate::pool::PoolResult;

/// Most packets in one message: 5,000 samples, some milliseconds of work.
const MAX_RESULTS: usize = 256;

/// Time for which finished packets wait for others, unless there are many.
const GATHER: Duration = Duration::from_millis(1);

/// Sends finished packets until the pool is gone. Packets that finish in quick succession share a
/// message.
pub async fn send_results(mut results: mpsc::UnboundedReceiver<PoolResult>, outbox: Outbox) {
    let mut batch = Vec::with_capacity(MAX_RESULTS);
    while results.recv_many(&mut batch, MAX_RESULTS).await > 0 {
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
