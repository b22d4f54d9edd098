//! Rows of the point image as filters add them: decoded, and with margins.

use std::ops::Range;

use crate::colour;

/// Red, green, blue, and the count of points.
pub(crate) const CHANNELS: usize = 4;
/// The count of points among the channels.
pub(crate) const COUNT: usize = 3;

/// Radiances of some rows and whether there are points, channel by channel. Zeros are around the
/// picture, so that filters need not look for its edges.
pub(crate) struct Rows {
    numbers: Vec<f32>,
    /// Pixels of a row with its margins.
    width: usize,
}

impl Rows {
    /// Returns the rows of a picture, `reach` more on each side, and as many pixels.
    #[inline(always)]
    pub fn around(colours: &[u32], width: usize, rows: Range<usize>, reach: usize) -> Self {
        let (height, wide) = (colours.len() / width, width + 2 * reach);
        let mut numbers = vec![0.0; CHANNELS * wide * (rows.len() + 2 * reach)];
        let lines = numbers.chunks_exact_mut(CHANNELS * wide).zip(rows.start..);
        for (line, row) in lines.filter(|(_, row)| (reach..height + reach).contains(row)) {
            decode(&colours[(row - reach) * width..][..width], line, wide, reach);
        }
        Self { numbers, width: wide }
    }

    /// Returns a channel of a row with its margins.
    #[inline(always)]
    pub fn channel(&self, row: usize, channel: usize) -> &[f32] {
        &self.numbers[(CHANNELS * row + channel) * self.width..][..self.width]
    }
}

/// Decodes a row of colours to channels of `wide` numbers each, behind a margin.
#[inline(always)]
fn decode(colours: &[u32], line: &mut [f32], wide: usize, margin: usize) {
    let (red, rest) = line.split_at_mut(wide);
    let (green, rest) = rest.split_at_mut(wide);
    let (blue, count) = rest.split_at_mut(wide);
    let length = margin + colours.len();
    let (red, green) = (&mut red[margin..length], &mut green[margin..length]);
    let (blue, count) = (&mut blue[margin..length], &mut count[margin..length]);
    for (x, &colour) in colours.iter().enumerate() {
        [red[x], green[x], blue[x]] = colour::decode(colour);
        count[x] = if colour == colour::NONE { 0.0 } else { 1.0 };
    }
}
