//! Exact sums over samples, and their moments.
//!
//! Invariant: all sums add integers ≥ 0, and stop at the largest value instead of overflowing. So
//! the same samples give the same bits in any order and in any batches.

use bytemuck::Zeroable;
use holo_section::rgbe;

/// Classes of nearness to the eye. Each reaches half as far as the one before.
pub(crate) const NEAR_CLASSES: usize = 4;
/// Fraction bits of colour sums: RGBE colours from 2⁻⁴⁰ · 256 up are exact.
const COLOUR_FRACTION: i32 = 40;
/// Largest RGBE exponent (radiance 4e12), so that a product with a weight fits. Larger ones count
/// as this one.
const MAX_EXPONENT: u8 = 170;
/// Steps of luminance in a unit of radiance, and the largest sum of steps of one sample.
const LUMINANCE_SCALE: f32 = 1_048_576.0;
const LUMINANCE_MAX: f32 = (1_u64 << 50) as f32;
/// Steps of the fourth root of luminance in a unit, and the largest number of steps.
const ROOT_SCALE: f32 = 4096.0;
const ROOT_MAX: f32 = (1_u64 << 26) as f32;

pub(crate) use holo_picture::relative_luminance as luminance;

/// The colour of a sample in fixed point.
#[derive(Clone, Copy)]
pub(crate) struct Colour {
    /// Fixed point; to be shifted left by `doublings`.
    rgb: [u64; 3],
    doublings: u32,
    luminance: u64,
    /// Fourth root of luminance. Leaves are compared by it, so that rare bright samples do not
    /// outweigh all others. A lamp that is 1000 times as bright as its surroundings counts six
    /// times as much. A logarithm would not do, because black samples are common and scenes have
    /// any scale.
    root: u64,
}

impl Colour {
    /// Converts an RGBE colour, channels c·2^(e−136).
    #[inline(always)]
    pub fn from_rgbe([r, g, b, exponent]: [u8; 4]) -> Self {
        if exponent == 0 {
            return Self { rgb: [0; 3], doublings: 0, luminance: 0, root: 0 };
        }
        let exponent = exponent.min(MAX_EXPONENT);
        let shift = i32::from(exponent) - 136 + COLOUR_FRACTION;
        let luminance = luminance(rgbe::decode([r, g, b, exponent]));
        let root = luminance.sqrt().sqrt();
        Self {
            rgb: [r, g, b].map(|channel| u64::from(channel) >> (-shift).clamp(0, 8)),
            doublings: shift.max(0) as u32,
            luminance: (luminance * LUMINANCE_SCALE).min(LUMINANCE_MAX) as u64,
            root: (root * ROOT_SCALE).min(ROOT_MAX) as u64,
        }
    }
}

/// Weighted sums over the samples of one depth bin of one pixel.
#[derive(Clone, Copy, Default, Debug, PartialEq, Zeroable)]
pub(crate) struct BinSums {
    rgb: [u128; 3],
    luminance_squared: u128,
    root_squared: u128,
    root: u64,
    weight: u64,
    weight_squared: u64,
    /// Number of samples.
    pub count: u32,
    /// Number of samples whose rays pass near the eye, by class: within a pixel's footprint, within
    /// half of it, a quarter, an eighth. Each sample counts in its narrowest class alone.
    pub near: [u32; NEAR_CLASSES],
}

impl BinSums {
    /// Adds a sample of a weight up to 65,536. `near` is its class of nearness, if any.
    #[inline(always)]
    pub fn add(&mut self, colour: &Colour, weight: u32, near: Option<usize>) {
        let wide = u128::from(weight);
        let squared = |number: u64| u128::from(number) * u128::from(number);
        for (sum, channel) in self.rgb.iter_mut().zip(colour.rgb) {
            add_wide(sum, u128::from(channel * u64::from(weight)) << colour.doublings);
        }
        add_wide(&mut self.luminance_squared, squared(colour.luminance) * wide);
        add_wide(&mut self.root_squared, squared(colour.root) * wide);
        add_long(&mut self.root, colour.root * u64::from(weight));
        add_long(&mut self.weight, u64::from(weight));
        add_long(&mut self.weight_squared, u64::from(weight) * u64::from(weight));
        self.count = self.count.saturating_add(1);
        if let Some(count) = near.and_then(|class| self.near.get_mut(class)) {
            *count = count.saturating_add(1);
        }
    }

    /// Adds another bin's sums.
    #[inline(always)]
    pub fn join(&mut self, other: &Self) {
        self.rgb.iter_mut().zip(other.rgb).for_each(|(sum, other)| add_wide(sum, other));
        add_wide(&mut self.luminance_squared, other.luminance_squared);
        add_wide(&mut self.root_squared, other.root_squared);
        add_long(&mut self.root, other.root);
        add_long(&mut self.weight, other.weight);
        add_long(&mut self.weight_squared, other.weight_squared);
        self.count = self.count.saturating_add(other.count);
        for (near, other) in self.near.iter_mut().zip(other.near) {
            *near = near.saturating_add(other);
        }
    }

    /// Returns the moments. There must be samples.
    #[inline(always)]
    pub fn moments(&self) -> Moments {
        // Exact to two roundings. The language's own conversion is a slow call.
        let wide = |sum: u128| {
            (sum >> 64) as u64 as f64 * 18_446_744_073_709_551_616.0 + sum as u64 as f64
        };
        let [r, g, b] = self.rgb;
        let scale = 1.0 / self.weight as f64;
        let colour_scale = scale / (1_u64 << COLOUR_FRACTION) as f64;
        let root_scale = scale / f64::from(ROOT_SCALE);
        Moments {
            weight: self.weight as f64,
            weight_squared: self.weight_squared as f64,
            mean: [wide(r) * colour_scale, wide(g) * colour_scale, wide(b) * colour_scale],
            luminance_squared: wide(self.luminance_squared) * scale
                / f64::from(LUMINANCE_SCALE).powi(2),
            root: self.root as f64 * root_scale,
            root_squared: wide(self.root_squared) * root_scale / f64::from(ROOT_SCALE),
        }
    }
}

#[inline(always)]
fn add_wide(sum: &mut u128, more: u128) {
    *sum = sum.saturating_add(more);
}

#[inline(always)]
fn add_long(sum: &mut u64, more: u64) {
    *sum = sum.saturating_add(more);
}

/// Weighted means over samples.
pub(crate) struct Moments {
    pub weight: f64,
    pub weight_squared: f64,
    /// Mean colour.
    pub mean: [f64; 3],
    /// Mean square of luminance.
    pub luminance_squared: f64,
    /// Mean of the fourth root of luminance.
    pub root: f64,
    /// Mean square of the fourth root of luminance.
    pub root_squared: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Means are those of the decoded colours, over the whole range of scenes: 2⁻²⁰ to 4e12.
        #[test]
        fn means_are_exact(
            samples in prop::collection::vec((any::<[u8; 3]>(), 116..=170_u8, 1..70_000_u32), 1..20)
        ) {
            let mut sums = BinSums::default();
            let (mut weights, mut expected) = (0.0, [0.0; 3]);
            for &([r, g, b], exponent, weight) in &samples {
                let colour = [r, g, b, exponent];
                sums.add(&Colour::from_rgbe(colour), weight, None);
                weights += f64::from(weight);
                for (sum, channel) in expected.iter_mut().zip(rgbe::decode(colour)) {
                    *sum += f64::from(weight) * f64::from(channel);
                }
            }
            for (mean, sum) in sums.moments().mean.into_iter().zip(expected) {
                let expected = sum / weights;
                prop_assert!((mean - expected).abs() <= 1e-12 * mean, "{} {}", mean, expected);
            }
        }
    }

    #[test]
    fn moments_are_those_of_the_samples() {
        let colours = [[128, 64, 32, 129], [200, 220, 20, 127], [0, 0, 0, 0], [255, 255, 255, 133]];
        let mut sums = BinSums::default();
        let (mut weights, mut square, mut root, mut root_square) = (0.0, 0.0, 0.0, 0.0);
        for (colour, weight) in colours.into_iter().zip([3, 8, 64, 20_u32]) {
            sums.add(&Colour::from_rgbe(colour), weight, None);
            let luminance = f64::from(luminance(rgbe::decode(colour)));
            let weight = f64::from(weight);
            weights += weight;
            square += weight * luminance * luminance;
            root += weight * luminance.powf(0.25);
            root_square += weight * luminance.sqrt();
        }
        // Fixed point keeps luminance to 2⁻²⁰ and its root to 2⁻¹², cut off.
        let moments = sums.moments();
        assert!((moments.luminance_squared / (square / weights) - 1.0).abs() < 1e-5);
        assert!((moments.root - root / weights).abs() < 1.0 / 4096.0);
        assert!((moments.root_squared - root_square / weights).abs() < 4.0 / 4096.0);
    }

    #[test]
    fn extreme_colours_neither_overflow_nor_vanish() {
        let mut sums = BinSums::default();
        for _ in 0..5000 {
            sums.add(&Colour::from_rgbe([255; 4]), 65_536, Some(0));
            sums.add(&Colour::from_rgbe([255, 255, 255, 1]), 65_536, Some(7));
        }
        assert!(sums.moments().mean.iter().all(|mean| mean.is_finite() && *mean > 1e12));
        assert_eq!(sums.near, [5000, 0, 0, 0]);
        // The largest squares end at the largest number, not at 0.
        assert_eq!(sums.luminance_squared, u128::MAX);
        let whole = sums;
        sums.join(&whole);
        assert_eq!(sums.luminance_squared, u128::MAX);
    }

    #[test]
    fn counts_end_at_the_largest_number() {
        let colour = Colour::from_rgbe([1, 1, 1, 128]);
        let mut sums = BinSums {
            count: u32::MAX - 1,
            near: [u32::MAX - 1; NEAR_CLASSES],
            ..BinSums::default()
        };
        (0..3).for_each(|_| sums.add(&colour, 8, Some(1)));
        assert_eq!(sums.count, u32::MAX);
        assert_eq!(sums.near, [u32::MAX - 1, u32::MAX, u32::MAX - 1, u32::MAX - 1]);
    }
}
