//! The 7×7 prefilter (Walter et al. 2002, §3.3): means over the points near a pixel, for gaps that 3×3 pixels do not fill. The window's
//! side may be another odd number up to 9.
//!
//! Sums down the columns take two additions a pixel whatever the height: running sums that start anew every window of rows, one from the top of
//! each block and one from its bottom (van Herk; Gil & Werman 1993). Nothing is ever subtracted, so a lamp that left the
//! window leaves no rounding error behind, as a sliding sum in f32 would. Across, the columns are added as a tree, after that and only
//! where means are wanted.
//!
//! Always true: the result does not depend on where bands of rows begin.

use super::colour;
use super::points::LINE;
use super::rows::{ROOM, Row, row_of, strips};
use holo_cpu::Kernel;
use holo_cpu::prefetch_at;
use std::ops::Range;

/// Pixels along the side of the widest window.
pub(super) const WIDEST: usize = 9;
const _: () = assert!(WIDEST / 2 <= ROOM);

/// Columns looked through for gaps at a time.
const WIDE: usize = 512;
/// Columns filtered at a time: the rows of two blocks take 30 kB.
const STRIP: usize = 128;
/// Columns of a row that are filtered alone if few have gaps.
const PIECE: usize = 64;
const PIECES: usize = STRIP / PIECE;
/// Lengths of rows of sums.
const STRIP_WITH_ROOM: usize = STRIP + 2 * ROOM;
const PIECE_WITH_ROOM: usize = PIECE + 2 * ROOM;
/// Rows filtered at a time.
const ROWS: usize = 32;
/// Rows by which what will be shown is asked for before: processors on their own do not look beyond a page of memory, and each row is on
/// another. Without this the filter took a quarter longer at 2048×2048.
const AHEAD: usize = 3;
/// One in how many pieces of a strip are filtered alone at most. With two, the filter took 30 % longer; with fourteen, as long.
const FEW: usize = 5;

/// Filters rows `from..` of a band, as many as `picture` has.
pub(super) struct Prefilter<'a> {
    pub width: usize,
    /// Pixels along the window's side: odd, at most [`WIDEST`].
    pub window: usize,
    pub from: usize,
    /// Where the band begins in the picture.
    pub first_row: usize,
    /// Of the whole band; what is beyond it is taken for empty.
    pub colour: &'a [u32],
    pub picture: [&'a mut [f32]; 3],
    /// Whether pixels without points nearby become 0.
    pub black: bool,
    /// Only pixels without a point among 3×3 matter: others will be overwritten.
    pub gaps_only: bool,
    pub scratch: &'a mut Scratch,
}

/// Memory to be used again.
#[derive(Debug)]
pub(super) struct Scratch {
    buffers: Buffers,
    single: Single,
    gaps: Gaps,
}

impl Scratch {
    pub fn new() -> Self {
        Self { buffers: Buffers::new(), single: Single::new(), gaps: Gaps::new() }
    }
}

impl Kernel for Prefilter<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self {
            width,
            window,
            from,
            first_row,
            colour,
            picture: [red, green, blue],
            black,
            gaps_only,
            scratch,
        } = self;
        let Scratch { buffers, single, gaps } = scratch;
        let rows = red.len() / width;
        for first in (0..rows).step_by(ROWS) {
            let last = (first + ROWS).min(rows);
            for wide in strips(width, WIDE) {
                if gaps_only {
                    gaps.find(colour, width, from + first..from + last, &wide);
                }
                for (start, strip) in wide.clone().step_by(STRIP).zip(0..) {
                    let columns = start..(start + STRIP).min(wide.end);
                    let count = if gaps_only { gaps.count(strip) } else { usize::MAX };
                    if count > (last - first) * PIECES / FEW {
                        let out = [&mut *red, &mut *green, &mut *blue]
                            .map(|plane| &mut plane[first * width..last * width]);
                        let gaps = gaps_only.then_some((&*gaps, strip));
                        buffers.filter(
                            colour,
                            (width, window),
                            (first_row, from + first),
                            columns,
                            out,
                            black,
                            gaps,
                        );
                    } else if count > 0 {
                        for row in first..last {
                            for start in gaps
                                .pieces(row - first, strip)
                                .map(|piece| columns.start + piece * PIECE)
                            {
                                let columns = start..(start + PIECE).min(columns.end);
                                let at = row * width + columns.start..row * width + columns.end;
                                let out = [&mut *red, &mut *green, &mut *blue]
                                    .map(|plane| &mut plane[at.clone()]);
                                single.filter(
                                    colour,
                                    (width, window),
                                    (first_row, from + row),
                                    &columns,
                                    out,
                                    black,
                                );
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Where pixels without a point among their 3×3 are: in which pieces of which rows.
#[derive(Debug)]
struct Gaps {
    is_in: [[bool; WIDE / PIECE]; ROWS],
    /// Of three rows and of the columns beside them, whether there is a point.
    merged: [u32; WIDE + 2],
}

impl Gaps {
    fn new() -> Self {
        Self { is_in: [[false; WIDE / PIECE]; ROWS], merged: [colour::NONE; WIDE + 2] }
    }

    #[inline(always)]
    fn find(&mut self, colour: &[u32], width: usize, rows: Range<usize>, columns: &Range<usize>) {
        let (start, end) = (columns.start.saturating_sub(1), (columns.end + 1).min(width));
        let count = columns.len();
        let (to, length) = ((start + 1) - columns.start, end - start);
        // The column beyond the picture's edge has no points.
        (self.merged[0], self.merged[count + 1]) = (colour::NONE, colour::NONE);
        self.is_in = [[false; WIDE / PIECE]; ROWS];
        for (y, is_in) in rows.zip(&mut self.is_in) {
            let Some(here) = row_of(colour, width, y) else { continue };
            let above = y.checked_sub(1).and_then(|y| row_of(colour, width, y)).unwrap_or(here);
            let below = row_of(colour, width, y + 1).unwrap_or(here);
            merge(
                &above[start..end],
                &here[start..end],
                &below[start..end],
                &mut self.merged[to..][..length],
            );
            // Beyond, no gaps: so all pieces are whole ones.
            self.merged[count + 2..].fill(u32::MAX);
            for (start, is_in) in (0..count).step_by(PIECE).zip(is_in) {
                *is_in = self.merged[start..].first_chunk().is_some_and(any_gap);
            }
        }
    }

    /// How many pieces of a strip have some.
    fn count(&self, strip: usize) -> usize {
        self.is_in
            .iter()
            .map(|row| row[strip * PIECES..][..PIECES].iter().filter(|&&is_in| is_in).count())
            .sum()
    }

    /// Pieces of a row of a strip that have some.
    fn pieces(&self, row: usize, strip: usize) -> impl Iterator<Item = usize> {
        let pieces = self.of_strip(row, strip);
        (0..PIECES).filter(move |&piece| pieces[piece])
    }

    /// Whether each piece of a row of a strip has some.
    #[inline(always)]
    fn of_strip(&self, row: usize, strip: usize) -> [bool; PIECES] {
        self.is_in[row].as_chunks().0[strip]
    }
}

#[inline(always)]
fn merge(above: &[u32], here: &[u32], below: &[u32], merged: &mut [u32]) {
    for (((merged, a), b), c) in merged.iter_mut().zip(above).zip(here).zip(below) {
        *merged = a | b | c;
    }
}

#[inline(always)]
fn any_gap(merged: &[u32; PIECE + 2]) -> bool {
    let (left, here, right) = (&merged[..PIECE], &merged[1..][..PIECE], &merged[2..]);
    let mut least = u32::MAX;
    for x in 0..PIECE {
        least = least.min(left[x] | here[x] | right[x]);
    }
    least == colour::NONE
}

// No colour is less.
const _: () = assert!(colour::NONE == 0);

/// Filters single pieces of rows: to the bit what [`Buffers::filter`] gives.
#[derive(Debug)]
struct Single {
    decoded: Row<PIECE_WITH_ROOM>,
    means: Means,
    /// Sums from the first row of the block that the window ends in, and to the last row of the one before.
    from_top: Row<PIECE_WITH_ROOM>,
    to_bottom: Row<PIECE_WITH_ROOM>,
}

impl Single {
    fn new() -> Self {
        let row = Row::new();
        Self { decoded: row.clone(), means: Means::new(), from_top: row.clone(), to_bottom: row }
    }

    /// Filters `columns` of row `y` of a band that begins at `first_row`.
    #[inline(always)]
    fn filter(
        &mut self,
        colour: &[u32],
        (width, window): (usize, usize),
        (first_row, y): (usize, usize),
        columns: &Range<usize>,
        out: [&mut [f32]; 3],
        black: bool,
    ) {
        let Self { decoded, means, from_top, to_bottom } = self;
        let reach = window / 2;
        // Rows are counted from `reach` above the band, in blocks of a window that do not depend on where it begins.
        let last = y + 2 * reach;
        let boundary = last - (first_row + last) % window;
        from_top.clear();
        to_bottom.clear();
        for (row, is_below) in (y..boundary)
            .rev()
            .map(|row| (row, false))
            .chain((boundary..=last).map(|row| (row, true)))
        {
            decoded.decode(row.checked_sub(reach).and_then(|y| row_of(colour, width, y)), columns);
            let total = if is_below { &mut *from_top } else { &mut *to_bottom };
            total.add(decoded);
        }
        means.show(from_top, to_bottom, 0, window, out, black);
    }
}

/// Rows of sums for one strip.
#[derive(Debug)]
struct Buffers {
    /// Sums from each row of the block that was left to its end.
    left: Vec<Row<STRIP_WITH_ROOM>>,
    /// Rows of the block at hand, and their sum so far.
    block: Vec<Row<STRIP_WITH_ROOM>>,
    so_far: Row<STRIP_WITH_ROOM>,
    nothing: Row<STRIP_WITH_ROOM>,
    means: Means,
}

impl Buffers {
    fn new() -> Self {
        let row = Row::new();
        let [left, block] = [(); 2].map(|()| vec![row.clone(); WIDEST]);
        Self { left, block, so_far: row.clone(), nothing: row, means: Means::new() }
    }

    /// Filters a strip of rows `from..` of a band that begins at `first_row`, as many as `out` has; or shows only the pieces of it that
    /// have `gaps`, by the number of the strip.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn filter(
        &mut self,
        colour: &[u32],
        (width, window): (usize, usize),
        (first_row, from): (usize, usize),
        columns: Range<usize>,
        out: [&mut [f32]; 3],
        black: bool,
        gaps: Option<(&Gaps, usize)>,
    ) {
        let Self { left, block, so_far, nothing, means } = self;
        let [red, green, blue] = out;
        let (rows, count) = (red.len() / width, columns.len());
        let reach = window / 2;
        // Rows are counted from `reach` above the band, in blocks of a window that do not depend on where it begins; those outside are
        // zeros. `last` is the last of a window. What the block of the first row has from before is in no window.
        for last in from..from + rows + 2 * reach {
            if let Some(row) = (last + AHEAD).checked_sub(from + 2 * reach) {
                for line in (row * width + columns.start..).step_by(LINE).take(count.div_ceil(LINE))
                {
                    [&*red, &*green, &*blue].into_iter().for_each(|plane| prefetch_at(plane, line));
                }
            }
            let at = (first_row + last) % window;
            if at == 0 {
                std::mem::swap(left, block);
                finish_block(&mut left[..window]);
            }
            block[at]
                .decode(last.checked_sub(reach).and_then(|y| row_of(colour, width, y)), &columns);
            if at == 0 {
                so_far.clone_from(&block[at]);
            } else {
                so_far.add(&block[at]);
            }
            let Some(row) = last.checked_sub(from + 2 * reach) else { continue };
            // A window that ends with a block is that block: nothing of the one before is in it.
            let before = if at + 1 < window { &left[at + 1] } else { &*nothing };
            let all = [true; PIECES];
            let pieces = gaps.map_or(all, |(gaps, strip)| gaps.of_strip(row, strip));
            for (from, _) in (0..count).step_by(PIECE).zip(pieces).filter(|&(_, has_gap)| has_gap) {
                let to = (from + PIECE).min(count);
                let place = row * width + columns.start + from..row * width + columns.start + to;
                let out = [&mut red[place.clone()], &mut green[place.clone()], &mut blue[place]];
                means.show(so_far, before, from, window, out, black);
            }
        }
    }
}

/// Turns a block's rows into sums from each row to the block's end.
#[inline(always)]
fn finish_block(block: &mut [Row<STRIP_WITH_ROOM>]) {
    for row in (0..block.len() - 1).rev() {
        let (these, rest) = block.split_at_mut(row + 1);
        these[row].add(&rest[0]);
    }
}

/// Sums over the window of a piece of a row.
#[derive(Debug)]
#[repr(C, align(64))]
struct Means {
    sums: [[f32; PIECE]; 3],
    counts: [u8; PIECE],
}

impl Means {
    fn new() -> Self {
        Self { sums: [[0.0; PIECE]; 3], counts: [0; PIECE] }
    }

    /// Shows the means of a piece whose columns' sums, in two parts, are in these rows at `from`.
    #[inline(always)]
    fn show<const N: usize>(
        &mut self,
        one: &Row<N>,
        other: &Row<N>,
        from: usize,
        window: usize,
        [red, green, blue]: [&mut [f32]; 3],
        black: bool,
    ) {
        let Self { sums, counts } = self;
        for ((sums, one), other) in sums.iter_mut().zip(&one.channels).zip(&other.channels) {
            across(&one[from..], &other[from..], window, sums, |one, other| one + other);
        }
        across(&one.counts[from..], &other.counts[from..], window, counts, u8::wrapping_add);
        show(sums, counts, red, green, blue, black);
    }
}

/// Sums of two rows, and of `window` such sums each. A loop of its own for each window: its sums are a tree, not a chain.
#[inline(always)]
fn across<T: Copy + Default>(
    one: &[T],
    other: &[T],
    window: usize,
    to: &mut [T; PIECE],
    add: impl Fn(T, T) -> T + Copy,
) {
    let (one, other) = (&one[..PIECE_WITH_ROOM], &other[..PIECE_WITH_ROOM]);
    let mut down = [T::default(); PIECE_WITH_ROOM];
    for x in 0..PIECE_WITH_ROOM {
        down[x] = add(one[x], other[x]);
    }
    let from = &down[ROOM - window / 2..];
    match window {
        3 => sums::<T, 3>(from, to, add),
        5 => sums::<T, 5>(from, to, add),
        7 => sums::<T, 7>(from, to, add),
        _ => sums::<T, WIDEST>(from, to, add),
    }
}

#[inline(always)]
fn sums<T: Copy, const N: usize>(from: &[T], to: &mut [T; PIECE], add: impl Fn(T, T) -> T) {
    let tap: [&[T]; N] = std::array::from_fn(|offset| &from[offset..][..PIECE]);
    for x in 0..PIECE {
        let one = |number: usize| tap[number][x];
        let two = |number: usize| add(one(number), one(number + 1));
        to[x] = match N {
            3 => add(two(0), one(2)),
            5 => add(add(two(0), two(2)), one(4)),
            7 => add(add(two(0), two(2)), add(two(4), one(6))),
            _ => add(add(add(two(0), two(2)), add(two(4), two(6))), one(8)),
        };
    }
}

#[inline(always)]
fn show(
    [r, g, b]: &[[f32; PIECE]; 3],
    counts: &[u8; PIECE],
    red: &mut [f32],
    green: &mut [f32],
    blue: &mut [f32],
    black: bool,
) {
    let count = red.len();
    let (r, g, b, n) = (&r[..count], &g[..count], &b[..count], &counts[..count]);
    let (green, blue) = (&mut green[..count], &mut blue[..count]);
    let kept = if black { 0.0 } else { 1.0 };
    for x in 0..count {
        let inverse = 1.0 / f32::from(n[x].max(1));
        // Both are computed, and one is chosen: loads and stores of some pixels only took half of the filter's time.
        let means = [r[x] * inverse, g[x] * inverse, b[x] * inverse];
        let old = [red[x] * kept, green[x] * kept, blue[x] * kept];
        [red[x], green[x], blue[x]] = if n[x] > 0 { means } else { old };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_cpu::{Instructions, Isa};
    use holo_display::pair;

    const SIZE: (usize, usize) = (700, 120);

    /// Points in a third of the pixels on the left, where most pieces have gaps, and in three fifths on the right, where few have.
    fn points() -> Vec<u32> {
        let point = |pixel: usize| {
            let chance = if pixel % SIZE.0 < 300 { 0.33 } else { 0.6 };
            let (is_there, light) = pair(7, pixel as u32);
            if is_there < chance { colour::encode([light, 0.3, 5.0 * light]) } else { colour::NONE }
        };
        (0..SIZE.0 * SIZE.1).map(point).collect()
    }

    fn filtered(colour: &[u32], window: usize, gaps_only: bool) -> [Vec<f32>; 3] {
        let mut picture = [(); 3].map(|()| vec![0.0; colour.len()]);
        let [red, green, blue] = picture.each_mut().map(Vec::as_mut_slice);
        let isa = Isa::new(Instructions::best()).unwrap();
        let (picture_of, scratch) = ([red, green, blue], &mut Scratch::new());
        let (width, black) = (SIZE.0, true);
        isa.run(Prefilter {
            width,
            window,
            from: 0,
            first_row: 0,
            colour,
            picture: picture_of,
            black,
            gaps_only,
            scratch,
        });
        picture
    }

    /// Mean of a channel over the points of `window` × `window` pixels.
    fn mean(colour: &[u32], window: usize, column: usize, row: usize, channel: usize) -> f64 {
        let (mut sum, mut count, reach) = (0.0, 0.0, window / 2);
        for y in row.saturating_sub(reach)..(row + reach + 1).min(SIZE.1) {
            for x in column.saturating_sub(reach)..(column + reach + 1).min(SIZE.0) {
                let point = colour[y * SIZE.0 + x];
                count += if point == colour::NONE { 0.0 } else { 1.0 };
                sum += f64::from(colour::decode(point)[channel]);
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    }

    #[test]
    fn gaps_filtered_alone_are_to_the_bit_what_the_whole_picture_gives_and_the_means_of_the_window()
    {
        let colour = points();
        for window in [3, 5, 7, WIDEST] {
            let (all, gaps) = (filtered(&colour, window, false), filtered(&colour, window, true));
            let (width, height) = SIZE;
            let mut found = [0; 2];
            for (row, column) in
                (0..height).flat_map(|row| (0..width).map(move |column| (row, column)))
            {
                let around = |x: usize, y: usize| colour[y * width + x] == colour::NONE;
                let rows = row.saturating_sub(1)..(row + 2).min(height);
                let is_gap = rows.flat_map(|y| {
                    (column.saturating_sub(1)..(column + 2).min(width)).map(move |x| (x, y))
                });
                let is_gap = is_gap.into_iter().all(|(x, y)| around(x, y));
                let pixel = row * width + column;
                for channel in 0..3 {
                    let expected = mean(&colour, window, column, row, channel);
                    // A rounding of an f32 for each of the window's pixels at most, and a few.
                    let roundings = (window * window + 11) as f64;
                    let error = (f64::from(all[channel][pixel]) - expected).abs();
                    assert!(
                        error <= roundings * f64::from(f32::EPSILON) * expected,
                        "{column} {row}: {error}"
                    );
                    let is_same = all[channel][pixel].to_bits() == gaps[channel][pixel].to_bits();
                    assert!(!is_gap || is_same, "{window}: {column} {row}");
                }
                found[usize::from(column >= 300)] += usize::from(is_gap);
            }
            // 0.67⁹ of 36,000 and 0.4⁹ of 48,000, and more at the edges.
            assert!(found[0] > 500 && (5..200).contains(&found[1]), "{found:?}");
        }
    }
}
