//! Exact sums over the samples of one depth in one cell.
//!
//! Invariant: all sums add integers, and stop at the largest value instead of overflowing. So the
//! same samples give the same bits in any order.

use holo_picture::relative_luminance;

use crate::direction::GridDirection;

/// Steps of a unit of radiance in colour sums.
const COLOUR_STEPS: f64 = (1_u64 << 40) as f64;
/// Steps of a unit of squared luminance.
const SQUARE_STEPS: f64 = (1_u64 << 32) as f64;
/// Largest number of steps of one sample, so that many samples fit.
const MOST_STEPS: f64 = (1_u128 << 84) as f64;
/// Steps of a depth within its bin.
const DEPTH_STEPS: f64 = (1_u32 << 20) as f64;
/// Least number of aligned samples that are compared with all samples.
const FEWEST: u32 = 3;
/// Aligned samples that differ from all samples by more than this number of standard errors are
/// used alone, because the surface looks different from elsewhere.
const DIFFERENT: f64 = 2.5;
/// A smaller difference than this share of the luminance is none.
const SAME_SHARE: f64 = 0.02;

/// A sample in a cell.
#[derive(Clone, Copy, Debug)]
pub struct CellSample {
    /// Its direction from the canonical eye.
    pub direction: GridDirection,
    /// Its depth, scene units; infinite if it hit nothing.
    pub depth: f64,
    /// Radiance, not negative.
    pub radiance: [f32; 3],
    /// Its weight, at least 1.
    pub weight: u32,
    /// True if it looks in nearly the same direction as the eye.
    pub is_aligned: bool,
    /// True if its ray passes so near to the eye that it sees what the eye sees.
    pub is_near: bool,
}

/// Sums of colours with their weights.
#[derive(Clone, Copy, Debug, Default)]
struct ColourSums {
    rgb: [u128; 3],
    weight: u64,
    count: u32,
}

impl ColourSums {
    fn add(&mut self, rgb: [u128; 3], weight: u32) {
        for (sum, channel) in self.rgb.iter_mut().zip(rgb) {
            *sum = sum.saturating_add(channel * u128::from(weight));
        }
        self.weight = self.weight.saturating_add(u64::from(weight));
        self.count = self.count.saturating_add(1);
    }

    fn join(&mut self, other: &ColourSums) {
        for (sum, other) in self.rgb.iter_mut().zip(other.rgb) {
            *sum = sum.saturating_add(other);
        }
        self.weight = self.weight.saturating_add(other.weight);
        self.count = self.count.saturating_add(other.count);
    }

    fn mean(&self) -> [f32; 3] {
        let scale = 1.0 / (self.weight.max(1) as f64 * COLOUR_STEPS);
        self.rgb.map(|sum| (sum as f64 * scale) as f32)
    }
}

/// Sums over samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct LayerSums {
    all: ColourSums,
    aligned: ColourSums,
    /// Number of samples near to the eye.
    near: u32,
    /// Luminance squared, by weight.
    squares: u128,
    /// Coordinates of directions on their face, by weight.
    place: [u64; 2],
    /// Depths within their bins, by weight.
    depth: u64,
}

impl LayerSums {
    /// Adds a sample whose depth is at this share of its bin.
    pub fn add(&mut self, sample: &CellSample, share: f64) {
        let steps = |value: f64, scale: f64| (value * scale).clamp(0.0, MOST_STEPS) as u128;
        let rgb = sample.radiance.map(|channel| steps(f64::from(channel), COLOUR_STEPS));
        self.all.add(rgb, sample.weight);
        if sample.is_aligned {
            self.aligned.add(rgb, sample.weight);
        }
        self.near = self.near.saturating_add(u32::from(sample.is_near));
        let luminance = f64::from(relative_luminance(sample.radiance));
        let square = steps(luminance * luminance, SQUARE_STEPS);
        self.squares = self.squares.saturating_add(square * u128::from(sample.weight));
        let weight = u64::from(sample.weight);
        for (sum, at) in self.place.iter_mut().zip(sample.direction.place()) {
            *sum = sum.saturating_add(at as u64 * weight);
        }
        let share = (share * DEPTH_STEPS).clamp(0.0, DEPTH_STEPS) as u64;
        self.depth = self.depth.saturating_add(share * weight);
    }

    /// Adds another layer's sums, all but those of depth.
    pub fn join(&mut self, other: &LayerSums) {
        self.all.join(&other.all);
        self.aligned.join(&other.aligned);
        self.near = self.near.saturating_add(other.near);
        self.squares = self.squares.saturating_add(other.squares);
        for (sum, other) in self.place.iter_mut().zip(other.place) {
            *sum = sum.saturating_add(other);
        }
    }

    /// Returns the number of samples.
    pub fn count(&self) -> u32 {
        self.all.count
    }

    /// Returns the number of samples whose rays pass near to the eye.
    pub fn near_count(&self) -> u32 {
        self.near
    }

    /// Returns the sum of weights.
    pub fn weight(&self) -> f64 {
        self.all.weight as f64
    }

    /// Returns the mean depth, as a share of its bin.
    pub fn depth_share(&self) -> f64 {
        self.depth as f64 / (self.all.weight.max(1) as f64 * DEPTH_STEPS)
    }

    /// Returns the mean place of directions on their face, rounded down.
    pub fn place(&self) -> [i32; 2] {
        self.place.map(|sum| (sum / self.all.weight.max(1)) as i32)
    }

    /// Returns the colour: the mean of all samples, or of the aligned ones alone if these differ.
    pub fn colour(&self) -> [f32; 3] {
        let (all, aligned) = (self.all.mean(), self.aligned.mean());
        if self.aligned.count < FEWEST {
            return all;
        }
        let [mean, of_aligned] = [all, aligned].map(|rgb| f64::from(relative_luminance(rgb)));
        let square = self.squares as f64 / (self.all.weight.max(1) as f64 * SQUARE_STEPS);
        let variance = (square - mean * mean).max(0.0);
        let error = (variance / f64::from(self.aligned.count)).sqrt();
        let difference = (of_aligned - mean).abs();
        if difference > DIFFERENT * error && difference > SAME_SHARE * mean { aligned } else { all }
    }
}
