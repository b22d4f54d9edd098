//! Interpolation and smoothing over 3×3 pixels weighted 4-2-1, and the priority of each pixel (Walter et al. 1999, §3.1 and §4).
//!
//! The weights are the product of 1-2-1 down and 1-2-1 across, so two passes of two additions make them.
//!
//! Always true: a pixel with a point has its point's age as priority; one without has 255 if no neighbour has one either, and less
//! the more neighbours have.

use super::colour;
use super::isa::Kernel;
use super::params::Smoothing;
use super::rows::{ROOM, Row};

/// Priority that a pixel without a point loses per unit of its neighbours' weight, of which there are 12: 135 are left.
const PRIORITY_PER_WEIGHT: i32 = 10;

/// Filters rows `from..` of a picture, as many as `picture` has. Gives the sum of the priorities.
pub(super) struct Interpolate<'a> {
    pub width: usize,
    pub from: usize,
    /// Of the whole picture.
    pub colour: &'a [u32],
    pub depth: &'a [u32],
    pub age: &'a [u8],
    pub picture: [&'a mut [f32]; 3],
    pub priority: &'a mut [u8],
    pub smoothing: Smoothing,
    /// Whether pixels without points nearby become 0; the prefilter may have seen to them.
    pub black: bool,
    /// Whether gaps are filled at all.
    pub fill: bool,
}

impl Kernel for Interpolate<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { width, from, colour, depth, age, picture: [red, green, blue], priority, smoothing, black, fill } =
            self;
        let rows = priority.len() / width;
        // The rows above, at and below the one that is made, in turn.
        let mut ring = [Row::new(width), Row::new(width), Row::new(width)];
        let mut down = Row::new(width);
        let mut sharp = vec![0_u32; width];
        let load =
            |row: &mut Row, y: usize| match colour.get(y.wrapping_mul(width)..).and_then(|rest| rest.get(..width)) {
                Some(colours) => row.decode(colours),
                None => row.clear(),
            };
        if from > 0 {
            load(&mut ring[(from - 1) % 3], from - 1);
        }
        load(&mut ring[from % 3], from);
        for row in 0..rows {
            let y = from + row;
            load(&mut ring[(y + 1) % 3], y + 1);
            let [above, here, below] = [&ring[(y + 2) % 3], &ring[y % 3], &ring[(y + 1) % 3]];
            for channel in 0..4 {
                let [above, here, below] = [above, here, below].map(|row| &row.channels[channel][ROOM..][..width]);
                one_two_one(above, here, below, &mut down.channels[channel][ROOM..][..width]);
            }
            let pixels = y * width..(y + 1) * width;
            mark_sharp(&colour[pixels.clone()], &depth[pixels.clone()], smoothing, fill, &mut sharp);
            let at = row * width..(row + 1) * width;
            for (channel, out) in [&mut *red, &mut *green, &mut *blue].into_iter().enumerate() {
                let here = &here.channels[channel][ROOM..][..width];
                show(&down.channels[channel], &down.channels[3], here, &sharp, fill, black, &mut out[at.clone()]);
            }
            prioritise(&down.channels[3], &colour[pixels.clone()], &age[pixels], &mut priority[at]);
        }
    }
}

/// All ones for pixels that show their own point alone.
#[inline(always)]
fn mark_sharp(colour: &[u32], depth: &[u32], smoothing: Smoothing, fill: bool, sharp: &mut [u32]) {
    let (old, all) = match smoothing {
        Smoothing::Everywhere => (false, !fill),
        Smoothing::WhereOld => (true, !fill),
        Smoothing::Gaps => (false, true),
    };
    for ((&colour, &depth), sharp) in colour.iter().zip(depth).zip(sharp) {
        let is_sharp = (colour != colour::NONE) & (all | (old & ((depth as i32) > 0)));
        *sharp = if is_sharp { u32::MAX } else { 0 };
    }
}

#[inline(always)]
fn one_two_one(above: &[f32], here: &[f32], below: &[f32], sums: &mut [f32]) {
    for (((sum, a), b), c) in sums.iter_mut().zip(above).zip(here).zip(below) {
        *sum = (a + c) + (b + b);
    }
}

#[inline(always)]
fn show(down: &[f32], weight: &[f32], here: &[f32], sharp: &[u32], fill: bool, black: bool, out: &mut [f32]) {
    let width = out.len();
    let [d0, d1, d2] = [0, 1, 2].map(|offset| &down[ROOM - 1 + offset..][..width]);
    let [w0, w1, w2] = [0, 1, 2].map(|offset| &weight[ROOM - 1 + offset..][..width]);
    let (here, sharp) = (&here[..width], &sharp[..width]);
    for x in 0..width {
        let weight = (w0[x] + w2[x]) + (w1[x] + w1[x]);
        let sum = (d0[x] + d2[x]) + (d1[x] + d1[x]);
        let empty = if black { 0.0 } else { out[x] };
        let blurred = if fill & (weight > 0.0) { sum / weight.max(1.0) } else { empty };
        out[x] = if sharp[x] != 0 { here[x] } else { blurred };
    }
}

#[inline(always)]
fn prioritise(weight: &[f32], colour: &[u32], age: &[u8], priority: &mut [u8]) {
    let width = priority.len();
    let [w0, w1, w2] = [0, 1, 2].map(|offset| &weight[ROOM - 1 + offset..][..width]);
    let (colour, age) = (&colour[..width], &age[..width]);
    for x in 0..width {
        // A pixel without a point adds nothing to its own weight.
        let neighbours = ((w0[x] + w2[x]) + (w1[x] + w1[x])) as i32;
        let gap = 255 - PRIORITY_PER_WEIGHT * neighbours;
        priority[x] = if colour[x] == colour::NONE { gap as u8 } else { age[x] };
    }
}
