//! The sums that are filtered.

use crate::light_store::Sums;
use crate::planes::SquarePlanes;

/// Number of neighbourhoods. Each is twice as wide as the one before.
pub(super) const SCALES: usize = 6;

/// The sums of each square: light (3), count, square.
pub(super) type Sum = SquarePlanes<5>;

/// The sums of all squares.
pub(crate) struct OfSquares {
    /// Over samples that count for the view.
    pub towards_eye: Vec<Sums>,
    /// Over samples from all directions on coats, and as above elsewhere. `None` without coats.
    pub from_all: Option<Vec<Sums>>,
}

impl OfSquares {
    /// Returns true if no square has a sample, as at the start of a new holodeck.
    pub fn are_empty(&self) -> bool {
        let all = self.from_all.as_ref().unwrap_or(&self.towards_eye);
        all.iter().all(|sums| sums.count == 0)
    }
}
