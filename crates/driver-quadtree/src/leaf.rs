//! Which leaf a pixel's surface is averaged over: variance against bias, by the samples themselves.
//!
//! Lepski's rule (Lepski 1991; as intersection of confidence intervals, Katkovnik 1999): from the
//! finest leaf upwards, a coarser one is taken as long as its confidence interval meets those of all
//! finer ones. Where the picture is flat the intervals go on meeting, and noise is averaged out.
//! Elsewhere they part once the samples can tell. Samples without noise have intervals of no width
//! and stay in their pixels. As samples grow every interval shrinks, so every pixel that is not flat
//! ends with its own mean. What else was tried: docs/notes/quadtree.md.
//!
//! Invariant: only samples of one surface are averaged: bins connected to the pixel's own.

use crate::LeafSize;
use crate::pyramid::Level;
use crate::sums::luminance;
use crate::surface::{Bins, Deviation, Surface, gap_allowed};
use glam::Vec4;
use std::cell::Cell;

/// Half-width of an interval of the mean root of luminance, in standard errors.
pub(crate) const KAPPA: f32 = 2.2;
/// Half-width of an interval of a mean channel, in standard errors. Radiance has heavy tails, and
/// the root of luminance tells most edges. This one sees differences of hue, and means that differ
/// though most samples do not.
pub(crate) const KAPPA_LINEAR: f32 = 4.0;
/// Intervals of n samples are wider by 1 + FEW_SAMPLES · (relative variance + PLAIN_TAIL) / n. The
/// mean is far from normal until n outgrows the relative variance of one sample.
const FEW_SAMPLES: f32 = 4.0;
const PLAIN_TAIL: f32 = 0.2;
/// Degrees of freedom wanted of an estimate of noise. With 12 of them an estimate goes up and down
/// with the pixel's own mean, which darkened pictures of one-path samples by 3 to 6 %.
const NOISE_FREEDOM: f32 = 256.0;
/// RGBE keeps a colour to about this part of its largest channel. Smaller differences are not the
/// picture's.
const QUANTUM: f32 = 0.004;
/// Below this part of the mean root a half-width is not seen, and no larger leaf is tried: 2.4 % of
/// luminance, a standard error of 1.1 %.
const UNSEEN: f32 = 0.006;
/// Columns of pixels that share the noise found last.
const NOISE_COLUMNS: usize = 4;

/// Weighted mean over neighbouring leaves of one level, of one surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blend {
    /// Mean colour and, last, mean root of luminance.
    pub mean: Vec4,
    /// Standard error for samples of unit deviation: √Σw² / Σw. Infinite if few of many samples make
    /// the mean of one of the leaves.
    pub error: f32,
    /// Whether quarters of one of the leaves differ by more than noise.
    is_mixed: bool,
}

/// Noise of a surface's samples around a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Noise {
    /// Half-widths of intervals for a standard error of 1: of the channels and of the root.
    pub half_widths: Vec4,
    /// By how much few samples widen intervals: times the squared standard error for samples of
    /// unit deviation.
    few_samples: f32,
}

/// A leaf whose noise is known. Most neighbours ask for the same leaf's, and climbing the levels to
/// find it takes a good part of a drawing's time.
#[derive(Clone, Copy)]
struct KnownNoise {
    level: usize,
    column: usize,
    row: usize,
    bins: Bins,
    noise: Noise,
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

    /// Narrows it by another interval. Returns the share of that interval's width that is common to
    /// all; 0 if nothing is.
    #[inline(always)]
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

/// Reads colours of a band of pixels from a pyramid.
///
/// Pixels are read in a fixed order, row by row, so the noise remembered from one to the next
/// changes no picture by chance.
pub(crate) struct Reader<'a> {
    pub levels: &'a [Level],
    leaf: LeafSize,
    /// Noise found last, of every [`NOISE_COLUMNS`] columns.
    known: Vec<Cell<Option<KnownNoise>>>,
}

impl<'a> Reader<'a> {
    pub fn new(levels: &'a [Level], leaf: LeafSize) -> Self {
        let parts = levels.first().map_or(0, |level| level.width.div_ceil(NOISE_COLUMNS));
        Self { levels, leaf, known: vec![Cell::new(None); parts] }
    }

    /// Returns the leaf of a level around a pixel.
    #[inline(always)]
    pub fn leaf(&self, level: usize, column: usize, row: usize) -> &'a [Surface] {
        self.levels[level].leaf(column >> level, row >> level)
    }

    /// Returns the colour at a pixel of the surface that has `bins` in the pixel's leaf of level
    /// `start`: the mean over the leaves that noise asks for.
    pub fn colour(&self, column: usize, row: usize, start: usize, bins: Bins) -> [f32; 3] {
        if let LeafSize::Fixed(level) = self.leaf {
            let level = start.max(usize::from(level)).min(self.levels.len() - 1);
            let blend = self.blend(column, row, level, bins);
            return blend.map_or([0.0; 3], |blend| blend.mean.truncate().to_array());
        }
        let noise = self.noise(column, row, start, bins);
        let mut common = Intersection::everything();
        let mut best = Vec4::ZERO;
        for level in start..self.levels.len() {
            let Some(blend) = self.blend(column, row, level, bins) else { break };
            if level > start && (blend.is_mixed || blend.error == f32::INFINITY) {
                break;
            }
            let error = if blend.is_mixed { f32::INFINITY } else { blend.error };
            let width = error * (1.0 + noise.few_samples * error * error);
            let half = noise.half_widths * width;
            let common_share = common.narrow(blend.mean, half);
            // The finest leaf counts as a whole: the difference of its bounds is rounded.
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

    /// Returns the noise of the surface around a pixel, from the smallest leaf that has enough
    /// samples.
    #[inline(always)]
    pub fn noise(&self, column: usize, row: usize, start: usize, bins: Bins) -> Noise {
        let place = &self.known[column / NOISE_COLUMNS];
        let is_same = |known: &KnownNoise| {
            known.level >= start
                && known.column == column >> known.level
                && known.row == row >> known.level
                && known.bins.first <= bins.first
                && bins.first <= known.bins.last
        };
        let known = place.get().filter(is_same).unwrap_or_else(|| {
            let found = self.find_noise(column, row, start, bins);
            place.set(Some(found));
            found
        });
        known.noise
    }

    #[inline(never)]
    fn find_noise(&self, column: usize, row: usize, start: usize, bins: Bins) -> KnownNoise {
        let (mut level, mut found_bins, mut mean) = (start, bins, [0.0; 4]);
        let mut deviation = Deviation { luminance: 0.0, root: 0.0, freedom: -1.0 };
        for number in start..self.levels.len() {
            let Some(own) = own_surface(self.leaf(number, column, row), bins) else { break };
            let found = own.deviation();
            if found.freedom > deviation.freedom {
                (level, found_bins, mean, deviation) = (number, own.bins, own.mean, found);
            }
            if deviation.freedom >= NOISE_FREEDOM {
                break;
            }
        }
        let [r, g, b, root] = mean;
        let brightest = r.max(g).max(b);
        // Noise is mostly of brightness: a channel's share of it is its share of the colour.
        let relative = deviation.luminance / luminance([r, g, b]).max(f32::MIN_POSITIVE);
        let channel = |mean: f32| KAPPA_LINEAR * (relative * mean).max(QUANTUM * brightest);
        let noise = Noise {
            half_widths: Vec4::new(
                channel(r),
                channel(g),
                channel(b),
                KAPPA * deviation.root.max(0.25 * QUANTUM * root),
            ),
            few_samples: FEW_SAMPLES * (relative * relative + PLAIN_TAIL),
        };
        let (column, row) = (column >> level, row >> level);
        KnownNoise { level, column, row, bins: found_bins, noise }
    }

    /// Returns the mean of one surface around a pixel at one level, leaves weighted bilinearly by
    /// the nearness of their middles. `None` if the pixel's leaf does not have the surface.
    ///
    /// Bilinear weights centre the mean on the pixel: a gradient is then not biased, and no blocks
    /// show.
    #[inline(always)]
    pub fn blend(&self, column: usize, row: usize, level: usize, bins: Bins) -> Option<Blend> {
        let leaves = &self.levels[level];
        let own = own_surface(leaves.leaf(column >> level, row >> level), bins)?;
        if level == 0 {
            let error = own.error_squared.sqrt() / own.weight;
            return Some(Blend { mean: Vec4::from_array(own.mean), error, is_mixed: false });
        }
        let gap = gap_allowed(level);
        let (near, far) = (own.bins.first.saturating_sub(gap), own.bins.last.saturating_add(gap));
        let (columns, column_weights) = neighbours(column, level, leaves.width);
        let (rows, row_weights) = neighbours(row, level, leaves.height);
        let (mut weight, mut error_squared, mut sum) = (0.0_f32, 0.0_f32, Vec4::ZERO);
        let mut is_mixed = false;
        for (&leaf_row, row_weight) in rows.iter().zip(row_weights) {
            for (&leaf_column, column_weight) in columns.iter().zip(column_weights) {
                let share = row_weight * column_weight;
                for surface in leaves.leaf(leaf_column, leaf_row) {
                    if surface.bins.last < near || surface.bins.first > far {
                        continue;
                    }
                    let part = share * surface.weight;
                    weight += part;
                    error_squared += share * share * surface.error_squared;
                    is_mixed |= surface.is_mixed;
                    sum += part * Vec4::from_array(surface.mean);
                }
            }
        }
        let scale = weight.recip();
        Some(Blend { mean: sum * scale, error: error_squared.sqrt() * scale, is_mixed })
    }
}

/// Returns the surface of a leaf that holds a surface of one of its pixels.
#[inline(always)]
pub(crate) fn own_surface(leaf: &[Surface], bins: Bins) -> Option<&Surface> {
    leaf.iter().find(|surface| surface.bins.first <= bins.first && bins.first <= surface.bins.last)
}

/// Returns the two leaves along one direction whose middles a pixel's middle lies between, and
/// their bilinear weights.
#[inline(always)]
pub(crate) fn neighbours(pixel: usize, level: usize, leaves: usize) -> ([usize; 2], [f32; 2]) {
    let own = pixel >> level;
    let size = 1_usize << level;
    let offset = (2 * (pixel & (size - 1)) + 1) as f32 / (2 * size) as f32 - 0.5;
    let other = if offset < 0.0 { own.saturating_sub(1) } else { (own + 1).min(leaves - 1) };
    ([own, other], [1.0 - offset.abs(), offset.abs()])
}

/// Returns the nearest surface of a leaf that lies at most `gap` bins beside `bins`.
pub(crate) fn beside(leaf: &[Surface], bins: Bins, gap: u16) -> Option<&Surface> {
    leaf.iter().find(|surface| {
        surface.bins.first <= bins.last.saturating_add(gap)
            && bins.first <= surface.bins.last.saturating_add(gap)
    })
}
