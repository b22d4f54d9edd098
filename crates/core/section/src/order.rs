//! An order of beams whose every beginning is spread evenly over a section. It takes no memory.

use crate::cells::BeamId;
use crate::hash::combine;

const ROUNDS: u64 = 6;

/// A keyed permutation of the beams 0 to n-1.
///
/// It is a Feistel network over the next even power of two, repeated until the result is below n
/// (Black & Rogaway 2002, "cycle walking").
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct BeamOrder {
    beams: u64,
    key: u64,
    half_bits: u32,
}

impl BeamOrder {
    /// Returns an order of `beams` beams. Different keys give different orders.
    pub fn new(beams: u64, key: u64) -> BeamOrder {
        let bits = 64 - beams.saturating_sub(1).leading_zeros();
        BeamOrder { beams, key, half_bits: bits.div_ceil(2).max(1) }
    }

    /// Returns the beam at `position`, modulo the number of beams; beam 0 if that number is 0.
    pub fn at(&self, position: u64) -> BeamId {
        if self.beams == 0 {
            return BeamId(0);
        }
        // The network's domain is less than 4 times the beams, so fewer than 4 steps are expected.
        // The walk ends, because the position itself is on its cycle.
        let mut x = self.permute(position % self.beams);
        while x >= self.beams {
            x = self.permute(x);
        }
        BeamId(x)
    }

    fn permute(&self, x: u64) -> u64 {
        let mask = (1u64 << self.half_bits) - 1;
        let (mut left, mut right) = (x >> self.half_bits, x & mask);
        for round in 0..ROUNDS {
            (left, right) = (right, left ^ combine(self.key ^ round << 56, right) & mask);
        }
        left << self.half_bits | right
    }
}
