//! Rows of the point image, decoded for the filters.

use std::ops::Range;

use glam::Vec4;

use crate::colour;

/// Some rows of the point image: the radiance of each pixel's point, and 1 as fourth number. A
/// pixel without a point is 0. Zeros surround the picture, so filters need not look for its edges.
pub(crate) struct Rows {
    pixels: Vec<Vec4>,
    /// Pixels of a row with its margins.
    width: usize,
}

impl Rows {
    /// Decodes `rows` of a picture that is `width` pixels wide. Adds margins: `reach` rows above
    /// and below, and `reach` pixels at both ends of each row.
    pub fn around(colours: &[u32], width: usize, rows: Range<usize>, reach: usize) -> Self {
        let (height, wide) = (colours.len() / width, width + 2 * reach);
        let mut pixels = vec![Vec4::ZERO; wide * (rows.len() + 2 * reach)];
        let lines = pixels.chunks_exact_mut(wide).zip(rows.start..);
        for (line, row) in lines.filter(|(_, row)| (reach..height + reach).contains(row)) {
            let colours = &colours[(row - reach) * width..][..width];
            for (pixel, &colour) in line[reach..].iter_mut().zip(colours) {
                *pixel = decode(colour);
            }
        }
        Self { pixels, width: wide }
    }

    /// Returns a row with its margins. Row 0 is the topmost of the margin.
    pub fn row(&self, row: usize) -> &[Vec4] {
        &self.pixels[row * self.width..][..self.width]
    }
}

/// Returns the channels of a packed colour, and 1 as fourth number; 0 without a point.
#[inline]
pub(crate) fn decode(colour: u32) -> Vec4 {
    let [red, green, blue] = colour::decode(colour);
    Vec4::new(red, green, blue, if colour == colour::NONE { 0.0 } else { 1.0 })
}
