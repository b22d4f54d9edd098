//! Leaves of four smaller ones, sixteen side by side.
//!
//! Leaves lie in memory one by one, as they are read in bursts; to be joined, those of sixteen larger ones are turned into rows of numbers, and
//! what comes out of it is turned back. Most leaves have one surface, which their quarters share. Others are joined one by one. With AVX-512 it
//! takes less than half the time that one by one takes; with AVX2, or what every processor has, as long.
//!
//! Always true: a leaf is what its quarters make joined one by one, bit for bit: the same operations in the same order.

use super::pyramid::Leaf;
use super::surface::{Surface, adjacent, gap_allowed};
use holo_cpu::Isa;
use holo_cpu::prefetch;
use crate::transpose::{WORDS, Words};
use bytemuck::{Zeroable, cast, cast_ref};
use std::mem::offset_of;

/// Leaves that are joined side by side.
pub(super) const LANES: usize = WORDS;

/// The word of a leaf that tells how many surfaces it has.
const COUNT: usize = offset_of!(Leaf, count) / size_of::<u32>();

/// The words of sixteen leaves, row by row.
type Rows = [Words; WORDS];

/// Leaves above others.
pub(super) struct Joined {
    /// The leaves, with no room for several surfaces.
    pub leaves: [Leaf; LANES],
    pub samples: [u32; LANES],
    /// Of which leaves nothing is told, since they may have several surfaces; 0: this is not one of them.
    pub left: [u32; LANES],
    /// Those below where a row ends, and empty ones beyond; scratch.
    edges: [[Leaf; 2 * LANES]; 2],
}

impl Default for Joined {
    fn default() -> Self {
        Self {
            leaves: [Leaf::zeroed(); LANES],
            samples: [0; LANES],
            left: [0; LANES],
            edges: [[Leaf::zeroed(); 2 * LANES]; 2],
        }
    }
}

impl Joined {
    /// Makes leaves of level `number` of those below, which two rows begin with.
    #[inline(always)]
    pub fn join(&mut self, number: usize, below: [&[Leaf]; 2], isa: Isa) {
        let mut quarters = [[[0; LANES]; WORDS]; 4];
        for (half, row) in below.into_iter().enumerate() {
            // Those of the next sixteen.
            row.iter().skip(2 * LANES).take(2 * LANES).for_each(prefetch);
            let leaves: &[Leaf; 2 * LANES] = match row.first_chunk() {
                Some(all) => all,
                None => {
                    let edge = &mut self.edges[half];
                    edge.fill(Leaf::zeroed());
                    edge[..row.len()].copy_from_slice(row);
                    edge
                }
            };
            isa.transpose(
                std::array::from_fn(|at| cast_ref(&leaves[2 * at])),
                &mut quarters[2 * half],
            );
            isa.transpose(
                std::array::from_fn(|at| cast_ref(&leaves[2 * at + 1])),
                &mut quarters[2 * half + 1],
            );
        }
        // Compiled for either: pixels' noise is still to be told.
        let joined =
            if number == 1 { self.joined(1, &quarters) } else { self.joined(number, &quarters) };
        let mut leaves = [[0; WORDS]; LANES];
        isa.transpose(joined.each_ref(), &mut leaves);
        self.leaves = cast(leaves);
    }

    #[inline(always)]
    fn joined(&mut self, number: usize, quarters: &[Rows; 4]) -> Rows {
        let mut joined = [[0; LANES]; WORDS];
        for lane in 0..LANES {
            self.join_lane(lane, number, quarters, &mut joined);
        }
        joined
    }

    #[inline(always)]
    fn join_lane(
        &mut self,
        lane: usize,
        number: usize,
        [a, b, c, d]: &[Rows; 4],
        joined: &mut Rows,
    ) {
        let (gap, below) = (gap_allowed(number), number - 1);
        let (a, b) = (Part::new(a, lane, 0, below), Part::new(b, lane, 1, below));
        let (c, d) = (Part::new(c, lane, 2, below), Part::new(d, lane, 3, below));
        let is_several = a.is_several | b.is_several | c.is_several | d.is_several;
        // Nearest first.
        let ((a, b), (c, d)) = (Part::sorted(a, b), Part::sorted(c, d));
        let ((a, c), (b, d)) = (Part::sorted(a, c), Part::sorted(b, d));
        let (b, c) = Part::sorted(b, c);
        let (open, meets_b) = b.joined_to(a.surface, gap);
        let (open, meets_c) = c.joined_to(open, gap);
        let (open, meets_d) = d.joined_to(open, gap);
        let surface = Surface::chosen(b.is_any(), open.closed_among_many(), open);
        self.left[lane] = u32::from(is_several | !(meets_b & meets_c & meets_d));
        self.samples[lane] = if a.is_any() { surface.count } else { 0 };
        surface.to_words(|word, value| joined[word][lane] = value);
        joined[COUNT][lane] = if a.is_any() { cast([1_u16, 0]) } else { 0 };
    }
}

/// A quarter of a leaf.
#[derive(Clone, Copy)]
struct Part {
    surface: Surface,
    /// By which quarters are sorted: their nearest bin, if they have any, and which of the four they are.
    key: u32,
    is_several: bool,
}

/// Key of a quarter that has nothing.
const NOTHING: u32 = 1 << 31;

impl Part {
    /// The quarter of a leaf, from the words of leaves of level `below`.
    #[inline(always)]
    fn new(rows: &Rows, lane: usize, quarter: u32, below: usize) -> Self {
        let surface = Surface::from_words(|word| rows[word][lane]).risen(below);
        let [count, _] = cast::<u32, [u16; 2]>(rows[COUNT][lane]);
        let nothing = if count == 0 { NOTHING } else { 0 };
        Self {
            surface,
            key: nothing | u32::from(surface.bins.first) << 2 | quarter,
            is_several: count > 1,
        }
    }

    #[inline(always)]
    fn is_any(&self) -> bool {
        self.key < NOTHING
    }

    #[inline(always)]
    fn sorted(a: Self, b: Self) -> (Self, Self) {
        let is_swapped = b.key < a.key;
        let choose = |a: &Self, b: &Self| Self {
            surface: Surface::chosen(is_swapped, b.surface, a.surface),
            key: if is_swapped { b.key } else { a.key },
            is_several: false,
        };
        (choose(&a, &b), choose(&b, &a))
    }

    /// A surface with this quarter, if it has any, and whether they meet.
    #[inline(always)]
    fn joined_to(&self, mut open: Surface, gap: u16) -> (Surface, bool) {
        let meets = adjacent(open.bins.last, self.surface.bins.first, gap) | !self.is_any();
        let alone = open;
        open.join(&self.surface);
        (Surface::chosen(self.is_any(), open, alone), meets)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Pyramids, any_samples};
    use holo_cpu::Instructions;
    use holo_cpu::Isa;

    #[test]
    fn leaves_joined_side_by_side_are_those_joined_one_by_one_with_all_instructions() {
        let all = [Instructions::Portable, Instructions::Avx2, Instructions::Avx512];
        for (size, samples) in
            [((37, 21), 300), ((37, 21), 30_000), ((80, 64), 9000), ((65, 3), 2000), ((3, 2), 500)]
        {
            let mut tree = any_samples(size, samples);
            let mut memory = None;
            for isa in all.into_iter().filter_map(Isa::new) {
                tree.isa = isa;
                // Made anew, and again in place.
                let mut pyramids = Pyramids::new(&tree, memory.take());
                for _ in 0..2 {
                    let [mut several, mut single] = [0; 2];
                    for levels in [&pyramids.narrow, pyramids.all()] {
                        for (number, two) in (1..).zip(levels.windows(2)) {
                            let [below, level] = two else { continue };
                            for (column, row) in (0..level.height)
                                .flat_map(|row| (0..level.width).map(move |column| (column, row)))
                            {
                                let mut alone = Vec::new();
                                below.of_children(number, column, row, &mut Vec::new(), &mut alone);
                                let found = level.leaf(column, row);
                                let bytes = bytemuck::cast_slice::<_, u8>;
                                assert_eq!(
                                    bytes(found),
                                    bytes(&alone),
                                    "{size:?} {samples} {number} {column} {row} {isa:?}"
                                );
                                let count: u32 = found.iter().map(|surface| surface.count).sum();
                                assert_eq!(level.samples[row * level.width + column], count);
                                *if found.len() > 1 { &mut several } else { &mut single } +=
                                    found.len();
                            }
                        }
                    }
                    assert!(single > 0 && several > 0);
                    pyramids.renew(&tree, &|_, index| index % 3 != 1);
                }
                memory = Some(pyramids);
            }
        }
    }
}
