//! Which leaf a pixel's surface is averaged over: variance against bias, by the samples themselves.
//!
//! Lepski's rule (Lepski 1991; as intersection of confidence intervals, Katkovnik 1999): from the finest leaf upwards,
//! a coarser one is taken as long as its confidence interval meets those of all finer ones. Where the picture is flat the
//! intervals go on meeting and noise is averaged; where it is not, they part once the samples can tell. Samples without
//! noise have intervals of no width and stay in their pixels; as samples grow every interval shrinks, so every pixel that
//! is not flat ends with its own mean. Leaves whose mean one sample in 32 or fewer make, as those that see a lamp do, are not taken.
//!
//! Invariant: only samples of one surface are averaged: bins connected to the pixel's own.

use crate::paint::TILE;
use crate::pyramid::Level;
use crate::sums::luminance;
use crate::surface::{Bins, Deviation, Surface, gap_allowed};
use crate::{LeafSize, QuadtreeParams};
use glam::Vec4;
use std::cell::Cell;

/// Half-width of an interval of mean compressed luminance, in standard errors.
pub(crate) const KAPPA: f32 = 2.2;
/// Half-width of an interval of a mean channel, in standard errors: plain radiance has heavy tails, and the compressed
/// luminance tells most edges. This one sees differences of hue, and means that differ though most samples do not.
pub(crate) const KAPPA_LINEAR: f32 = 4.0;
/// Intervals are wider by 1 + FEW_SAMPLES · (relative variance + PLAIN_TAIL) / n, for n samples: as long as n is not well
/// above the relative variance of one, the mean is far from normal (n has to outgrow the square of the skewness).
pub(crate) const FEW_SAMPLES: f32 = 4.0;
pub(crate) const PLAIN_TAIL: f32 = 0.2;
// Tried, as error over that of the best fixed size, with samples of one path, of 64, and without noise, 0.1 to 64 a pixel
// (tests/leaf_size.rs prints such a table): without FEW_SAMPLES 1.0 to 1.1 clean but 2.4 to 17 with one path, whose bright
// samples stay alone in their pixels; with 1 in place of the relative variance 1.1 to 1.5 clean and 1.2 to 2.7 with one path;
// noise by mean variance instead of mean deviation 1.5 to 2.1 clean; the last accepted leaf alone, instead of the soft
// step, up to 1.6 with exponential noise, where it now is 1.3.
/// Degrees of freedom wanted of an estimate of noise: with 12 of them an estimate goes up and down with the pixel's own
/// mean, which darkened pictures of one-path samples by 3 to 6 %.
pub(crate) const NOISE_FREEDOM: f32 = 256.0;
/// RGBE keeps a colour to about this part of its largest channel: differences below are not the picture's.
pub(crate) const QUANTUM: f32 = 0.004;
/// A half-width below this part of the mean compressed luminance (2.4 % of luminance, a standard error of 1.1 %) is not seen:
/// no larger leaf is tried.
pub(crate) const UNSEEN: f32 = 0.006;

/// Weighted mean over neighbouring leaves of one level, of one surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blend {
    /// Mean colour and, last, compressed luminance.
    pub mean: Vec4,
    /// Standard error for samples of unit deviation: √Σw² / Σw. Infinite if few of many samples make the mean of one of the leaves.
    pub error: f32,
    /// Whether quarters of one of the leaves differ by more than noise.
    pub is_mixed: bool,
}

impl Blend {
    /// Its error where it is to be shown: infinite of what is not.
    pub fn error_of_shown(&self) -> f32 {
        if self.is_mixed { f32::INFINITY } else { self.error }
    }
}

/// What is known of the noise of samples.
#[derive(Clone, Copy)]
pub(crate) struct Noise {
    /// Half-widths of intervals for a standard error of 1: of the channels and, last, of compressed luminance.
    pub half_widths: Vec4,
    /// By how much intervals are wider for few samples: times the standard error squared for samples of unit deviation.
    pub few_samples: f32,
}

/// Running intersection of intervals, one for each thing compared.
struct Intersection {
    low: Vec4,
    high: Vec4,
}

impl Intersection {
    fn everything() -> Self {
        Self { low: Vec4::NEG_INFINITY, high: Vec4::INFINITY }
    }

    /// Narrows it by another interval: the share of that interval's width that is common to all, 0 if nothing is.
    #[inline]
    fn narrow(&mut self, middle: Vec4, half: Vec4) -> f32 {
        self.low = self.low.max(middle - half);
        self.high = self.high.min(middle + half);
        let left = self.high - self.low;
        // An interval without width is common wholly or not at all.
        let point = Vec4::select(left.cmpge(Vec4::ZERO), Vec4::ONE, Vec4::ZERO);
        let share = Vec4::select(half.cmpgt(Vec4::ZERO), 0.5 * left / half, point);
        share.min_element().clamp(0.0, 1.0)
    }
}

/// Reads colours from a pyramid.
pub(crate) struct Reader<'a> {
    pub levels: &'a [Level],
    params: &'a QuadtreeParams,
    /// The noise found last, and whose it is, of every [`NOISE_COLUMNS`] columns of a tile.
    last_noise: [Cell<Noise>; TILE / NOISE_COLUMNS],
    last_place: [Cell<NoisePlace>; TILE / NOISE_COLUMNS],
    /// Highest level that was averaged over since it was last set.
    pub reach: Cell<usize>,
}

/// Columns of pixels that noise is remembered for together: where samples are many, it is that of leaves of so many pixels, which a tile, drawn
/// row by row, comes back to.
const NOISE_COLUMNS: usize = 4;

/// Which of them a column of the picture lies in, counted in its tile.
#[inline(always)]
fn noise_part(column: usize) -> usize {
    column % TILE / NOISE_COLUMNS
}

/// The leaf whose noise was found last, and its bins: pixels side by side mostly ask for the same, and climbing the levels is a good
/// part of a drawing's time. Pixels are read in a fixed order, so this changes no picture by chance.
#[derive(Clone, Copy)]
struct NoisePlace {
    level: usize,
    column: usize,
    row: usize,
    bins: Bins,
}

/// No leaf's.
const NO_PLACE: NoisePlace =
    NoisePlace { level: 0, column: usize::MAX, row: usize::MAX, bins: Bins { first: 1, last: 0 } };
const NO_NOISE: Noise = Noise { half_widths: Vec4::ZERO, few_samples: 0.0 };

impl<'a> Reader<'a> {
    pub fn new(levels: &'a [Level], params: &'a QuadtreeParams) -> Self {
        Self {
            levels,
            params,
            last_noise: [const { Cell::new(NO_NOISE) }; TILE / NOISE_COLUMNS],
            last_place: [const { Cell::new(NO_PLACE) }; TILE / NOISE_COLUMNS],
            reach: Cell::new(0),
        }
    }

    /// Colour at a pixel of the surface that has `bins` in the pixel's leaf of level `start`.
    pub fn colour(&self, column: usize, row: usize, start: usize, bins: Bins) -> [f32; 3] {
        if let LeafSize::Fixed(level) = self.params.leaf {
            let level = start.max(usize::from(level)).min(self.levels.len() - 1);
            return self
                .blend(column, row, level, bins)
                .map_or([0.0; 3], |blend| blend.mean.truncate().to_array());
        }
        let noise = self.noise(column, row, start, bins);
        self.mean(column, row, start, bins, &noise)
    }

    /// The mean over the leaves that noise asks for.
    pub fn mean(
        &self,
        column: usize,
        row: usize,
        start: usize,
        bins: Bins,
        noise: &Noise,
    ) -> [f32; 3] {
        let few_samples = noise.few_samples;
        let mut common = Intersection::everything();
        let mut best = Vec4::ZERO;
        for level in start..self.levels.len() {
            let Some(blend) = self.blend(column, row, level, bins) else { break };
            let error = blend.error_of_shown();
            if level > start && error == f32::INFINITY {
                break;
            }
            let width = error * (1.0 + few_samples * error * error);
            let half = noise.half_widths * width;
            let common_share = common.narrow(blend.mean, half);
            // The finest leaf as a whole: the difference of its bounds is rounded.
            let share = if level == start { 1.0 } else { common_share };
            if share == 0.0 {
                break;
            }
            best += share * (blend.mean - best);
            if half.w < UNSEEN * blend.mean.w {
                break;
            }
        }
        best.truncate().to_array()
    }

    /// Forgets the noise found last: no tile depends on others.
    pub fn begin_tile(&self) {
        self.last_place.iter().for_each(|place| place.set(NO_PLACE));
    }

    /// Noise of the surface around a pixel: from the smallest leaf that has samples enough.
    #[inline(always)]
    pub fn noise(&self, column: usize, row: usize, start: usize, bins: Bins) -> Noise {
        let part = noise_part(column);
        let place = self.last_place[part].get();
        let is_near = (place.level >= start)
            & (place.column == column >> place.level)
            & (place.row == row >> place.level)
            & (place.bins.first <= bins.first)
            & (bins.first <= place.bins.last);
        if is_near {
            self.last_noise[part].get()
        } else {
            self.find_noise(column, row, start, bins)
        }
    }

    #[inline(never)]
    fn find_noise(&self, column: usize, row: usize, start: usize, bins: Bins) -> Noise {
        let mut found_at = (start, bins);
        let mut deviation = Deviation { luminance: 0.0, compressed: 0.0, freedom: -1.0 };
        let mut mean = [0.0; 4];
        for (number, level) in self.levels.iter().enumerate().skip(start) {
            let Some(own) = own_surface(level.leaf(column >> number, row >> number), bins) else {
                break;
            };
            let found = own.deviation(number);
            if found.freedom > deviation.freedom {
                (deviation, mean) = (found, own.mean);
                found_at = (number, own.bins);
            }
            if deviation.freedom >= NOISE_FREEDOM {
                break;
            }
        }
        let [r, g, b, compressed] = mean;
        let brightest = r.max(g).max(b);
        // Noise is mostly brightness: a channel's share of it is its share of the colour.
        let relative = deviation.luminance / luminance([r, g, b]).max(f32::MIN_POSITIVE);
        let channel = |mean: f32| KAPPA_LINEAR * (relative * mean).max(QUANTUM * brightest);
        let noise = Noise {
            half_widths: Vec4::new(
                channel(r),
                channel(g),
                channel(b),
                KAPPA * deviation.compressed.max(0.25 * QUANTUM * compressed),
            ),
            few_samples: FEW_SAMPLES * (relative * relative + PLAIN_TAIL),
        };
        let (level, bins) = found_at;
        let part = noise_part(column);
        self.last_place[part].set(NoisePlace {
            level,
            column: column >> level,
            row: row >> level,
            bins,
        });
        self.last_noise[part].set(noise);
        noise
    }

    /// Mean of one surface around a pixel at one level, leaves weighted bilinearly by the nearness of their middles.
    ///
    /// Bilinear weights centre the mean on the pixel: a gradient is then not biased, and no blocks show.
    pub fn blend(&self, column: usize, row: usize, level: usize, bins: Bins) -> Option<Blend> {
        let leaves = &self.levels[level];
        let own = own_surface(leaves.leaf(column >> level, row >> level), bins)?;
        if level > self.reach.get() {
            self.reach.set(level);
        }
        if level == 0 {
            return Some(Blend {
                mean: Vec4::from_array(own.mean),
                error: own.weight_squared.sqrt() / own.weight,
                is_mixed: false,
            });
        }
        let gap = gap_allowed(level);
        let (near, far) = (own.bins.first.saturating_sub(gap), own.bins.last.saturating_add(gap));
        let (columns, column_weights) = neighbours(column, level, leaves.width);
        let (rows, row_weights) = neighbours(row, level, leaves.height);
        let (mut weight, mut weight_squared, mut sum, mut is_mixed) =
            (0.0_f32, 0.0_f32, Vec4::ZERO, false);
        for (&leaf_row, row_weight) in rows.iter().zip(row_weights) {
            for (&leaf_column, column_weight) in columns.iter().zip(column_weights) {
                let share = row_weight * column_weight;
                for surface in leaves.leaf(leaf_column, leaf_row) {
                    if surface.bins.last < near || surface.bins.first > far {
                        continue;
                    }
                    let part = share * surface.weight;
                    weight += part;
                    weight_squared += share * share * surface.weight_squared_of_mean();
                    is_mixed |= surface.is_mixed();
                    sum += part * Vec4::from_array(surface.mean);
                }
            }
        }
        let scale = weight.recip();
        Some(Blend { mean: sum * scale, error: weight_squared.sqrt() * scale, is_mixed })
    }
}

/// The surface of a leaf that holds a surface of one of its pixels.
pub(crate) fn own_surface(leaf: &[Surface], bins: Bins) -> Option<&Surface> {
    leaf.iter().find(|surface| surface.bins.first <= bins.first && bins.first <= surface.bins.last)
}

/// The two leaves whose middles a pixel's middle lies between, along one direction, and their bilinear weights.
pub(crate) fn neighbours(pixel: usize, level: usize, leaves: usize) -> ([usize; 2], [f32; 2]) {
    let own = pixel >> level;
    let size = 1_usize << level;
    let offset = (2 * (pixel & (size - 1)) + 1) as f32 / (2 * size) as f32 - 0.5;
    let other = if offset < 0.0 { own.saturating_sub(1) } else { (own + 1).min(leaves - 1) };
    ([own, other], [1.0 - offset.abs(), offset.abs()])
}

/// The nearest surface of a leaf that lies at most `gap` bins beside `bins`.
pub(crate) fn beside(leaf: &[Surface], bins: Bins, gap: u16) -> Option<&Surface> {
    leaf.iter().find(|surface| {
        surface.bins.first <= bins.last.saturating_add(gap)
            && bins.first <= surface.bins.last.saturating_add(gap)
    })
}
