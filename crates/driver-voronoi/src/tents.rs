//! Sums over ever wider tents (half-widths of 1, 2, 4, ... pixels) around every pixel of a picture, each over pixels of one label only.
//!
//! A tent twice as wide is the sum of one tent and half of those a step away, on both sides: first along rows, then along columns. Both
//! are done for a row at a time while it is in the cache: rows a step apart are taken one after the other, so that what was added up
//! along each serves three of them.
//!
//! Invariant: a row's sums are a function of the narrower tents alone, however the rows are shared out.

use super::blocks::ROWS;
use std::ops::Range;

/// Kinds of sums that a pixel has: light by channel, weight, and squared luminance. A row of a picture has each kind by itself, one after
/// the other, so that a pass adds many pixels at once.
pub(crate) const KINDS: usize = 5;

/// Sums along rows that are still of use.
pub(crate) struct Passes<'a> {
    /// Of the narrower tents, all rows.
    from: &'a [f32],
    labels: &'a [u32],
    width: usize,
    step: usize,
    /// By rows of blocks, columns that are wanted of the sums along rows, and of the tents.
    wanted: [&'a [Vec<Range<usize>>]; 2],
    /// The row that each of the sums is of.
    rows: [Option<usize>; 3],
    sums: [Vec<f32>; 3],
}

impl<'a> Passes<'a> {
    /// From tents that are `step` pixels wide on each side to those twice as wide.
    pub fn new(
        from: &'a [f32],
        labels: &'a [u32],
        width: usize,
        step: usize,
        wanted: [&'a [Vec<Range<usize>>]; 2],
    ) -> Self {
        Self {
            from,
            labels,
            width,
            step,
            wanted,
            rows: [None; 3],
            sums: std::array::from_fn(|_| vec![0.0; KINDS * width]),
        }
    }

    fn labels(&self, row: usize) -> &'a [u32] {
        &self.labels[row * self.width..][..self.width]
    }

    /// The wider tents' sums of a row, as far as they are wanted.
    #[inline(always)]
    pub fn widen(&mut self, row: usize, sums: &mut [f32]) {
        let width = self.width;
        let above = row.checked_sub(self.step);
        let below = Some(row + self.step).filter(|&below| below * width < self.labels.len());
        // What was below the last row is this one.
        if self.rows[2] == Some(row) {
            self.rows.rotate_left(1);
            self.sums.rotate_left(1);
        }
        for (place, row) in [above, Some(row), below].into_iter().enumerate() {
            if let Some(row) = row.filter(|_| self.rows[place] != row) {
                let from = &self.from[row * KINDS * width..][..KINDS * width];
                let labels = self.labels(row);
                for columns in &self.wanted[0][row / ROWS] {
                    across(from, labels, self.step, columns, &mut self.sums[place]);
                }
                self.rows[place] = Some(row);
            }
        }
        let labels = self.labels(row);
        let [before, here, after] = &self.sums;
        for columns in &self.wanted[1][row / ROWS] {
            for (kind, sums) in sums.chunks_mut(width).enumerate() {
                let part = kind * width + columns.start..kind * width + columns.end;
                let (sums, here) = (&mut sums[columns.clone()], &here[part.clone()]);
                let its = |row: usize| &self.labels(row)[columns.clone()];
                let labels = &labels[columns.clone()];
                let above = above.map(|row| (&before[part.clone()], its(row)));
                let below = below.map(|row| (&after[part.clone()], its(row)));
                if let (Some(above), Some(below)) = (above, below) {
                    with_halves(sums, here, labels, above, below);
                } else {
                    sums.copy_from_slice(here);
                    if let Some((beside, labels_beside)) = above.or(below) {
                        add_half(sums, labels, beside, labels_beside);
                    }
                }
            }
        }
    }
}

/// Adds half of what is beside, where that is of the same label. Sky has nothing to add.
#[inline(always)]
fn add_half(sums: &mut [f32], labels: &[u32], beside: &[f32], labels_beside: &[u32]) {
    let count = sums.len().min(labels.len()).min(beside.len()).min(labels_beside.len());
    // Cut to one length first: then many are added at once, which a chain of iterators prevents.
    let (sums, labels) = (&mut sums[..count], &labels[..count]);
    let (beside, labels_beside) = (&beside[..count], &labels_beside[..count]);
    for i in 0..count {
        let half = 0.5 * beside[i];
        sums[i] += if labels[i] == labels_beside[i] { half } else { 0.0 };
    }
}

/// The same from both sides, without a look back at what was added first.
#[inline(always)]
fn with_halves(
    sums: &mut [f32],
    from: &[f32],
    labels: &[u32],
    before: (&[f32], &[u32]),
    after: (&[f32], &[u32]),
) {
    let count = sums.len();
    let (from, labels) = (&from[..count], &labels[..count]);
    let (before, labels_before) = (&before.0[..count], &before.1[..count]);
    let (after, labels_after) = (&after.0[..count], &after.1[..count]);
    for i in 0..count {
        let first = if labels[i] == labels_before[i] { 0.5 * before[i] } else { 0.0 };
        let second = if labels[i] == labels_after[i] { 0.5 * after[i] } else { 0.0 };
        sums[i] = from[i] + first + second;
    }
}

/// One pass of the tent along these columns of a row.
#[inline(always)]
fn across(from: &[f32], labels: &[u32], step: usize, columns: &Range<usize>, line: &mut [f32]) {
    let width = labels.len();
    let Range { start, end } = *columns;
    // Up to here there is nothing before, from here on nothing after.
    let (first, last) = (step.min(width), width.saturating_sub(step));
    let (low, high) = (first.min(last).clamp(start, end), first.max(last).clamp(start, end));
    for (sums, from) in line.chunks_mut(width).zip(from.chunks(width)) {
        if start < low {
            sums[start..low].copy_from_slice(&from[start..low]);
            add_half(
                &mut sums[start..low],
                &labels[start..],
                &from[start + step..],
                &labels[start + step..],
            );
        }
        if low < high && first >= last {
            sums[low..high].copy_from_slice(&from[low..high]);
        } else if low < high {
            let before = (&from[low - step..], &labels[low - step..]);
            let after = (&from[low + step..], &labels[low + step..]);
            with_halves(&mut sums[low..high], &from[low..], &labels[low..], before, after);
        }
        if high < end {
            sums[high..end].copy_from_slice(&from[high..end]);
            add_half(
                &mut sums[high..end],
                &labels[high..],
                &from[high - step..],
                &labels[high - step..],
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The same tents by their definition: half of what is beside, along rows, then along columns.
    fn model(from: &[f32], labels: &[u32], width: usize, step: usize) -> Vec<f32> {
        let height = labels.len() / width;
        let value =
            |of: &[f32], kind: usize, x: usize, y: usize| of[(y * KINDS + kind) * width + x];
        let pass = |of: &[f32], by: (usize, usize)| -> Vec<f32> {
            let mut to = of.to_vec();
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                let before = x.checked_sub(by.0).zip(y.checked_sub(by.1));
                let after = Some((x + by.0, y + by.1)).filter(|&(x, y)| x < width && y < height);
                for kind in 0..KINDS {
                    for (i, j) in [before, after].into_iter().flatten() {
                        if labels[j * width + i] == labels[y * width + x] {
                            to[(y * KINDS + kind) * width + x] += 0.5 * value(of, kind, i, j);
                        }
                    }
                }
            }
            to
        };
        pass(&pass(from, (step, 0)), (0, step))
    }

    proptest! {
        #[test]
        fn tents_are_those_of_their_definition(
            width in 1_usize..150, height in 1_usize..70, step in 1_usize..70, seed in any::<u32>(), kinds in 1_u32..4,
        ) {
            let bits = |i: usize| (i as u32).wrapping_mul(0x9E37_79B9).wrapping_add(seed).wrapping_mul(0x85EB_CA6B) >> 16;
            let labels: Vec<u32> = (0..width * height).map(|i| bits(i / 3) % kinds).collect();
            // Whole numbers, so that no order of additions rounds.
            let from: Vec<f32> = (0..KINDS * width * height).map(|i| (bits(i) % 64) as f32 * 4.0).collect();
            let all: Vec<Vec<_>> = (0..height).step_by(ROWS).map(|_| std::iter::once(0..width).collect()).collect();
            let mut passes = Passes::new(&from, &labels, width, step, [&all, &all]);
            let mut rows: Vec<usize> = (0..height).collect();
            rows.sort_by_key(|row| (row % step, *row));
            let expected = model(&from, &labels, width, step);
            for row in rows {
                let mut sums = vec![0.0; KINDS * width];
                passes.widen(row, &mut sums);
                prop_assert_eq!(&sums[..], &expected[row * KINDS * width..][..KINDS * width], "row {}", row);
            }
        }
    }
}
