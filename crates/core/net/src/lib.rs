//! Protocol sockets: frames over TCP, the handshake, limits and time-outs.
//!
//! No other crate opens a protocol socket. Invariants:
//! - Memory for a frame is allocated only after its length was checked against its kind. Before the
//!   handshake is done, nothing longer than a hello is read.
//! - Both sides ping every [`PING_EVERY`], from tasks of their own. Neither a long computation nor
//!   a long transfer looks like silence.
//! - A connection ends if nothing arrives for [`SILENCE`]: the other side has vanished. It also
//!   ends if the other side takes nothing of what waits for it for [`LONGEST_BUSY`].
//! - Sending never blocks. Frames queue in an [`Outbox`], whose owner monitors
//!   [`Outbox::queued_bytes`].
//! - Without encryption, only loopback addresses are used. Other connections are TLS 1.3. The
//!   client knows the server's certificate by its fingerprint, and proves that it holds a token.
//! - A worker proves which machine it belongs to, everywhere.

mod address;
mod error;
mod handshake;
mod identity;
mod inbox;
mod join;
mod last_heard;
mod machine;
mod message;
mod outbox;
mod page_certificate;
mod parent;
mod private_files;
mod reach;
mod scene;
mod shutdown;
mod tls;

pub use address::{any_address, loopback, seen_from_outside};
pub use error::NetError;
pub use handshake::{
    accept, accept_over, accept_secure, connect, connect_as, connect_over, refuse, welcome,
};
pub use identity::{EncryptedStream, Identity, Secret};
pub use inbox::Inbox;
pub use join::{Access, Destination, Invitation, Rights, Token};
pub use machine::{MachineId, MachineKey};
pub use message::Message;
pub use outbox::Outbox;
pub use parent::{ChildReports, ParentLink, child_link};
pub use reach::{RETURN_TIME, reach};
pub use scene::{SCENE_CHUNK_BYTES, SceneReceiver, absent};
pub use shutdown::{AGAIN, Ending, Shutdown};
pub use tls::encrypt_to;

use std::time::Duration;

/// Time of silence after which a connection is dead. Both sides ping every [`PING_EVERY`], so live
/// ones are never silent that long. A process on a machine that swaps may stall for some seconds
/// and must survive.
pub const SILENCE: Duration = Duration::from_secs(15);

/// Longest time for which a side may take nothing of what waits for it, although it pings. A
/// display may draw a large picture for a minute. A process that hangs must not hold the memory of
/// its connection for ever.
pub const LONGEST_BUSY: Duration = Duration::from_secs(120);

/// Interval between pings.
pub const PING_EVERY: Duration = Duration::from_secs(2);

/// Longest time for a handshake. It takes round trips, not seconds. A peer that connects and sends
/// nothing holds a socket no longer than this.
pub const HANDSHAKE_TIME: Duration = Duration::from_secs(5);

/// Number of the pings that keep a connection alive. Nobody needs to answer them. A ping with any
/// other number is an ordinary message: its pong reports that everything before it was handled.
const KEEP_ALIVE: u64 = 0;
