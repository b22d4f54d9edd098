//! Coordinates as people read them.
//!
//! Invariant: the step of rounding follows from the size of the scene and from its unit, never from
//! the distance to the origin. A house at map coordinates keeps its millimetres.

/// Rounding of coordinates, as a share of the scene's size.
const SHARE: f64 = 1e-4;

/// Coarsest rounding of coordinates, metres.
const COARSEST: f64 = 1e-4;

/// Returns the step to which coordinates in a scene of this size are rounded: a power of ten, in
/// scene units. `unit` is the scene's unit in metres.
pub fn step(size: f64, unit: f64) -> f64 {
    let finest = (size * SHARE).min(COARSEST / unit);
    10f64.powf(finest.max(f64::MIN_POSITIVE).log10().floor())
}

/// Returns the multiple of `step`, a power of ten, that is nearest to a value.
pub fn rounded(value: f64, step: f64) -> f64 {
    let rounded = (value / step).round() * step;
    // Decimal places, so that the number prints as rounded.
    let places = (-step.log10()).max(0.0).round() as usize;
    format!("{rounded:.places$}").parse().unwrap_or(value) + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_a_tenth_of_a_millimetre_or_finer() {
        assert_eq!([step(7.0, 1.0), step(20_000.0, 1.0), step(0.3, 1.0)], [1e-4, 1e-4, 1e-5]);
        assert_eq!([step(7000.0, 1e-3), step(0.007, 1e3)], [0.1, 1e-7]);
    }

    #[test]
    fn numbers_are_printed_as_short_as_they_need_to_be() {
        assert_eq!(rounded(12.345_678, 1e-3).to_string(), "12.346");
        assert_eq!(rounded(-0.000_01, 1e-4).to_string(), "0");
        assert_eq!(rounded(123_456.7, 10.0).to_string(), "123460");
        assert_eq!(rounded(100_000_000.123_45, 1e-3).to_string(), "100000000.123");
    }
}
