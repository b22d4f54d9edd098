//! Protocol sockets: frames over TCP, the handshake, limits and time-outs. The only crate that opens protocol sockets.
//!
//! What always holds:
//! - a frame's length is checked against its kind before memory is taken for it, and before the handshake nothing
//!   longer than a hello is read;
//! - a connection on which nothing arrives for [`SILENCE`] is given up: the server pings everyone, so silence means that
//!   the other side hangs or has vanished; so is one that takes nothing of what is sent for as long;
//! - sending never blocks: frames queue in an [`Outbox`] whose [`Outbox::queued_bytes`] its owner watches, and which is 0
//!   again once everything is with the operating system or the connection is gone;
//! - addresses other than loopback are refused until connections are encrypted and authenticated.

mod address;
mod connection;
mod error;
mod handshake;
mod scene;
mod shutdown;

pub use address::loopback;
pub use connection::{Inbox, Message, Outbox};
pub use error::NetError;
pub use handshake::{accept, connect, refuse};
pub use scene::{SCENE_CHUNK_BYTES, SceneReceiver};
pub use shutdown::Shutdown;

use std::time::Duration;

/// A connection silent for so long is dead. The server pings every [`PING_EVERY`], so live ones never are; a worker on
/// a machine that swaps may stall for some seconds and must not be given up for it.
pub const SILENCE: Duration = Duration::from_secs(15);

/// How often the server pings.
pub const PING_EVERY: Duration = Duration::from_secs(2);

/// A handshake takes round trips, not seconds; whoever connects and says nothing holds a socket no longer than this.
pub const HANDSHAKE_TIME: Duration = Duration::from_secs(5);
