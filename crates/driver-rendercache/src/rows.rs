//! A row of a filter: three channels and a count, with room at both ends.
//!
//! Lengths are known and memory begins with a cache line: loops have no remainders, and no load or store is of two lines.

use super::colour;
use std::ops::Range;

/// Pixels of room at each end: at least the widest filter's reach.
pub(super) const ROOM: usize = 8;
/// Numbers added at a time; the length of a row is a multiple.
const LANES: usize = 16;

/// Sums of three channels, and numbers of points, of `N` pixels.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Row<const N: usize> {
    pub channels: [[f32; N]; 3],
    /// A quarter of what another channel takes.
    pub counts: [u8; N],
}

impl<const N: usize> Row<N> {
    pub fn new() -> Self {
        const { assert!(N.is_multiple_of(LANES)) };
        Self { channels: [[0.0; N]; 3], counts: [0; N] }
    }

    /// Colours of `columns` of a row and of [`ROOM`] more at both ends, and count 1 where there is one; 0 outside the picture and beyond.
    /// The first of `columns` goes to [`ROOM`].
    #[inline(always)]
    pub fn decode(&mut self, row: Option<&[u32]>, columns: &Range<usize>) {
        let Some(row) = row else { return self.clear() };
        let (start, end) =
            (columns.start.saturating_sub(ROOM), (columns.end + ROOM).min(row.len()));
        let (to, row) = ((ROOM + start) - columns.start, &row[start..end]);
        if let Some(row) = row.first_chunk::<N>().filter(|_| to == 0) {
            decode_into(row, &mut self.channels, &mut self.counts);
        } else {
            let mut copy = [colour::NONE; N];
            copy[to..][..row.len()].copy_from_slice(row);
            decode_into(&copy, &mut self.channels, &mut self.counts);
        }
    }

    pub fn clear(&mut self) {
        self.channels.as_flattened_mut().fill(0.0);
        self.counts.fill(0);
    }

    /// Adds another's numbers.
    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        for (sums, other) in self.channels.iter_mut().zip(&other.channels) {
            for (sums, other) in
                sums.as_chunks_mut::<LANES>().0.iter_mut().zip(other.as_chunks::<LANES>().0)
            {
                for x in 0..LANES {
                    sums[x] += other[x];
                }
            }
        }
        let counts = self.counts.as_chunks_mut::<LANES>().0.iter_mut();
        for (sums, other) in counts.zip(other.counts.as_chunks::<LANES>().0) {
            for x in 0..LANES {
                sums[x] = sums[x].wrapping_add(other[x]);
            }
        }
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
fn decode_into<const N: usize>(
    colours: &[u32; N],
    [red, green, blue]: &mut [[f32; N]; 3],
    counts: &mut [u8; N],
) {
    for x in 0..N {
        [red[x], green[x], blue[x]] = colour::decode(colours[x]);
    }
    for x in 0..N {
        counts[x] = if colours[x] == colour::NONE { 0 } else { 1 };
    }
}
