//! The receiving half of a connection: a task reads the socket, even while its owner is busy.

use std::{io::ErrorKind, sync::Arc};

use holo_proto::{
    ProtoError,
    control::{Control, Farewell},
    frame::{FrameHeader, FrameKind, HEADER_BYTES},
};
use parking_lot::Mutex;
use tokio::{
    io::{AsyncReadExt, BufReader},
    sync::{OwnedSemaphorePermit, Semaphore, mpsc},
    task::AbortHandle,
    time::timeout,
};

use crate::{KEEP_ALIVE, Message, NetError, SILENCE, last_heard::LastHeard, tls::ReadHalf};

/// Messages of a peer that a server reads in advance. A peer that sends more waits.
pub(crate) const FROM_A_PEER: usize = 1;

/// Messages of a server that its peers read in advance.
pub(crate) const FROM_THE_SERVER: usize = 64;

/// Most bytes of payloads that are read in advance. A longer message waits alone.
const AHEAD_BYTES: usize = 32 << 20;

/// Bytes of a payload that memory is taken for at once.
const FIRST_PIECE: usize = 1 << 15;

/// Memory for payloads that have not arrived whole, of all connections of this process. If they
/// need more, those that hold more than an equal share of it end.
const MAX_UNFINISHED: usize = 256 << 20;

/// Bytes of payloads that have not arrived whole, and their number.
static UNFINISHED: Mutex<(usize, usize)> = Mutex::new((0, 0));

/// The part of one payload in [`UNFINISHED`].
#[derive(Default)]
struct Unfinished {
    bytes: usize,
}

impl Unfinished {
    /// Takes memory for so many bytes of a payload.
    fn grow(&mut self, bytes: usize) -> Result<(), NetError> {
        let mut all = UNFINISHED.lock();
        all.1 += usize::from(self.bytes == 0);
        all.0 += bytes - self.bytes;
        self.bytes = bytes;
        if all.0 > MAX_UNFINISHED && bytes > MAX_UNFINISHED / all.1 {
            return Err(NetError::NoMemory);
        }
        Ok(())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let mut all = UNFINISHED.lock();
        all.0 -= self.bytes;
        all.1 -= usize::from(self.bytes > 0);
    }
}

/// The receiving half: messages that a task has read from the socket, in bounded memory. Dropping
/// the inbox ends the task.
#[derive(Debug)]
pub struct Inbox {
    messages: mpsc::Receiver<WaitingMessage>,
    task: AbortHandle,
}

/// A message, or the end of the connection, with its part of [`AHEAD_BYTES`].
type WaitingMessage = (Result<Message, NetError>, Option<OwnedSemaphorePermit>);

impl Inbox {
    /// Starts the task. It reads at most `ahead` messages in advance.
    pub(crate) fn start(reader: FrameReader, ahead: usize) -> Inbox {
        let (sender, messages) = mpsc::channel(ahead);
        let task = tokio::spawn(read(reader, sender)).abort_handle();
        Inbox { messages, task }
    }

    /// Returns the next message. A call that is dropped half-way (`select!`) loses nothing.
    ///
    /// # Errors
    /// [`NetError::Closed`], [`NetError::StartsAgain`], [`NetError::Silent`], [`NetError::Io`] or
    /// [`NetError::Proto`]; the connection is then over.
    pub async fn next(&mut self) -> Result<Message, NetError> {
        self.messages.recv().await.map_or(Err(NetError::Closed), |(message, _)| message)
    }
}

impl Drop for Inbox {
    fn drop(&mut self) {
        self.task.abort();
    }
}

/// Reads messages until the connection ends or the inbox is dropped.
async fn read(mut reader: FrameReader, messages: mpsc::Sender<WaitingMessage>) {
    let ahead = Arc::new(Semaphore::new(AHEAD_BYTES));
    loop {
        let (mut message, bytes) = match reader.message().await {
            Ok((message, bytes)) => (Ok(message), bytes),
            Err(error) => (Err(error), 0),
        };
        match message {
            // They have no other content.
            Ok(Message::Control(Control::Ping(KEEP_ALIVE) | Control::Pong(KEEP_ALIVE))) => {
                continue;
            }
            // Whatever waits for a message must connect anew, as after a lost connection.
            Ok(Message::Control(Control::Bye(Farewell::StartsAgain))) => {
                message = Err(NetError::StartsAgain);
            }
            _ => {}
        }
        let over = message.is_err();
        let room = Arc::clone(&ahead).acquire_many_owned(bytes.min(AHEAD_BYTES) as u32).await;
        // The semaphore is never closed.
        if messages.send((message, room.ok())).await.is_err() || over {
            return;
        }
    }
}

/// Reads frames from a socket.
pub(crate) struct FrameReader {
    reader: BufReader<ReadHalf>,
    heard: LastHeard,
}

impl FrameReader {
    pub(crate) fn new(socket: ReadHalf, heard: LastHeard) -> FrameReader {
        FrameReader { reader: BufReader::with_capacity(1 << 16, socket), heard }
    }

    /// Reads a frame of the given kind, and refuses others. A handshake reads nothing else, and
    /// nothing longer.
    pub(crate) async fn frame_of(&mut self, kind: FrameKind) -> Result<Vec<u8>, NetError> {
        match self.header().await {
            Ok(header) if header.kind == kind => self.payload(header).await,
            // The peer is a browser, for example, whose first bytes are no frame.
            Ok(_) | Err(NetError::Proto(ProtoError::Kind(_))) => {
                Err(ProtoError::NotHolodeck.into())
            }
            Err(error) => Err(error),
        }
    }

    /// Reads a frame of one of two kinds, and refuses others.
    pub(crate) async fn frame_of_either(
        &mut self,
        one: FrameKind,
        other: FrameKind,
    ) -> Result<(FrameKind, Vec<u8>), NetError> {
        match self.header().await {
            Ok(header) if header.kind == one || header.kind == other => {
                Ok((header.kind, self.payload(header).await?))
            }
            // The server is a web server, for example.
            Ok(_) | Err(NetError::Proto(ProtoError::Kind(_))) => {
                Err(ProtoError::NotHolodeck.into())
            }
            Err(error) => Err(error),
        }
    }

    /// Reads a message. Returns it with the bytes of its payload.
    async fn message(&mut self) -> Result<(Message, usize), NetError> {
        let header = self.header().await?;
        let payload = self.payload(header).await?;
        Ok((Message::decode(header.kind, &payload)?, payload.len()))
    }

    async fn header(&mut self) -> Result<FrameHeader, NetError> {
        let mut bytes = [0; HEADER_BYTES];
        self.fill(&mut bytes).await?;
        Ok(FrameHeader::parse(bytes)?)
    }

    /// Reads a payload. Memory is taken as its bytes arrive.
    async fn payload(&mut self, header: FrameHeader) -> Result<Vec<u8>, NetError> {
        let length = header.length as usize;
        let mut payload = Vec::new();
        let mut share = Unfinished::default();
        while payload.len() < length {
            let have = payload.len();
            let next = length.min(have.max(FIRST_PIECE) * 2);
            share.grow(next)?;
            payload.reserve_exact(next - have);
            payload.resize(next, 0);
            self.fill(&mut payload[have..]).await?;
        }
        Ok(payload)
    }

    /// Fills `room`. A long message on a slow line is not silence, because every byte counts as a
    /// sign of life.
    async fn fill(&mut self, mut room: &mut [u8]) -> Result<(), NetError> {
        while !room.is_empty() {
            let read = timeout(SILENCE, self.reader.read(room)).await;
            let read = match read.map_err(|_| NetError::Silent)? {
                // An encrypted connection may end without a closing message.
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => 0,
                read => read?,
            };
            if read == 0 {
                return Err(NetError::Closed);
            }
            self.heard.note();
            room = &mut std::mem::take(&mut room)[read..];
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unfinished_payloads_are_bounded_together_and_short_ones_pass() {
        let mut held = Vec::new();
        for _ in 0..1000 {
            let mut share = Unfinished::default();
            if (15..25).all(|power| share.grow(1 << power).is_ok()) {
                held.push(share);
            }
        }
        let (all, number) = *UNFINISHED.lock();
        assert!(all <= MAX_UNFINISHED && number >= held.len(), "{all} of {number}");
        assert!(held.len() >= 8, "some arrive");
        assert!(Unfinished::default().grow(1 << 20).is_ok(), "short ones arrive all the same");
    }
}
