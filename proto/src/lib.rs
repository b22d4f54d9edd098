//! The wire protocol: the messages between holoserver, rtworker and holoview. `SPEC.md` draws every
//! byte.
//!
//! This crate encodes and decodes; `holo-net` has the sockets. Invariants:
//! - Nothing from outside is trusted. Every count is checked against the payload's length and a
//!   named limit before memory is allocated for it. A payload with bytes left over is refused.
//! - Control messages ([`control`]) are bincode with fixed-size little-endian integers. Beams,
//!   packets and samples ([`bulk`]) are nearly all of the traffic, so they are arrays of plain
//!   data.
//! - The first message of either side ([`hello`]) has a layout that no later version changes. Two
//!   programs can therefore always report that their versions differ.

#[cfg(target_endian = "big")]
compile_error!(
    "bulk messages are arrays of little-endian data: big-endian machines are not supported"
);

pub mod bulk;
pub mod control;
mod error;
pub mod fading;
pub mod frame;
pub mod hello;
mod kind;
pub mod proof;
pub mod report;
pub mod stand_ins;

pub use error::ProtoError;

/// Returns a text from outside without control characters, so that it cannot steer the terminal
/// that prints it.
pub(crate) fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// The version of everything after the hello. Every change of a message's bytes raises it.
pub const PROTOCOL_VERSION: u16 = 13;

/// Most rays in one packet: as many as fitted the original's packets of 512 bytes (Larson & Simmons
/// 1999, §2.2, footnote 4).
///
/// A packet is a good unit of work: its rays share their beam's set-up, and losing it costs little.
pub const MAX_RAYS_PER_PACKET: usize = 21;

/// Least weight of a display's beam for tracing. Beams below it are not traced, and their stored
/// samples are sent last.
pub const LEAST_TRACED_WEIGHT: f32 = 1e-4;
