//! What pixels of a draft are made of: sums become means, sixteen pixels side by side.

use super::super::Quadtree;
use super::super::bins::{BINS_AN_OCTAVE, BINS_KEPT, NONE, PixelBins, merged};
use super::super::paint::UnseenPixels;
use super::super::sums::{
    COLOUR_FRACTION, COMPRESSED, COMPRESSED_SCALE, COMPRESSED_SQUARED, COUNTS, HAS_HIGH, High,
    Kept, LOW_BITS, LOW_HALF_BITS, LUMINANCE_SCALE, LUMINANCE_SQUARED, Moments, NEAR_CLASSES,
    Packed, Summed, Sums, WEIGHTS, luminance,
};
use super::super::surface::{Bins, adjacent, gap_allowed};
use super::join::{join, keep_own, own_noise, pull_row, split};
use super::*;
use holo_cpu::{Isa, Kernel};
use crate::transpose::Words;
use bytemuck::{Zeroable, cast_ref};

/// Two rows of leaves of 4 × 4 pixels, and all that they are made of: four of leaves of 2 × 2, and eight of pixels.
pub(super) struct Band<'a> {
    pub tree: &'a Quadtree,
    /// Of the planes of the largest of them.
    pub row: usize,
    pub pixels: &'a mut [Lanes],
    pub leaves: &'a mut [Lanes],
    /// None: there are no leaves so large.
    pub above: Option<&'a mut [Lanes]>,
    /// Of each four rows of pixels.
    pub mixed: &'a mut [Vec<Mixed>],
    /// Once it is gathered: samples, and pixels without.
    pub samples: u64,
    pub empty: u64,
}

/// Gathers them.
pub(super) struct GatherBands<'a, 'b>(pub &'a mut [Band<'b>]);

impl Kernel for GatherBands<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Some(tree) = self.0.first().map(|band| band.tree) else { return };
        let width = tree.size.0 as usize;
        // Of leaves of 2 × 2: small enough to stay in the caches until those above are made of them.
        let mut row = Leaves::new(width.div_ceil(2), 2, FIELDS);
        for band in self.0 {
            let halves =
                band.pixels.chunks_mut(2 * plane_len(width, OF_PIXELS)).zip(&mut *band.mixed);
            let halves = halves.zip(band.leaves.chunks_mut(row.row_len() / FIELDS * OF_LEAVES));
            for (half, ((pixels, mixed), leaves)) in halves.enumerate() {
                let counts = gather_rows(tree, 2 * band.row + half, pixels, mixed, &mut row);
                (band.samples, band.empty) = (band.samples + counts.0, band.empty + counts.1);
                pull_row(1, row.row(0), row.across, leaves, band.above.as_deref_mut(), half);
            }
        }
    }
}

/// Numbers in a row of the planes of leaves of which there are so many across.
#[inline(always)]
fn plane_len(width: usize, fields: usize) -> usize {
    4 * fields * width.div_ceil(2).div_ceil(LANES)
}

/// Two rows of leaves of 2 × 2 pixels, which are one of the planes, and the four rows of pixels that they are made of: their samples, and pixels
/// without.
#[inline(always)]
fn gather_rows(
    tree: &Quadtree,
    row_of_planes: usize,
    pixels: &mut [Lanes],
    mixed: &mut Vec<Mixed>,
    above: &mut Leaves,
) -> (u64, u64) {
    let (width, height) = (tree.size.0 as usize, tree.size.1 as usize);
    let across = width.div_ceil(2).next_multiple_of(LANES);
    mixed.clear();
    let mut unseen = UnseenPixels::default();
    let mut several = [(Packed::zeroed(), High::zeroed()); LANES];
    let mut found = [[NONE_LANES; FIELDS]; 4];
    let (mut samples, mut empty) = ([0.0_f64; LANES], [0_u32; LANES]);
    let may_hide = tree.may_hide_pixels();
    let len = plane_len(width, OF_PIXELS);
    if pixels.len() <= len {
        // The second row is not written.
        above.values.fill(NONE_LANES);
    }
    for (half, pixels) in pixels.chunks_mut(len).enumerate() {
        let row = 2 * row_of_planes + half;
        for x in (0..across).step_by(LANES) {
            for (plane, found) in found.iter_mut().enumerate() {
                let y = 2 * row + plane / 2;
                if y >= height {
                    *found = [NONE_LANES; FIELDS];
                    continue;
                }
                // One half of the next columns'.
                let next = (2 * (x + LANES) + plane % 2 * LANES).min(width);
                let next = y * width + next..y * width + (next + LANES).min(width);
                tree.narrow.prefetch_sums_of(next.clone());
                tree.wide.prefetch_sums_of(next);
                let columns = LANES.min(((width + 1 - plane % 2) / 2).saturating_sub(x));
                let first = y * width + 2 * x + plane % 2;
                pixel_lanes(
                    tree,
                    first,
                    columns,
                    (2 * x + plane % 2, y),
                    mixed,
                    &mut several,
                    found,
                );
                let mut counts = [0_u32; LANES];
                for lane in 0..columns {
                    counts[lane] = 1;
                }
                if may_hide {
                    for (lane, counts) in counts.iter_mut().enumerate().take(columns) {
                        let pixel = first + 2 * lane;
                        *counts = u32::from(tree.covered[pixel] && !unseen.has(tree, pixel));
                    }
                }
                for lane in 0..LANES {
                    let all = found[ALL][lane];
                    samples[lane] += f64::from(if counts[lane] != 0 { all } else { 0.0 });
                    empty[lane] += if all == 0.0 { counts[lane] } else { 0 };
                }
                keep_own(found, &mut pixels[(x / LANES * 4 + plane) * OF_PIXELS..][..OF_PIXELS]);
            }
            let joined = join(1, [&found[0], &found[1], &found[2], &found[3]]);
            split(&joined, &mut above.values, half, x);
        }
    }
    (samples.iter().sum::<f64>() as u64, empty.iter().map(|&empty| u64::from(empty)).sum())
}

/// What sums of sixteen pixels are, in their fixed points, by number: the words of what is kept, and of those that hold two sums the upper.
type Values = [Lanes; 10];
const SUM_WEIGHT: usize = WEIGHTS;
const SUM_COUNT: usize = COUNTS;
const SUM_WEIGHT_SQUARED: usize = 8;
/// Not 0 if there are any.
const SUM_NEAR: usize = 9;

/// Of a word of 64 bits the lower half and the upper, by their places as words of 32.
#[inline(always)]
fn halves(word: usize) -> [usize; 2] {
    if cfg!(target_endian = "big") { [2 * word + 1, 2 * word] } else { [2 * word, 2 * word + 1] }
}

/// Sums of sixteen pixels from their lower parts; and from those above, if there are any, which `high` has of a lane.
#[inline(always)]
fn values<'a>(
    packed: &[&Packed; LANES],
    isa: Isa,
    high: impl Fn(usize) -> Option<&'a High>,
) -> Values {
    let mut records: [&Words; LANES] = [cast_ref(packed[0]); LANES];
    for lane in 0..LANES {
        records[lane] = cast_ref(packed[lane]);
    }
    let mut rows = [[0; LANES]; WORDS];
    isa.transpose(records, &mut rows);
    let mut values = [NONE_LANES; 10];
    add_words(&rows, [1.0; 2], &mut values);
    let [count, near] = halves(COUNTS).map(|at| rows[at]);
    let mut has_high = 0;
    for lane in 0..LANES {
        values[SUM_COUNT][lane] = (count[lane] & !HAS_HIGH) as f32;
        values[SUM_NEAR][lane] = near[lane] as f32;
        has_high |= count[lane] & HAS_HIGH;
    }
    if has_high != 0 {
        let none = High::zeroed();
        for lane in 0..LANES {
            records[lane] = cast_ref(high(lane).unwrap_or(&none));
        }
        isa.transpose(records, &mut rows);
        add_words(&rows, [LOW_BITS, LOW_HALF_BITS].map(|bits| (1_u64 << bits) as f32), &mut values);
        let near = halves(COUNTS).map(|at| rows[at]);
        for lane in 0..LANES {
            values[SUM_NEAR][lane] += near[0][lane] as f32 + near[1][lane] as f32;
        }
    }
    values
}

/// Adds what words are worth, of wide sums and of those that are halves of a word.
#[inline(always)]
fn add_words(rows: &[Words; WORDS], [wide, half]: [f32; 2], values: &mut Values) {
    /// Of the upper half of a word.
    const UPPER: f32 = 4_294_967_296.0;
    for lane in 0..LANES {
        for word in 0..WEIGHTS {
            let [low, high] = halves(word).map(|at| rows[at][lane] as f32);
            values[word][lane] += high * (UPPER * wide) + low * wide;
        }
        let [weight, weight_squared] = halves(WEIGHTS).map(|at| rows[at][lane] as f32);
        values[SUM_WEIGHT][lane] += weight * half;
        values[SUM_WEIGHT_SQUARED][lane] += weight_squared * half;
    }
}

/// Of the first `columns` of every other sums those that are chosen (not 0), and `empty` in the place of others.
#[inline(always)]
fn every_other<'a>(
    sums: &'a [Packed],
    columns: usize,
    is_chosen: &Words,
    empty: &'a Packed,
) -> [&'a Packed; LANES] {
    let mut records = [empty; LANES];
    // All but where rows end: without a bound to look at for each.
    if let (LANES, Some(sums)) = (columns, sums.first_chunk::<{ 2 * LANES - 1 }>()) {
        for lane in 0..LANES {
            records[lane] = if is_chosen[lane] != 0 { &sums[2 * lane] } else { empty };
        }
    } else {
        for (lane, sums) in sums.iter().step_by(2).take(columns).enumerate() {
            records[lane] = if is_chosen[lane] != 0 { sums } else { empty };
        }
    }
    records
}

/// The surface that a pixel shows most of.
struct Most {
    bins: Bins,
    /// Samples of all of the pixel's surfaces.
    all: u32,
    /// Of those that look as the eye does, the surface's, and all.
    seen: u32,
    seen_all: u32,
}

/// What is known of sixteen pixels, every other of a row from the one whose number and place are given; of them the first `columns` are in the
/// picture. `several` is scratch.
#[inline(always)]
fn pixel_lanes(
    tree: &Quadtree,
    start: usize,
    columns: usize,
    place: (usize, usize),
    mixed: &mut Vec<Mixed>,
    several: &mut [(Packed, High); LANES],
    found: &mut [Lanes; FIELDS],
) {
    let has_wide = !tree.wide.is_empty();
    let none = u32::from(NONE);
    let [own_bins, more_bins]: [Words; 2] = tree.narrow.bins_of_every_other(start, columns);
    let [wide_bins, more_wide_bins] =
        if has_wide { tree.wide.bins_of_every_other(start, columns) } else { [[none; LANES]; 2] };
    let mut known = Known::default();
    let [mut alone, mut alone_wide, mut many] = [[0_u32; LANES]; 3];
    for lane in 0..LANES {
        let (own, more, wide, wide_more) =
            (own_bins[lane], more_bins[lane], wide_bins[lane], more_wide_bins[lane]);
        let is_both = (own != none) & (wide != none);
        let is_apart = is_both & (own.abs_diff(wide) > u32::from(gap_allowed(0)));
        let is_many = (more != none) | (wide_more != none) | is_apart;
        many[lane] = u32::from(is_many);
        alone[lane] = u32::from(!is_many & (own != none));
        alone_wide[lane] = u32::from(!is_many & (wide != none));
        known.first[lane] = own.min(wide);
        known.last[lane] = if is_both { own.max(wide) } else { own.min(wide) };
    }
    let empty = Packed::zeroed();
    let mut records = every_other(tree.narrow.nearest_from(start), columns, &alone, &empty);
    if many != [0; LANES] {
        for lane in 0..columns {
            if many[lane] != 0 {
                let place = (place.0 + 2 * lane, place.1);
                let found =
                    several_surfaces(tree, start + 2 * lane, place, mixed, &mut several[lane]);
                (known.first[lane], known.last[lane]) =
                    (found.bins.first.into(), found.bins.last.into());
                (known.all[lane], known.seen[lane], known.seen_all[lane]) =
                    (found.all, found.seen, found.seen_all);
            }
        }
        for lane in 0..columns {
            if many[lane] != 0 {
                records[lane] = &several[lane].0;
            }
        }
    }
    let several = &*several;
    let high = |lane: usize| {
        if many[lane] != 0 {
            Some(&several[lane].1)
        } else {
            high_alone(&tree.narrow, start, lane, &alone)
        }
    };
    let mut sums = values(&records, tree.isa, high);
    let own_count = sums[SUM_COUNT];
    if has_wide {
        records = every_other(tree.wide.nearest_from(start), columns, &alone_wide, &empty);
        let wide =
            values(&records, tree.isa, |lane| high_alone(&tree.wide, start, lane, &alone_wide));
        for (sums, wide) in sums.iter_mut().zip(&wide) {
            for lane in 0..LANES {
                sums[lane] += wide[lane];
            }
        }
    }
    moments(&sums, &own_count, &known, found);
}

/// Parts above those of one of every other pixel's nearest bin, if it is chosen (not 0) and has some.
#[inline(always)]
fn high_alone<'a>(
    bins: &'a PixelBins,
    start: usize,
    lane: usize,
    is_chosen: &Words,
) -> Option<&'a High> {
    if is_chosen[lane] != 0 { bins.high_of_nearest(start + 2 * lane) } else { None }
}

/// What is known of sixteen pixels besides their sums.
#[derive(Default)]
struct Known {
    first: Words,
    last: Words,
    /// Of pixels with several surfaces: samples of all; 0: there is one surface.
    all: Words,
    seen: Words,
    seen_all: Words,
}

/// What the sums of sixteen pixels tell: of samples that look as the eye does, which `own_count` counts, and, if there are any, of others.
///
/// In single precision: variances are differences of numbers that agree in all but the last bits where samples have no noise, but are then below
/// what RGBE's steps are taken for.
#[inline(always)]
fn moments(sums: &Values, own_count: &Lanes, known: &Known, found: &mut [Lanes; FIELDS]) {
    for lane in 0..LANES {
        let value = |number: usize| sums[number][lane];
        let (weight, weight_squared, count) =
            (value(SUM_WEIGHT), value(SUM_WEIGHT_SQUARED), value(SUM_COUNT));
        let part = 1.0 / greater(weight, 1.0);
        let scale = 1.0 / (1_u64 << COLOUR_FRACTION) as f32;
        let mean = [0, 1, 2].map(|channel| value(channel) * scale * part);
        let luminance_squared =
            value(LUMINANCE_SQUARED) * (1.0 / (LUMINANCE_SCALE * LUMINANCE_SCALE)) * part;
        let compressed = value(COMPRESSED) * (1.0 / COMPRESSED_SCALE) * part;
        let compressed_scale = 1.0 / (COMPRESSED_SCALE * COMPRESSED_SCALE);
        let compressed_squared = value(COMPRESSED_SQUARED) * compressed_scale * part;
        let bright = luminance(mean);
        let some = if count < 2.0 { 0.0 } else { weight };
        let spread_luminance = greater(luminance_squared - bright * bright, 0.0) * some;
        let spread_compressed = greater(compressed_squared - compressed * compressed, 0.0) * some;
        found[MEAN][lane] = mean[0];
        found[MEAN + 1][lane] = mean[1];
        found[MEAN + 2][lane] = mean[2];
        found[MEAN + 3][lane] = compressed;
        found[ERROR][lane] = weight_squared.sqrt() * part;
        found[FIRST][lane] = known.first[lane] as f32;
        found[LAST][lane] = known.last[lane] as f32;
        found[NEAR][lane] = value(SUM_NEAR);
        found[WEIGHT][lane] = weight;
        found[WEIGHT_SQUARED][lane] = weight_squared;
        found[COUNT][lane] = count;
        let is_one = known.all[lane] == 0;
        let own_count = own_count[lane];
        found[ALL][lane] = if is_one { count } else { known.all[lane] as f32 };
        found[SEEN][lane] = if is_one { own_count } else { known.seen[lane] as f32 };
        found[SEEN_ALL][lane] = if is_one { own_count } else { known.seen_all[lane] as f32 };
        found[SPREAD_LUMINANCE][lane] = spread_luminance;
        found[SPREAD_COMPRESSED][lane] = spread_compressed;
        let noise = own_noise(count, weight, weight_squared, spread_luminance, spread_compressed);
        found[WITHIN_LUMINANCE][lane] = noise[0];
        found[WITHIN_COMPRESSED][lane] = noise[1];
        found[FREEDOM][lane] = noise[2];
    }
}

/// Of a pixel with several bins: the surface that it shows most of, and its sums. Its other ones are added to `mixed`.
#[inline(never)]
fn several_surfaces(
    tree: &Quadtree,
    pixel: usize,
    (column, row): (usize, usize),
    mixed: &mut Vec<Mixed>,
    most: &mut (Packed, High),
) -> Most {
    // Mostly bins side by side are of one surface.
    if !tree.wide.has(pixel)
        && let Some(bins) = join_alone(tree.narrow.of(pixel), most)
    {
        let count = most.0.count();
        return Most { bins, all: count, seen: count, seen_all: count };
    }
    let mut found = [(Bins::of(NONE), Sums::default()); BINS_KEPT];
    let mut count = 0;
    for (bin, sums) in merged(&tree.narrow, &tree.wide, pixel) {
        match found[..count].last_mut() {
            Some((bins, joined)) if adjacent(bins.last, bin, gap_allowed(0)) => {
                joined.join(&sums);
                bins.last = bin;
            }
            _ => {
                found[count] = (Bins::of(bin), sums);
                count += 1;
            }
        }
    }
    let (found, front) = (&found[..count], found[0].0);
    let near = |(bins, sums): &(Bins, Sums)| {
        let behind = bins.first.saturating_sub(front.first);
        let halvings = if tree.params.viewpoint_radius.is_none() {
            usize::from(behind / BINS_AN_OCTAVE)
        } else {
            0
        };
        sums.near()
            .iter()
            .skip(halvings.min(NEAR_CLASSES - 1))
            .map(|&count| count as f32)
            .sum::<f32>()
    };
    let (mut chosen, mut nearest) = (0, 0.0);
    for (number, surface) in found.iter().enumerate() {
        if near(surface) > nearest {
            (chosen, nearest) = (number, near(surface));
        }
    }
    let mut known = nearest;
    for (_, surface) in found.iter().enumerate().filter(|&(number, _)| number != chosen) {
        let part = near(surface);
        if part > 0.0 {
            known += part;
            mixed.push(Mixed::new(column, row, part / known, surface));
        }
    }
    let (bins, sums) = found[chosen];
    let [mut seen, mut seen_all] = [0; 2];
    for (bin, sums) in tree.narrow.of(pixel) {
        seen_all += sums.count();
        seen += if bins.first <= bin && bin <= bins.last { sums.count() } else { 0 };
    }
    *most = sums.packed();
    Most { bins, all: found.iter().map(|(_, sums)| sums.count()).sum(), seen, seen_all }
}

/// The bins of a pixel and the sums of all of them, if they are of one surface.
#[inline(always)]
fn join_alone<'a>(
    mut bins: impl Iterator<Item = (u16, Kept<'a>)>,
    joined: &mut (Packed, High),
) -> Option<Bins> {
    let (first, sums) = bins.next()?;
    (joined.0, joined.1) = (*sums.packed, sums.high.copied().unwrap_or_default());
    let mut last = first;
    for (bin, sums) in bins {
        if !adjacent(last, bin, gap_allowed(0)) {
            return None;
        }
        if !joined.0.join(sums.packed) {
            let (packed, high) = &*joined;
            let mut all = Kept { packed, high: packed.has_high().then_some(high) }.sums();
            all.join(&sums.sums());
            *joined = all.packed();
        }
        last = bin;
    }
    Some(Bins { first, last })
}

impl Mixed {
    #[inline(always)]
    fn new(column: usize, row: usize, part: f32, (bins, sums): &(Bins, Sums)) -> Self {
        let Moments { weight, weight_squared, mean: [r, g, b], compressed, .. } = sums.moments();
        let own = Own {
            mean: [r as f32, g as f32, b as f32, compressed as f32],
            error: (weight_squared.sqrt() / weight) as f32,
            first: f32::from(bins.first),
            last: f32::from(bins.last),
        };
        Self { column, row, part, own }
    }
}
