//! Events that the coordinator handles, and the connections that cause them.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use holo_beamfile::Mark;
use holo_net::{Access, Outbox};
use holo_proto::{control::Farewell, hello::Hello};

use crate::mailbox::Mailbox;

/// The number of a connection. None is used twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ConnectionId(u64);

impl ConnectionId {
    /// Returns the number of a new connection.
    pub fn next() -> ConnectionId {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        ConnectionId(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}

/// Something that has happened.
#[derive(Debug)]
pub enum ServerEvent {
    /// A peer has joined.
    Joined { id: ConnectionId, hello: Hello, access: Access, outbox: Outbox, mailbox: Arc<Mailbox> },
    /// A peer has sent something.
    Mail { id: ConnectionId, mailbox: Arc<Mailbox> },
    /// All stored samples of a view are sent, or the display wants another view.
    Recalled { id: ConnectionId, view: u32, result: Result<(), String> },
    /// A part of the file is sent: the number of the section's next beam.
    PartSent { id: ConnectionId, section: u16, result: Result<Option<u64>, String> },
    /// For a display that settles: everything that was stored before is on disk.
    Flushed { id: ConnectionId, view: u32, mark: Mark },
    /// Views were kept for displays: all views, and who was refused with which reason.
    ViewsKept { views: Vec<(String, String)>, refused: Vec<(ConnectionId, String)> },
    /// A blob was sent to a peer, or cannot be.
    BlobSent { id: ConnectionId },
    /// The server must end, with these words to everyone.
    Shutdown(Farewell),
}
