//! The reasons for which a message is refused.

use thiserror::Error;

/// A message that does not follow `SPEC.md`. It is the other side's fault, and ends the connection.
#[derive(Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProtoError {
    /// The first bytes are not a Holodeck hello.
    #[error("the other side does not speak the Holodeck protocol")]
    NotHolodeck,
    /// The two programs have different versions.
    #[error(
        "the other side speaks protocol version {theirs}, this program speaks {ours}; \
         run the same release on both machines"
    )]
    Version {
        /// The version of this program.
        ours: u16,
        /// The version of the other side.
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
        kind: crate::kind::FrameKind,
        /// Its stated length, bytes.
        length: u64,
        /// The limit, bytes.
        limit: u64,
    },
    /// The payload ends early.
    #[error("a {what} needs {needed} bytes, found {found}")]
    Truncated {
        /// The part of the message that was being read.
        what: &'static str,
        /// Bytes that this part takes.
        needed: u64,
        /// Bytes that were left.
        found: u64,
    },
    /// The payload continues after the message's end.
    #[error("{0} bytes are left over after a message")]
    Trailing(usize),
    /// More entries than a message may carry.
    #[error("{found} {what}, more than the {limit} allowed")]
    TooMany {
        /// What the entries are.
        what: &'static str,
        /// Their number in the message.
        found: u64,
        /// The limit.
        limit: u64,
    },
    /// A packet must have 1 to [`crate::MAX_RAYS_PER_PACKET`] rays.
    #[error("a packet of {0} rays; a packet has 1 to 21")]
    RayCount(u32),
    /// A packet names a viewpoint that is not in its message.
    #[error("a packet names viewpoint {index}, but the message has {count}")]
    Viewpoint {
        /// The index named.
        index: u16,
        /// Viewpoints in the message.
        count: usize,
    },
    /// A number that is not finite, or not in its range.
    #[error("{0} is not a usable number")]
    Number(&'static str),
    /// A sample kind that does not exist.
    #[error("unknown sample kind {0}")]
    SampleKind(u8),
    /// Compressed bytes that do not give the stated number of bytes.
    #[error("a compressed piece is damaged")]
    Compressed,
    /// A control message that bincode cannot decode.
    #[error("malformed control message: {0}")]
    Control(String),
}
