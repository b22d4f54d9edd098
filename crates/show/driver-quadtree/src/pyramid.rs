//! The quadtree as a pyramid: the surfaces of each square of the picture.
//!
//! The leaves of level 0 are the pixels. A leaf of a further level is a square of 2 × 2 leaves of
//! the level below.
//!
//! Invariants:
//! - The surfaces of a leaf are disjoint in depth, nearest first, and each surface of a child lies
//!   within one of its parent.
//! - The same bins give the same bits, however many threads there are.

use crate::surface::{LeafSurface, adjacent, gap_allowed};
use rayon::prelude::*;

/// All leaves of one size.
pub(crate) struct PyramidLevel {
    pub width: usize,
    pub height: usize,
    rows: Vec<Row>,
}

/// A row of leaves.
#[derive(Default)]
struct Row {
    /// Where each leaf's surfaces begin, and one more for the end.
    starts: Vec<u32>,
    surfaces: Vec<LeafSurface>,
}

impl Row {
    /// Makes a row of leaves. `append` adds the surfaces of the leaf in a column, nearest first.
    fn new(width: usize, mut append: impl FnMut(usize, &mut Vec<LeafSurface>)) -> Self {
        let mut starts = Vec::with_capacity(width + 1);
        let mut surfaces = Vec::with_capacity(width);
        starts.push(0);
        for column in 0..width {
            append(column, &mut surfaces);
            starts.push(surfaces.len() as u32);
        }
        Self { starts, surfaces }
    }
}

impl PyramidLevel {
    /// Returns the surfaces of a leaf, nearest first.
    #[inline(always)]
    pub fn leaf(&self, column: usize, row: usize) -> &[LeafSurface] {
        let row = &self.rows[row];
        &row.surfaces[row.starts[column] as usize..row.starts[column + 1] as usize]
    }

    /// Returns the leaves of level `number`, each made of four of these.
    fn parents(&self, number: usize) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let make_row = |row: usize| {
            let mut parts = Vec::new();
            Row::new(width, |column, surfaces| {
                parts.clear();
                for row in 2 * row..(2 * row + 2).min(self.height) {
                    for column in 2 * column..(2 * column + 2).min(self.width) {
                        parts.extend(self.leaf(column, row));
                    }
                }
                // A stable sort of parts in a fixed order: the same bits every time.
                parts.sort_by_key(|part: &&LeafSurface| part.bins.first);
                join_adjacent(&parts, gap_allowed(number), surfaces);
            })
        };
        Self { width, height, rows: (0..height).into_par_iter().map(make_row).collect() }
    }
}

/// Appends the surfaces that quarters' surfaces, nearest first, are parts of.
fn join_adjacent(parts: &[&LeafSurface], gap: u16, surfaces: &mut Vec<LeafSurface>) {
    let Some((first, others)) = parts.split_first() else { return };
    let mut open = first.of_quarter();
    for part in others {
        if adjacent(open.bins.last, part.bins.first, gap) {
            open.join(part);
        } else {
            surfaces.push(open.closed());
            open = part.of_quarter();
        }
    }
    surfaces.push(open.closed());
}

/// Returns all levels of a picture of `size` pixels, up to one leaf. `append` adds the surfaces of
/// a pixel, by its number, nearest first.
pub(crate) fn pyramid(
    (width, height): (usize, usize),
    append: impl Fn(usize, &mut Vec<LeafSurface>) + Sync,
) -> Vec<PyramidLevel> {
    let make_row =
        |row: usize| Row::new(width, |column, surfaces| append(row * width + column, surfaces));
    let rows = (0..height).into_par_iter().map(make_row).collect();
    let mut levels = vec![PyramidLevel { width, height, rows }];
    while let Some(last) = levels.last().filter(|last| last.width > 1 || last.height > 1) {
        let parents = last.parents(levels.len());
        levels.push(parents);
    }
    levels
}
