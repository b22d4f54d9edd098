//! The largest rectangle in a mask.

/// Cells from `low` to `high`, both within.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rectangle {
    pub low: [usize; 2],
    pub high: [usize; 2],
}

impl Rectangle {
    /// Returns the number of cells.
    pub(crate) fn cells(&self) -> usize {
        (self.high[0] + 1 - self.low[0]) * (self.high[1] + 1 - self.low[1])
    }

    /// Returns all cells.
    pub(crate) fn places(self) -> impl Iterator<Item = [usize; 2]> {
        let Rectangle { low, high } = self;
        (low[0]..=high[0]).flat_map(move |x| (low[1]..=high[1]).map(move |y| [x, y]))
    }
}

/// Returns the largest rectangle of set cells in rows of `width`; the first of equal ones.
pub(crate) fn largest(mask: &[bool], width: usize) -> Option<Rectangle> {
    let mut best: Option<Rectangle> = None;
    // Number of set cells that end at the present row, in each column.
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
                let found = Rectangle { low: [row + 1 - deeper, from], high: [row, column - 1] };
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_rectangle_is_found() {
        let rows = ["..##.", ".####", ".####", "##..#"];
        let mask: Vec<bool> = rows.concat().chars().map(|c| c == '#').collect();
        assert_eq!(largest(&mask, 5), Some(Rectangle { low: [1, 1], high: [2, 4] }));
        assert_eq!(largest(&[false; 6], 3), None);
        assert_eq!(largest(&[true; 6], 3), Some(Rectangle { low: [0, 0], high: [1, 2] }));
    }
}
