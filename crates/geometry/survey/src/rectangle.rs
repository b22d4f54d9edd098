//! The largest rectangle in a mask.

/// Cells from `low` to `high`, inclusive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CellRectangle {
    pub low: [usize; 2],
    pub high: [usize; 2],
}

impl CellRectangle {
    /// Returns the number of cells.
    pub(crate) fn cells(&self) -> usize {
        (self.high[0] + 1 - self.low[0]) * (self.high[1] + 1 - self.low[1])
    }

    /// Returns true if the rectangle contains a cell.
    pub(crate) fn contains(self, at: [usize; 2]) -> bool {
        (0..2).all(|axis| (self.low[axis]..=self.high[axis]).contains(&at[axis]))
    }

    /// Returns the least rectangle that also contains this cell.
    pub(crate) fn with(self, at: [usize; 2]) -> CellRectangle {
        let (low, high) = (self.low, self.high);
        CellRectangle {
            low: [low[0].min(at[0]), low[1].min(at[1])],
            high: [high[0].max(at[0]), high[1].max(at[1])],
        }
    }

    /// Returns all cells.
    pub(crate) fn places(self) -> impl Iterator<Item = [usize; 2]> {
        let CellRectangle { low, high } = self;
        (low[0]..=high[0]).flat_map(move |x| (low[1]..=high[1]).map(move |y| [x, y]))
    }
}

/// Returns the largest rectangle of set cells, in rows of `width`. Among equal ones, the first.
pub(crate) fn largest(mask: &[bool], width: usize) -> Option<CellRectangle> {
    let mut best: Option<CellRectangle> = None;
    // Number of set cells that end at the present row, by column.
    let mut depths = vec![0usize; width];
    for (row, cells) in mask.chunks_exact(width).enumerate() {
        for (depth, &set) in depths.iter_mut().zip(cells) {
            *depth = if set { *depth + 1 } else { 0 };
        }
        // Columns of ascending depth: where a rectangle of that depth begins.
        let mut open: Vec<(usize, usize)> = Vec::new();
        for column in 0..=width {
            let depth = depths.get(column).copied().unwrap_or(0);
            let mut begin = column;
            while let Some(&(from, deeper)) = open.last().filter(|(_, open)| *open > depth) {
                let found =
                    CellRectangle { low: [row + 1 - deeper, from], high: [row, column - 1] };
                if best.is_none_or(|best| found.cells() > best.cells()) {
                    best = Some(found);
                }
                open.pop();
                begin = from;
            }
            if depth > 0 && open.last().is_none_or(|&(_, open)| open < depth) {
                open.push((begin, depth));
            }
        }
    }
    best
}

/// Returns the set cells that lie in a square of set cells with this side, in rows of `width`.
pub(crate) fn opened(mask: &[bool], width: usize, side: usize) -> Vec<bool> {
    // The side of the largest square that ends at each cell.
    let mut squares = vec![0usize; mask.len()];
    for at in 0..mask.len() {
        if mask[at] {
            let is_edge = at < width || at.is_multiple_of(width);
            let before = |back: usize| if is_edge { 0 } else { squares[at - back] };
            squares[at] = 1 + before(1).min(before(width)).min(before(width + 1));
        }
    }
    // The squares, backwards along rows and then along columns.
    let mut opened: Vec<bool> = squares.iter().map(|&square| square >= side).collect();
    for step in [1, width] {
        let mut left = vec![0usize; mask.len()];
        for at in (0..mask.len()).rev() {
            let next = at + step;
            let is_same_line = next < mask.len() && (step > 1 || !next.is_multiple_of(width));
            let rest = if is_same_line { left[next].saturating_sub(1) } else { 0 };
            left[at] = if opened[at] { side } else { rest };
        }
        opened = left.iter().map(|&left| left > 0).collect();
    }
    opened
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_cells_in_squares_of_the_side_are_left() {
        let rows = ["..##.", ".####", "#####", "##..#"];
        let set = |rows: [&str; 4]| rows.concat().chars().map(|c| c == '#').collect::<Vec<_>>();
        assert_eq!(opened(&set(rows), 5, 1), set(rows));
        let two = ["..##.", ".####", "#####", "##..."];
        assert_eq!(opened(&set(rows), 5, 2), set(two));
        assert_eq!(opened(&set(rows), 5, 3), vec![false; 20]);
    }

    #[test]
    fn the_largest_rectangle_is_found() {
        let rows = ["..##.", ".####", ".####", "##..#"];
        let mask: Vec<bool> = rows.concat().chars().map(|c| c == '#').collect();
        assert_eq!(largest(&mask, 5), Some(CellRectangle { low: [1, 1], high: [2, 4] }));
        assert_eq!(largest(&[false; 6], 3), None);
        assert_eq!(largest(&[true; 6], 3), Some(CellRectangle { low: [0, 0], high: [1, 2] }));
    }
}
