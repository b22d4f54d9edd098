//! The greatest radii of cells, from "a low-resolution grid over the display image so that we know
//! the approximate local sample density" (Larson & Simmons 1999, §2.4.4).
//!
//! The paper's largest cone "covers about 10% of the screen", its smallest 0.01 %, as shares of its
//! area. Between them, the radius is such that only one place in 10,000 is farther from its nearest
//! sample, if samples are spread at random.

/// Shares of the picture's area that the largest and the smallest cell may cover.
const LARGEST: f32 = 0.1;
const SMALLEST: f32 = 0.0001;
/// Least squared radius, pixels, so that a pixel shows its own sample in a picture of any size.
const OWN: f32 = 0.5;
/// Squares of the grid along the larger of the picture's sides.
const SQUARES: usize = 32;
/// Expected number of samples within the radius, at the density around a cell. A share of e⁻⁹ of
/// all places then has none.
const ROOM: f32 = 9.0;

/// Greatest radii over a picture.
pub(super) struct Radii {
    side: usize,
    width: usize,
    across: usize,
    /// Squared, of each square of the grid.
    squared: Vec<f32>,
}

impl Radii {
    /// Returns the radii for samples in these pixels.
    pub fn new((width, height): (usize, usize), pixels: impl Iterator<Item = usize>) -> Self {
        let side = width.max(height).div_ceil(SQUARES).max(1);
        let (across, down) = (width.div_ceil(side), height.div_ceil(side));
        let mut counts = vec![0_u32; across * down];
        pixels.for_each(|pixel| counts[pixel / width / side * across + pixel % width / side] += 1);
        let circle = (width * height) as f32 / std::f32::consts::PI;
        let (least, most) = ((SMALLEST * circle).max(OWN), (LARGEST * circle).max(OWN));
        let radius = |index: usize| {
            // The sum covers 3 × 3 squares, because one square has too few samples.
            let (column, row) = (index % across, index / across);
            let columns = column.saturating_sub(1)..(column + 2).min(across);
            let rows = row.saturating_sub(1)..(row + 2).min(down);
            let area = side * side * columns.len() * rows.len();
            let count: u32 = rows
                .flat_map(|row| &counts[row * across + columns.start..row * across + columns.end])
                .sum();
            (ROOM / std::f32::consts::PI * area as f32 / count as f32).clamp(least, most)
        };
        let squared = (0..across * down).map(radius).collect();
        Self { side, width, across, squared }
    }

    /// Returns the square of the greatest distance of a pixel from the sample whose cell it is in.
    pub fn squared_at(&self, pixel: usize) -> f32 {
        self.squared[pixel / self.width / self.side * self.across + pixel % self.width / self.side]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_cover_a_tenth_of_the_picture_at_the_most_and_one_in_ten_thousand_at_the_least() {
        let circle = 640.0 * 480.0 / std::f32::consts::PI;
        let none = Radii::new((640, 480), std::iter::empty());
        let all = Radii::new((640, 480), 0..640 * 480);
        for pixel in [0, 639, 640 * 240 + 320, 640 * 480 - 1] {
            assert_eq!(none.squared_at(pixel), 0.1 * circle);
            assert_eq!(all.squared_at(pixel), 0.0001 * circle);
        }
        // One sample in 100 pixels, all on the left: nine have room in a cell there, and cells far
        // from them are the largest.
        let some = Radii::new(
            (640, 480),
            (0..640 * 480).filter(|pixel| {
                pixel % 640 < 320 && pixel % 10 == pixel / 640 % 10 && pixel / 640 % 10 == 3
            }),
        );
        assert!(
            (some.squared_at(640 * 240 + 100) * std::f32::consts::PI / 900.0 - 1.0).abs() < 0.2
        );
        assert_eq!(some.squared_at(640 * 240 + 600), 0.1 * circle);
    }
}
