//! The sending half of a connection: a queue in front of a task that writes the socket.

use std::{
    io,
    pin::pin,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use holo_proto::{
    ProtoError,
    control::Control,
    frame::{self, FrameKind},
};
use tokio::{
    io::{AsyncWriteExt, BufWriter},
    sync::mpsc,
    time::{Instant, sleep, timeout},
};

use crate::{KEEP_ALIVE, LONGEST_BUSY, PING_EVERY, SILENCE, last_heard::LastHeard, tls::WriteHalf};

/// The sending half: a queue that a task writes to the socket. Clones share the queue.
///
/// The connection closes once the last clone is gone and the queue is written, once it is ended, or
/// once the other side closes it.
#[derive(Clone, Debug)]
pub struct Outbox {
    queue: mpsc::UnboundedSender<Vec<u8>>,
    queued: Arc<AtomicUsize>,
}

impl Outbox {
    /// Starts the task that writes.
    pub(crate) fn start(socket: WriteHalf, heard: LastHeard) -> Outbox {
        let (queue, frames) = mpsc::unbounded_channel();
        let queued = Arc::new(AtomicUsize::new(0));
        let writer = OutboxWriter {
            stream: BufWriter::with_capacity(1 << 16, socket),
            in_hand: 0,
            queued: Arc::clone(&queued),
            heard,
        };
        tokio::spawn(writer.run(frames));
        Outbox { queue, queued }
    }

    /// Queues a frame. A frame to a peer that has gone is dropped, because the inbox reports the
    /// end.
    ///
    /// # Errors
    /// [`ProtoError::TooLong`] if the payload must be split.
    pub fn send(&self, kind: FrameKind, payload: &[u8]) -> Result<(), ProtoError> {
        let frame = frame::encode(kind, payload)?;
        let bytes = frame.len();
        self.queued.fetch_add(bytes, Ordering::Relaxed);
        if self.queue.send(frame).is_err() {
            self.queued.fetch_sub(bytes, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Queues a control message.
    ///
    /// # Errors
    /// As [`Control::encode`].
    pub fn control(&self, message: &Control) -> Result<(), ProtoError> {
        self.send(FrameKind::Control, &message.encode()?)
    }

    /// Closes the connection once all frames queued so far are written. Later frames are dropped.
    pub fn end(&self) {
        // An empty frame marks the end; no other frame is empty. If the queue is closed, so is the
        // connection.
        let _ = self.queue.send(Vec::new());
    }

    /// Returns the bytes that are queued and not yet with the operating system.
    pub fn queued_bytes(&self) -> usize {
        self.queued.load(Ordering::Relaxed)
    }

    /// Returns true once no frame can arrive any more.
    pub fn is_closed(&self) -> bool {
        self.queue.is_closed()
    }

    /// Waits until everything queued is with the operating system, or the connection is gone.
    pub async fn drained(&self) {
        while self.queued_bytes() > 0 && !self.queue.is_closed() {
            sleep(Duration::from_millis(2)).await;
        }
    }

    /// Starts a task that pings the other side every [`PING_EVERY`] until the connection ends.
    pub(crate) fn keep_alive(&self) {
        let (weak, queued) = (self.queue.downgrade(), Arc::clone(&self.queued));
        tokio::spawn(async move {
            loop {
                sleep(PING_EVERY).await;
                let Some(queue) = weak.upgrade().filter(|queue| !queue.is_closed()) else {
                    return;
                };
                let outbox = Outbox { queue, queued: Arc::clone(&queued) };
                // Other frames in the queue also show that this side is alive.
                if outbox.queued_bytes() == 0 {
                    // A ping is far below a frame's limit.
                    let _ = outbox.control(&Control::Ping(KEEP_ALIVE));
                }
            }
        });
    }
}

/// The task that writes.
///
/// It ends with the last [`Outbox`], at an empty frame, or when the other side is gone. It also
/// ends when the other side has taken nothing and was not heard for [`SILENCE`], or has taken
/// nothing for [`LONGEST_BUSY`].
struct OutboxWriter {
    stream: BufWriter<WriteHalf>,
    /// Bytes taken off the queue, counted in `queued` and not yet with the operating system.
    in_hand: usize,
    queued: Arc<AtomicUsize>,
    heard: LastHeard,
}

impl OutboxWriter {
    async fn run(mut self, mut frames: mpsc::UnboundedReceiver<Vec<u8>>) {
        if self.write_all(&mut frames).await.is_ok() {
            let _ = timeout(SILENCE, self.stream.shutdown()).await;
        }
        // Frames that cannot be sent any more no longer count as queued.
        frames.close();
        while let Some(frame) = frames.recv().await {
            self.in_hand += frame.len();
        }
        self.queued.fetch_sub(self.in_hand, Ordering::Relaxed);
    }

    async fn write_all(&mut self, frames: &mut mpsc::UnboundedReceiver<Vec<u8>>) -> io::Result<()> {
        while let Some(frame) = frames.recv().await {
            let mut next = Some(frame);
            let mut is_last = false;
            // All waiting frames go out together. A flush follows, because the other side waits for
            // them.
            while let Some(frame) = next {
                is_last = frame.is_empty();
                self.in_hand += frame.len();
                self.write(&frame).await?;
                next = if is_last { None } else { frames.try_recv().ok() };
            }
            taken(self.stream.flush(), &self.heard).await?;
            self.count(0);
            if is_last {
                return Ok(());
            }
        }
        Ok(())
    }

    async fn write(&mut self, mut rest: &[u8]) -> io::Result<()> {
        while !rest.is_empty() {
            let written = taken(self.stream.write(rest), &self.heard).await?;
            if written == 0 {
                return Err(io::ErrorKind::WriteZero.into());
            }
            rest = &rest[written..];
            self.count(rest.len());
        }
        Ok(())
    }

    /// Reduces the count by the bytes that the operating system has taken. The last `of_this_frame`
    /// bytes of the present frame are not in the buffer yet.
    fn count(&mut self, of_this_frame: usize) {
        let left = self.stream.buffer().len() + of_this_frame;
        self.queued.fetch_sub(self.in_hand.saturating_sub(left), Ordering::Relaxed);
        self.in_hand = self.in_hand.min(left);
    }
}

/// Waits until the other side takes something, as long as it may wait.
async fn taken<T>(taking: impl Future<Output = io::Result<T>>, heard: &LastHeard) -> io::Result<T> {
    let start = Instant::now();
    let mut taking = pin!(taking);
    loop {
        match timeout(SILENCE, &mut taking).await {
            Ok(taken) => return taken,
            Err(late) if !heard.is_recent() || start.elapsed() >= LONGEST_BUSY => {
                return Err(late.into());
            }
            Err(_) => {}
        }
    }
}
