//! Cells of surface light between the tracer and the server.

use std::{
    sync::{
        Arc,
        mpsc::{self, RecvTimeoutError},
    },
    time::{Duration, Instant},
};

use holo_net::Outbox;
use holo_proto::{
    ProtoError,
    bulk::{CellBatch, WireCell},
    frame::FrameKind,
};
use holo_tracer::{SharedCell, Tracer, Verdict};

/// Interval at which new estimates are sent, and received ones compared. A worker that joins others
/// soon has cells of its own, so there is no hurry.
const SHARE_EVERY: Duration = Duration::from_millis(500);

/// Most cells in one message: half a megabyte.
const MESSAGE_CELLS: usize = 1 << 13;

/// A thread that gives received cells to the tracer, and sends the tracer's own. Both take too long
/// for the connection's thread. It ends when this is dropped.
pub struct CellExchange(mpsc::Sender<CellBatch>);

impl CellExchange {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the operating system starts no thread.
    pub fn start(tracer: Arc<Tracer>, outbox: Outbox) -> std::io::Result<CellExchange> {
        let (sender, received) = mpsc::channel();
        let exchange = move || exchange(&tracer, &outbox, &received);
        std::thread::Builder::new().name("cells".to_owned()).spawn(exchange)?;
        Ok(CellExchange(sender))
    }

    /// Takes cells that the server sent.
    pub fn receive(&self, cells: CellBatch) {
        // If the thread has ended, the connection has too.
        let _ = self.0.send(cells);
    }
}

fn exchange(tracer: &Tracer, outbox: &Outbox, received: &mpsc::Receiver<CellBatch>) {
    let mut next = Instant::now() + SHARE_EVERY;
    loop {
        match received.recv_timeout(next.saturating_duration_since(Instant::now())) {
            Ok(cells) => receive(tracer, &cells),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        if Instant::now() < next {
            continue;
        }
        next = Instant::now() + SHARE_EVERY;
        for (maker, verdict) in tracer.review_cells() {
            report(maker, verdict);
        }
        let new = tracer.new_cells(usize::MAX);
        if new.chunks(MESSAGE_CELLS).try_for_each(|cells| send(cells, outbox)).is_err() {
            return;
        }
    }
}

fn send(cells: &[SharedCell], outbox: &Outbox) -> Result<(), ProtoError> {
    let cells = cells.iter().filter_map(to_message).filter(WireCell::is_valid).collect();
    outbox.send(FrameKind::Cells, &CellBatch { cells }.encode())
}

/// Gives the tracer cells that the server sent.
fn receive(tracer: &Tracer, cells: &CellBatch) {
    for cells in cells.cells.chunk_by(|a, b| a.maker == b.maker) {
        let Some(first) = cells.first() else { continue };
        let received: Vec<SharedCell> = cells.iter().map(from_message).collect();
        if let Some(verdict) = tracer.receive_cells(first.maker, &received) {
            report(first.maker, verdict);
        }
    }
}

/// Says that a worker's light is left out. Light that counts needs no message.
fn report(maker: u16, verdict: Verdict) {
    if verdict == Verdict::Contradicts {
        eprintln!(
            "rtworker: the surface light of worker {maker} contradicts this worker's own, and is \
             left out (`holodeck info` names workers, `holodeck forget` removes what one made)"
        );
    }
}

fn to_message(cell: &SharedCell) -> Option<WireCell> {
    let SharedCell { point, normal, light, albedo, count, material, bounces, level } = *cell;
    let level = u16::try_from(level).ok()?;
    Some(WireCell { point, normal, material, bounces, level, maker: 0, count, light, albedo })
}

fn from_message(cell: &WireCell) -> SharedCell {
    let WireCell { point, normal, material, bounces, level, count, light, albedo, .. } = *cell;
    SharedCell { point, normal, light, albedo, count, material, bounces, level: level.into() }
}
