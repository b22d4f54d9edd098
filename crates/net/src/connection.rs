//! The two halves of a connection: frames in, frames out.

use std::{
    io,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
};

use holo_proto::{
    ProtoError,
    bulk::{
        BlobChunk, Light, LiveResults, LiveSamples, LiveWanted, LiveWork, RaysWanted, Results,
        Samples, Unseen, ViewRequest, Work,
    },
    control::Control,
    frame::{self, HEADER_BYTES, Header, Kind},
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, BufReader, BufWriter},
    net::{
        TcpStream,
        tcp::{OwnedReadHalf, OwnedWriteHalf},
    },
    sync::mpsc,
    time::timeout,
};

use crate::{NetError, SILENCE};

/// Anything that may arrive after the handshake, parsed.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// A control message.
    Control(Control),
    /// Packets for a worker.
    Work(Work),
    /// Traced packets.
    Results(Results),
    /// A display's view.
    View(ViewRequest),
    /// Samples for a display.
    Samples(Samples),
    /// A piece of the scene.
    BlobChunk(BlobChunk),
    /// Beams that meet nothing, for a display.
    Unseen(Unseen),
    /// Records of indirect light.
    Light(Light),
    /// Single rays that a display wants.
    Rays(RaysWanted),
    /// Rays that a display wants traced and not stored.
    LiveWanted(LiveWanted),
    /// Such rays, for a worker.
    LiveWork(LiveWork),
    /// What they saw, from a worker.
    LiveResults(LiveResults),
    /// What they saw, for a display.
    LiveSamples(LiveSamples),
}

impl Message {
    fn decode(kind: Kind, payload: &[u8]) -> Result<Message, ProtoError> {
        Ok(match kind {
            Kind::Hello | Kind::Answer => return Err(ProtoError::Kind(kind as u8)),
            Kind::Control => Message::Control(Control::decode(payload)?),
            Kind::Work => Message::Work(Work::decode(payload)?),
            Kind::Results => Message::Results(Results::decode(payload)?),
            Kind::View => Message::View(ViewRequest::decode(payload)?),
            Kind::Samples => Message::Samples(Samples::decode(payload)?),
            Kind::BlobChunk => Message::BlobChunk(BlobChunk::decode(payload)?),
            Kind::Unseen => Message::Unseen(Unseen::decode(payload)?),
            Kind::Light => Message::Light(Light::decode(payload)?),
            Kind::Rays => Message::Rays(RaysWanted::decode(payload)?),
            Kind::LiveWanted => Message::LiveWanted(LiveWanted::decode(payload)?),
            Kind::LiveWork => Message::LiveWork(LiveWork::decode(payload)?),
            Kind::LiveResults => Message::LiveResults(LiveResults::decode(payload)?),
            Kind::LiveSamples => Message::LiveSamples(LiveSamples::decode(payload)?),
        })
    }
}

/// The receiving half.
#[derive(Debug)]
pub struct Inbox {
    reader: BufReader<OwnedReadHalf>,
}

impl Inbox {
    /// The next message. Not to be dropped half-way (`select!`): a frame read in part would be lost.
    ///
    /// # Errors
    /// [`NetError::Closed`], [`NetError::Silent`], [`NetError::Io`], or [`NetError::Proto`]; the connection is then over.
    pub async fn next(&mut self) -> Result<Message, NetError> {
        let header = self.header().await?;
        let payload = self.payload(header).await?;
        Ok(Message::decode(header.kind, &payload)?)
    }

    /// Reads a frame that must be of this kind: during the handshake nothing else, and nothing longer, is read.
    pub(crate) async fn frame_of(&mut self, kind: Kind) -> Result<Vec<u8>, NetError> {
        match self.header().await {
            Ok(header) if header.kind == kind => self.payload(header).await,
            // A browser, say: its first bytes are no frame.
            Ok(_) | Err(NetError::Proto(ProtoError::Kind(_))) => {
                Err(ProtoError::NotHolodeck.into())
            }
            Err(error) => Err(error),
        }
    }

    async fn header(&mut self) -> Result<Header, NetError> {
        let mut bytes = [0; HEADER_BYTES];
        self.fill(&mut bytes).await?;
        Ok(Header::parse(bytes)?)
    }

    async fn payload(&mut self, header: Header) -> Result<Vec<u8>, NetError> {
        let mut payload = vec![0; header.length as usize];
        self.fill(&mut payload).await?;
        Ok(payload)
    }

    /// Reads as many bytes as there is room for. A long message on a slow line is not silence: every piece that arrives
    /// counts as a sign of life.
    async fn fill(&mut self, mut room: &mut [u8]) -> Result<(), NetError> {
        while !room.is_empty() {
            let read =
                timeout(SILENCE, self.reader.read(room)).await.map_err(|_| NetError::Silent)??;
            if read == 0 {
                return Err(NetError::Closed);
            }
            room = &mut std::mem::take(&mut room)[read..];
        }
        Ok(())
    }
}

/// The sending half: a queue in front of a task that writes. Cheap to clone; the connection closes when the last clone
/// is gone and everything queued is written, or when the other side is.
#[derive(Clone, Debug)]
pub struct Outbox {
    queue: mpsc::UnboundedSender<Vec<u8>>,
    queued: Arc<AtomicUsize>,
}

impl Outbox {
    /// Queues a frame. A frame to a side that has gone is dropped: the receiving half tells of the end.
    ///
    /// # Errors
    /// [`ProtoError::TooLong`] if the payload must be split.
    pub fn send(&self, kind: Kind, payload: &[u8]) -> Result<(), ProtoError> {
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
        self.send(Kind::Control, &message.encode()?)
    }

    /// Bytes queued and not yet handed to the operating system.
    pub fn queued_bytes(&self) -> usize {
        self.queued.load(Ordering::Relaxed)
    }

    /// True once nothing sent can arrive any more.
    pub fn is_closed(&self) -> bool {
        self.queue.is_closed()
    }

    /// Waits until everything queued so far is with the operating system, or the connection is gone.
    pub async fn drained(&self) {
        while self.queued_bytes() > 0 && !self.queue.is_closed() {
            tokio::time::sleep(std::time::Duration::from_millis(2)).await;
        }
    }
}

/// Splits a stream into its halves and starts the task that writes.
pub(crate) fn split(stream: TcpStream) -> (Inbox, Outbox) {
    // Packets are small and somebody waits for each: Nagle's delay would show. If it cannot be set, all still works.
    let _ = stream.set_nodelay(true);
    let (read, write) = stream.into_split();
    let (queue, frames) = mpsc::unbounded_channel();
    let queued = Arc::new(AtomicUsize::new(0));
    let writer = Writer {
        stream: BufWriter::with_capacity(1 << 16, write),
        in_hand: 0,
        queued: Arc::clone(&queued),
    };
    tokio::spawn(writer.run(frames));
    (Inbox { reader: BufReader::with_capacity(1 << 16, read) }, Outbox { queue, queued })
}

/// The task that writes. It ends with the last [`Outbox`], when the other side is gone, or when the other side has taken
/// nothing for [`SILENCE`]: a process that hangs must not hold its connection's memory for ever.
struct Writer {
    stream: BufWriter<OwnedWriteHalf>,
    /// Bytes taken off the queue, counted in `queued` and not yet with the operating system.
    in_hand: usize,
    queued: Arc<AtomicUsize>,
}

impl Writer {
    async fn run(mut self, mut frames: mpsc::UnboundedReceiver<Vec<u8>>) {
        if self.write_all(&mut frames).await.is_ok() {
            let _ = timeout(SILENCE, self.stream.shutdown()).await;
        }
        // What cannot be sent any more is not queued either.
        frames.close();
        while let Some(frame) = frames.recv().await {
            self.in_hand += frame.len();
        }
        self.queued.fetch_sub(self.in_hand, Ordering::Relaxed);
    }

    async fn write_all(&mut self, frames: &mut mpsc::UnboundedReceiver<Vec<u8>>) -> io::Result<()> {
        while let Some(frame) = frames.recv().await {
            let mut next = Some(frame);
            // Everything that waits goes out together; then flush, since somebody waits for it.
            while let Some(frame) = next {
                self.in_hand += frame.len();
                self.write(&frame).await?;
                next = frames.try_recv().ok();
            }
            timeout(SILENCE, self.stream.flush()).await??;
            self.count(0);
        }
        Ok(())
    }

    async fn write(&mut self, mut rest: &[u8]) -> io::Result<()> {
        while !rest.is_empty() {
            let written = timeout(SILENCE, self.stream.write(rest)).await??;
            if written == 0 {
                return Err(io::ErrorKind::WriteZero.into());
            }
            rest = &rest[written..];
            self.count(rest.len());
        }
        Ok(())
    }

    /// Takes what the operating system has by now off the count; `of_this_frame` bytes are not even in the buffer.
    fn count(&mut self, of_this_frame: usize) {
        let left = self.stream.buffer().len() + of_this_frame;
        self.queued.fetch_sub(self.in_hand.saturating_sub(left), Ordering::Relaxed);
        self.in_hand = self.in_hand.min(left);
    }
}
