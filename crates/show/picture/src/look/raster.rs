//! Values on a grid over a picture, interpolated between the grid's centres.

use std::ops::{Add, Mul};

use rayon::prelude::*;

/// A grid of values in rows from the top.
#[derive(Clone)]
pub(super) struct Raster<T> {
    pub width: usize,
    pub height: usize,
    pub values: Vec<T>,
}

impl<T: Copy + Send + Sync + Add<Output = T> + Mul<f32, Output = T>> Raster<T> {
    /// Returns the value at a place of the picture: (0, 0) is its top left corner, and (1, 1) its
    /// bottom right one. Beyond the outermost centres it stays the same.
    #[inline]
    pub fn at(&self, x: f32, y: f32) -> T {
        let place = |share: f32, count: usize| {
            let place = (share * count as f32 - 0.5).clamp(0.0, (count - 1) as f32);
            let low = place as usize;
            (low, (low + 1).min(count - 1), place - low as f32)
        };
        let (left, right, across) = place(x, self.width);
        let (top, bottom, along) = place(y, self.height);
        let row = |row: usize| {
            let values = &self.values[row * self.width..][..self.width];
            values[left] * (1.0 - across) + values[right] * across
        };
        row(top) * (1.0 - along) + row(bottom) * along
    }

    /// Returns a grid of half the size, rounded up, whose values are means of four.
    pub fn halved(&self) -> Raster<T> {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let value = |index: usize| {
            let (left, top) = (2 * (index % width), 2 * (index / width));
            let (right, bottom) = ((left + 1).min(self.width - 1), (top + 1).min(self.height - 1));
            let at = |column: usize, row: usize| self.values[row * self.width + column];
            (at(left, top) + at(right, top) + (at(left, bottom) + at(right, bottom))) * 0.25
        };
        let values = (0..width * height).into_par_iter().with_min_len(width).map(value).collect();
        Raster { width, height, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_interpolated_between_centres_and_held_beyond_them() {
        let raster = Raster { width: 2, height: 2, values: vec![0.0_f32, 4.0, 8.0, 12.0] };
        assert_eq!(raster.at(0.25, 0.25), 0.0);
        assert_eq!(raster.at(0.5, 0.25), 2.0);
        assert_eq!(raster.at(0.5, 0.5), 6.0);
        assert_eq!(raster.at(1.0, 1.0), 12.0);
        assert_eq!(raster.at(0.0, 0.75), 8.0);
    }

    #[test]
    fn halves_keep_the_mean() {
        let raster = Raster { width: 3, height: 1, values: vec![1.0_f32, 3.0, 7.0] };
        let half = raster.halved();
        assert_eq!((half.width, half.height), (2, 1));
        assert_eq!(half.values, [2.0, 7.0]);
        assert_eq!(half.halved().halved().values, [4.5]);
    }
}
