//! Scales of luminance: the place of each luminance between the ends of a legend.
//!
//! Invariants: the ends of a [`Scale`] are finite and differ. Those of a logarithmic one are
//! positive.

use super::histogram::{Histogram, log2};

/// Shares of the pixels that lie below the ends of an automatic scale.
const PERCENTILES: [f64; 2] = [0.01, 0.99];

/// Greatest ratio between the ends of an automatic logarithmic scale.
const MOST_RATIO: f64 = 1e4;

/// Most ticks of a scale.
const MOST_TICKS: usize = 10;

/// An automatic scale stays until the 99th percentile falls below this share of its end. Its end is
/// at most 2.5 times the percentile, so a scale does not flicker between two ends.
const LEAST_USE: f64 = 0.3;

/// A range of luminances in cd/m², linear or logarithmic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    least: f32,
    most: f32,
    log: bool,
}

/// The reason why a range is no scale.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ScaleError {
    /// The ends are not finite, negative, or in the wrong order.
    #[error("{0} to {1} cd/m² is no range: write MIN:MAX with 0 ≤ MIN < MAX, such as 10:1000")]
    Range(f32, f32),
    /// A logarithmic scale that begins at 0.
    #[error(
        "a logarithmic scale cannot begin at 0: write MIN:MAX with MIN above 0, such as 1:1000"
    )]
    LogOfZero,
}

/// The choice of the scale of false colours and contours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scaling {
    /// From the picture: up to its 99th percentile, rounded up to 1, 2 or 5 times a power of ten.
    /// A linear scale begins at 0, a logarithmic one at the 1st percentile, rounded down, but at
    /// most four decades below its end.
    Auto {
        /// True if the scale is logarithmic.
        log: bool,
    },
    /// A fixed scale.
    Fixed(Scale),
}

impl Scale {
    /// Returns the scale of a range in cd/m².
    ///
    /// # Errors
    /// Ends that are not finite, negative, not in order, or 0 on a logarithmic scale.
    pub fn new(least: f32, most: f32, log: bool) -> Result<Scale, ScaleError> {
        if !(least >= 0.0 && least < most && most.is_finite()) {
            return Err(ScaleError::Range(least, most));
        }
        // Logarithms need normal numbers.
        if log && least < f32::MIN_POSITIVE {
            return Err(ScaleError::LogOfZero);
        }
        Ok(Scale { least, most, log })
    }

    /// Returns the scale that fits a picture, or `before` if that still fits.
    pub(super) fn fitting(seen: &Histogram, log: bool, before: Option<Scale>) -> Scale {
        let [low, high] = PERCENTILES.map(|share| seen.quantile(share).map(f64::exp2));
        let (Some(low), Some(high)) = (low, high) else {
            let nothing = Scale { least: if log { 0.01 } else { 0.0 }, most: 1.0, log };
            return before.filter(|before| before.log == log).unwrap_or(nothing);
        };
        let fits = |before: &Scale| {
            let (least, most) = (f64::from(before.least), f64::from(before.most));
            let below =
                !log || low > 0.99 * least && low < least / LEAST_USE || least <= most / MOST_RATIO;
            before.log == log && high < 1.01 * most && high > LEAST_USE * most && below
        };
        before.filter(fits).unwrap_or_else(|| {
            let most = round_up(high).min(f64::from(f32::MAX));
            let least =
                if log { round_down(low).max(most / MOST_RATIO).min(most / 10.0) } else { 0.0 };
            Scale { least: least as f32, most: most as f32, log }
        })
    }

    /// Returns the luminance at the low end, in cd/m².
    pub fn least(&self) -> f32 {
        self.least
    }

    /// Returns the luminance at the high end, in cd/m².
    pub fn most(&self) -> f32 {
        self.most
    }

    /// Returns whether the scale is logarithmic.
    pub fn is_log(&self) -> bool {
        self.log
    }

    /// Returns the place of a luminance: 0 at the low end and below, 1 at the high end and above. 0
    /// for NaN.
    #[inline]
    pub fn place(&self, luminance: f32) -> f32 {
        let place = if self.log {
            let least = log2(self.least);
            (log2(luminance) - least) / (log2(self.most) - least)
        } else {
            (luminance - self.least) / (self.most - self.least)
        };
        if place > 0.0 { place.min(1.0) } else { 0.0 }
    }

    /// Returns round luminances on the scale, at most 10, in order. They are the lines of contours
    /// and the labels of a legend.
    pub fn ticks(&self) -> Vec<f32> {
        let logarithmic = if self.log { self.log_ticks() } else { Vec::new() };
        if logarithmic.len() >= 3 { logarithmic } else { self.linear_ticks() }
    }

    fn linear_ticks(&self) -> Vec<f32> {
        let (least, most) = (f64::from(self.least), f64::from(self.most));
        let step = round_up((most - least) / (MOST_TICKS - 1) as f64);
        let first = (least / step - 1e-6).ceil();
        let ticks = (0..MOST_TICKS).map(|i| (first + i as f64) * step);
        ticks.take_while(|tick| *tick <= most * (1.0 + 1e-6)).map(|tick| tick as f32).collect()
    }

    /// 1, 2 and 5 times powers of ten, or powers of ten, or every second of them, and so on.
    fn log_ticks(&self) -> Vec<f32> {
        let (least, most) = (f64::from(self.least), f64::from(self.most));
        let decades = least.log10().floor() as i32..=most.log10().ceil() as i32;
        let within = |tick: &f64| (least * (1.0 - 1e-6)..=most * (1.0 + 1e-6)).contains(tick);
        let ticks = |mantissas: &'static [f64], apart: usize| -> Vec<f32> {
            let powers = decades.clone().step_by(apart).map(|decade| 10_f64.powi(decade));
            let ticks = powers.flat_map(|power| mantissas.iter().map(move |m| m * power));
            ticks.filter(within).map(|tick| tick as f32).collect()
        };
        let fine = ticks(&[1.0, 2.0, 5.0], 1);
        if fine.len() <= MOST_TICKS {
            return fine;
        }
        (1..)
            .map(|apart| ticks(&[1.0], apart))
            .find(|ticks| ticks.len() <= MOST_TICKS)
            .unwrap_or(fine)
    }
}

/// Returns the least of 1, 2 and 5 times powers of ten that is not below a positive number.
fn round_up(x: f64) -> f64 {
    let power = 10_f64.powf(x.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    steps.into_iter().find(|step| *step >= x * (1.0 - 1e-6)).unwrap_or(10.0 * power)
}

/// Returns the greatest of 1, 2 and 5 times powers of ten that is not above a positive number.
fn round_down(x: f64) -> f64 {
    round_up(x.recip()).recip()
}

/// Writes a luminance with at most four digits, such as `0.5`, `1200` or `2e6`.
pub(super) fn label(luminance: f32) -> String {
    let rounded: f64 = format!("{luminance:.3e}").parse().unwrap_or_default();
    if rounded == 0.0 || (1e-3..1e5).contains(&rounded) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(luminances: impl IntoIterator<Item = f32>) -> Histogram {
        let pixels: Vec<_> = luminances.into_iter().map(|l| [l / 179.0; 3]).collect();
        Histogram::new(&pixels)
    }

    #[test]
    fn an_automatic_scale_ends_above_the_99th_percentile() {
        let room = || (1..=1000).map(|i| i as f32 * 0.4);
        let scale = Scale::fitting(&seen(room()), false, None);
        assert_eq!((scale.least(), scale.most()), (0.0, 500.0));
        // A lamp in fewer than one pixel of a hundred changes nothing.
        let lamp = seen(room().chain([1e6; 9]));
        assert_eq!(Scale::fitting(&lamp, false, None), scale);
        let log = Scale::fitting(&seen(room()), true, None);
        assert_eq!((log.least(), log.most()), (2.0, 500.0));
        let night_and_day = seen((0..1000).map(|i| 1e-6 * 1.03_f32.powi(i)));
        let log = Scale::fitting(&night_and_day, true, None);
        assert_eq!(log.most() / log.least(), 1e4);
        for level in [1e-30, 1e30] {
            let scale = Scale::fitting(&seen([level; 10]), true, None);
            assert!(scale.least() < level && level <= scale.most() && scale.least() > 0.0);
        }
        let black = Scale::fitting(&seen([0.0]), true, None);
        assert_eq!((black.least(), black.most()), (0.01, 1.0));
    }

    #[test]
    fn an_automatic_scale_stays_until_it_no_longer_fits() {
        let level = |level: f32| seen([level; 100]);
        let first = Scale::fitting(&level(90.0), false, None);
        assert_eq!(first.most(), 100.0);
        for steady in [99.0, 60.0, 40.0] {
            assert_eq!(Scale::fitting(&level(steady), false, Some(first)), first, "{steady}");
        }
        assert_eq!(Scale::fitting(&level(150.0), false, Some(first)).most(), 200.0);
        assert_eq!(Scale::fitting(&level(15.0), false, Some(first)).most(), 20.0);
        assert!(Scale::fitting(&level(90.0), true, Some(first)).is_log());
    }

    #[test]
    fn places_are_linear_or_logarithmic_and_held_to_the_ends() {
        let linear = Scale::new(10.0, 30.0, false).unwrap();
        assert_eq!(
            [0.0, 10.0, 20.0, 30.0, f32::INFINITY].map(|l| linear.place(l)),
            [0.0, 0.0, 0.5, 1.0, 1.0]
        );
        let log = Scale::new(1.0, 10_000.0, true).unwrap();
        assert!((log.place(100.0) - 0.5).abs() < 1e-5);
        assert_eq!(
            [0.0, f32::NAN, -5.0, f32::INFINITY].map(|l| log.place(l)),
            [0.0, 0.0, 0.0, 1.0]
        );
        assert_eq!(linear.place(f32::NAN), 0.0);
    }

    #[test]
    fn impossible_ranges_are_refused() {
        for (least, most) in
            [(1.0, 1.0), (2.0, 1.0), (-1.0, 1.0), (0.0, f32::INFINITY), (f32::NAN, 1.0)]
        {
            assert!(matches!(Scale::new(least, most, false), Err(ScaleError::Range(..))));
        }
        assert_eq!(Scale::new(0.0, 1.0, true), Err(ScaleError::LogOfZero));
    }

    #[test]
    fn ticks_are_round_numbers() {
        let ticks = |least, most, log| Scale::new(least, most, log).unwrap().ticks();
        assert_eq!(ticks(0.0, 500.0, false), [0.0, 100.0, 200.0, 300.0, 400.0, 500.0]);
        assert_eq!(ticks(3.0, 8.0, false), [3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        assert_eq!(ticks(1.0, 100.0, true), [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]);
        let decades: Vec<f32> = (0..9).map(|i| 10_f32.powi(i - 3)).collect();
        assert_eq!(ticks(1e-3, 1e5, true), decades);
        assert!(ticks(1e-20, 1e20, true).len() <= MOST_TICKS);
        // No power of ten and few round numbers lie within: the ticks are linear.
        assert_eq!(ticks(3.0, 4.0, true), [3.0, 3.2, 3.4, 3.6, 3.8, 4.0]);
    }

    #[test]
    fn labels_are_short() {
        for (luminance, text) in [
            (0.0, "0"),
            (0.05, "0.05"),
            (1200.0, "1200"),
            (3.600_001, "3.6"),
            (2e6, "2e6"),
            (1.5e-4, "1.5e-4"),
        ] {
            assert_eq!(label(luminance), text);
        }
    }
}
