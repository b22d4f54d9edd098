//! Why a message was refused.

use thiserror::Error;

/// A message that does not follow `SPEC.md`. Always the other side's fault: the connection ends with this as the reason.
#[derive(Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProtoError {
    /// The first bytes are not a Holodeck hello.
    #[error("the other side does not speak the Holodeck protocol")]
    NotHolodeck,
    /// The two programs are of different versions.
    #[error(
        "the other side speaks protocol version {theirs}, this program speaks {ours}; run the same release on both machines"
    )]
    Version {
        /// What this program speaks.
        ours: u16,
        /// What the other side said.
        theirs: u16,
    },
    /// A role number that does not exist.
    #[error("unknown role {0}")]
    Role(u8),
    /// A frame kind that does not exist, or that this side never receives.
    #[error("unexpected message kind {0}")]
    Kind(u8),
    /// A frame longer than its kind may be.
    #[error("a {kind:?} message of {length} bytes, more than the {limit} allowed")]
    TooLong {
        /// The frame's kind.
        kind: crate::frame::Kind,
        /// Its stated length, bytes.
        length: u64,
        /// What is allowed, bytes.
        limit: u64,
    },
    /// The payload ended early.
    #[error("a {what} needs {needed} bytes, found {found}")]
    Truncated {
        /// What was being read.
        what: &'static str,
        /// Bytes that it takes.
        needed: u64,
        /// Bytes that were there.
        found: u64,
    },
    /// The payload went on after the message's end.
    #[error("{0} bytes left over after a message")]
    Trailing(usize),
    /// More entries than a message may carry.
    #[error("{found} {what}, more than the {limit} allowed")]
    TooMany {
        /// What was counted.
        what: &'static str,
        /// How many the message says.
        found: u64,
        /// How many are allowed.
        limit: u64,
    },
    /// A packet must have 1 to [`crate::MAX_RAYS_PER_PACKET`] rays.
    #[error("a packet of {0} rays, must be 1 to 21")]
    RayCount(u32),
    /// A packet names a viewpoint that its message does not carry.
    #[error("viewpoint {index} of {count}")]
    Viewpoint {
        /// The index named.
        index: u16,
        /// Viewpoints in the message.
        count: usize,
    },
    /// A number that must be finite (or positive) is not.
    #[error("{0} is not a usable number")]
    Number(&'static str),
    /// A sample kind that does not exist.
    #[error("unknown sample kind {0}")]
    SampleKind(u8),
    /// bincode's own complaint about a control message.
    #[error("malformed control message: {0}")]
    Control(String),
}
