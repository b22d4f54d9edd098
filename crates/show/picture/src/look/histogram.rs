//! A histogram of the luminances of a picture, on a logarithmic scale.
//!
//! Invariants: all sums are integers, so neither the order of pixels nor the number of threads
//! changes a bit. Black, infinite and NaN luminances do not count.

use rayon::prelude::*;
use std::sync::LazyLock;

use holo_color::luminance;

/// Bins for each doubling of luminance: 0.038 decades, a little finer than the paper's.
pub(super) const BINS_PER_OCTAVE: usize = 8;

/// Binary logarithm of the least luminance that counts: that of the least normal number.
pub(super) const LEAST_LOG: i32 = -126;

/// Number of bins. They cover all normal numbers.
pub(super) const BINS: usize = 254 * BINS_PER_OCTAVE;

/// Fraction bits of a logarithm. The sum over 2²⁶ pixels then fits 64 bits.
const LOG_BITS: u32 = 20;

/// Bits of the mantissa that index the table of logarithms.
const TABLE_BITS: u32 = 10;

/// Most that the logarithm of an outlier may differ from the median's: a factor of 100. So neither
/// a lamp nor a dark crack decides how a room is shown.
const OUTLIER_LOG: f64 = 6.643_856_189_774_724;

/// Pixels that a thread takes at a time.
pub(super) const CHUNK: usize = 1 << 14;

/// Binary logarithms of 1 to 2, with [`LOG_BITS`] fraction bits.
static LOGS: LazyLock<Vec<i32>> = LazyLock::new(|| {
    let steps = 1_i32 << TABLE_BITS;
    let log = |i: i32| (1.0 + f64::from(i) / f64::from(steps)).log2();
    (0..=steps).map(|i| (log(i) * f64::from(1 << LOG_BITS)).round() as i32).collect()
});

/// Returns the binary logarithm of a positive normal number as a fixed-point number, exact to 1e-6.
#[inline]
fn fixed_log2(x: f32, table: &[i32]) -> i64 {
    const REST_BITS: u32 = 23 - TABLE_BITS;
    let bits = x.to_bits();
    let exponent = (bits >> 23) as i64 - 127;
    let mantissa = bits & 0x007f_ffff;
    let index = (mantissa >> REST_BITS) as usize;
    let rest = (mantissa & ((1 << REST_BITS) - 1)) as i32;
    let step = ((table[index + 1] - table[index]) * rest) >> REST_BITS;
    (exponent << LOG_BITS) + i64::from(table[index] + step)
}

/// Returns the binary logarithm of a luminance. Black and NaN count as the least luminance of
/// [`LEAST_LOG`], infinity as 128.
#[inline]
pub(super) fn log2(luminance: f32) -> f32 {
    let least = f32::MIN_POSITIVE;
    let bounded = if luminance > least { luminance.min(f32::MAX) } else { least };
    fixed_log2(bounded, &LOGS) as f32 / (1 << LOG_BITS) as f32
}

#[derive(Clone, Copy, Default)]
struct Bin {
    count: u64,
    /// Sum of fixed-point logarithms.
    logs: i64,
}

/// The luminances of a picture in cd/m².
#[derive(Clone)]
pub(super) struct Histogram {
    bins: Vec<Bin>,
    count: u64,
}

impl Histogram {
    pub fn new(pixels: &[[f32; 3]]) -> Histogram {
        let table = LOGS.as_slice();
        pixels
            .par_chunks(CHUNK)
            .fold(Histogram::empty, |mut histogram, pixels| {
                for &rgb in pixels {
                    histogram.add(luminance(rgb), table);
                }
                histogram
            })
            .reduce(Histogram::empty, Histogram::merged)
    }

    fn empty() -> Histogram {
        Histogram { bins: vec![Bin::default(); BINS], count: 0 }
    }

    #[inline]
    fn add(&mut self, luminance: f32, table: &[i32]) {
        // Also false for NaN.
        if (f32::MIN_POSITIVE..=f32::MAX).contains(&luminance) {
            let log = fixed_log2(luminance, table);
            let above = log - (i64::from(LEAST_LOG) << LOG_BITS);
            let bin = &mut self.bins[((above * BINS_PER_OCTAVE as i64) >> LOG_BITS) as usize];
            bin.count += 1;
            bin.logs += log;
            self.count += 1;
        }
    }

    fn merged(mut self, other: Histogram) -> Histogram {
        for (bin, other) in self.bins.iter_mut().zip(&other.bins) {
            bin.count += other.count;
            bin.logs += other.logs;
        }
        self.count += other.count;
        self
    }

    /// Returns the number of pixels in a bin.
    pub fn count(&self, bin: usize) -> u64 {
        self.bins[bin].count
    }

    /// Returns the binary logarithm of the luminance below which a share of the pixels lies, as the
    /// mean of its bin. `None` if no pixel counts.
    pub fn quantile(&self, share: f64) -> Option<f64> {
        let wanted = (share.clamp(0.0, 1.0) * self.count.saturating_sub(1) as f64).round() as u64;
        let mut below = 0;
        let bin = self.bins.iter().find(|bin| {
            below += bin.count;
            below > wanted
        })?;
        Some(bin.mean())
    }

    /// Returns the binary logarithm of the luminance that lit pixels have on average, with outliers
    /// held to a factor of 100 from the median. `None` if no pixel counts.
    pub fn log_average(&self) -> Option<f64> {
        let median = self.quantile(0.5)?;
        let (low, high) = (median - OUTLIER_LOG, median + OUTLIER_LOG);
        let held = |bin: &Bin| bin.count as f64 * bin.mean().max(low).min(high);
        let sum: f64 = self.bins.iter().filter(|bin| bin.count > 0).map(held).sum();
        Some(sum / self.count as f64)
    }
}

impl Bin {
    fn mean(&self) -> f64 {
        self.logs as f64 / self.count as f64 / f64::from(1 << LOG_BITS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_exact_to_a_millionth() {
        for i in 0..100_000 {
            let x = 1e-37_f64 * 1.0017_f64.powi(i % 98_000);
            let x = x as f32;
            if x.is_finite() {
                assert!((f64::from(log2(x)) - f64::from(x).log2()).abs() < 1e-5, "{x}");
                let fixed = fixed_log2(x, &LOGS) as f64 / f64::from(1 << LOG_BITS);
                assert!((fixed - f64::from(x).log2()).abs() < 2.1e-6, "{x}");
            }
        }
        assert_eq!([log2(0.0), log2(f32::NAN), log2(-1.0)], [-126.0; 3]);
        assert_eq!(log2(f32::INFINITY), log2(f32::MAX));
    }

    #[test]
    fn the_order_of_pixels_changes_nothing() {
        let ramp: Vec<[f32; 3]> = (0..50_000).map(|i| [1e-3 * 1.0003_f32.powi(i); 3]).collect();
        let mut shuffled = ramp.clone();
        (0..shuffled.len()).for_each(|i| shuffled.swap(i, i * 7919 % ramp.len()));
        let (a, b) = (Histogram::new(&ramp), Histogram::new(&shuffled));
        assert_eq!(a.log_average(), b.log_average());
        assert!((0..BINS).all(|bin| a.count(bin) == b.count(bin)));
    }

    #[test]
    fn quantiles_are_those_of_the_pixels_that_count() {
        let mut pixels: Vec<[f32; 3]> = (1..=1000).map(|i| [i as f32; 3]).collect();
        pixels.extend([[0.0; 3], [f32::NAN; 3], [f32::INFINITY; 3], [-1.0; 3]]);
        let histogram = Histogram::new(&pixels);
        for (share, radiance) in [(0.0, 1.0), (0.5, 500.0), (0.99, 990.0), (1.0, 1000.0_f64)] {
            let log = histogram.quantile(share).unwrap();
            // Half a bin.
            assert!((log - (179.0 * radiance).log2()).abs() < 0.0625, "{share}");
        }
        assert_eq!(Histogram::new(&[[0.0; 3]]).quantile(0.5), None);
    }
}
