//! Tone curves by histogram adjustment (Larson, Rushmeier & Piatko 1997, "A Visibility Matching
//! Tone Reproduction Operator for High Dynamic Range Scenes").
//!
//! Invariants: a curve never falls, and stays within the range of the display. A curve of a camera
//! never rises faster than light does, so it shows no contrast greater than that of the scene.

use std::array;

use super::eye::{self, SEEN_STEP};
use super::histogram::{BINS, BINS_PER_OCTAVE, Histogram, LEAST_LOG, log2};
use holo_color::{EFFICACY, luminance};

/// Luminance of the display's white in cd/m², and of white over black (the paper, §3).
pub(super) const WHITE: f64 = 100.0;

/// See [`WHITE`].
const DYNAMIC_RANGE: f64 = 100.0;

/// Binary logarithm of [`DYNAMIC_RANGE`].
const RANGE: f64 = 6.643_856_189_774_724;

/// Linear display value of the log-average luminance: the photographer's grey card (Reinhard et al.
/// 2002, "Photographic tone reproduction for digital images", §2).
pub(super) const KEY: f64 = 0.18;

/// Octaves in one bin.
const BIN: f64 = 1.0 / BINS_PER_OCTAVE as f64;

/// Most rounds that make the ceiling of the eye follow the curve.
const ROUNDS: u32 = 40;

/// Change of the curve, in octaves, below which the rounds end.
const STEADY: f64 = 1e-3;

/// Binary logarithms of display luminance over the display's white, at both ends of each bin.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Curve {
    edges: Vec<f32>,
}

impl Curve {
    /// Returns the curve of a camera: the ceiling is the contrast of the scene (§4.2). If the scene
    /// has less contrast than the display, the curve is a factor.
    pub fn camera(seen: &Histogram) -> Curve {
        let bins = HistogramBins::new(seen);
        let rises = bins.share_out(&vec![BIN; bins.weights.len()]);
        rises.map_or_else(|| bins.factor(seen), |rises| bins.curve(&rises))
    }

    /// Returns the curve of a human eye (§4.3). If the eye cannot distinguish two luminances in the
    /// scene, it cannot distinguish them on the display either.
    ///
    /// If the eye sees less contrast than the display has, the curve rises as steeply as it may.
    /// Then one just visible step at the scene's log-average is one of the display (Ward 1994, "A
    /// Contrast-Based Scalefactor for Luminance Display").
    pub fn human(seen: &Histogram) -> Curve {
        let bins = HistogramBins::new(seen);
        let mut rises = vec![RANGE / bins.weights.len() as f64; bins.weights.len()];
        for _ in 0..ROUNDS {
            let mut shown = -RANGE;
            let most = |(&(bin, _), rise): (&(usize, f64), &f64)| {
                let middle = shown + 0.5 * rise;
                shown += rise;
                BIN * eye::most_slope((bin_log(bin) + 0.5 * BIN).exp2(), WHITE * middle.exp2())
            };
            let most: Vec<f64> = bins.weights.iter().zip(&rises).map(most).collect();
            let Some(next) = bins.share_out(&most) else { return Self::as_steep_as_seen(seen) };
            // Steps are halved: the ceiling falls if the curve rises, so whole steps may oscillate.
            let change = rises.iter().zip(&next).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            rises.iter_mut().zip(&next).for_each(|(rise, next)| *rise = 0.5 * (*rise + next));
            if change < STEADY * BIN {
                break;
            }
        }
        bins.curve(&rises)
    }

    /// Returns the second curve of [`human`](Self::human).
    fn as_steep_as_seen(seen: &Histogram) -> Curve {
        let average = seen.log_average().unwrap_or(0.0);
        // The eye of a person at the display is adapted to the middle of its logarithms.
        let display = WHITE / DYNAMIC_RANGE.sqrt();
        let factor = eye::threshold(display) / eye::threshold(average.exp2());
        let middle = (average + (factor / WHITE).log2()).clamp(-RANGE, 0.0);
        let first = ((average - f64::from(LEAST_LOG)) / BIN).clamp(0.0, (BINS - 1) as f64) as usize;
        let rise = |bin: usize, from: f64, direction: f64| {
            let world = (bin_log(bin) + 0.5 * BIN).exp2();
            let slope = |shown: f64| eye::most_slope(world, WHITE * shown.exp2());
            let half = from + direction * 0.5 * BIN * slope(from);
            (from + direction * BIN * slope(half)).clamp(-RANGE, 0.0)
        };
        // The average lies within a bin, not at its edge.
        let share = (average - bin_log(first)) / BIN;
        let lower = middle + share * (rise(first, middle, -1.0) - middle);
        let mut edges = vec![lower as f32; BINS + 1];
        let mut shown = lower;
        for bin in first..BINS {
            shown = rise(bin, shown, 1.0);
            edges[bin + 1] = shown as f32;
        }
        shown = lower;
        for bin in (0..first).rev() {
            shown = rise(bin, shown, -1.0);
            edges[bin] = shown as f32;
        }
        Curve { edges }
    }

    fn by_factor(log_factor: f64) -> Curve {
        let edge = |bin: usize| (bin_log(bin) + log_factor).clamp(-RANGE, 0.0) as f32;
        Curve { edges: (0..=BINS).map(edge).collect() }
    }

    /// Moves a share of the way to another curve, unless nobody would see the difference. Both
    /// properties of curves stay true, because they are true of every mean of two.
    pub fn approach(&mut self, target: &Curve, share: f32) {
        let mut pairs = self.edges.iter().zip(&target.edges);
        if pairs.all(|(edge, target)| (edge - target).abs() < SEEN_STEP) {
            return;
        }
        for (edge, target) in self.edges.iter_mut().zip(&target.edges) {
            *edge += share * (target - *edge);
        }
    }

    /// Returns the binary logarithm of the display's luminance over its white, for a luminance of
    /// the scene given by its binary logarithm.
    fn at(&self, log: f32) -> f32 {
        let place = ((log - LEAST_LOG as f32) * BINS_PER_OCTAVE as f32).clamp(0.0, BINS as f32);
        let bin = (place as usize).min(BINS - 1);
        let (low, high) = (self.edges[bin], self.edges[bin + 1]);
        low + (high - low) * (place - bin as f32)
    }

    /// Makes the table that maps pixels to the display, `gain` times as bright.
    pub fn table(&self, gain: f32) -> CurveTable {
        let value = |entry: usize| {
            let luminance = f32::from_bits((entry as u32) << REST_BITS);
            let black = 1.0 / DYNAMIC_RANGE as f32;
            gain * ((self.at(log2(luminance)).exp2() - black) / (1.0 - black)).max(0.0)
        };
        CurveTable { values: (0..=ENTRIES).map(value).collect() }
    }
}

/// Returns the binary logarithm of the least luminance in a bin.
fn bin_log(bin: usize) -> f64 {
    f64::from(LEAST_LOG) + BIN * bin as f64
}

/// The bins that have pixels.
struct HistogramBins {
    /// Number of each bin, and its pixels.
    weights: Vec<(usize, f64)>,
}

impl HistogramBins {
    fn new(seen: &Histogram) -> HistogramBins {
        let weight = |bin| Some((bin, seen.count(bin) as f64)).filter(|weight| weight.1 > 0.0);
        HistogramBins { weights: (0..BINS).filter_map(weight).collect() }
    }

    /// Divides the range of the display among the bins, in proportion to their pixels, but with at
    /// most `most` octaves for each. `None` if the bins cannot use the whole range.
    ///
    /// The result is the limit of the paper's rounds of trimming (§4.2), without their tolerance of
    /// 2.5 %.
    fn share_out(&self, most: &[f64]) -> Option<Vec<f64>> {
        let mut order: Vec<usize> = (0..self.weights.len()).collect();
        // Octaves per pixel at which a bin is full.
        let full = |i: usize| most[i] / self.weights[i].1;
        order.sort_by(|&a, &b| full(a).total_cmp(&full(b)));
        let (mut rest, mut pixels) =
            (RANGE, self.weights.iter().map(|weight| weight.1).sum::<f64>());
        for &i in &order {
            let each = rest / pixels;
            if full(i) >= each {
                let rise = |(most, weight): (&f64, &(usize, f64))| most.min(each * weight.1);
                return Some(most.iter().zip(&self.weights).map(rise).collect());
            }
            rest -= most[i];
            pixels -= self.weights[i].1;
        }
        None
    }

    /// Returns the curve that rises in each bin by this many octaves, and nowhere else.
    fn curve(&self, rises: &[f64]) -> Curve {
        let (mut edges, mut shown) = (vec![-RANGE as f32], -RANGE);
        let mut next = self.weights.iter().zip(rises).peekable();
        for bin in 0..BINS {
            if let Some((_, rise)) = next.next_if(|(weight, _)| weight.0 == bin) {
                shown += rise;
            }
            edges.push(shown.min(0.0) as f32);
        }
        Curve { edges }
    }

    /// Returns the factor that shows the log-average as a grey card. The factor changes if that
    /// keeps all of the scene within the display.
    fn factor(&self, seen: &Histogram) -> Curve {
        let grey = (KEY * (1.0 - 1.0 / DYNAMIC_RANGE) + 1.0 / DYNAMIC_RANGE).log2();
        let wanted = grey - seen.log_average().unwrap_or(0.0);
        let ends = self.weights.first().zip(self.weights.last());
        let [least, most] = ends
            .map_or([0.0; 2], |(first, last)| [-RANGE - bin_log(first.0), -bin_log(last.0 + 1)]);
        let fits = least <= most;
        Curve::by_factor(if fits { wanted.clamp(least, most) } else { wanted })
    }
}

/// Bits of a float that do not choose the table's entry: entries are at most 0.8 % wide.
const REST_BITS: u32 = 16;

/// Entries of a table: all finite floats.
const ENTRIES: usize = 0x7f80;

/// Greatest radiance whose luminance is finite. Larger ones count as infinite.
const MOST_RADIANCE: f32 = 1e36;

/// A curve as display values by luminance.
pub(super) struct CurveTable {
    values: Vec<f32>,
}

impl CurveTable {
    /// Returns the display values of a radiance. Its hue stays, unless a channel exceeds 1.
    #[inline]
    pub fn color(&self, rgb: [f32; 3]) -> [f32; 3] {
        let rgb = finite(rgb);
        let luminance = luminance(rgb);
        // A luminance of 0 gives black: 0 times the value of the least.
        let bits = luminance.to_bits();
        let entry = (bits >> REST_BITS) as usize;
        let (low, high) = (self.values[entry], self.values[entry + 1]);
        let value = low + (high - low) * ((bits & 0xffff) as f32 / 65_536.0);
        let factor = value * EFFICACY / luminance.max(f32::MIN_POSITIVE);
        array::from_fn(|channel| rgb[channel] * factor)
    }
}

/// Returns a radiance that is neither negative nor infinite. NaN becomes 0.
#[inline]
pub(super) fn finite(rgb: [f32; 3]) -> [f32; 3] {
    rgb.map(|value| if value > 0.0 { value.min(MOST_RADIANCE) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(levels: impl IntoIterator<Item = (f64, usize)>) -> Histogram {
        let pixels: Vec<[f32; 3]> = levels
            .into_iter()
            .flat_map(|(level, count)| vec![[(level / 179.0) as f32; 3]; count])
            .collect();
        Histogram::new(&pixels)
    }

    /// Luminances from `low` to `high` that are dense on a logarithmic scale; most are dark.
    fn scene(low: f64, high: f64) -> Histogram {
        let ratio = (high / low).powf(1.0 / 2000.0);
        seen((0..=2000).map(|i| (low * ratio.powi(i), 1 + (2000 - i as usize) / 100)))
    }

    fn rises(curve: &Curve) -> impl Iterator<Item = f64> {
        curve.edges.windows(2).map(|pair| f64::from(pair[1]) - f64::from(pair[0]))
    }

    #[test]
    fn a_camera_shows_no_more_contrast_than_the_scene_has() {
        for (low, high) in [(1.0, 20.0), (0.01, 1e4), (1e-30, 1e-22), (1.0, 1e30)] {
            let curve = Curve::camera(&scene(low, high));
            assert!(rises(&curve).all(|rise| (0.0..BIN + 1e-5).contains(&rise)), "{low} {high}");
            assert!(curve.edges.iter().all(|edge| (-RANGE as f32..=0.0).contains(edge)));
        }
    }

    #[test]
    fn a_scene_with_more_contrast_than_the_display_fills_it() {
        for curve in [Curve::camera(&scene(0.01, 1e4)), Curve::human(&scene(0.1, 1e5))] {
            assert!((f64::from(curve.edges[0]) + RANGE).abs() < 1e-6);
            assert!(curve.edges[BINS].abs() < 1e-3);
        }
    }

    #[test]
    fn evenly_spread_luminances_are_shown_on_a_straight_line() {
        // Each octave has as many pixels, so equalisation is linear in the logarithm.
        let histogram = seen((0..=1600).map(|i| (2_f64.powf(-4.0 + 0.01 * f64::from(i)), 1)));
        let curve = Curve::camera(&histogram);
        for log in -3..=11_i16 {
            let share = (f64::from(log) + 4.0) / 16.0;
            let expected = RANGE * (share - 1.0);
            assert!((f64::from(curve.at(log.into())) - expected).abs() < 0.1, "{log}");
        }
    }

    #[test]
    fn a_scene_with_less_contrast_is_multiplied() {
        // The two levels are a factor of 4 apart, so both are within the display, around the grey
        // card.
        let curve = Curve::camera(&seen([(10.0, 100), (40.0, 100)]));
        let [dark, light] = [10.0_f32, 40.0].map(|level| curve.at(level.log2()).exp2());
        assert!((light / dark - 4.0).abs() < 1e-3, "{dark} {light}");
        assert!((f64::from((light * dark).sqrt()) - 0.1882).abs() < 1e-3, "{dark} {light}");
        // Pixels that are too bright for that are kept on the display.
        let curve = Curve::camera(&seen([(1.0, 10_000), (30.0, 10)]));
        let [dark, light] = [1.0_f32, 30.0].map(|level| curve.at(level.log2()).exp2());
        assert!((light / dark - 30.0).abs() < 0.01 && light < 1.0, "{dark} {light}");
    }

    #[test]
    fn the_eye_s_ceiling_holds() {
        for (low, high) in [(1e-3, 1e3), (0.1, 1e5), (1e-4, 10.0), (1.0, 1e6)] {
            let curve = Curve::human(&scene(low, high));
            for (bin, rise) in rises(&curve).enumerate() {
                assert!(rise >= 0.0);
                let shown = f64::from(curve.edges[bin]) + 0.5 * rise;
                let world = (bin_log(bin) + 0.5 * BIN).exp2();
                let most = eye::most_slope(world, WHITE * shown.exp2());
                assert!(rise <= BIN * most * 1.01 + 1e-5, "{low} {high}: {world}");
            }
        }
    }

    #[test]
    fn night_is_shown_darker_than_day() {
        let average = |low: f64, high: f64| {
            let histogram = scene(low, high);
            Curve::human(&histogram).at(histogram.log_average().unwrap() as f32)
        };
        let (night, dusk, day) = (average(1e-3, 1e-2), average(0.1, 1.0), average(1e3, 1e4));
        assert!(night < dusk && dusk < day, "{night} {dusk} {day}");
    }

    #[test]
    fn a_curve_approaches_another_one_and_stays_a_camera_s() {
        let (before, after) = (Curve::camera(&scene(0.01, 1e4)), Curve::camera(&scene(5.0, 50.0)));
        let mut curve = before.clone();
        curve.approach(&after, 0.25);
        assert!(rises(&curve).all(|rise| (0.0..BIN + 1e-5).contains(&rise)));
        for (edge, (before, after)) in curve.edges.iter().zip(before.edges.iter().zip(&after.edges))
        {
            assert!((edge - (0.75 * before + 0.25 * after)).abs() < 1e-5);
        }
    }

    #[test]
    fn tables_keep_hue_and_survive_every_radiance() {
        let histogram = scene(0.01, 1e4);
        let table = Curve::camera(&histogram).table(1.0);
        let [red, green, blue] = table.color([0.2, 0.1, 0.4]);
        assert!((red / green - 2.0).abs() < 1e-5 && (blue / red - 2.0).abs() < 1e-5);
        assert_eq!(table.color([0.0, -1.0, f32::NAN]), [0.0; 3]);
        assert!(table.color([f32::INFINITY; 3]).iter().all(|value| (value - 1.0).abs() < 1e-3));
        assert!(table.color([1e-45; 3])[0] < 1e-9);
        let ramp = (0..9000).map(|i| table.color([1e-6 * 1.003_f32.powi(i); 3])[1]);
        assert!(ramp.collect::<Vec<_>>().windows(2).all(|pair| pair[1] > pair[0] - 1e-6));
    }
}
