//! What leaves of a draft show: their own mean, or what is shown around them of the leaves above.

use super::super::bins::bin_distance_squared;
use super::super::leaf::{FEW_SAMPLES, KAPPA, KAPPA_LINEAR, PLAIN_TAIL, QUANTUM, UNSEEN};
use super::super::paint::{CLEARLY_IN_FRONT, UnseenPixels};
use super::super::surface::gap_allowed;
use super::*;
use holo_cpu::Kernel;

/// Distance of means, in half-widths of intervals, up to which they are taken for the same,
const SAME: f32 = 0.6;
/// and from which on for others. On samples of a known room, 0.1 to 16 a pixel: with 0.5 and 1.0 noise of one path stayed (1.8 dB at 16 a pixel), with
/// 0.4 and 1.4 the error of 16 paths was half as large again as a drawing's, which now it exceeds by a sixth at most.
const OTHER: f32 = 1.8;
/// Doublings from pixels to the largest leaves whose surface hides what a pixel sees behind it.
pub(super) const HIDING_LEVEL: usize = 2;
/// Share of a leaf whose colour only leaves without samples take.
pub(super) const LEAST_SHARE: f32 = 1e-6;
/// Least sum of shares that leaves with samples take a colour from.
const ENOUGH_SHARE: f32 = 1e-3;

/// What a leaf shows.
struct Settled {
    colour: [f32; 4],
    /// Whether there is anything to show.
    is_any: bool,
}

/// Settles a leaf's colour, given what those above it show, of which its own is the first. `is_some`: it has a surface to show.
#[inline(always)]
fn settle(
    own: &Own,
    is_some: bool,
    above: impl Fn(usize, usize) -> f32,
    [relative, compressed]: [f32; 2],
    gap: f32,
) -> Settled {
    let nearest = if is_some { own.first } else { above(0, SHOWN_FIRST) } - gap;
    let furthest = if is_some { own.last } else { above(0, SHOWN_LAST) } + gap;
    let mut total = 0.0_f32;
    let mut sum = [0.0_f32; 4];
    for (part, share) in [9.0 / 16.0, 3.0 / 16.0, 3.0 / 16.0, 1.0 / 16.0].into_iter().enumerate() {
        let meets = (above(part, SHOWN_LAST) >= nearest) & (above(part, SHOWN_FIRST) <= furthest);
        let share = if meets { share * above(part, SHOWN_SHARE) } else { 0.0 };
        total += share;
        for channel in 0..4 {
            sum[channel] += share * above(part, COLOUR + channel);
        }
    }
    let is_any = total > 0.0;
    let scale = if is_any { 1.0 / total } else { 0.0 };
    let around = four(|channel| sum[channel] * scale);
    let few_samples = FEW_SAMPLES * (relative * relative + PLAIN_TAIL);
    let width = own.error * (1.0 + few_samples * own.error * own.error);
    let brightest = greater(around[0], greater(around[1], around[2]));
    // Differences and the half-widths of the intervals that they are held against. The greatest of the four quotients takes one division.
    let step = |channel: usize| (own.mean[channel] - around[channel]).abs();
    let linear = |channel: usize| {
        (
            step(channel),
            KAPPA_LINEAR * greater(relative * around[channel], QUANTUM * brightest) * width,
        )
    };
    let half = KAPPA * greater(compressed, 0.25 * QUANTUM * around[3]) * width;
    let further = |a: (f32, f32), b: (f32, f32)| {
        let is_first = a.0 * b.1 > b.0 * a.1;
        (if is_first { a.0 } else { b.0 }, if is_first { a.1 } else { b.1 })
    };
    let (step, width) = further(further(linear(0), linear(1)), further(linear(2), (step(3), half)));
    let own_part = (step / greater(width, f32::MIN_POSITIVE) - SAME) * (1.0 / (OTHER - SAME));
    let own_part = if own_part > 0.0 { own_part } else { 0.0 };
    let is_whole = (own_part > 1.0) | (half < UNSEEN * own.mean[3]) | (total <= ENOUGH_SHARE);
    let own_part = if is_whole { 1.0 } else { own_part };
    let own_part = if is_some { own_part } else { 0.0 };
    let colour = four(|channel| around[channel] + own_part * (own.mean[channel] - around[channel]));
    Settled { colour, is_any: is_any | is_some }
}

/// Whether a leaf's surface is hidden by that which the leaf above shows, as pixels' are by leaves around them
/// ([`covering`](super::super::shown)), if none of its own samples pass near the eye.
#[inline(always)]
fn is_hidden(first: f32, above: impl Fn(usize, usize) -> f32) -> bool {
    (above(0, HIDES) > 0.0) & (above(0, SHOWN_LAST) + f32::from(CLEARLY_IN_FRONT) < first)
}

/// Leaves that a plane's leaf lies between, above: its own, the one beside, the one over or under it, and the one beside that.
#[inline(always)]
fn around<'a>(rows: &[ShownRow<'a>; 2], plane: usize, x: usize) -> [[&'a Lanes; SHOWN_FIELDS]; 4] {
    let beside = 2 * (plane % 2);
    [
        rows[0].lanes(x + 1),
        rows[0].lanes(x + beside),
        rows[1].lanes(x + 1),
        rows[1].lanes(x + beside),
    ]
}

/// Settles two rows of leaves of level `number`.
pub(super) struct Push<'a> {
    pub number: usize,
    pub leaves: &'a Leaves,
    pub above: &'a Shown,
    /// Of the planes.
    pub row: usize,
    /// The two rows of what is shown of them.
    pub below: &'a mut [f32],
    pub stride: usize,
}

impl Kernel for Push<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { number, leaves, above, row, below, stride } = self;
        let gap = f32::from(gap_allowed(number + 1));
        let planes = leaves.row(row);
        for (down, below) in below.chunks_mut(SHOWN_FIELDS * stride).enumerate() {
            if 2 * row + down >= leaves.height {
                break;
            }
            let rows = [above.row(row + 1), above.row(row + 2 * down)];
            for x in (0..leaves.across).step_by(LANES) {
                let mut pair = [[NONE_LANES; SHOWN_FIELDS]; 2];
                for beside in 0..2 {
                    let plane = 2 * down + beside;
                    let columns = leaves.width.saturating_sub(2 * x + beside).div_ceil(2);
                    pair[beside] =
                        shown_lanes(planes.lanes(plane, x), &around(&rows, plane, x), gap, columns);
                }
                for field in 0..SHOWN_FIELDS {
                    let at = field * stride + 2 * x + 1;
                    if let Some(to) = below[at..].first_chunk_mut::<{ 2 * LANES }>() {
                        for lane in 0..LANES {
                            to[2 * lane] = pair[0][field][lane];
                            to[2 * lane + 1] = pair[1][field][lane];
                        }
                    }
                }
            }
        }
    }
}

/// What sixteen leaves show, of which the first ones are in the picture.
#[inline(always)]
fn shown_lanes(
    own: &[Lanes; OF_LEAVES],
    above: &[[&Lanes; SHOWN_FIELDS]; 4],
    gap: f32,
    columns: usize,
) -> [Lanes; SHOWN_FIELDS] {
    let mut shown = [NONE_LANES; SHOWN_FIELDS];
    for lane in 0..LANES {
        let of = |field: usize| own[field][lane];
        let above = |part: usize, field: usize| above[part][field][lane];
        let (leaf, is_some) = own_surface(of, above);
        let is_own = of(KEPT_RELATIVE).is_sign_positive() | (above(0, SHOWN_SHARE) == 0.0);
        let relative = if is_own { of(KEPT_RELATIVE).abs() } else { above(0, RELATIVE) };
        let compressed = if is_own { of(KEPT_COMPRESSED) } else { above(0, COMPRESSED) };
        let settled = settle(&leaf, is_some, above, [relative, compressed], gap);
        for channel in 0..4 {
            shown[COLOUR + channel][lane] = settled.colour[channel];
        }
        shown[SHOWN_FIRST][lane] = if is_some { leaf.first } else { above(0, SHOWN_FIRST) };
        shown[SHOWN_LAST][lane] = if is_some { leaf.last } else { above(0, SHOWN_LAST) };
        let filled = if settled.is_any { 1.0 } else { 0.0 };
        let share = if is_some { of(KEPT_SHARE).abs() } else { filled };
        shown[SHOWN_SHARE][lane] = if lane < columns { share } else { 0.0 };
        shown[RELATIVE][lane] = relative;
        shown[COMPRESSED][lane] = compressed;
        let hides = if is_some { of(KEPT_SHARE).is_sign_negative() } else { above(0, HIDES) > 0.0 };
        shown[HIDES][lane] = if hides { 1.0 } else { 0.0 };
    }
    shown
}

/// What is kept of a leaf's own surface, and whether there is one that is not hidden.
#[inline(always)]
fn own_surface(of: impl Fn(usize) -> f32, above: impl Fn(usize, usize) -> f32) -> (Own, bool) {
    let bins = of(KEPT_BINS).to_bits();
    let leaf = Own {
        mean: [of(MEAN), of(MEAN + 1), of(MEAN + 2), of(MEAN + 3)],
        error: of(KEPT_ERROR).abs(),
        first: (bins & 0xffff) as f32,
        last: (bins >> 16) as f32,
    };
    let is_near = of(KEPT_ERROR) < 0.0;
    let is_some = (leaf.error > 0.0) & (is_near | !is_hidden(leaf.first, above));
    (leaf, is_some)
}

/// Four rows of pixels.
pub(super) struct Paint<'a> {
    pub tree: &'a Quadtree,
    pub leaves: &'a Leaves,
    pub above: &'a Shown,
    /// The first of the planes.
    pub row: usize,
    pub pixels: &'a mut [[f32; 3]],
    pub depth: &'a mut [f32],
    pub mixed: &'a [Mixed],
    /// Pixels of beams that see nothing, once they are painted.
    pub unseen: u64,
}

/// Paints them.
pub(super) struct PaintBand<'a, 'b>(pub &'a mut Paint<'b>);

impl Kernel for PaintBand<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self(band) = self;
        let Paint { tree, leaves, above, .. } = *band;
        let gap = f32::from(gap_allowed(1));
        let width = leaves.width;
        let rows = band.pixels.chunks_mut(width).zip(band.depth.chunks_mut(width));
        for (number, (pixels, depth)) in rows.enumerate() {
            let (row, down) = (band.row + number / 2, number % 2);
            let planes = leaves.row(row);
            let rows = [above.row(row + 1), above.row(row + 2 * down)];
            for x in (0..leaves.across).step_by(LANES) {
                if down == 0 {
                    planes.prefetch(x);
                }
                let (mut colours, mut distances) = ([[0.0; 3]; 2 * LANES], [0.0; 2 * LANES]);
                for beside in 0..2 {
                    let plane = 2 * down + beside;
                    let [red, green, blue, distance] =
                        pixel_colours(planes.lanes(plane, x), &around(&rows, plane, x), gap);
                    for lane in 0..LANES {
                        colours[2 * lane + beside] = [red[lane], green[lane], blue[lane]];
                        distances[2 * lane + beside] = distance[lane];
                    }
                }
                let start = 2 * x;
                let count = (2 * LANES).min(width.saturating_sub(start));
                if count > 0 {
                    pixels[start..start + count].copy_from_slice(&colours[..count]);
                    depth[start..start + count].copy_from_slice(&distances[..count]);
                }
            }
        }
        for other in band.mixed {
            other.mix(above, &mut band.pixels[(other.row - 2 * band.row) * width + other.column]);
        }
        if tree.may_hide_pixels() {
            let first = 2 * band.row * width;
            let mut unseen = UnseenPixels::default();
            for (at, (colour, depth)) in band.pixels.iter_mut().zip(&mut *band.depth).enumerate() {
                let pixel = first + at;
                if !tree.covered[pixel] {
                    (*colour, *depth) = ([0.0; 3], 0.0);
                } else if unseen.has(tree, pixel) {
                    let sky = if tree.view.clips_sky() { [0.0; 3] } else { tree.params.sky };
                    (*colour, *depth) = (sky, f32::INFINITY);
                    band.unseen += 1;
                }
            }
        }
    }
}

/// Colours and distances of sixteen pixels.
#[inline(always)]
fn pixel_colours(
    own: &[Lanes; OF_PIXELS],
    above: &[[&Lanes; SHOWN_FIELDS]; 4],
    gap: f32,
) -> [Lanes; 4] {
    let mut found = [NONE_LANES; 4];
    for lane in 0..LANES {
        let of = |field: usize| own[field][lane];
        let above = |part: usize, field: usize| above[part][field][lane];
        let (leaf, is_some) = own_surface(of, above);
        let settled =
            settle(&leaf, is_some, above, [above(0, RELATIVE), above(0, COMPRESSED)], gap);
        for channel in 0..3 {
            found[channel][lane] = settled.colour[channel];
        }
        let bin = if is_some { leaf.first } else { above(0, SHOWN_FIRST) };
        let distance = bin_distance_squared(bin as u16).sqrt();
        found[3][lane] = if settled.is_any { distance } else { 0.0 };
    }
    found
}

impl Mixed {
    /// Mixes its surface into a pixel.
    #[inline(always)]
    fn mix(&self, above: &Shown, pixel: &mut [f32; 3]) {
        let (column, row) = (self.column / 2, self.row / 2);
        let (beside, over) = (2 * (self.column % 2), 2 * (self.row % 2));
        let places = [(1, 1), (beside, 1), (1, over), (beside, over)];
        let above = |part: usize, field: usize| {
            let (across, down) = places[part];
            above.values[((row + down) * SHOWN_FIELDS + field) * above.stride + column + across]
        };
        let settled = settle(
            &self.own,
            true,
            above,
            [above(0, RELATIVE), above(0, COMPRESSED)],
            f32::from(gap_allowed(1)),
        );
        for (pixel, other) in pixel.iter_mut().zip(settled.colour) {
            *pixel += self.part * (other - *pixel);
        }
    }
}
