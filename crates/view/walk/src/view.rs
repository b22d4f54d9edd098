//! A view as Radiance's options.

use glam::DVec3;
use holo_picture::ViewSpec;

/// Least number of significant digits. A millionth of a building is invisible.
const DIGITS: i32 = 7;

/// Least number of decimals. A building far from the origin keeps its millimetres, even if the unit
/// is a kilometre.
const DECIMALS: i32 = 6;

/// Whole numbers from here on leave no room for decimals in an `f64`: 2⁵².
const WHOLE: f64 = 4_503_599_627_370_496.0;

/// Returns the stated parts of a view as Radiance's options, such as `-vtv -vp 1 2 1.6 -vd 0 1 0
/// -vh 60`. Numbers have 7 digits, or six decimals if these are more. Numbers of a vector have the
/// decimals of its largest number.
pub fn options(spec: &ViewSpec) -> String {
    let mut words = vec![format!("-vt{}", spec.kind.unwrap_or_default().letter())];
    for (name, value) in [("vp", spec.vp), ("vd", spec.vd), ("vu", spec.vu)] {
        words.extend(value.map(|value| triple(name, value)));
    }
    let sizes = [("vh", spec.vh), ("vv", spec.vv), ("vo", spec.vo), ("va", spec.va)];
    for (name, value) in sizes.into_iter().chain([("vs", spec.vs), ("vl", spec.vl)]) {
        words.extend(value.map(|value| format!("-{name} {}", rounded(value, value.abs()))));
    }
    words.join(" ")
}

fn triple(name: &str, value: DVec3) -> String {
    let largest = value.abs().max_element();
    let [x, y, z] = value.to_array().map(|part| rounded(part, largest));
    format!("-{name} {x} {y} {z}")
}

/// Rounds a number to [`DIGITS`] digits of `largest`, or to [`DECIMALS`] if these are finer.
fn rounded(value: f64, largest: f64) -> f64 {
    // The cast saturates, because the logarithm of 0 is negative infinity.
    let decimals = (DIGITS - 1).saturating_sub(largest.log10().floor() as i32).max(DECIMALS);
    let up = 10f64.powi(decimals.min(300));
    if decimals >= 300 || (value * up).abs() >= WHOLE {
        return value;
    }
    // Turns -0 into 0.
    (value * up).round() / up + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_short_and_say_the_same_view_when_they_are_read_again() {
        let mut spec = ViewSpec::default();
        spec.apply_line("-vp 12.3456789123 0.1 -1e-12 -vd .6 .8 0 -vu 0 0 1 -vh 60").unwrap();
        let line = options(&spec);
        assert_eq!(line, "-vtv -vp 12.345679 0.1 0 -vd 0.6 0.8 0 -vu 0 0 1 -vh 60");
        let mut again = ViewSpec::default();
        again.apply_line(&line).unwrap();
        assert_eq!(options(&again), line);
    }

    #[test]
    fn millimetres_of_map_coordinates_are_written_whatever_the_unit() {
        for metres in [1e-3, 1.0, 1e3] {
            let at = DVec3::new(5_400_000.123, -99_999_999.877, 300.001) / metres;
            let spec = ViewSpec { vp: Some(at), vd: Some(DVec3::Y), ..ViewSpec::default() };
            let mut again = ViewSpec::default();
            again.apply_line(&options(&spec)).unwrap();
            let error = again.vp.unwrap().distance(at) * metres;
            assert!(error < 5e-4, "{metres}: {error} m");
        }
    }

    #[test]
    fn large_and_small_numbers_keep_their_digits() {
        assert_eq!([0.0, 1e-320].map(|value| rounded(value, value)), [0.0, 1e-320]);
        assert_eq!(rounded(123_456_789.0, 123_456_789.0), 123_456_789.0);
        assert_eq!(rounded(100_000_000.001_234_4, 1e8), 100_000_000.001_234);
        assert_eq!(rounded(1e300, 1e300), 1e300);
        assert_eq!(rounded(1.234_567_89e-9, 1.234_567_89e-9), 1.234_568e-9);
    }
}
