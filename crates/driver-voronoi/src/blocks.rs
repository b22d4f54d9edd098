//! Blocks of a picture: where something has to be done again, and how far that reaches.
//!
//! Invariant: a mask that was widened holds every block any pixel of which is as near as that to one of the mask's.

use std::ops::Range;

/// Rows of a block.
pub(crate) const ROWS: usize = 16;

/// Columns of a block.
pub(crate) const COLUMNS: usize = 64;

/// Blocks in a row of them, for a picture of this width.
pub(crate) fn across(width: usize) -> usize {
    width.div_ceil(COLUMNS)
}

/// Blocks of a picture of this many rows and columns.
pub(crate) fn count((width, height): (usize, usize)) -> usize {
    across(width) * height.div_ceil(ROWS)
}

/// The block of a pixel.
#[inline]
pub(crate) fn of(pixel: usize, width: usize) -> usize {
    pixel / width / ROWS * across(width) + pixel % width / COLUMNS
}

/// Some of a picture's blocks.
#[derive(Clone, Debug)]
pub(crate) struct Mask {
    across: usize,
    marks: Vec<bool>,
}

impl Mask {
    /// Those of a picture of this width for which `is_in` holds.
    pub fn new((width, height): (usize, usize), is_in: impl FnMut(usize) -> bool) -> Mask {
        Mask { across: across(width), marks: (0..count((width, height))).map(is_in).collect() }
    }

    pub fn has(&self, block: usize) -> bool {
        self.marks.get(block).copied().unwrap_or(false)
    }

    pub fn any(&self) -> bool {
        self.marks.contains(&true)
    }

    /// Whether any block within so many pixels of this one is in it.
    pub fn has_near(&self, block: usize, pixels: usize) -> bool {
        let across = self.across.max(1);
        let (column, row) = (block % across, block / across);
        let (beside, above) = (pixels.div_ceil(COLUMNS), pixels.div_ceil(ROWS));
        let rows = row.saturating_sub(above)..(row + above + 1).min(self.marks.len() / across);
        let columns = column.saturating_sub(beside)..(column + beside + 1).min(across);
        rows.into_iter().any(|row| self.marks[row * across..][columns.clone()].contains(&true))
    }

    /// The blocks within so many pixels of its own.
    pub fn widened(&self, pixels: usize) -> Mask {
        self.widened_by(pixels.div_ceil(COLUMNS), pixels.div_ceil(ROWS))
    }

    /// The blocks within so many rows of pixels of its own.
    pub fn heightened(&self, rows: usize) -> Mask {
        self.widened_by(0, rows.div_ceil(ROWS))
    }

    /// Those of its blocks that are in another one of the same picture too.
    pub fn within(&self, other: &Mask) -> Mask {
        let marks = self.marks.iter().zip(&other.marks).map(|(mark, other)| mark & other).collect();
        Mask { across: self.across, marks }
    }

    fn widened_by(&self, beside: usize, above: usize) -> Mask {
        let across = self.across.max(1);
        let down = self.marks.len() / across;
        let mut wide = vec![false; self.marks.len()];
        for (block, _) in self.marks.iter().enumerate().filter(|(_, mark)| **mark) {
            let (column, row) = (block % across, block / across);
            wide[row * across..][column.saturating_sub(beside)..(column + beside + 1).min(across)]
                .fill(true);
        }
        let mut marks = vec![false; self.marks.len()];
        for row in 0..down {
            for from in wide
                .chunks(across)
                .take((row + above + 1).min(down))
                .skip(row.saturating_sub(above))
            {
                marks[row * across..][..across]
                    .iter_mut()
                    .zip(from)
                    .for_each(|(mark, from)| *mark |= from);
            }
        }
        Mask { across, marks }
    }

    /// For each row of blocks the columns of pixels, of a picture of this width, that are in it.
    pub fn runs(&self, width: usize) -> Vec<Vec<Range<usize>>> {
        let of_row = |marks: &[bool]| {
            let mut runs: Vec<Range<usize>> = Vec::new();
            for (block, _) in marks.iter().enumerate().filter(|(_, mark)| **mark) {
                let columns = block * COLUMNS..((block + 1) * COLUMNS).min(width);
                match runs.last_mut() {
                    Some(last) if last.end == columns.start => last.end = columns.end,
                    _ => runs.push(columns),
                }
            }
            runs
        };
        self.marks.chunks(self.across.max(1)).map(of_row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_widened_mask_holds_exactly_what_is_near() {
        let size = (700, 130);
        let mask = Mask::new(size, |block| block == 15 || block == 40);
        for pixels in [0, 1, 15, 16, 17, 63, 64, 65, 127] {
            let wide = mask.widened(pixels);
            for block in 0..count(size) {
                assert_eq!(wide.has(block), mask.has_near(block, pixels), "{block} {pixels}");
            }
        }
        // Every pixel as near as that is in it.
        let wide = mask.widened(20);
        for at in 0..size.0 * size.1 {
            let (x, y) = ((at % size.0) as i64, (at / size.0) as i64);
            let is_near = [15_i64, 40].iter().any(|block| {
                let (left, top) = (block % 11 * 64, block / 11 * 16);
                (left - 20..left + 64 + 20).contains(&x) && (top - 20..top + 16 + 20).contains(&y)
            });
            assert!(!is_near || wide.has(of(at, size.0)), "{x} {y}");
        }
    }

    #[test]
    fn runs_are_the_columns_of_a_rows_blocks() {
        let mask = Mask::new((200, 20), |block| [0, 1, 3, 4, 6].contains(&block));
        assert_eq!(mask.runs(200), [vec![0..128, 192..200], vec![0..64, 128..192]]);
    }
}
