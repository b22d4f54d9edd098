//! One surface in one leaf: moments of its samples, and their noise.
//!
//! Adjacent depth bins belong to one surface, so no mean is taken across a jump in depth.
//!
//! Invariant: moments depend only on the bins' sums and on the order of joining leaves, which is
//! fixed.

use crate::bins::FAR;
use crate::sums::{BinSums, Moments, luminance};
use holo_picture::LUMINANCE_WEIGHTS;
use std::borrow::Borrow;

/// Least number of degrees of freedom of an estimate of noise from finer leaves. With fewer, a leaf
/// uses its own spread.
const ENOUGH_FREEDOM: f32 = 6.0;
/// Relative variance of a leaf's samples above which few of them make its mean: 1 in 32 or fewer.
/// See docs/notes/quadtree.md.
const FEW_OF: f32 = 32.0;
// The next three numbers define when a leaf is mixed. docs/notes/quadtree.md explains how they were
// chosen.
/// Least ratio of the variance between quarters to the variance expected from the spread within
/// them. This is the F-ratio of an analysis of variance (Fisher 1925).
const MIXED_RATIO: f32 = 8.0;
/// Least ratio of the spread between quarters to the spread within them, so that a slow gradient
/// over a large leaf does not count.
const MIXED_SHARE: f32 = 0.1;
/// Least number of effective samples, less one for each quarter.
const MIXED_SAMPLES: f32 = 20.0;
/// Relative deviation of the root of luminance that comes from RGBE's steps alone.
const MIXED_STEP: f32 = 0.001;

/// The depth bins of a surface, first and last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bins {
    pub first: u16,
    pub last: u16,
}

impl Bins {
    /// Returns one bin alone.
    #[inline(always)]
    pub fn of(bin: u16) -> Self {
        Self { first: bin, last: bin }
    }
}

/// Returns the largest step, in bins, within one surface in a leaf of a level. The depth of a
/// slanted surface varies more across a larger leaf.
#[inline(always)]
pub(crate) fn gap_allowed(level: usize) -> u16 {
    1 + level.min(3) as u16
}

/// Returns whether a surface that ends at bin `end` continues at bin `next`.
#[inline(always)]
pub(crate) fn adjacent(end: u16, next: u16, gap: u16) -> bool {
    next <= end || (next < FAR && next - end <= gap)
}

/// One surface in a leaf. A "spread" is Σ w (x − mean)².
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafSurface {
    pub bins: Bins,
    /// Number of samples.
    pub count: u32,
    pub weight: f32,
    pub weight_squared: f32,
    /// Means of red, green, blue and the fourth root of luminance.
    pub mean: [f32; 4],
    spread_luminance: f32,
    spread_root: f32,
    /// The part of `spread_root` that lies between the leaf's four quarters; 0 for a pixel.
    spread_between: f32,
    noise: LeafNoise,
    /// True if few of the samples make the mean of a leaf larger than a pixel. These samples may
    /// see a lamp, and smaller leaves show where it shines. No light is lost if pixels do not use
    /// the mean, because neither the bright part of the leaf nor the dark part uses it.
    pub is_of_few: bool,
    /// True if the quarters of the leaf differ by more than noise. The mean then fits none of them.
    pub is_mixed: bool,
}

/// Noise of samples about the means of the smallest leaves that have enough samples. So the
/// picture's own variation across larger leaves does not count. Each leaf counts by its degrees of
/// freedom.
#[derive(Clone, Copy, Debug)]
struct LeafNoise {
    /// Sum of freedom × variance of luminance.
    luminance: f32,
    /// Sum of freedom × *deviation* of the root. So the few leaves that an edge crosses raise the
    /// mean little. (For luminance the variance is needed, because rare bright samples make most of
    /// it.)
    root: f32,
    /// Effective number of samples less the number of means.
    freedom: f32,
}

/// Standard deviations of one sample of mean weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deviation {
    pub luminance: f32,
    pub root: f32,
    /// Degrees of freedom of the estimate.
    pub freedom: f32,
}

impl LeafSurface {
    /// Returns the surface of a pixel's bins with these sums.
    #[inline(always)]
    fn of_pixel(bins: Bins, sums: &BinSums) -> Self {
        let Moments { weight, weight_squared, mean, luminance_squared, root, root_squared } =
            sums.moments();
        let ([r, g, b], [wr, wg, wb]) = (mean, LUMINANCE_WEIGHTS.map(f64::from));
        let mean_luminance = wr * r + wg * g + wb * b;
        let spread = |square: f64, mean: f64| {
            if sums.count < 2 { 0.0 } else { ((square - mean * mean).max(0.0) * weight) as f32 }
        };
        let mut surface = Self {
            bins,
            count: sums.count,
            weight: weight as f32,
            weight_squared: weight_squared as f32,
            mean: [r as f32, g as f32, b as f32, root as f32],
            spread_luminance: spread(luminance_squared, mean_luminance),
            spread_root: spread(root_squared, root),
            spread_between: 0.0,
            noise: LeafNoise { luminance: 0.0, root: 0.0, freedom: 0.0 },
            is_of_few: false,
            is_mixed: false,
        };
        surface.noise = surface.own_noise();
        surface
    }

    /// Returns the surface of a whole leaf that so far has this quarter only.
    #[inline(always)]
    pub fn of_quarter(&self) -> Self {
        Self { spread_between: 0.0, ..*self }
    }

    /// Adds another quarter's part of the same surface (the update of Chan, Golub & LeVeque 1979).
    #[inline(always)]
    pub fn join(&mut self, other: &Self) {
        let weight = self.weight + other.weight;
        let part = other.weight / weight;
        let cross = self.weight * part;
        let luminance_step = other.luminance() - self.luminance();
        let root_step = other.mean[3] - self.mean[3];
        let between = root_step * root_step * cross;
        self.spread_luminance += other.spread_luminance + luminance_step * luminance_step * cross;
        self.spread_root += other.spread_root + between;
        self.spread_between += between;
        for (mean, new) in self.mean.iter_mut().zip(other.mean) {
            *mean += (new - *mean) * part;
        }
        self.weight = weight;
        self.weight_squared += other.weight_squared;
        self.count = self.count.saturating_add(other.count);
        self.bins.first = self.bins.first.min(other.bins.first);
        self.bins.last = self.bins.last.max(other.bins.last);
        self.noise.luminance += other.noise.luminance;
        self.noise.root += other.noise.root;
        self.noise.freedom += other.noise.freedom;
    }

    /// Returns the complete surface of a leaf larger than a pixel.
    #[inline(always)]
    pub fn closed(mut self) -> Self {
        if self.noise.freedom < ENOUGH_FREEDOM {
            self.noise = self.own_noise();
        }
        let mean = self.luminance();
        self.is_of_few = self.spread_luminance > FEW_OF * mean * mean * self.weight;
        self.is_mixed = self.has_different_quarters();
        self
    }

    /// Returns the noise as the spread about the leaf's own mean.
    #[inline(always)]
    fn own_noise(&self) -> LeafNoise {
        let freedom = self.weight * self.weight / self.weight_squared - 1.0;
        // Σw − Σw²/Σw: times the variance, this is the expectation of the spread.
        let divisor = self.weight - self.weight_squared / self.weight;
        if self.count < 2 || freedom <= 0.0 || divisor <= 0.0 {
            return LeafNoise { luminance: 0.0, root: 0.0, freedom: 0.0 };
        }
        LeafNoise {
            luminance: freedom * self.spread_luminance / divisor,
            root: freedom * (self.spread_root / divisor).sqrt(),
            freedom,
        }
    }

    #[inline(always)]
    fn has_different_quarters(&self) -> bool {
        let between = self.spread_between;
        // One mean for each quarter is subtracted. Three of the four means are free.
        let freedom = self.weight * self.weight / self.weight_squared - 4.0;
        let step = MIXED_STEP * self.mean[3];
        let within = (self.spread_root - between).max(0.0) + step * step * self.weight;
        freedom > MIXED_SAMPLES
            && between > MIXED_SHARE * within
            && between * freedom > MIXED_RATIO * 3.0 * within
    }

    /// Returns the squared standard error of the mean for samples of unit deviation, times the
    /// squared weight. Infinite if few of the samples make the mean.
    #[inline(always)]
    pub fn error_squared(&self) -> f32 {
        if self.is_of_few { f32::INFINITY } else { self.weight_squared }
    }

    #[inline(always)]
    fn luminance(&self) -> f32 {
        let [r, g, b, _] = self.mean;
        luminance([r, g, b])
    }

    /// Returns the standard deviations of one sample about the mean in this leaf: of luminance over
    /// its mean, and of its root. They include the picture's own variation.
    pub fn total_deviation(&self) -> (f32, f32) {
        let divisor = (self.weight - self.weight_squared / self.weight).max(f32::MIN_POSITIVE);
        let mean = self.luminance().max(f32::MIN_POSITIVE);
        ((self.spread_luminance / divisor).sqrt() / mean, (self.spread_root / divisor).sqrt())
    }

    /// Returns the noise of the surface's samples; 0 if it is not known.
    pub fn deviation(&self) -> Deviation {
        let LeafNoise { luminance, root, freedom } = self.noise;
        let scale = if freedom > 0.0 { 1.0 / freedom } else { 0.0 };
        Deviation { luminance: (luminance * scale).sqrt(), root: root * scale, freedom }
    }
}

/// Appends the surfaces of one pixel's bins, which come nearest first.
#[inline(always)]
pub(crate) fn of_pixel<S: Borrow<BinSums>>(
    bins: impl Iterator<Item = (u16, S)>,
    surfaces: &mut Vec<LeafSurface>,
) {
    let mut bins = bins.peekable();
    while let Some((first, sums)) = bins.next() {
        let mut last = first;
        let mut next = || {
            let (bin, sums) = bins.next_if(|(bin, _)| adjacent(last, *bin, gap_allowed(0)))?;
            last = bin;
            Some(sums)
        };
        // Most surfaces have one bin, and its sums need no copy.
        let surface = match next() {
            None => LeafSurface::of_pixel(Bins::of(first), sums.borrow()),
            Some(second) => {
                let mut joined = *sums.borrow();
                joined.join(second.borrow());
                while let Some(more) = next() {
                    joined.join(more.borrow());
                }
                LeafSurface::of_pixel(Bins { first, last }, &joined)
            }
        };
        surfaces.push(surface);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::sums::Colour;
    use holo_section::{RayCoords, Sample};

    /// A leaf of four pixels, each with so many samples of its own mean times a random number.
    fn leaf(means: [f32; 4], samples: usize, mut random: impl FnMut() -> f32) -> LeafSurface {
        let mut quarters = means.map(|mean| {
            let mut sums = BinSums::default();
            for _ in 0..samples {
                let rgb = [mean * random(); 3];
                let sample = Sample::encode(RayCoords::default(), rgb, 1.0, 1.0, 0x8000_0000);
                sums.add(&Colour::from_rgbe(sample.rgbe), 64, None);
            }
            LeafSurface::of_pixel(Bins::of(7), &sums).of_quarter()
        });
        let (whole, others) = quarters.split_first_mut().unwrap();
        others.iter().for_each(|quarter| whole.join(quarter));
        whole.closed()
    }

    #[test]
    fn quarters_that_differ_are_told_from_noise() {
        let mut state = 9_u32;
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state.rotate_left(11) as f32 + 0.5) / 2.0_f32.powi(32)
        };
        let mut mixed = |means: [f32; 4], samples: usize, noise: fn(f32) -> f32| {
            (0..500).filter(|_| leaf(means, samples, || noise(uniform())).is_mixed).count()
        };
        let even: fn(f32) -> f32 = |u| 0.9 + 0.2 * u;
        let exponential: fn(f32) -> f32 = |u| -u.ln();
        let of_one_path: fn(f32) -> f32 = |u| if u < 0.9 { 0.1 } else { 9.0 };
        // At most one leaf of equal quarters in a hundred: at five standard errors 16 of 500.
        for noise in [even, exponential, of_one_path] {
            for samples in [2, 6, 30] {
                assert!(mixed([1.0; 4], samples, noise) <= 16, "{samples}");
            }
        }
        // Bars before panes, with little noise and with as much noise as light.
        assert_eq!(mixed([3.0, 1.0, 3.0, 1.0], 7, even), 500);
        assert!(mixed([9.0, 1.0, 9.0, 1.0], 30, exponential) > 450);
        // Few samples, differences far below the spread, and steps of stored colours do not count.
        assert_eq!(mixed([3.0, 1.0, 3.0, 1.0], 4, even), 0);
        assert_eq!(mixed([1.0, 1.03, 1.0, 1.03], 3000, exponential), 0);
        assert_eq!(mixed([1.0, 1.003, 1.0, 1.003], 30, |_| 1.0), 0);
        // Mixed leaves that are alike are alike quarters of a larger leaf.
        let closed = |mut surface: LeafSurface, parts: &[LeafSurface]| {
            parts.iter().for_each(|part| surface.join(part));
            surface.closed()
        };
        let bars = leaf([3.0, 1.0, 3.0, 1.0], 7, || 1.0).of_quarter();
        assert!(!closed(bars, &[]).is_mixed);
        assert!(!closed(bars, &[bars; 3]).is_mixed);
        assert!(closed(bars, &[leaf([9.0; 4], 7, || 1.0).of_quarter()]).is_mixed);
    }
}
