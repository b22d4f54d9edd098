//! The pyramid of leaves: what each square of the picture holds, surface by surface.
//!
//! Level 0 is the pixels. A leaf of each further level is a square of 2 × 2 leaves of the level
//! below: the quadtree.
//!
//! What always holds:
//! - The surfaces of a leaf are disjoint in depth, nearest first, and each surface of a child lies
//!   within one of its parent.
//! - The same bins give the same bits, however many threads there are.

use crate::surface::{Surface, adjacent, gap_allowed};
use rayon::prelude::*;

/// All leaves of one size.
pub(crate) struct Level {
    pub width: usize,
    pub height: usize,
    rows: Vec<Row>,
}

/// A row of leaves.
#[derive(Default)]
struct Row {
    /// Where each leaf's surfaces begin, and one more for the end.
    starts: Vec<u32>,
    surfaces: Vec<Surface>,
}

impl Level {
    /// Makes the leaves of each row by `append`, which adds the surfaces of the leaf in a column
    /// and row, nearest first.
    fn new(
        (width, height): (usize, usize),
        append: impl Fn(usize, usize, &mut Vec<Surface>) + Sync,
    ) -> Self {
        let make_row = |row: usize| {
            let mut starts = Vec::with_capacity(width + 1);
            let mut surfaces = Vec::with_capacity(width);
            starts.push(0);
            for column in 0..width {
                append(column, row, &mut surfaces);
                starts.push(surfaces.len() as u32);
            }
            Row { starts, surfaces }
        };
        Self { width, height, rows: (0..height).into_par_iter().map(make_row).collect() }
    }

    /// Returns the surfaces of a leaf, nearest first.
    #[inline(always)]
    pub fn leaf(&self, column: usize, row: usize) -> &[Surface] {
        let row = &self.rows[row];
        &row.surfaces[row.starts[column] as usize..row.starts[column + 1] as usize]
    }

    /// Returns the leaves of level `number`, each made of four of these.
    fn parents(&self, number: usize) -> Self {
        let size = (self.width.div_ceil(2), self.height.div_ceil(2));
        Self::new(size, |column, row, surfaces| self.join_quarters(number, column, row, surfaces))
    }

    /// Appends the surfaces of one leaf of level `number`.
    fn join_quarters(&self, number: usize, column: usize, row: usize, surfaces: &mut Vec<Surface>) {
        let start = surfaces.len();
        for row in 2 * row..(2 * row + 2).min(self.height) {
            for column in 2 * column..(2 * column + 2).min(self.width) {
                surfaces.extend(self.leaf(column, row).iter().map(Surface::of_quarter));
            }
        }
        // A stable sort of parts in a fixed order: the same bits every time.
        surfaces[start..].sort_by_key(|part| part.bins.first);
        join_adjacent(surfaces, start, gap_allowed(number));
    }
}

/// Joins those of the surfaces from `start` on that are parts of one surface.
fn join_adjacent(surfaces: &mut Vec<Surface>, start: usize, gap: u16) {
    let mut open = start;
    for at in start + 1..surfaces.len() {
        let part = surfaces[at];
        if adjacent(surfaces[open].bins.last, part.bins.first, gap) {
            surfaces[open].join(&part);
        } else {
            open += 1;
            surfaces[open] = part;
        }
    }
    surfaces.truncate(open + 1);
    surfaces[start..].iter_mut().for_each(Surface::close);
}

/// Returns all levels of a picture of `size` pixels, up to one leaf. `append` adds the surfaces of a
/// pixel, by its number, nearest first.
pub(crate) fn pyramid(
    size: (usize, usize),
    append: impl Fn(usize, &mut Vec<Surface>) + Sync,
) -> Vec<Level> {
    let mut levels =
        vec![Level::new(size, |column, row, surfaces| append(row * size.0 + column, surfaces))];
    while let Some(last) = levels.last().filter(|last| last.width > 1 || last.height > 1) {
        let parents = last.parents(levels.len());
        levels.push(parents);
    }
    levels
}
