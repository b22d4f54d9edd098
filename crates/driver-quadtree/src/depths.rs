//! How far away what a picture shows is, without drawing it.
//!
//! A drawing averages colours over leaves of the size that their noise asks for; depths need no more than which surface a leaf
//! shows, by the counts of its samples.
//!
//! Invariant: depths are a function of the set of samples, as the picture is.

use super::bins::{FAR, bin_distance};
use super::sums::Summed;
use super::surface::{Bins, adjacent, gap_allowed};
use super::{Quadtree, SEEN_SHARE};

/// Doublings from a pixel to the leaves whose depths are looked at: 4 × 4 pixels.
const LEVEL: usize = 2;

/// One surface in a leaf: its first and last depth bin, and its samples.
#[derive(Clone, Copy)]
struct Part {
    bins: Bins,
    count: u32,
}

/// All leaves of one size.
struct Leaves {
    width: usize,
    height: usize,
    /// Where each leaf's surfaces begin, and one more for the end.
    first: Vec<u32>,
    parts: Vec<Part>,
    are_all_filled: bool,
}

impl Leaves {
    /// Leaves of `width` × `height`, of what `gather` adds for a column and row.
    fn new(
        level: usize,
        width: usize,
        height: usize,
        mut gather: impl FnMut(usize, usize, &mut Vec<Part>),
    ) -> Self {
        let mut first = Vec::with_capacity(width * height + 1);
        first.push(0);
        let mut leaves = Self { width, height, first, parts: Vec::new(), are_all_filled: true };
        let (gap, mut found) = (gap_allowed(level), Vec::new());
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column)))
        {
            found.clear();
            gather(column, row, &mut found);
            found.sort_unstable_by_key(|part: &Part| (part.bins.first, part.bins.last));
            let start = leaves.parts.len();
            for part in &found {
                match leaves.parts[start..].last_mut() {
                    Some(open) if adjacent(open.bins.last, part.bins.first, gap) => {
                        open.bins.last = open.bins.last.max(part.bins.last);
                        open.count = open.count.saturating_add(part.count);
                    }
                    _ => leaves.parts.push(*part),
                }
            }
            leaves.are_all_filled &= !found.is_empty();
            leaves.first.push(leaves.parts.len() as u32);
        }
        leaves
    }

    fn leaf(&self, column: usize, row: usize) -> &[Part] {
        let index = row * self.width + column;
        &self.parts[self.first[index] as usize..self.first[index + 1] as usize]
    }

    /// Leaves of twice the side.
    fn parent(&self, level: usize) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        Self::new(level, width, height, |column, row, found| {
            for row in 2 * row..(2 * row + 2).min(self.height) {
                for column in 2 * column..(2 * column + 2).min(self.width) {
                    found.extend_from_slice(self.leaf(column, row));
                }
            }
        })
    }
}

impl Quadtree {
    /// Distances from the eye of what is shown, one for each square of 4 × 4 pixels in which anything is, with the pixel
    /// in its middle: as a drawing has them but for the finest detail, in a small part of its time.
    pub(super) fn depths(&self) -> impl Iterator<Item = (u32, u32, f32)> {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let side = 1 << LEVEL;
        let finest =
            Leaves::new(
                LEVEL,
                width.div_ceil(side),
                height.div_ceil(side),
                |column, row, found| {
                    for row in side * row..(side * row + side).min(height) {
                        for pixel in row * width + side * column
                            ..row * width + (side * column + side).min(width)
                        {
                            let bins = self.narrow.of(pixel).chain(self.wide.of(pixel));
                            found.extend(bins.map(|(bin, sums)| Part {
                                bins: Bins::of(bin),
                                count: sums.count(),
                            }));
                        }
                    }
                },
            );
        let (columns, rows) = (finest.width, finest.height);
        let mut levels = vec![finest];
        // Larger leaves are for where smaller ones are empty.
        while let Some(last) =
            levels.last().filter(|last| !last.are_all_filled && last.width.max(last.height) > 1)
        {
            levels.push(last.parent(LEVEL + levels.len()));
        }
        let squares = (0..rows).flat_map(move |row| (0..columns).map(move |column| (column, row)));
        squares.filter_map(move |(column, row)| {
            let middle = |at: usize, size: usize| (side * at + side / 2).min(size - 1);
            let (x, y) = (middle(column, width), middle(row, height));
            let pixel = y * width + x;
            if !self.covered[pixel] || self.sees_nothing(pixel) {
                return None;
            }
            let (level, leaves) = levels
                .iter()
                .enumerate()
                .find(|(up, level)| !level.leaf(column >> up, row >> up).is_empty())?;
            let leaf = leaves.leaf(column >> level, row >> level);
            let all: f32 = leaf.iter().map(|part| part.count as f32).sum();
            let seen = leaf.iter().find(|part| part.count as f32 >= SEEN_SHARE * all)?;
            (seen.bins.first < FAR).then(|| (x as u32, y as u32, bin_distance(seen.bins.first)))
        })
    }
}
