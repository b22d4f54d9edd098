//! Errors of a connection.

use std::{io, net::SocketAddr, path::PathBuf};

use holo_proto::ProtoError;
use thiserror::Error;

/// The reason why a connection could not be made, or has ended.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NetError {
    /// The address does not parse or resolve.
    #[error("`{0}` is not an address; write HOST:PORT, such as 127.0.0.1:7070")]
    Address(String),
    /// The address belongs to another machine, which needs an invitation.
    #[error(
        "{0} is not a loopback address: servers on other machines are joined by the string that \
         they print (holodeck://…)"
    )]
    NotLoopback(SocketAddr),
    /// A joining string is damaged.
    #[error(
        "this is no joining string, or not all of it: its {0} is wrong; copy what the server \
         prints (holodeck://HOST:PORT/FINGERPRINT/TOKEN)"
    )]
    Invitation(&'static str),
    /// The server is a different one, or has a new certificate.
    #[error(
        "the server's certificate is not the one that the joining string names: it is another \
         server, or somebody is in between; ask for its present string"
    )]
    Fingerprint,
    /// A server's certificate or tokens, or a machine's key, cannot be used.
    #[error("{0}: {1}")]
    Identity(PathBuf, String),
    /// Too many long messages arrive at once.
    #[error("it sends a long message slowly, and others wait for the memory")]
    NoMemory,
    /// An error of the operating system.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The other side broke the protocol.
    // Not marked as its source, because the message already contains it.
    #[error("protocol error: {0}")]
    Proto(ProtoError),
    /// The server refuses this peer.
    #[error("the server refused: {0}")]
    Refused(String),
    /// The other side closed the connection.
    #[error("the connection was closed by the other side")]
    Closed,
    /// The server has ended, and another one takes its place.
    #[error("the server starts again")]
    StartsAgain,
    /// Nothing arrived for [`crate::SILENCE`].
    #[error("the other side has been silent for {} seconds", crate::SILENCE.as_secs())]
    Silent,
    /// The handshake did not finish.
    #[error(
        "no answer within {} seconds; is this a holoserver's port?",
        crate::HANDSHAKE_TIME.as_secs()
    )]
    Handshake,
    /// The scene that arrived is not the one announced.
    #[error("the scene received does not have the announced {0}")]
    Scene(&'static str),
    /// The server does not have this scene, or its copy is damaged.
    #[error("the server cannot read the scene that was asked for, and has said why")]
    Absent,
}

impl NetError {
    /// Returns whether a connection has ended without a fault of either side, so that the same
    /// server may be reached again.
    pub fn is_lost(&self) -> bool {
        matches!(
            self,
            NetError::Closed | NetError::StartsAgain | NetError::Silent | NetError::Io(_)
        )
    }
}

impl From<ProtoError> for NetError {
    fn from(error: ProtoError) -> NetError {
        NetError::Proto(error)
    }
}
