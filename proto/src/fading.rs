//! The rule by which samples of an earlier generation yield to those of the present one.
//!
//! The samples that a beam has of an earlier generation are ranked from 0, in the order (kind,
//! number). The rule needs nothing but a rank and the number of present samples. So server and
//! displays come to the same result, whatever each of them has seen.

use std::ops::Range;

/// So many present samples of a beam replace all its earlier ones. Fewer do, if there are fewer
/// earlier ones than this: each present one replaces one of them.
pub const ENOUGH: u32 = 64;

/// Returns the ranks among `ranks` that still count in a beam with so many present samples: those
/// whose remainder by [`ENOUGH`] is not below that number.
pub fn lasting(ranks: Range<u32>, present: u64) -> impl Iterator<Item = Range<u32>> {
    let gone = u32::try_from(present).unwrap_or(u32::MAX).min(ENOUGH);
    let begin = ranks.start - ranks.start % ENOUGH;
    let blocks = (begin..ranks.end).step_by(ENOUGH as usize);
    let of_block = move |block: u32| {
        let first = block.saturating_add(gone).max(ranks.start);
        first..block.saturating_add(ENOUGH).min(ranks.end)
    };
    blocks.map(of_block).filter(|range| !range.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(ranks: Range<u32>, present: u64) -> Vec<u32> {
        lasting(ranks, present).flatten().collect()
    }

    #[test]
    fn earlier_samples_yield_one_by_one_and_are_gone_after_enough_or_as_many_new_ones() {
        assert_eq!(counted(0..200, 0), (0..200).collect::<Vec<_>>());
        for earlier in [1, 5, 63, 64, 65, 200, 1000] {
            let left = |present| counted(0..earlier, present).len();
            assert!((0..64).all(|present| left(present) >= left(present + 1)));
            assert!((1..earlier.min(64)).all(|present| left(u64::from(present)) > 0));
            assert_eq!(left(u64::from(earlier.min(ENOUGH))), 0, "{earlier}");
            assert_eq!(left(u64::MAX), 0);
        }
    }

    #[test]
    fn the_rule_is_the_same_for_a_part_of_the_ranks() {
        for present in [0, 1, 17, 63, 64] {
            let all = counted(0..300, present);
            for part in [0..10, 60..70, 64..128, 100..300, 5..5] {
                let expected: Vec<u32> =
                    all.iter().copied().filter(|rank| part.contains(rank)).collect();
                assert_eq!(counted(part, present), expected);
            }
        }
        assert_eq!(counted(u32::MAX - 3..u32::MAX, 0).len(), 3);
    }
}
