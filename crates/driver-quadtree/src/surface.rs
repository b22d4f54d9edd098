//! What is known of one surface in one leaf: moments of its samples.
//!
//! Depth bins are one surface while they are adjacent, so no mean is ever taken across a jump in depth.
//!
//! Invariant: moments are functions of the bins' sums and of the order in which leaves are joined, which is fixed.

use crate::bins::FAR;
use crate::sums::{Moments, NEAR_CLASSES, Summed, luminance};
use bytemuck::{Pod, Zeroable, cast};

/// Degrees of freedom that an estimate of noise from finer leaves needs before a leaf's own spread is not used for it.
pub(crate) const ENOUGH_FREEDOM: f32 = 6.0;

/// A mean that so small a part of a leaf's samples make, all others being dark beside them, is shown by none of its pixels: where it shines
/// smaller leaves tell. It may be a lamp; samples of noise alone, one in so many of which finds all light, are not told apart from that, and
/// stay in the smaller leaves too. Either way no light is lost, since the bright part of the leaf does without the larger one as the dark
/// part does. On recorded walks relative variances of one path are up to 4 in leaves without lamps, and 34 to 400 in those with; with 12 in
/// place of 32 one-path samples of dark corners stayed dots, and the means over frames were the same.
pub(crate) const FEW_OF: f32 = 32.0;

/// A leaf's quarters are of different brightness, as its samples tell, if the variance between them (of compressed luminance) is so many times
/// what samples within them spread lets expect (the F-ratio of an analysis of variance, Fisher 1925),
pub(crate) const MIXED_F: f32 = 8.0;
/// if it is this part of that spread at least: a gradient over a large leaf is told by any number of samples and does no harm, since leaves are
/// blended,
pub(crate) const MIXED_PART: f32 = 0.1;
/// and if there are more samples than that, beyond one for each quarter: with few, one bright one of noise alone makes its quarter differ.
///
/// Such a mean is of none of the leaf's quarters, and no pixel takes it but an empty one that knows nothing smaller: without, the bars of a
/// window came out of it long before its panes did, and the window was too bright until they did. On the same samples of recorded sessions of a
/// cabin, 5 to 80 a pixel, display PSNR rose by 0.1 to 0.6 dB; on those of a room that is known, clean, of 16 paths and of one, 0.003 to 3 a
/// pixel, by 0.2 on average and 0.7 at most, and fell by 0.01 at most. From 8 samples on, without regard to the part, those of one path lost up
/// to 1.4 dB; with a ratio of 5 and 32 samples, up to 0.3. Where samples are noisy, whole pictures take up to 14 % longer.
pub(crate) const MIXED_SAMPLES: f32 = 20.0;
/// Standard deviation of compressed luminance, over it, that is taken for none: that of RGBE's steps.
pub(crate) const MIXED_STEP: f32 = 0.001;

/// The depth bins of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Bins {
    pub first: u16,
    pub last: u16,
}

impl Bins {
    /// One alone.
    #[inline(always)]
    pub fn of(bin: u16) -> Self {
        Self { first: bin, last: bin }
    }
}

/// One surface in a leaf: moments of its samples. "Spread" is Σ w (x − mean)².
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Surface {
    pub bins: Bins,
    pub count: u32,
    pub weight: f32,
    pub weight_squared: f32,
    /// Means of the colour and, last, of compressed luminance.
    pub mean: [f32; 4],
    spread_luminance: f32,
    spread_compressed: f32,
    /// Of a single pixel, samples that pass near the eye, as [`Summed::near`] has them; of larger leaves, [`Within`], as bits: noise about
    /// the means of the smallest leaves that have enough samples to tell, without the picture's own variation across larger leaves.
    near_or_within: [u32; NEAR_CLASSES],
}

/// With what a pyramid keeps beside it, a surface is one cache line.
const _: () = assert!(size_of::<Surface>() == 56);

/// Noise pooled over small leaves, each counting by its degrees of freedom.
#[derive(Clone, Copy, Debug, Default, Zeroable)]
struct Within {
    /// Sum of freedom × variance.
    luminance: f32,
    /// Sum of freedom × *deviation*: the few leaves that an edge crosses, where the picture itself spreads, then raise the
    /// mean little. (Tails of plain luminance are too heavy for that: rare bright samples are most of its variance.)
    compressed: f32,
    /// Effective number of samples less the number of means.
    freedom: f32,
    /// Of this leaf alone: the part of its samples' spread of compressed luminance that lies between its quarters.
    between: f32,
}

impl Within {
    #[inline(always)]
    fn to_bits(self) -> [u32; NEAR_CLASSES] {
        [
            self.luminance.to_bits(),
            self.compressed.to_bits(),
            self.freedom.to_bits(),
            self.between.to_bits(),
        ]
    }

    #[inline(always)]
    fn from_bits(bits: [u32; NEAR_CLASSES]) -> Self {
        let [luminance, compressed, freedom, between] = bits.map(f32::from_bits);
        Self { luminance, compressed, freedom, between }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self {
            luminance: self.luminance + other.luminance,
            compressed: self.compressed + other.compressed,
            freedom: self.freedom + other.freedom,
            between: self.between + other.between,
        }
    }
}

/// Standard deviations of one sample of mean weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deviation {
    pub luminance: f32,
    pub compressed: f32,
    /// Degrees of freedom of the estimate.
    pub freedom: f32,
}

impl Surface {
    #[inline(always)]
    pub fn new(bins: Bins, sums: &impl Summed) -> Self {
        let Moments {
            weight,
            weight_squared,
            mean: [r, g, b],
            luminance_squared,
            compressed,
            compressed_squared,
        } = sums.moments();
        let mean_luminance = 0.265 * r + 0.670 * g + 0.065 * b;
        let variance = luminance_squared - mean_luminance * mean_luminance;
        let spread_luminance = (variance.max(0.0) * weight) as f32;
        let spread_compressed =
            ((compressed_squared - compressed * compressed).max(0.0) * weight) as f32;
        // Chosen, not skipped: which pixels have one sample no processor can tell beforehand.
        let is_one = sums.count() < 2;
        let (spread_luminance, spread_compressed) = (
            if is_one { 0.0 } else { spread_luminance },
            if is_one { 0.0 } else { spread_compressed },
        );
        Self {
            bins,
            count: sums.count(),
            weight: weight as f32,
            weight_squared: weight_squared as f32,
            mean: [r as f32, g as f32, b as f32, compressed as f32],
            spread_luminance,
            spread_compressed,
            near_or_within: sums.near(),
        }
    }

    /// Samples of a single pixel's surface that pass near the eye, as [`Summed::near`] has them.
    #[inline(always)]
    pub fn near(&self) -> [u32; NEAR_CLASSES] {
        self.near_or_within
    }

    /// The surface of a leaf of level `number` as part of a larger leaf's.
    #[inline(always)]
    pub fn risen(&self, number: usize) -> Self {
        let within = Within { between: 0.0, ..self.within(number) };
        Self { near_or_within: within.to_bits(), ..*self }
    }

    /// Noise of a leaf of level `number`.
    #[inline(always)]
    fn within(&self, number: usize) -> Within {
        if number == 0 { self.own_noise() } else { Within::from_bits(self.near_or_within) }
    }

    /// Adds a neighbour's part of the same surface, both [`risen`](Self::risen) (the update of Chan, Golub & LeVeque 1979).
    #[inline(always)]
    pub fn join(&mut self, other: &Self) {
        let weight = self.weight + other.weight;
        let part = other.weight / weight;
        let cross = self.weight * part;
        let luminance_step = other.luminance() - self.luminance();
        let compressed_step = other.mean[3] - self.mean[3];
        self.spread_luminance += other.spread_luminance + luminance_step * luminance_step * cross;
        let between = compressed_step * compressed_step * cross;
        self.spread_compressed += other.spread_compressed + between;
        for (mean, new) in self.mean.iter_mut().zip(other.mean) {
            *mean += (new - *mean) * part;
        }
        self.weight = weight;
        self.weight_squared += other.weight_squared;
        self.count = self.count.saturating_add(other.count);
        self.bins = Bins {
            first: self.bins.first.min(other.bins.first),
            last: self.bins.last.max(other.bins.last),
        };
        let within =
            Within::from_bits(self.near_or_within).plus(Within::from_bits(other.near_or_within));
        self.near_or_within = Within { between: within.between + between, ..within }.to_bits();
    }

    /// Sum of squared weights, as the error of a mean over larger leaves is told by it: infinite where one in [`FEW_OF`] samples, or
    /// fewer, make the mean.
    #[inline(always)]
    pub fn weight_squared_of_mean(&self) -> f32 {
        let mean = self.luminance();
        let is_of_few = self.spread_luminance > FEW_OF * mean * mean * self.weight;
        if is_of_few { f32::INFINITY } else { self.weight_squared }
    }

    /// The same of a mean that pixels show: infinite, too, where the leaf's quarters differ by more than noise.
    #[inline(always)]
    pub fn weight_squared_of_shown(&self) -> f32 {
        if self.is_mixed() { f32::INFINITY } else { self.weight_squared_of_mean() }
    }

    /// Whether the quarters of a leaf that is larger than a pixel differ by more than noise.
    #[inline(always)]
    pub fn is_mixed(&self) -> bool {
        let between = Within::from_bits(self.near_or_within).between;
        // Less one mean for each quarter, of which three are free. (A quarter of several surfaces has more, if the leaf joins them: few do.)
        let freedom = self.weight * self.weight / self.weight_squared - 4.0;
        let step = MIXED_STEP * self.mean[3];
        let within = (self.spread_compressed - between).max(0.0) + step * step * self.weight;
        (freedom > MIXED_SAMPLES)
            & (between > MIXED_PART * within)
            & (between * freedom > MIXED_F * 3.0 * within)
    }

    #[inline(always)]
    fn luminance(&self) -> f32 {
        let [r, g, b, _] = self.mean;
        luminance([r, g, b])
    }

    /// A surface joined of several, complete.
    #[inline(always)]
    pub fn closed(self) -> Self {
        // A branch that is mostly foreseen: alone, its own noise takes as long as joining it took.
        if self.lacks_freedom() { self.with_own_noise() } else { self }
    }

    /// The same without a branch, for many side by side.
    #[inline(always)]
    pub fn closed_among_many(self) -> Self {
        Self::chosen(self.lacks_freedom(), self.with_own_noise(), self)
    }

    #[inline(always)]
    fn lacks_freedom(&self) -> bool {
        Within::from_bits(self.near_or_within).freedom < ENOUGH_FREEDOM
    }

    #[inline(always)]
    fn with_own_noise(self) -> Self {
        let between = Within::from_bits(self.near_or_within).between;
        Self { near_or_within: Within { between, ..self.own_noise() }.to_bits(), ..self }
    }

    /// One of two. For the sake of many side by side, number by number.
    #[inline(always)]
    pub fn chosen(is_first: bool, first: Self, second: Self) -> Self {
        let one = |first: f32, second: f32| if is_first { first } else { second };
        Self {
            bins: Bins {
                first: if is_first { first.bins.first } else { second.bins.first },
                last: if is_first { first.bins.last } else { second.bins.last },
            },
            count: if is_first { first.count } else { second.count },
            weight: one(first.weight, second.weight),
            weight_squared: one(first.weight_squared, second.weight_squared),
            mean: [
                one(first.mean[0], second.mean[0]),
                one(first.mean[1], second.mean[1]),
                one(first.mean[2], second.mean[2]),
                one(first.mean[3], second.mean[3]),
            ],
            spread_luminance: one(first.spread_luminance, second.spread_luminance),
            spread_compressed: one(first.spread_compressed, second.spread_compressed),
            near_or_within: chosen(is_first, first.near_or_within, second.near_or_within),
        }
    }

    /// From the words that it is made of, by their number.
    #[inline(always)]
    pub fn from_words(word: impl Fn(usize) -> u32) -> Self {
        let number = |at: usize| f32::from_bits(word(at));
        Self {
            bins: cast(word(0)),
            count: word(1),
            weight: number(2),
            weight_squared: number(3),
            mean: [number(4), number(5), number(6), number(7)],
            spread_luminance: number(8),
            spread_compressed: number(9),
            near_or_within: [word(10), word(11), word(12), word(13)],
        }
    }

    /// Gives the words that it is made of, by their number.
    #[inline(always)]
    pub fn to_words(self, mut put: impl FnMut(usize, u32)) {
        let [red, green, blue, compressed] = self.mean;
        let [a, b, c, d] = self.near_or_within;
        put(0, cast(self.bins));
        put(1, self.count);
        put(2, self.weight.to_bits());
        put(3, self.weight_squared.to_bits());
        put(4, red.to_bits());
        put(5, green.to_bits());
        put(6, blue.to_bits());
        put(7, compressed.to_bits());
        put(8, self.spread_luminance.to_bits());
        put(9, self.spread_compressed.to_bits());
        put(10, a);
        put(11, b);
        put(12, c);
        put(13, d);
    }

    /// Noise as the spread about the leaf's own mean.
    #[inline(always)]
    fn own_noise(&self) -> Within {
        let freedom = self.weight * self.weight / self.weight_squared - 1.0;
        // Σw − Σw²/Σw: its product with a variance is the spread expected.
        let divisor = self.weight - self.weight_squared / self.weight;
        let is_none = (self.count < 2) | (freedom <= 0.0) | (divisor <= 0.0);
        let luminance = freedom * self.spread_luminance / divisor;
        let compressed = freedom * (self.spread_compressed / divisor).sqrt();
        // Chosen, as in `new`.
        let chosen = |value: f32| if is_none { 0.0 } else { value };
        Within {
            luminance: chosen(luminance),
            compressed: chosen(compressed),
            freedom: chosen(freedom),
            between: 0.0,
        }
    }

    /// Standard deviations of one sample about the surface's mean in this leaf, noise and the picture's own variation
    /// together: of luminance over its mean, and of compressed luminance.
    pub fn total_deviation(&self) -> (f32, f32) {
        let divisor = (self.weight - self.weight_squared / self.weight).max(f32::MIN_POSITIVE);
        let mean = self.luminance().max(f32::MIN_POSITIVE);
        ((self.spread_luminance / divisor).sqrt() / mean, (self.spread_compressed / divisor).sqrt())
    }

    /// The noise of its samples, as far as it can be told, in a leaf of level `number`.
    pub fn deviation(&self, number: usize) -> Deviation {
        let within = self.within(number);
        let scale = if within.freedom > 0.0 { 1.0 / within.freedom } else { 0.0 };
        Deviation {
            luminance: (within.luminance * scale).sqrt(),
            compressed: within.compressed * scale,
            freedom: within.freedom,
        }
    }
}

#[inline(always)]
fn chosen(is_first: bool, [a, b, c, d]: [u32; 4], second: [u32; 4]) -> [u32; 4] {
    let one = |first: u32, second: u32| if is_first { first } else { second };
    [one(a, second[0]), one(b, second[1]), one(c, second[2]), one(d, second[3])]
}

/// Adds to `surfaces` those of one pixel's bins, which are given nearest first.
#[inline(always)]
pub(crate) fn of_pixel<S: Summed>(
    bins: impl Iterator<Item = (u16, S)>,
    surfaces: &mut Vec<Surface>,
) {
    let mut bins = bins.peekable();
    while let Some((first, sums)) = bins.next() {
        let mut last = first;
        let mut next = || {
            let (bin, sums) = bins.next_if(|(bin, _)| adjacent(last, *bin, gap_allowed(0)))?;
            last = bin;
            Some(sums)
        };
        // Mostly there is one bin, whose sums are not copied.
        let surface = match next() {
            None => Surface::new(Bins::of(first), &sums),
            Some(second) => {
                let mut joined = sums.sums();
                joined.join(&second.sums());
                while let Some(more) = next() {
                    joined.join(&more.sums());
                }
                Surface::new(Bins { first, last }, &joined)
            }
        };
        surfaces.push(surface);
    }
}

/// Steps from one bin to the next that still are one surface: a slanted surface drops further across a larger leaf.
#[inline(always)]
pub(crate) fn gap_allowed(level: usize) -> u16 {
    1 + level.min(3) as u16
}

/// Whether a surface that ends at one bin goes on at another.
#[inline(always)]
pub(crate) fn adjacent(end: u16, next: u16, gap: u16) -> bool {
    next <= end || (next < FAR && next - end <= gap)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::bins::PixelBins;
    use crate::sums::Colour;
    use holo_section::{RayCoords, Sample};

    /// A leaf of four pixels with so many samples each, of a mean of its own times a random number.
    fn leaf(means: [f32; 4], samples: usize, mut random: impl FnMut() -> f32) -> Surface {
        let quarters = means.map(|mean| {
            let mut bins = PixelBins::new(1);
            for _ in 0..samples {
                let sample = Sample::encode(
                    RayCoords::default(),
                    [mean * random(); 3],
                    1.0,
                    1.0,
                    0x8000_0000,
                );
                bins.add(0, 7, &Colour::from_rgbe(sample.rgbe), 64, None);
            }
            Surface::new(Bins::of(7), &bins.of(0).next().unwrap().1).risen(0)
        });
        let mut whole = quarters[0];
        quarters[1..].iter().for_each(|quarter| whole.join(quarter));
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
            (0..500).filter(|_| leaf(means, samples, || noise(uniform())).is_mixed()).count()
        };
        let even: fn(f32) -> f32 = |u| 0.9 + 0.2 * u;
        let exponential: fn(f32) -> f32 = |u| -u.ln();
        let of_one_path: fn(f32) -> f32 = |u| if u < 0.9 { 0.1 } else { 9.0 };
        // Of alike quarters one in a hundred at most: at five standard errors 16 of 500.
        for noise in [even, exponential, of_one_path] {
            for samples in [2, 6, 30] {
                assert!(mixed([1.0; 4], samples, noise) <= 16, "{samples}");
            }
        }
        // Bars before panes, with little noise and with as much as the light itself.
        assert_eq!(mixed([3.0, 1.0, 3.0, 1.0], 7, even), 500);
        assert!(mixed([9.0, 1.0, 9.0, 1.0], 30, exponential) > 450);
        // Few samples tell nothing, any number of them nothing of what is below their spread, and steps of colours are none.
        assert_eq!(mixed([3.0, 1.0, 3.0, 1.0], 4, even), 0);
        assert_eq!(mixed([1.0, 1.03, 1.0, 1.03], 3000, exponential), 0);
        assert_eq!(mixed([1.0, 1.003, 1.0, 1.003], 30, |_| 1.0), 0);
        // Alike leaves of different quarters are alike quarters of a larger leaf, and one that is its only part is no difference.
        let bars = leaf([3.0, 1.0, 3.0, 1.0], 7, || 1.0).risen(1);
        assert!(!bars.is_mixed());
        let mut larger = bars;
        (0..3).for_each(|_| larger.join(&bars));
        assert!(!larger.is_mixed());
        let mut beside = bars;
        beside.join(&leaf([9.0; 4], 7, || 1.0).risen(1));
        assert!(beside.is_mixed());
    }
}
