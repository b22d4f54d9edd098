//! A small network that determines how much a neighbourhood counts beside the next wider one.
//!
//! It sees the logarithms of [`INPUTS`] ratios, and has two hidden layers of [`HIDDEN`] rectified
//! units. `scripts/train-filter` finds its weights. Kalantari, Bako & Sen (2015) let a network
//! choose a filter's parameters in the same way.
//!
//! Invariant: results depend neither on the processor nor on what the other squares hold.

mod size;
mod weights;

use holo_cpu::{Isa, Kernel};
use size::HIDDEN;
pub(super) use size::INPUTS;
use weights::{FIRST, FIRST_BIAS, LAST, LAST_BIAS, SECOND, SECOND_BIAS};

/// Squares whose shares are computed together.
pub(super) const LANES: usize = 16;

/// Greatest and least input that the network distinguishes, as binary logarithms.
const RANGE: [f32; 2] = [-16.0, 16.0];

/// The inputs of [`LANES`] squares.
pub(super) type Inputs = [[f32; LANES]; INPUTS];

/// Returns shares from 0 to 1.
pub(super) fn shares(isa: Isa, inputs: &Inputs) -> [f32; LANES] {
    isa.run(Network { inputs })
}

/// Returns the logarithms that the network sees.
pub(super) fn logarithms(inputs: &[f32; INPUTS]) -> [f32; INPUTS] {
    inputs.map(log2)
}

struct Network<'a> {
    inputs: &'a Inputs,
}

impl Kernel for Network<'_> {
    type Output = [f32; LANES];

    // Loops with indices: iterators of short arrays become calls, which took 5 times as long.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    fn run(self) -> [f32; LANES] {
        let mut seen = [[0.0; LANES]; INPUTS];
        for input in 0..INPUTS {
            for lane in 0..LANES {
                seen[input][lane] = log2(self.inputs[input][lane]);
            }
        }
        let first = layer(&seen, &FIRST, &FIRST_BIAS);
        let second = layer(&first, &SECOND, &SECOND_BIAS);
        let mut shares = [LAST_BIAS; LANES];
        for unit in 0..HIDDEN {
            for lane in 0..LANES {
                shares[lane] += LAST[unit] * second[unit][lane];
            }
        }
        for lane in 0..LANES {
            // A softer step than the logistic function, and one that needs no exponential.
            let sum = shares[lane];
            shares[lane] = 0.5 + 0.5 * sum / (1.0 + sum * sum).sqrt();
        }
        shares
    }
}

/// Returns the units of a hidden layer. `weights` has a row for each unit.
#[allow(clippy::needless_range_loop)]
#[inline(always)]
fn layer<const N: usize>(
    inputs: &[[f32; LANES]; N],
    weights: &[[f32; N]; HIDDEN],
    bias: &[f32; HIDDEN],
) -> [[f32; LANES]; HIDDEN] {
    let mut units = [[0.0; LANES]; HIDDEN];
    for unit in 0..HIDDEN {
        let mut sums = [bias[unit]; LANES];
        for input in 0..N {
            for lane in 0..LANES {
                sums[lane] += weights[unit][input] * inputs[input][lane];
            }
        }
        for lane in 0..LANES {
            units[unit][lane] = sums[lane].max(0.0);
        }
    }
    units
}

/// Returns the binary logarithm of a positive number with an error of at most 1.2e-4, within
/// [`RANGE`]. Loops over it use wide instructions, unlike those over [`f32::log2`].
#[inline(always)]
fn log2(value: f32) -> f32 {
    let bits = value.clamp(f32::MIN_POSITIVE, f32::MAX).to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let m = f32::from_bits(bits & 0x7f_ffff | 0x3f80_0000) - 1.0;
    // Exact at powers of 2. The factors have the least greatest error.
    let curve = 0.438_724_8 - m * (0.239_054_5 - m * 0.082_127_7);
    let fraction = m * (1.0 + (1.0 - m) * curve);
    (exponent as f32 + fraction).clamp(RANGE[0], RANGE[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_cpu::Instructions;

    #[test]
    fn logarithms_have_the_stated_error_and_range() {
        for number in -16_000..=16_000 {
            let wanted = number as f32 / 1000.0;
            let found = log2(wanted.exp2());
            assert!((found - wanted).abs() < 1.2e-4, "{wanted}: {found}");
        }
        for (value, wanted) in
            [(0.0, -16.0), (1e-30, -16.0), (1e30, 16.0), (f32::INFINITY, 16.0), (1.0, 0.0)]
        {
            assert_eq!(log2(value), wanted, "{value}");
        }
    }

    /// Inputs that differ from square to square and span all magnitudes.
    fn inputs() -> Inputs {
        std::array::from_fn(|input| {
            std::array::from_fn(|lane| {
                let random = holo_display::split_mix((input * LANES + lane) as u64) >> 40;
                (40.0 * (random as f32 / (1 << 24) as f32) - 20.0).exp2()
            })
        })
    }

    #[test]
    fn shares_are_those_of_the_formula_on_every_processor() {
        let inputs = inputs();
        let sets: Vec<_> = Instructions::available().into_iter().filter_map(Isa::new).collect();
        let all = shares(sets[0], &inputs);
        for &isa in &sets[1..] {
            assert_eq!(shares(isa, &inputs), all, "{isa:?}");
        }
        for (lane, &found) in all.iter().enumerate() {
            let seen: Vec<f64> = inputs.iter().map(|lanes| f64::from(log2(lanes[lane]))).collect();
            let unit = |values: &[f64], weights: &[f32], bias: f32| {
                let terms = values.iter().zip(weights).map(|(v, &w)| v * f64::from(w));
                terms.sum::<f64>() + f64::from(bias)
            };
            let rectified = |of: f64| of.max(0.0);
            let first: Vec<f64> =
                (0..HIDDEN).map(|n| rectified(unit(&seen, &FIRST[n], FIRST_BIAS[n]))).collect();
            let second: Vec<f64> =
                (0..HIDDEN).map(|n| rectified(unit(&first, &SECOND[n], SECOND_BIAS[n]))).collect();
            let sum = unit(&second, &LAST, LAST_BIAS);
            let wanted = 0.5 + 0.5 * sum / (1.0 + sum * sum).sqrt();
            assert!((f64::from(found) - wanted).abs() < 1e-5, "{found} {wanted}");
            assert!((0.0..=1.0).contains(&found));
        }
    }
}
