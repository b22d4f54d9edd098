//! Interpolation and smoothing over 3×3 pixels weighted 4-2-1, and the priority of each pixel (Walter et al. 1999, §3.1 and §4).
//!
//! The weights are the product of 1-2-1 down and 1-2-1 across, so two passes of two additions make them.
//!
//! Always true: a pixel with a point has its point's age as priority; one without has 255 if no neighbour has one either, and less
//! the more neighbours have.

use super::isa::Kernel;
use super::rows::{ROOM, Row, row_of, strips};

/// Priority that a pixel without a point loses per unit of its neighbours' weight, of which there are 12: 135 are left.
const PRIORITY_PER_WEIGHT: u8 = 10;

/// Columns filtered at a time: their rows take 16 kB.
const STRIP: usize = 256;

/// Filters rows `from..` of a picture, as many as `picture` has.
pub(super) struct Interpolate<'a> {
    pub width: usize,
    pub from: usize,
    /// Of the whole picture.
    pub colour: &'a [u32],
    pub age: &'a [u8],
    pub picture: [&'a mut [f32]; 3],
    pub priority: &'a mut [u8],
    /// Whether pixels with a point show it alone.
    pub own_point: bool,
    /// Whether pixels without points nearby become 0; the prefilter may have seen to them.
    pub black: bool,
    /// Whether gaps are filled at all.
    pub fill: bool,
}

impl Kernel for Interpolate<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { width, from, colour, age, picture: [red, green, blue], priority, own_point, black, fill } = self;
        let rows = priority.len() / width;
        let strip = STRIP.min(width);
        // The rows above, at and below the one that is made, in turn.
        let mut ring = [Row::new(strip), Row::new(strip), Row::new(strip)];
        let mut has_point: [Vec<u8>; 3] = std::array::from_fn(|_| vec![0; strip + 2]);
        let mut down = vec![0.0; strip + 2];
        let mut weight_down = vec![0; strip + 2];
        let mut weight = vec![0; strip];
        let mut inverse = vec![0.0; strip];
        let around = |count: usize| ROOM - 1..ROOM + 1 + count;
        for columns in strips(width, STRIP) {
            let count = columns.len();
            let load = |ring: &mut [Row; 3], has_point: &mut [Vec<u8>; 3], y: Option<usize>| {
                let row = y.and_then(|y| row_of(colour, width, y));
                let at = y.map_or((from + 2) % 3, |y| y % 3);
                ring[at].decode(row, &columns, 1);
                mark(&ring[at].channels[3][around(count)], &mut has_point[at][..count + 2]);
            };
            load(&mut ring, &mut has_point, from.checked_sub(1));
            load(&mut ring, &mut has_point, Some(from));
            for row in 0..rows {
                let y = from + row;
                load(&mut ring, &mut has_point, Some(y + 1));
                let [above, here, below] = [(y + 2) % 3, y % 3, (y + 1) % 3];
                let at = row * width + columns.start..row * width + columns.end;
                let pixels = y * width + columns.start..y * width + columns.end;
                let rows = [above, here, below].map(|row| &has_point[row][..count + 2]);
                count_down(rows, &mut weight_down[..count + 2]);
                count_across(&weight_down[..count + 2], &mut weight[..count]);
                prioritise(
                    &weight[..count],
                    &has_point[here][1..][..count],
                    &age[pixels.clone()],
                    &mut priority[at.clone()],
                );
                if fill {
                    invert(&weight[..count], &mut inverse[..count]);
                } else {
                    inverse.fill(0.0);
                }
                for (channel, plane) in [&mut *red, &mut *green, &mut *blue].into_iter().enumerate() {
                    let rows = [above, here, below].map(|row| &ring[row].channels[channel][around(count)]);
                    one_two_one(rows, &mut down[..count + 2]);
                    show(&down[..count + 2], &inverse[..count], black, &mut plane[at.clone()]);
                    if own_point {
                        keep_own(rows[1], &has_point[here][1..][..count], &mut plane[at.clone()]);
                    }
                }
            }
        }
    }
}

/// Weights as numbers of one byte: 64 fit into a register.
#[inline(always)]
fn mark(weights: &[f32], has_point: &mut [u8]) {
    for (weight, has_point) in weights.iter().zip(has_point) {
        *has_point = if *weight != 0.0 { 1 } else { 0 };
    }
}

#[inline(always)]
fn count_down(rows: [&[u8]; 3], sums: &mut [u8]) {
    let width = sums.len();
    let [above, here, below] = rows.map(|row| &row[..width]);
    for x in 0..width {
        sums[x] = above[x].wrapping_add(here[x]).wrapping_add(here[x]).wrapping_add(below[x]);
    }
}

#[inline(always)]
fn count_across(down: &[u8], weight: &mut [u8]) {
    let width = weight.len();
    let [left, here, right] = [0, 1, 2].map(|offset| &down[offset..][..width]);
    for x in 0..width {
        weight[x] = left[x].wrapping_add(here[x]).wrapping_add(here[x]).wrapping_add(right[x]);
    }
}

/// A pixel without a point adds nothing to its own weight.
#[inline(always)]
fn prioritise(weight: &[u8], has_point: &[u8], age: &[u8], priority: &mut [u8]) {
    for (((priority, weight), has_point), age) in priority.iter_mut().zip(weight).zip(has_point).zip(age) {
        let gap = u8::MAX.wrapping_sub(PRIORITY_PER_WEIGHT.wrapping_mul(*weight));
        *priority = if *has_point != 0 { *age } else { gap };
    }
}

/// 1/weight, 0 for 0.
#[inline(always)]
fn invert(weight: &[u8], inverse: &mut [f32]) {
    for (inverse, weight) in inverse.iter_mut().zip(weight) {
        let weight = f32::from(*weight);
        *inverse = if weight > 0.0 { 1.0 / weight } else { 0.0 };
    }
}

#[inline(always)]
fn one_two_one(rows: [&[f32]; 3], sums: &mut [f32]) {
    let width = sums.len();
    let [above, here, below] = rows.map(|row| &row[..width]);
    for x in 0..width {
        sums[x] = (above[x] + below[x]) + (here[x] + here[x]);
    }
}

/// Sums across, and makes means of them.
#[inline(always)]
fn show(down: &[f32], inverse: &[f32], black: bool, plane: &mut [f32]) {
    let width = plane.len();
    let [left, here, right] = [0, 1, 2].map(|offset| &down[offset..][..width]);
    let inverse = &inverse[..width];
    for x in 0..width {
        let sum = (left[x] + right[x]) + (here[x] + here[x]);
        let last = if black { 0.0 } else { plane[x] };
        plane[x] = if inverse[x] > 0.0 { sum * inverse[x] } else { last };
    }
}

/// Pixels with a point show it alone.
#[inline(always)]
fn keep_own(here: &[f32], has_point: &[u8], plane: &mut [f32]) {
    let width = plane.len();
    let (here, has_point) = (&here[1..][..width], &has_point[..width]);
    for x in 0..width {
        plane[x] = if has_point[x] != 0 { here[x] } else { plane[x] };
    }
}
