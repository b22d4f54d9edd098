//! Workers, as those know them who compare and check their results.

use holo_beamfile::Maker;

/// A worker: its machine, and its seat among the connected workers of this machine. A worker that
/// loses its connection and comes back has the same again, and so has one that was replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct WorkerId {
    /// The machine.
    pub maker: Maker,
    /// The seat: the lowest one that was free.
    pub seat: u16,
}

impl WorkerId {
    /// Returns the worker that stands for all of a machine's before the server started.
    pub fn earlier(maker: Maker) -> WorkerId {
        WorkerId { maker, seat: u16::MAX }
    }

    /// Returns the first free seat of a machine.
    pub fn new(maker: Maker, taken: impl Iterator<Item = WorkerId>) -> WorkerId {
        let mut seats: Vec<u16> = taken.filter(|id| id.maker == maker).map(|id| id.seat).collect();
        seats.sort_unstable();
        let is_free = |seat: &u16| seats.binary_search(seat).is_err();
        WorkerId { maker, seat: (0..u16::MAX).find(is_free).unwrap_or_default() }
    }
}
