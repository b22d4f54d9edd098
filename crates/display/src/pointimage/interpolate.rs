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
    /// Weight of what `picture` holds, the prefilter's mean, beside the points'.
    pub prior: f32,
}

impl Kernel for Interpolate<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { width, from, colour, age, picture: [red, green, blue], priority, own_point, black, fill, prior } =
            self;
        let rows = priority.len() / width;
        // The rows above, at and below the one that is made, in turn.
        let mut ring: [Line; 3] = std::array::from_fn(|_| Line::new());
        let mut down = [0.0; STRIP + 2];
        let mut weight_down = [0; STRIP + 2];
        let mut weight = [0; STRIP];
        let mut inverse = [0.0; STRIP];
        for columns in strips(width, STRIP) {
            let count = columns.len();
            let above = from.checked_sub(1);
            ring[(from + 2) % 3].load(above.and_then(|y| row_of(colour, width, y)), &columns);
            ring[from % 3].load(row_of(colour, width, from), &columns);
            for row in 0..rows {
                let y = from + row;
                ring[(y + 1) % 3].load(row_of(colour, width, y + 1), &columns);
                let lines = [(y + 2) % 3, y % 3, (y + 1) % 3].map(|at| &ring[at]);
                let at = row * width + columns.start..row * width + columns.end;
                let pixels = y * width + columns.start..y * width + columns.end;
                let has_point = &lines[1].has_point[1..][..count];
                count_down(lines.map(|line| &line.has_point), &mut weight_down);
                count_across(&weight_down, &mut weight);
                prioritise(&weight[..count], has_point, &age[pixels.clone()], &mut priority[at.clone()]);
                if fill {
                    invert(&weight, prior, &mut inverse);
                }
                for (channel, plane) in [&mut *red, &mut *green, &mut *blue].into_iter().enumerate() {
                    let rows = lines.map(|line| &line.row.channels[channel][AROUND]);
                    one_two_one(rows, &mut down);
                    if prior > 0.0 {
                        mix(&down[..count + 2], &inverse[..count], prior, &mut plane[at.clone()]);
                    } else {
                        show(&down[..count + 2], &inverse[..count], black, &mut plane[at.clone()]);
                    }
                    if own_point {
                        keep_own(rows[1], has_point, &mut plane[at.clone()]);
                    }
                }
            }
        }
    }
}

/// Of a strip's row: its columns and one more at both ends.
const AROUND: std::ops::Range<usize> = ROOM - 1..ROOM + 1 + STRIP;

/// A row of a strip, always as long as the longest: loops of known length need no remainders. What lies beyond the picture is 0.
struct Line {
    row: Row,
    /// 1 for pixels with a point, one column more at both ends.
    has_point: [u8; STRIP + 2],
}

impl Line {
    fn new() -> Self {
        Self { row: Row::new(STRIP), has_point: [0; STRIP + 2] }
    }

    // Not a closure: those are compiled for any processor, whoever calls them (it took twice as long).
    #[inline(always)]
    fn load(&mut self, row: Option<&[u32]>, columns: &std::ops::Range<usize>) {
        self.row.decode(row, columns, 1);
        mark(&self.row.channels[3][AROUND], &mut self.has_point);
    }
}

/// Weights as numbers of one byte: 64 fit into a register.
#[inline(always)]
fn mark(weights: &[f32], has_point: &mut [u8; STRIP + 2]) {
    for (weight, has_point) in weights.iter().zip(has_point) {
        *has_point = if *weight != 0.0 { 1 } else { 0 };
    }
}

#[inline(always)]
fn count_down([above, here, below]: [&[u8; STRIP + 2]; 3], sums: &mut [u8; STRIP + 2]) {
    for x in 0..STRIP + 2 {
        sums[x] = above[x].wrapping_add(here[x]).wrapping_add(here[x]).wrapping_add(below[x]);
    }
}

#[inline(always)]
fn count_across(down: &[u8; STRIP + 2], weight: &mut [u8; STRIP]) {
    for x in 0..STRIP {
        weight[x] = down[x].wrapping_add(down[x + 1]).wrapping_add(down[x + 1]).wrapping_add(down[x + 2]);
    }
}

/// A pixel without a point adds nothing to its own weight.
#[inline(always)]
fn prioritise(weight: &[u8], has_point: &[u8], age: &[u8], priority: &mut [u8]) {
    for (((priority, weight), has_point), age) in priority.iter_mut().zip(weight).zip(has_point).zip(age) {
        let gap = u8::MAX.wrapping_sub(PRIORITY_PER_WEIGHT.wrapping_mul(*weight));
        // All ones with a point. Without AVX-512 a choice would be a branch for each pixel.
        let own = has_point.wrapping_neg();
        *priority = *age & own | gap & !own;
    }
}

/// 1/(weight + prior), 0 without weight.
#[inline(always)]
fn invert(weight: &[u8; STRIP], prior: f32, inverse: &mut [f32; STRIP]) {
    for (inverse, weight) in inverse.iter_mut().zip(weight) {
        let weight = f32::from(*weight);
        *inverse = if weight > 0.0 { 1.0 / (weight + prior) } else { 0.0 };
    }
}

#[inline(always)]
fn one_two_one(rows: [&[f32]; 3], sums: &mut [f32; STRIP + 2]) {
    let [above, here, below] = rows.map(|row| &row[..STRIP + 2]);
    for x in 0..STRIP + 2 {
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

/// As [`show`], with the mean that is there already weighing `prior`.
#[inline(always)]
fn mix(down: &[f32], inverse: &[f32], prior: f32, plane: &mut [f32]) {
    let width = plane.len();
    let [left, here, right] = [0, 1, 2].map(|offset| &down[offset..][..width]);
    let inverse = &inverse[..width];
    for x in 0..width {
        let sum = (left[x] + right[x]) + (here[x] + here[x]);
        plane[x] = if inverse[x] > 0.0 { (sum + prior * plane[x]) * inverse[x] } else { plane[x] };
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
