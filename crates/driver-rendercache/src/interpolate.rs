//! Interpolation and smoothing over 3×3 pixels weighted 4-2-1 (or another square, its root, 1), and the priority of each pixel (Walter et al. 1999, §3.1 and §4).
//!
//! The weights are the product of 1-2-1 across and 1-2-1 down, so two passes of three sums make them: across when a row is decoded,
//! down when the row below it has been. Only where a pixel has no point among its 3×3 is the picture read that it is written to.
//!
//! Always true: a pixel with a point has its point's age as priority; one without has 255 if no neighbour has one either, and less
//! the more neighbours have.

use super::colour;
use super::params::PointImageParams;
use super::rows::{row_of, strips};
use holo_cpu::Kernel;
use std::ops::Range;

/// Columns filtered at a time: their rows take 49 kB. Narrow strips touch a page for a few lines only, and wait for each.
const STRIP: usize = 1024;
/// Pixels filtered at a time: loops of known length need no remainders.
const PIECE: usize = 64;

/// Filters rows `from..` of a band, as many as `picture` has.
pub(super) struct Interpolate<'a> {
    pub width: usize,
    pub from: usize,
    /// Of the whole band; what is beyond it is taken for empty.
    pub colour: &'a [u32],
    pub picture: [&'a mut [f32]; 3],
    /// Each pixel's own, and nobody else's: the age of its point, and then its priority.
    pub priority: &'a mut [u8],
    pub looks: Looks,
    pub scratch: &'a mut Scratch,
}

/// Memory to be used again.
#[derive(Debug)]
pub(super) struct Scratch {
    decoded: Decoded,
    /// The rows above, at and below the one that is made, in turn.
    ring: [Line; 3],
    last: Last,
}

impl Scratch {
    pub fn new(width: usize) -> Self {
        let longest = STRIP.min(width).next_multiple_of(PIECE);
        let ring = std::array::from_fn(|_| Line::new(longest));
        Self { decoded: Decoded::new(longest), ring, last: Last::default() }
    }
}

/// What pixels show.
#[derive(Clone, Copy)]
pub(super) struct Looks {
    /// Whether pixels with a point show it alone.
    pub own_point: bool,
    /// Whether pixels without points nearby become 0; the prefilter may have seen to them.
    pub black: bool,
    /// Whether gaps are filled at all.
    pub fill: bool,
    /// Weight of what the picture holds, the prefilter's mean, beside the points'.
    pub prior: f32,
    pub weights: Weights,
}

/// What neighbours count.
#[derive(Clone, Copy)]
pub(super) struct Weights {
    /// Of the middle one of three, the others being 1: the 3×3 weights are its square, itself, and 1.
    centre: u8,
    /// Priority that a pixel without a point loses per unit of its neighbours' weight.
    priority: u8,
}

impl Weights {
    pub fn new(params: &PointImageParams) -> Self {
        let centre = params.centre_weight;
        // A pixel without a point has four neighbours of the centre's weight, and four of weight 1.
        Self { centre, priority: (u8::MAX - params.gap_priority) / (4 * centre + 4) }
    }
}

impl Kernel for Interpolate<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { width, from, colour, picture: [red, green, blue], priority, looks, scratch } =
            self;
        let Scratch { decoded, ring, last } = scratch;
        let (rows, centre) = (priority.len() / width, looks.weights.centre);
        for columns in strips(width, STRIP) {
            let above = from.checked_sub(1).and_then(|y| row_of(colour, width, y));
            ring[(from + 2) % 3].load(above, &columns, decoded, centre);
            ring[from % 3].load(row_of(colour, width, from), &columns, decoded, centre);
            for row in 0..rows {
                let y = from + row;
                ring[(y + 1) % 3].load(row_of(colour, width, y + 1), &columns, decoded, centre);
                let lines = [&ring[(y + 2) % 3], &ring[y % 3], &ring[(y + 1) % 3]];
                let pixels = y * width + columns.start..y * width + columns.end;
                let colour = &colour[pixels];
                let at = row * width + columns.start..row * width + columns.end;
                let (red, green, blue) =
                    (&mut red[at.clone()], &mut green[at.clone()], &mut blue[at.clone()]);
                let priority = &mut priority[at];
                let whole = columns.len() / PIECE;
                let pieces = colour.as_chunks().0.iter().zip(priority.as_chunks_mut().0);
                let planes = red
                    .as_chunks_mut()
                    .0
                    .iter_mut()
                    .zip(green.as_chunks_mut().0)
                    .zip(blue.as_chunks_mut().0);
                for (((colour, priority), ((red, green), blue)), piece) in
                    pieces.zip(planes).zip(0..)
                {
                    filter(lines, piece * PIECE, colour, priority, [red, green, blue], looks);
                }
                let at = whole * PIECE..columns.len();
                if !at.is_empty() {
                    let count = at.len();
                    last.priority[..count].copy_from_slice(&priority[at.clone()]);
                    last.colour[..count].copy_from_slice(&colour[at.clone()]);
                    let planes =
                        [&mut red[at.clone()], &mut green[at.clone()], &mut blue[at.clone()]];
                    let Last { colour, priority: made, planes: copies } = last;
                    copies
                        .iter_mut()
                        .zip(&planes)
                        .for_each(|(copy, plane)| copy[..count].copy_from_slice(plane));
                    filter(lines, at.start, colour, made, copies.each_mut(), looks);
                    priority[at].copy_from_slice(&made[..count]);
                    planes
                        .into_iter()
                        .zip(copies)
                        .for_each(|(plane, copy)| plane.copy_from_slice(&copy[..count]));
                }
            }
        }
    }
}

/// The last piece of a row, if it is not a whole one.
#[derive(Debug)]
struct Last {
    colour: [u32; PIECE],
    priority: [u8; PIECE],
    planes: [[f32; PIECE]; 3],
}

impl Default for Last {
    fn default() -> Self {
        Self { colour: [0; PIECE], priority: [0; PIECE], planes: [[0.0; PIECE]; 3] }
    }
}

/// A row of a strip as it was decoded, with one more pixel at both ends, 0 outside the picture.
#[derive(Debug)]
struct Decoded {
    channels: [Vec<f32>; 3],
    has_point: Vec<u8>,
}

impl Decoded {
    fn new(longest: usize) -> Self {
        Self {
            channels: std::array::from_fn(|_| vec![0.0; longest + 2]),
            has_point: vec![0; longest + 2],
        }
    }
}

/// A row of a strip, summed across; as long as whole pieces, what lies beyond the strip being anything.
#[derive(Debug)]
struct Line {
    sums: [Vec<f32>; 3],
    weights: Vec<u8>,
    /// 1 for pixels with a point.
    has_point: Vec<u8>,
}

impl Line {
    fn new(longest: usize) -> Self {
        let sums = std::array::from_fn(|_| vec![0.0; longest]);
        Self { sums, weights: vec![0; longest], has_point: vec![0; longest] }
    }

    // Not a closure: those are compiled for any processor, whoever calls them (it took twice as long).
    #[inline(always)]
    fn load(
        &mut self,
        row: Option<&[u32]>,
        columns: &Range<usize>,
        decoded: &mut Decoded,
        centre: u8,
    ) {
        let Some(row) = row else {
            self.sums.iter_mut().for_each(|sums| sums.fill(0.0));
            self.weights.fill(0);
            return self.has_point.fill(0);
        };
        let (start, end) = (columns.start.saturating_sub(1), (columns.end + 1).min(row.len()));
        let (to, count) = ((start + 1) - columns.start, end - start);
        let Decoded { channels: [red, green, blue], has_point } = decoded;
        // What is not written below: a column beyond the picture at either end.
        let beyond = columns.len() + 1;
        for channel in [&mut *red, &mut *green, &mut *blue] {
            (channel[0], channel[beyond]) = (0.0, 0.0);
        }
        (has_point[0], has_point[beyond]) = (0, 0);
        let row = &row[start..end];
        decode(row, &mut red[to..][..count], &mut green[to..][..count], &mut blue[to..][..count]);
        mark(row, &mut has_point[to..][..count]);
        let [sum_red, sum_green, sum_blue] = &mut self.sums;
        let count = columns.len();
        across(red, centre, &mut sum_red[..count]);
        across(green, centre, &mut sum_green[..count]);
        across(blue, centre, &mut sum_blue[..count]);
        count_across(has_point, centre, &mut self.weights[..count]);
        self.has_point[..count].copy_from_slice(&has_point[1..][..count]);
    }
}

#[inline(always)]
fn decode(colours: &[u32], red: &mut [f32], green: &mut [f32], blue: &mut [f32]) {
    let count = colours.len();
    let (red, green, blue) = (&mut red[..count], &mut green[..count], &mut blue[..count]);
    for x in 0..count {
        [red[x], green[x], blue[x]] = colour::decode(colours[x]);
    }
}

#[inline(always)]
fn mark(colours: &[u32], has_point: &mut [u8]) {
    for (has_point, &colour) in has_point.iter_mut().zip(colours) {
        *has_point = if colour == colour::NONE { 0 } else { 1 };
    }
}

#[inline(always)]
fn across(row: &[f32], centre: u8, sums: &mut [f32]) {
    let (count, centre) = (sums.len(), f32::from(centre));
    let (left, here, right) = (&row[..count], &row[1..][..count], &row[2..][..count]);
    for x in 0..count {
        sums[x] = (left[x] + right[x]) + centre * here[x];
    }
}

/// Weights as numbers of one byte: 64 fit into a register.
#[inline(always)]
fn count_across(row: &[u8], centre: u8, weights: &mut [u8]) {
    let count = weights.len();
    let (left, here, right) = (&row[..count], &row[1..][..count], &row[2..][..count]);
    for x in 0..count {
        // 1 or 0: bytes cannot be multiplied, and all ones or none can be masked.
        weights[x] = left[x].wrapping_add(here[x].wrapping_neg() & centre).wrapping_add(right[x]);
    }
}

/// A piece of a row that lines have at `start`.
#[inline(always)]
fn filter(
    lines: [&Line; 3],
    start: usize,
    colour: &[u32; PIECE],
    priority: &mut [u8; PIECE],
    planes: [&mut [f32; PIECE]; 3],
    looks: Looks,
) {
    let Looks { own_point, black, fill, prior, weights } = looks;
    let [above, here, below] = lines;
    let mut weight = [0; PIECE];
    let centre = f32::from(weights.centre);
    count_down(
        &above.weights[start..],
        &here.weights[start..],
        &below.weights[start..],
        weights.centre,
        &mut weight,
    );
    prioritise(&weight, weights.priority, &here.has_point[start..][..PIECE], priority);
    let mut inverse = [0.0; PIECE];
    let mut is_covered = false;
    if fill {
        invert(&weight, prior, &mut inverse);
        is_covered = has_weight(&weight);
    }
    for (channel, plane) in planes.into_iter().enumerate() {
        let (above, here) = (&above.sums[channel][start..], &here.sums[channel][start..]);
        let below = &below.sums[channel][start..];
        if prior > 0.0 {
            mix(above, here, below, (&inverse, centre, prior), plane);
        } else if is_covered {
            show_all(above, here, below, (&inverse, centre), plane);
        } else {
            show(above, here, below, (&inverse, centre), black, plane);
        }
        if own_point {
            keep_own(colour, channel, plane);
        }
    }
}

#[inline(always)]
fn count_down(above: &[u8], here: &[u8], below: &[u8], centre: u8, weight: &mut [u8; PIECE]) {
    let (above, here, below) = (&above[..PIECE], &here[..PIECE], &below[..PIECE]);
    for x in 0..PIECE {
        weight[x] = above[x].wrapping_add(here[x].wrapping_mul(centre)).wrapping_add(below[x]);
    }
}

/// A pixel without a point adds nothing to its own weight.
#[inline(always)]
fn prioritise(weight: &[u8; PIECE], per_weight: u8, has_point: &[u8], priority: &mut [u8; PIECE]) {
    let has_point = &has_point[..PIECE];
    for x in 0..PIECE {
        let gap = u8::MAX.wrapping_sub(per_weight.wrapping_mul(weight[x]));
        // All ones with a point. Without AVX-512 a choice would be a branch for each pixel.
        let own = has_point[x].wrapping_neg();
        priority[x] = priority[x] & own | gap & !own;
    }
}

#[inline(always)]
fn has_weight(weight: &[u8; PIECE]) -> bool {
    weight.iter().fold(u8::MAX, |least, &weight| least.min(weight)) > 0
}

/// 1/(weight + prior), 0 without weight.
#[inline(always)]
fn invert(weight: &[u8; PIECE], prior: f32, inverse: &mut [f32; PIECE]) {
    for x in 0..PIECE {
        let weight = f32::from(weight[x]);
        inverse[x] = if weight > 0.0 { 1.0 / (weight + prior) } else { 0.0 };
    }
}

/// Sums down, and makes means of them.
#[inline(always)]
fn show_all(
    above: &[f32],
    here: &[f32],
    below: &[f32],
    (inverse, centre): (&[f32; PIECE], f32),
    plane: &mut [f32; PIECE],
) {
    let (above, here, below) = (&above[..PIECE], &here[..PIECE], &below[..PIECE]);
    for x in 0..PIECE {
        plane[x] = ((above[x] + below[x]) + centre * here[x]) * inverse[x];
    }
}

/// As [`show_all`], where some pixels have no point among their 3×3.
#[inline(always)]
fn show(
    above: &[f32],
    here: &[f32],
    below: &[f32],
    (inverse, centre): (&[f32; PIECE], f32),
    black: bool,
    plane: &mut [f32; PIECE],
) {
    let (above, here, below) = (&above[..PIECE], &here[..PIECE], &below[..PIECE]);
    let kept = if black { 0.0 } else { 1.0 };
    for x in 0..PIECE {
        let sum = (above[x] + below[x]) + centre * here[x];
        // Both are computed, and one is chosen: loads of some pixels only take far longer.
        let (mean, last) = (sum * inverse[x], plane[x] * kept);
        plane[x] = if inverse[x] > 0.0 { mean } else { last };
    }
}

/// As [`show`], with the mean that is there already weighing `prior`.
#[inline(always)]
fn mix(
    above: &[f32],
    here: &[f32],
    below: &[f32],
    (inverse, centre, prior): (&[f32; PIECE], f32, f32),
    plane: &mut [f32; PIECE],
) {
    let (above, here, below) = (&above[..PIECE], &here[..PIECE], &below[..PIECE]);
    for x in 0..PIECE {
        let sum = (above[x] + below[x]) + centre * here[x];
        let (last, mean) = (plane[x], (sum + prior * plane[x]) * inverse[x]);
        plane[x] = if inverse[x] > 0.0 { mean } else { last };
    }
}

/// Pixels with a point show it alone.
#[inline(always)]
fn keep_own(colours: &[u32; PIECE], channel: usize, plane: &mut [f32; PIECE]) {
    for x in 0..PIECE {
        let own = colour::decode(colours[x])[channel];
        plane[x] = if colours[x] == colour::NONE { plane[x] } else { own };
    }
}
