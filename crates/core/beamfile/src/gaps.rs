//! Sample numbers that beams lack below their next free ones.
//!
//! Packets return from workers out of order, so gaps open all the time, and most close soon. To
//! find them in the beams' extents took more than half of opening a file of 1 GB.
//!
//! Invariant: gaps of a beam and kind are not empty, do not overlap, and are not adjacent.

use std::collections::BTreeMap;

use holo_section::BeamKey;

/// Gaps by beam, kind and first missing number. The value is the first number after the gap.
#[derive(Debug, Default)]
pub(crate) struct Gaps(BTreeMap<(BeamKey, u8, u32), u32>);

impl Gaps {
    /// Records that a beam lacks the numbers from `begin` to before `end`.
    pub fn open(&mut self, key: BeamKey, kind: u8, begin: u32, end: u32) {
        self.0.insert((key, kind, begin), end);
    }

    /// Records that the numbers from `begin` to before `end` have come. Returns how many of them
    /// were missing.
    pub fn close(&mut self, key: BeamKey, kind: u8, begin: u32, end: u32) -> u32 {
        let mut closed = 0;
        // The last gap that begins before `end`, until none is left that ends after `begin`.
        while let Some((&(of, its_kind, from), &to)) = self.0.range(..(key, kind, end)).next_back()
            && (of, its_kind) == (key, kind)
            && to > begin
        {
            self.0.remove(&(key, kind, from));
            if to > end {
                self.0.insert((key, kind, end), to);
            }
            if from < begin {
                self.0.insert((key, kind, from), begin);
            }
            closed += to.min(end) - from.max(begin);
        }
        closed
    }

    /// Forgets all gaps.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use holo_section::BeamId;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_number_is_missing_until_it_comes(
            runs in prop::collection::vec((0u64..2, 0u8..2, 0u32..80, 1u32..20), 0..40),
        ) {
            let mut gaps = Gaps::default();
            let mut missing = HashSet::new();
            for beam in 0..2 {
                for kind in 0..2 {
                    gaps.open(BeamKey { section: 0, beam: BeamId(beam) }, kind, 5, 90);
                    missing.extend((5..90).map(|number| (beam, kind, number)));
                }
            }
            for (beam, kind, first, count) in runs {
                let key = BeamKey { section: 0, beam: BeamId(beam) };
                let numbers = first..first + count;
                let model = numbers.filter(|&n| missing.remove(&(beam, kind, n))).count();
                prop_assert_eq!(gaps.close(key, kind, first, first + count) as usize, model);
                let left: u32 = gaps.0.iter().map(|(&(_, _, from), &to)| to - from).sum();
                prop_assert_eq!(left as usize, missing.len());
            }
        }
    }
}
