//! How far a cell reaches: "a low-resolution grid over the display image so that we know the approximate local sample density" (Larson
//! & Simmons 1999, §2.4.4).
//!
//! The paper's largest cone "covers about 10% of the screen", its smallest 0.01 %: shares of its area. Between them, cells reach as far
//! as only one in 10,000 places is from its nearest sample where samples are spread by chance.

/// Shares of the picture's area that the largest and the smallest cell may cover.
const LARGEST: f32 = 0.1;
const SMALLEST: f32 = 0.0001;
/// Squares of the grid along the larger of the picture's sides.
const SQUARES: usize = 32;
/// Samples that a cell has room for where they are as many as around: of a place with so many expected within reach, e⁻⁹ have none.
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
    /// Of the samples in these pixels.
    pub fn new((width, height): (usize, usize), pixels: impl Iterator<Item = usize>) -> Self {
        let side = width.max(height).div_ceil(SQUARES).max(1);
        let (across, down) = (width.div_ceil(side), height.div_ceil(side));
        let mut counts = vec![0_u32; across * down];
        pixels.for_each(|pixel| counts[pixel / width / side * across + pixel % width / side] += 1);
        let circle = (width * height) as f32 / std::f32::consts::PI;
        let (least, most) = (SMALLEST * circle, LARGEST * circle);
        let radius = |index: usize| {
            // Of 3 × 3 squares: one alone has too few to tell.
            let (column, row) = (index % across, index / across);
            let columns = column.saturating_sub(1)..(column + 2).min(across);
            let rows = row.saturating_sub(1)..(row + 2).min(down);
            let area = side * side * columns.len() * rows.len();
            let count: u32 = rows.flat_map(|row| &counts[row * across + columns.start..row * across + columns.end]).sum();
            (ROOM / std::f32::consts::PI * area as f32 / count as f32).clamp(least, most)
        };
        let squared = (0..across * down).map(radius).collect();
        Self { side, width, across, squared }
    }

    /// Square of the greatest distance of a pixel from the sample whose cell it is in, pixels.
    pub fn squared_at(&self, pixel: usize) -> f32 {
        self.squared[pixel / self.width / self.side * self.across + pixel % self.width / self.side]
    }
}
