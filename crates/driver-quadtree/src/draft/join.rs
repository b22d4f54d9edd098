//! Leaves of a draft above four others, sixteen side by side.

use super::super::SEEN_SHARE;
use super::super::bins::FAR;
use super::super::leaf::NOISE_FREEDOM;
use super::super::shown::MANY_A_PIXEL;
use super::super::sums::luminance;
use super::super::surface::{
    ENOUGH_FREEDOM, FEW_OF, MIXED_F, MIXED_PART, MIXED_SAMPLES, MIXED_STEP, gap_allowed,
};
use super::settle::{HIDING_LEVEL, LEAST_SHARE};
use super::*;
use holo_cpu::Kernel;

/// Leaves of level `number` above four each.
#[inline(always)]
pub(super) fn join(number: usize, below: [&[Lanes; FIELDS]; 4]) -> [Lanes; FIELDS] {
    let gap = f32::from(gap_allowed(number));
    let mut joined = [NONE_LANES; FIELDS];
    for lane in 0..LANES {
        let of = |part: usize, field: usize| below[part][field][lane];
        let is_any = four(|part| of(part, WEIGHT) > 0.0);
        let near = Cluster::new(is_any, &of, gap);
        let rest = four(|part| is_any[part] & !near.has[part]);
        let next = Cluster::new(rest, &of, gap);
        let all = (of(0, ALL) + of(1, ALL)) + (of(2, ALL) + of(3, ALL));
        let is_near = (near.count >= SEEN_SHARE * all) | (next.count <= near.count);
        let has = four(|part| if is_near { near.has[part] } else { next.has[part] });
        let sum = |field: usize| {
            let [a, b, c, d] = four(|part| if has[part] { of(part, field) } else { 0.0 });
            (a + b) + (c + d)
        };
        let weights = four(|part| if has[part] { of(part, WEIGHT) } else { 0.0 });
        let weight = (weights[0] + weights[1]) + (weights[2] + weights[3]);
        let scale = if weight > 0.0 { 1.0 / weight } else { 0.0 };
        let mean = four(|channel| {
            let [a, b, c, d] = four(|part| weights[part] * of(part, MEAN + channel));
            ((a + b) + (c + d)) * scale
        });
        let own = luminance([mean[0], mean[1], mean[2]]);
        let (mut between_luminance, mut between) = (0.0, 0.0);
        for part in 0..4 {
            let step = luminance([of(part, MEAN), of(part, MEAN + 1), of(part, MEAN + 2)]) - own;
            between_luminance += weights[part] * step * step;
            let step = of(part, MEAN + 3) - mean[3];
            between += weights[part] * step * step;
        }
        let (weight_squared, count) = (sum(WEIGHT_SQUARED), sum(COUNT));
        let spread_luminance = sum(SPREAD_LUMINANCE) + between_luminance;
        let spread_within = sum(SPREAD_COMPRESSED);
        let spread_compressed = spread_within + between;
        let within = [sum(WITHIN_LUMINANCE), sum(WITHIN_COMPRESSED), sum(FREEDOM)];
        let alone = own_noise(count, weight, weight_squared, spread_luminance, spread_compressed);
        let lacks = within[2] < ENOUGH_FREEDOM;
        let noise = [
            if lacks { alone[0] } else { within[0] },
            if lacks { alone[1] } else { within[1] },
            if lacks { alone[2] } else { within[2] },
        ];
        // As `Surface::weight_squared_of_shown`.
        let is_of_few = spread_luminance > FEW_OF * own * own * weight;
        let freedom = weight * weight / weight_squared - 4.0;
        let step = MIXED_STEP * mean[3];
        let within = spread_within + step * step * weight;
        let is_mixed = (freedom > MIXED_SAMPLES)
            & (between > MIXED_PART * within)
            & (between * freedom > 3.0 * MIXED_F * within);
        for channel in 0..4 {
            joined[MEAN + channel][lane] = mean[channel];
        }
        joined[ERROR][lane] = weight_squared.sqrt() * scale;
        joined[FIRST][lane] = if is_near { near.first } else { next.first };
        joined[LAST][lane] = if is_near { near.last } else { next.last };
        joined[NEAR][lane] = sum(NEAR);
        joined[WEIGHT][lane] = weight;
        joined[WEIGHT_SQUARED][lane] = weight_squared;
        joined[COUNT][lane] = count;
        joined[ALL][lane] = all;
        joined[SEEN][lane] = sum(SEEN);
        joined[SEEN_ALL][lane] =
            (of(0, SEEN_ALL) + of(1, SEEN_ALL)) + (of(2, SEEN_ALL) + of(3, SEEN_ALL));
        joined[SPREAD_LUMINANCE][lane] = spread_luminance;
        joined[SPREAD_COMPRESSED][lane] = spread_compressed;
        joined[WITHIN_LUMINANCE][lane] = noise[0];
        joined[WITHIN_COMPRESSED][lane] = noise[1];
        joined[FREEDOM][lane] = noise[2];
        joined[SHARE][lane] = if is_of_few | is_mixed { LEAST_SHARE } else { 1.0 };
    }
    joined
}

/// Parts of a leaf that are of one surface.
struct Cluster {
    has: [bool; 4],
    first: f32,
    last: f32,
    count: f32,
}

impl Cluster {
    /// The nearest surface of those parts that are within.
    #[inline(always)]
    fn new(within: [bool; 4], of: &impl Fn(usize, usize) -> f32, gap: f32) -> Self {
        let (mut first, mut last) = (f32::from(NONE), 0.0);
        for part in 0..4 {
            let is_nearer = within[part] & (of(part, FIRST) < first);
            first = if is_nearer { of(part, FIRST) } else { first };
            last = if is_nearer { of(part, LAST) } else { last };
        }
        let is_far = first >= f32::from(FAR);
        let gap = if is_far { 0.0 } else { gap };
        // Parts that meet only by way of two others stay apart.
        for _ in 0..2 {
            for part in 0..4 {
                let meets =
                    within[part] & (of(part, FIRST) <= last + gap) & (of(part, LAST) > last);
                last = if meets { of(part, LAST) } else { last };
            }
        }
        let has = four(|part| within[part] & (of(part, FIRST) <= last + gap));
        let [a, b, c, d] = four(|part| if has[part] { of(part, COUNT) } else { 0.0 });
        Self { has, first, last, count: (a + b) + (c + d) }
    }
}

/// What is kept of leaves of level `number`, and those above them.
pub(super) struct Pull<'a> {
    pub number: usize,
    pub below: &'a Leaves,
    pub kept: &'a mut Leaves,
    pub above: Option<&'a mut Leaves>,
}

impl Kernel for Pull<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { number, below, kept, mut above } = self;
        let len = kept.row_len();
        for (row, kept) in kept.values.chunks_mut(len).enumerate() {
            let above = above.as_deref_mut().map(|above| {
                let len = above.row_len();
                &mut above.values[row / 2 * len..][..len]
            });
            pull_row(number, below.row(row), below.across, kept, above, row % 2);
        }
    }
}

/// Of a row of the planes: what is kept of leaves of level `number`, and those above them, which are one row of two.
#[inline(always)]
pub(super) fn pull_row(
    number: usize,
    below: Row,
    across: usize,
    kept: &mut [Lanes],
    mut above: Option<&mut [Lanes]>,
    parity: usize,
) {
    for x in (0..across).step_by(LANES) {
        let parts = four(|plane| below.lanes(plane, x));
        for plane in 0..4 {
            keep(
                number,
                parts[plane],
                &mut kept[(x / LANES * 4 + plane) * OF_LEAVES..][..OF_LEAVES],
            );
        }
        if let Some(above) = &mut above {
            split(&join(number + 1, parts), above, parity, x);
        }
    }
}

/// What is kept of sixteen leaves of level `number`.
#[inline(always)]
fn keep(number: usize, leaves: &[Lanes; FIELDS], kept: &mut [Lanes]) {
    keep_own(leaves, kept);
    // As `covering` asks. What hides a leaf hides its pixels, too.
    let most = if number <= HIDING_LEVEL { (MANY_A_PIXEL << (2 * number)) as f32 } else { 0.0 };
    for lane in 0..LANES {
        let of = |field: usize| leaves[field][lane];
        let scale = if of(FREEDOM) > 0.0 { 1.0 / of(FREEDOM) } else { 0.0 };
        let bright = greater(luminance([of(MEAN), of(MEAN + 1), of(MEAN + 2)]), f32::MIN_POSITIVE);
        let known = if of(FREEDOM) >= NOISE_FREEDOM { 1.0 } else { -1.0_f32 };
        kept[KEPT_RELATIVE][lane] =
            ((of(WITHIN_LUMINANCE) * scale).sqrt() / bright).copysign(known);
        kept[KEPT_COMPRESSED][lane] = of(WITHIN_COMPRESSED) * scale;
        let (own, all) =
            if of(SEEN_ALL) > 0.0 { (of(SEEN), of(SEEN_ALL)) } else { (of(COUNT), of(ALL)) };
        let hides = (own >= 0.5 * all) & (of(COUNT) <= most);
        kept[KEPT_SHARE][lane] = of(SHARE).copysign(if hides { -1.0 } else { 1.0 });
    }
}

/// The first of it: of pixels, all.
#[inline(always)]
pub(super) fn keep_own(leaves: &[Lanes; FIELDS], kept: &mut [Lanes]) {
    /// 2²³: the last bits of a sum with it are those of the whole number added.
    const WHOLE: f32 = 8_388_608.0;
    kept[..MEAN + 4].copy_from_slice(&leaves[..MEAN + 4]);
    for lane in 0..LANES {
        let error = leaves[ERROR][lane];
        kept[KEPT_ERROR][lane] = if leaves[NEAR][lane] > 0.0 { -error } else { error };
        let bits = |bin: f32| (bin + WHOLE).to_bits() & 0xffff;
        let bins = bits(leaves[FIRST][lane]) | bits(leaves[LAST][lane]) << 16;
        kept[KEPT_BINS][lane] = f32::from_bits(bins);
    }
}

/// Noise as the spread about a leaf's own mean: freedom × variance of luminance, freedom × deviation of compressed luminance, and freedom.
#[inline(always)]
pub(super) fn own_noise(
    count: f32,
    weight: f32,
    weight_squared: f32,
    spread_luminance: f32,
    spread_compressed: f32,
) -> [f32; 3] {
    // As `Surface` has it, but with one division.
    let scale = weight / weight_squared;
    let freedom = weight * scale - 1.0;
    let is_any = (count >= 2.0) & (freedom > 0.0);
    let noise = [spread_luminance * scale, (freedom * spread_compressed * scale).sqrt(), freedom];
    let one = |noise: f32| if is_any { noise } else { 0.0 };
    [one(noise[0]), one(noise[1]), one(noise[2])]
}

/// Puts sixteen leaves of a row into the two planes of it.
#[inline(always)]
pub(super) fn split(joined: &[Lanes; FIELDS], planes: &mut [Lanes], parity: usize, x: usize) {
    for half in 0..2 {
        let at = (x / (2 * LANES) * 4 + 2 * parity + half) * FIELDS;
        for (lanes, to) in joined.iter().zip(&mut planes[at..at + FIELDS]) {
            let to = &mut to[x / 2 % LANES..][..LANES / 2];
            for (lane, to) in to.iter_mut().enumerate() {
                *to = lanes[2 * lane + half];
            }
        }
    }
}
