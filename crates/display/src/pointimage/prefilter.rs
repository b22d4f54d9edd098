//! The 7×7 prefilter (Walter et al. 2002, §3.3): means over the points near a pixel, for gaps that 3×3 pixels do not fill.
//!
//! Sums down the columns take two additions a pixel whatever the height: running sums that start anew every 7 rows, one from the top of
//! each block and one from its bottom (van Herk; Gil & Werman 1993). Nothing is ever subtracted, so a lamp that left the
//! window leaves no rounding error behind, as a sliding sum in f32 would. Across, the seven are added as a tree.
//!
//! Always true: the result does not depend on where bands of rows begin.

use super::isa::Kernel;
use super::rows::{ROOM, Row};

/// Pixels along the window's side.
const WINDOW: usize = 7;
const REACH: usize = WINDOW / 2;
const _: () = assert!(REACH <= ROOM);

/// Filters rows `from..` of a picture, as many as `picture` has.
pub(super) struct Prefilter<'a> {
    pub width: usize,
    pub from: usize,
    /// Of the whole picture.
    pub colour: &'a [u32],
    pub picture: [&'a mut [f32]; 3],
    /// Whether pixels without points nearby become 0.
    pub black: bool,
}

impl Kernel for Prefilter<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { width, from, colour, picture: [red, green, blue], black } = self;
        let mut decoded = Row::new(width);
        // Of the block that was left: sums from each of its rows to its end. Of the block at hand: its rows so far, and their sum.
        let mut left = vec![Row::new(width); WINDOW];
        let mut block = vec![Row::new(width); WINDOW];
        let mut so_far = Row::new(width);
        let nothing = Row::new(width);
        let rows = red.len() / width;
        // Rows are counted from REACH above the picture, in blocks of WINDOW; those outside are zeros. `y` is the last row of a window.
        let first = (from / WINDOW) * WINDOW;
        for last in first..from + rows + 2 * REACH {
            let at = last % WINDOW;
            if at == 0 {
                std::mem::swap(&mut left, &mut block);
                finish_block(&mut left, width);
            }
            let y = last.wrapping_sub(REACH);
            match colour.get(y.wrapping_mul(width)..).filter(|_| last >= REACH).and_then(|rest| rest.get(..width)) {
                Some(colours) => {
                    decoded.decode(colours);
                    across(&decoded, &mut block[at], width);
                }
                None => block[at].clear(),
            }
            for channel in 0..4 {
                add(&mut so_far.channels[channel][..width], &block[at].channels[channel][..width], at == 0);
            }
            let Some(out) = last.checked_sub(from + 2 * REACH) else { continue };
            let at = out * width..(out + 1) * width;
            let (red, green, blue) = (&mut red[at.clone()], &mut green[at.clone()], &mut blue[at]);
            // A window that ends with a block is that block: nothing of the one before is in it.
            let before = if last % WINDOW + 1 < WINDOW { &left[(last + 1) % WINDOW] } else { &nothing };
            show(&so_far, before, red, green, blue, black);
        }
    }
}

/// Turns a block's rows into sums from each row to the block's end.
#[inline(always)]
fn finish_block(block: &mut [Row], width: usize) {
    for row in (0..block.len() - 1).rev() {
        let (these, rest) = block.split_at_mut(row + 1);
        for channel in 0..4 {
            add(&mut these[row].channels[channel][..width], &rest[0].channels[channel][..width], false);
        }
    }
}

/// Sums over [`WINDOW`] columns around each.
#[inline(always)]
fn across(from: &Row, to: &mut Row, width: usize) {
    for channel in 0..4 {
        seven(&from.channels[channel][ROOM - REACH..][..width + 2 * REACH], &mut to.channels[channel][..width]);
    }
}

#[inline(always)]
fn seven(from: &[f32], to: &mut [f32]) {
    let width = to.len();
    let tap = [0, 1, 2, 3, 4, 5, 6].map(|offset| &from[offset..][..width]);
    for x in 0..width {
        to[x] = ((tap[0][x] + tap[1][x]) + (tap[2][x] + tap[3][x])) + ((tap[4][x] + tap[5][x]) + tap[6][x]);
    }
}

#[inline(always)]
fn add(to: &mut [f32], from: &[f32], anew: bool) {
    if anew {
        to.copy_from_slice(from);
    } else {
        for (to, from) in to.iter_mut().zip(from) {
            *to += from;
        }
    }
}

#[inline(always)]
fn show(sums: &Row, before: &Row, red: &mut [f32], green: &mut [f32], blue: &mut [f32], black: bool) {
    let width = red.len();
    let [s0, s1, s2, s3] = sums.channels.each_ref().map(|sum| &sum[..width]);
    let [b0, b1, b2, b3] = before.channels.each_ref().map(|sum| &sum[..width]);
    let (green, blue) = (&mut green[..width], &mut blue[..width]);
    for x in 0..width {
        let weight = s3[x] + b3[x];
        let has_points = weight > 0.0;
        let inverse = 1.0 / weight.max(1.0);
        let keep = |old: f32| if black { 0.0 } else { old };
        red[x] = if has_points { (s0[x] + b0[x]) * inverse } else { keep(red[x]) };
        green[x] = if has_points { (s1[x] + b1[x]) * inverse } else { keep(green[x]) };
        blue[x] = if has_points { (s2[x] + b2[x]) * inverse } else { keep(blue[x]) };
    }
}
