//! The wire protocol: what holoserver, rtworker and holoview say to each other, byte by byte as in `SPEC.md`.
//!
//! Pure encoding and decoding; sockets are `holo-net`'s business. What always holds:
//! - nothing that came from outside is trusted: every count is checked against the payload's length and a named limit
//!   before memory is taken for it, and a payload with bytes left over is refused;
//! - control messages are bincode with fixed-size little-endian integers ([`control`]); beams, packets and samples are
//!   plain-old-data arrays ([`bulk`]), because they are all of the traffic;
//! - the first message of either side ([`hello`]) has a layout of its own that no later version changes, so that two
//!   programs of different versions can always tell each other so.

#[cfg(target_endian = "big")]
compile_error!(
    "bulk messages and samples are little-endian plain-old-data arrays: no big-endian machine is supported"
);

pub mod bulk;
pub mod control;
mod error;
pub mod frame;
pub mod hello;
pub mod stand_ins;

pub use error::ProtoError;

/// A text from outside, for people: nothing in it may steer the terminal that it is printed on.
pub(crate) fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// The version of everything after the hello. Raised by any change to a message's bytes.
pub const PROTOCOL_VERSION: u16 = 3;

/// Rays in one packet: what fitted the original's 512-byte packets (Larson & Simmons 1999, §2.2, footnote 4), and still
/// a good unit of work: one beam's set-up is shared and a lost packet costs little.
pub const MAX_RAYS_PER_PACKET: usize = 21;

/// Least weight of a display's beam for which anything is traced; of those below, only what is stored is sent.
pub const LEAST_TRACED_WEIGHT: f32 = 1e-4;
