//! A row of a filter: three channels and a weight, with room at both ends.
//!
//! Always true: the room holds zeros.

use super::colour;
use std::ops::Range;

/// Pixels of room at each end: the widest filter's reach.
pub(super) const ROOM: usize = 4;

/// Sums of three channels and of weights.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub channels: [Vec<f32>; 4],
}

impl Row {
    pub fn new(width: usize) -> Self {
        Self { channels: std::array::from_fn(|_| vec![0.0; width + 2 * ROOM]) }
    }

    /// Colours of `columns` of a row and of `reach` more at both ends, and weight 1 where there is one; 0 outside the picture.
    /// The first of `columns` goes to [`ROOM`].
    #[inline(always)]
    pub fn decode(&mut self, row: Option<&[u32]>, columns: &Range<usize>, reach: usize) {
        let Some(row) = row else { return self.clear() };
        let (start, end) = (columns.start.saturating_sub(reach), (columns.end + reach).min(row.len()));
        let (to, count) = ((ROOM + start) - columns.start, end - start);
        let [r, g, b, w] = self.channels.each_mut().map(|channel| {
            channel[..to].fill(0.0);
            channel[to + count..].fill(0.0);
            &mut channel[to..][..count]
        });
        decode_into(&row[start..end], r, g, b, w);
    }

    pub fn clear(&mut self) {
        self.channels.iter_mut().for_each(|channel| channel.fill(0.0));
    }
}

/// The `y`-th row of a picture.
#[inline(always)]
pub(super) fn row_of<T>(plane: &[T], width: usize, y: usize) -> Option<&[T]> {
    plane.get(y.checked_mul(width)?..)?.get(..width)
}

/// Columns `0..width` in strips, so that a filter's rows stay in the fastest cache.
pub(super) fn strips(width: usize, of: usize) -> impl Iterator<Item = Range<usize>> {
    (0..width).step_by(of).map(move |start| start..(start + of).min(width))
}

#[inline(always)]
fn decode_into(colours: &[u32], r: &mut [f32], g: &mut [f32], b: &mut [f32], w: &mut [f32]) {
    for ((((&colour, r), g), b), w) in colours.iter().zip(r).zip(g).zip(b).zip(w) {
        [*r, *g, *b] = colour::decode(colour);
        *w = if colour == colour::NONE { 0.0 } else { 1.0 };
    }
}
