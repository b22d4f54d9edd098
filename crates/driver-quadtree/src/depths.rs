//! Distances of what a picture shows, without drawing it.
//!
//! A drawing averages colours over leaves as large as their noise asks. Depths need to know only
//! which surface a leaf shows, by the counts of its samples.
//!
//! Invariant: depths are a function of the set of samples, as the picture is.

use crate::Quadtree;
use crate::bins::{FAR, bin_distance};
use crate::shown::SEEN_SHARE;
use crate::sums::Sums;
use crate::surface::{Bins, adjacent, gap_allowed};

/// Level of the smallest leaves whose depths are looked at: 4 × 4 pixels.
const LEVEL: usize = 2;
/// Their side in pixels.
const SIDE: usize = 1 << LEVEL;

/// One surface in a leaf: its depth bins and its number of samples.
#[derive(Clone, Copy)]
struct Part {
    bins: Bins,
    count: u32,
}

/// All leaves of one size, row by row.
struct Leaves {
    width: usize,
    height: usize,
    leaves: Vec<Vec<Part>>,
}

impl Leaves {
    /// Makes the leaves of a level. `gather` adds the parts in a column and row, in any order.
    fn new(
        level: usize,
        (width, height): (usize, usize),
        gather: impl Fn(usize, usize, &mut Vec<Part>),
    ) -> Self {
        let leaf = |index: usize| {
            let mut parts = Vec::new();
            gather(index % width, index / width, &mut parts);
            parts.sort_unstable_by_key(|part: &Part| (part.bins.first, part.bins.last));
            parts.dedup_by(|part, open| {
                let is_same = adjacent(open.bins.last, part.bins.first, gap_allowed(level));
                if is_same {
                    open.bins.last = open.bins.last.max(part.bins.last);
                    open.count = open.count.saturating_add(part.count);
                }
                is_same
            });
            parts
        };
        Self { width, height, leaves: (0..width * height).map(leaf).collect() }
    }

    fn leaf(&self, column: usize, row: usize) -> &[Part] {
        &self.leaves[row * self.width + column]
    }

    /// Returns the leaves of twice the side, of a level.
    fn parents(&self, level: usize) -> Self {
        let size = (self.width.div_ceil(2), self.height.div_ceil(2));
        Self::new(level, size, |column, row, parts| {
            for row in 2 * row..(2 * row + 2).min(self.height) {
                for column in 2 * column..(2 * column + 2).min(self.width) {
                    parts.extend_from_slice(self.leaf(column, row));
                }
            }
        })
    }
}

impl Quadtree {
    /// Returns distances from the eye of what is shown, each with the column and row of its pixel:
    /// one for each square of 4 × 4 pixels in which anything is known.
    pub(crate) fn depths(&self) -> Vec<(usize, usize, f32)> {
        let levels = self.depth_leaves();
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let unseen = self.unseen_pixels();
        let depth = |square: usize| {
            let (column, row) = (square % levels[0].width, square / levels[0].width);
            let middle = |at: usize, size: usize| (SIDE * at + SIDE / 2).min(size - 1);
            let (x, y) = (middle(column, width), middle(row, height));
            let pixel = y * width + x;
            if !self.covered[pixel] || unseen.get(pixel) == Some(&true) {
                return None;
            }
            let leaves = levels.iter().enumerate();
            let mut leaves = leaves.map(|(up, level)| level.leaf(column >> up, row >> up));
            let leaf = leaves.find(|leaf| !leaf.is_empty())?;
            let all: f32 = leaf.iter().map(|part| part.count as f32).sum();
            let seen = leaf.iter().find(|part| part.count as f32 >= SEEN_SHARE * all)?;
            (seen.bins.first < FAR).then(|| (x, y, bin_distance(seen.bins.first)))
        };
        (0..levels[0].leaves.len()).filter_map(depth).collect()
    }

    /// Returns leaves of 4 × 4 pixels, and larger ones as long as some leaf is empty.
    fn depth_leaves(&self) -> Vec<Leaves> {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let size = (width.div_ceil(SIDE), height.div_ceil(SIDE));
        let mut levels = vec![Leaves::new(LEVEL, size, |column, row, parts| {
            for row in SIDE * row..(SIDE * row + SIDE).min(height) {
                for column in SIDE * column..(SIDE * column + SIDE).min(width) {
                    let part =
                        |(bin, sums): (u16, &Sums)| Part { bins: Bins::of(bin), count: sums.count };
                    parts.extend(self.bins(row * width + column).map(part));
                }
            }
        })];
        let is_incomplete = |level: &&Leaves| {
            level.width.max(level.height) > 1 && level.leaves.iter().any(Vec::is_empty)
        };
        while let Some(last) = levels.last().filter(is_incomplete) {
            let parents = last.parents(LEVEL + levels.len());
            levels.push(parents);
        }
        levels
    }
}
