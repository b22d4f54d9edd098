//! Chooses the size of the leaf over which a pixel's surface is averaged: a larger leaf has less
//! variance and more bias.
//!
//! This is Lepski's rule (Lepski 1991; as intersection of confidence intervals, Katkovnik 1999).
//! From the finest leaf upwards, a coarser one is used as long as its confidence interval meets
//! those of all finer ones. Where the picture is flat, the intervals meet, and noise is averaged
//! out. Elsewhere they separate once there are enough samples. Samples without noise have intervals
//! of no width and stay in their pixels. As the number of samples grows, every interval shrinks. So
//! every pixel that is not flat ends with its own mean. docs/notes/quadtree.md lists other rules
//! that were tried.
//!
//! Invariant: only samples of one surface are averaged: those in bins connected to the pixel's own.

use crate::LeafSize;
use crate::blend::{Blender, LeafBlend, own_surface};
use crate::pyramid::PyramidLevel;
use crate::sums::luminance;
use crate::surface::{Bins, Deviation, LeafSurface};
use glam::Vec4;

/// Half-width of an interval of the mean root of luminance, in standard errors.
pub(crate) const KAPPA: f32 = 2.2;
/// Half-width of an interval of a mean channel, in standard errors. The root of luminance finds
/// most edges, because radiance has heavy tails. Channels find differences of hue, and means that
/// differ although most samples do not.
pub(crate) const KAPPA_LINEAR: f32 = 4.0;
/// Intervals of n samples are wider by 1 + FEW_SAMPLES · (relative variance + PLAIN_TAIL) / n. The
/// mean is far from normal until n outgrows the relative variance of one sample.
const FEW_SAMPLES: f32 = 4.0;
const PLAIN_TAIL: f32 = 0.2;
/// Degrees of freedom that are enough for an estimate of noise. With 12, the estimate depended on
/// the pixel's own mean, which darkened pictures of one-path samples by 3 to 6 %.
const NOISE_FREEDOM: f32 = 256.0;
/// Relative step of RGBE colours, as a share of the largest channel. Smaller differences come from
/// rounding.
const QUANTUM: f32 = 0.004;
/// Half-width, as a share of the mean root, below which noise is not visible and no larger leaf is
/// tried. It is 2.4 % of luminance, a standard error of 1.1 %.
const INVISIBLE: f32 = 0.006;

/// Noise of a surface's samples around a pixel.
#[derive(Clone, Copy)]
pub(crate) struct PixelNoise {
    /// Half-widths of intervals for a standard error of 1: of the channels and of the root.
    pub half_widths: Vec4,
    /// Relative widening of intervals with few samples, for a squared standard error of 1.
    few_samples: f32,
}

/// Running intersection of confidence intervals, for three channels and the root of luminance.
struct Intersection {
    low: Vec4,
    high: Vec4,
}

impl Intersection {
    fn everything() -> Self {
        Self { low: Vec4::NEG_INFINITY, high: Vec4::INFINITY }
    }

    /// Intersects with another interval. Returns the share of the other interval that is common to
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

/// Reads colours of pixels from a pyramid.
pub(crate) struct LeafReader<'a> {
    pub levels: &'a [PyramidLevel],
    leaf: LeafSize,
    blender: Blender<'a>,
}

impl<'a> LeafReader<'a> {
    pub fn new(levels: &'a [PyramidLevel], leaf: LeafSize) -> Self {
        Self { levels, leaf, blender: Blender::new(levels) }
    }

    /// Returns the leaf of a level around a pixel.
    #[inline(always)]
    pub fn leaf(&self, level: usize, column: usize, row: usize) -> &'a [LeafSurface] {
        self.levels[level].leaf(column >> level, row >> level)
    }

    /// Returns the colour of a surface at a pixel: the mean over leaves as large as its noise
    /// needs. The surface has `bins` in the pixel's leaf of level `start`.
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
            // The mean of a mixed leaf fits none of its quarters. A mean that few samples make may
            // come from a lamp. Pixels use neither mean.
            let is_unusable = blend.is_mixed || blend.error_squared == f32::INFINITY;
            if level > start && is_unusable {
                break;
            }
            let error_squared = if is_unusable { f32::INFINITY } else { blend.error_squared };
            let width = error_squared.sqrt() * (1.0 + noise.few_samples * error_squared);
            let half = noise.half_widths * width;
            let common_share = common.narrow(blend.mean, half);
            // The finest leaf counts in full. Its share is 1 except for rounding.
            let share = if level == start { 1.0 } else { common_share };
            if share == 0.0 {
                break;
            }
            best += share * (blend.mean - best);
            if half.w < INVISIBLE * blend.mean.w {
                break;
            }
        }
        best.truncate().to_array()
    }

    /// Returns the noise of the surface around a pixel, from the smallest leaf that has enough
    /// samples.
    pub fn noise(&self, column: usize, row: usize, start: usize, bins: Bins) -> PixelNoise {
        let mut mean = [0.0; 4];
        let mut deviation = Deviation { luminance: 0.0, root: 0.0, freedom: -1.0 };
        for level in start..self.levels.len() {
            let Some(own) = own_surface(self.leaf(level, column, row), bins) else { break };
            let found = own.deviation();
            if found.freedom > deviation.freedom {
                (mean, deviation) = (own.mean, found);
            }
            if deviation.freedom >= NOISE_FREEDOM {
                break;
            }
        }
        let [r, g, b, root] = mean;
        let brightest = r.max(g).max(b);
        // Noise is mostly of brightness, so a channel's noise is in proportion to its mean.
        let relative = deviation.luminance / luminance([r, g, b]).max(f32::MIN_POSITIVE);
        let channel = |mean: f32| KAPPA_LINEAR * (relative * mean).max(QUANTUM * brightest);
        PixelNoise {
            half_widths: Vec4::new(
                channel(r),
                channel(g),
                channel(b),
                KAPPA * deviation.root.max(0.25 * QUANTUM * root),
            ),
            few_samples: FEW_SAMPLES * (relative * relative + PLAIN_TAIL),
        }
    }

    /// As [`Blender::blend`].
    #[inline(always)]
    pub fn blend(
        &mut self,
        column: usize,
        row: usize,
        level: usize,
        bins: Bins,
    ) -> Option<LeafBlend> {
        self.blender.blend(column, row, level, bins)
    }
}
