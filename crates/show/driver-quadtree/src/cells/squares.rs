//! Sums over squares of a picture and the squares around them.
//!
//! Invariant: pixels and squares are added row by row, so floats always add up to the same bits.

/// Sums over each square of pixels and the eight around it.
pub(super) struct SquareSums<T, const SIDE: usize> {
    width: usize,
    across: usize,
    around: Vec<T>,
}

impl<T: Copy, const SIDE: usize> SquareSums<T, SIDE> {
    /// Returns the sums of values of pixels, given with the pixels' numbers. `join` adds two sums,
    /// and `nothing` is the empty sum.
    pub fn new(
        (width, height): (usize, usize),
        nothing: T,
        pixels: impl Iterator<Item = (usize, T)>,
        join: impl Fn(T, T) -> T,
    ) -> Self {
        let (across, down) = (width.div_ceil(SIDE), height.div_ceil(SIDE));
        let mut own = vec![nothing; across * down];
        for (pixel, part) in pixels {
            let square = &mut own[pixel / width / SIDE * across + pixel % width / SIDE];
            *square = join(*square, part);
        }
        let around = |index: usize| {
            let (column, row) = (index % across, index / across);
            let columns = column.saturating_sub(1)..(column + 2).min(across);
            let rows = row.saturating_sub(1)..(row + 2).min(down);
            let squares = rows.flat_map(|row| &own[row * across..][columns.clone()]);
            squares.fold(nothing, |sum, square| join(sum, *square))
        };
        Self { width, across, around: (0..across * down).map(around).collect() }
    }

    /// Returns the sum around a pixel.
    pub fn around(&self, pixel: usize) -> T {
        self.around[pixel / self.width / SIDE * self.across + pixel % self.width / SIDE]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_is_of_all_pixels_of_the_squares_around_and_no_others() {
        const SIZE: (usize, usize) = (23, 18);
        let value = |pixel: usize| (pixel * 37 % 101) as u32;
        let pixels = (0..SIZE.0 * SIZE.1).filter(|pixel| pixel % 3 > 0);
        let squares = SquareSums::<u32, 4>::new(
            SIZE,
            0,
            pixels.clone().map(|pixel| (pixel, value(pixel))),
            |a, b| a + b,
        );
        let square = |pixel: usize| (pixel % SIZE.0 / 4, pixel / SIZE.0 / 4);
        for pixel in 0..SIZE.0 * SIZE.1 {
            let is_near = |other: &usize| {
                let ((a, b), (c, d)) = (square(pixel), square(*other));
                a.abs_diff(c) <= 1 && b.abs_diff(d) <= 1
            };
            assert_eq!(
                squares.around(pixel),
                pixels.clone().filter(is_near).map(value).sum::<u32>(),
                "{pixel}"
            );
        }
    }
}
