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
use crate::blend::{Blend, Blender, own_surface};
use crate::pyramid::Level;
use crate::sums::luminance;
use crate::surface::{Bins, Deviation, Surface};
use glam::Vec4;

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
        // An interval without width is common wholly or not at all.
        let least = Vec4::splat(f32::MIN_POSITIVE);
        let share = (0.5 * (self.high - self.low) + least) / (half + least);
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
    known: Vec<Option<KnownNoise>>,
    blender: Blender<'a>,
}

impl<'a> Reader<'a> {
    pub fn new(levels: &'a [Level], leaf: LeafSize) -> Self {
        let parts = levels.first().map_or(0, |level| level.width.div_ceil(NOISE_COLUMNS));
        Self { levels, leaf, known: vec![None; parts], blender: Blender::new(levels) }
    }

    /// Returns the leaf of a level around a pixel.
    #[inline(always)]
    pub fn leaf(&self, level: usize, column: usize, row: usize) -> &'a [Surface] {
        self.levels[level].leaf(column >> level, row >> level)
    }

    /// Returns the colour at a pixel of the surface that has `bins` in the pixel's leaf of level
    /// `start`: the mean over the leaves that noise asks for.
    pub fn colour(&mut self, column: usize, row: usize, start: usize, bins: Bins) -> [f32; 3] {
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
            // A mean that is of none of the leaf's parts, or of few of its samples, is no pixel's.
            let is_any = blend.is_mixed || blend.error_squared == f32::INFINITY;
            if level > start && is_any {
                break;
            }
            let error_squared = if is_any { f32::INFINITY } else { blend.error_squared };
            let width = error_squared.sqrt() * (1.0 + noise.few_samples * error_squared);
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
    pub fn noise(&mut self, column: usize, row: usize, start: usize, bins: Bins) -> Noise {
        let place = &self.known[column / NOISE_COLUMNS];
        let is_same = |known: &KnownNoise| {
            known.level >= start
                && known.column == column >> known.level
                && known.row == row >> known.level
                && known.bins.first <= bins.first
                && bins.first <= known.bins.last
        };
        if let Some(known) = place.as_ref().filter(|known| is_same(known)) {
            return known.noise;
        }
        let found = self.find_noise(column, row, start, bins);
        self.known[column / NOISE_COLUMNS] = Some(found);
        found.noise
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

    /// As [`Blender::blend`].
    #[inline(always)]
    pub fn blend(&mut self, column: usize, row: usize, level: usize, bins: Bins) -> Option<Blend> {
        self.blender.blend(column, row, level, bins)
    }
}
