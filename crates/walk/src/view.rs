//! A view as Radiance's options.

use glam::DVec3;
use holo_picture::ViewSpec;

/// Number of significant digits. A millionth of a building is invisible.
const DIGITS: i32 = 7;

/// Returns the stated parts of a view as Radiance's options, such as `-vtv -vp 1 2 1.6 -vd 0 1 0
/// -vh 60`. Numbers are rounded to 7 digits; those of a vector, to 7 digits of its largest number.
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

/// Rounds a number to [`DIGITS`] digits of `largest`.
fn rounded(value: f64, largest: f64) -> f64 {
    // The cast saturates, because the logarithm of 0 is negative infinity.
    let digits = (DIGITS - 1).saturating_sub(largest.log10().floor() as i32);
    if !(-300..300).contains(&digits) {
        return value;
    }
    let (up, down) = (10f64.powi(digits.abs()), value);
    let rounded = if digits < 0 { (down / up).round() * up } else { (down * up).round() / up };
    // Turns -0 into 0.
    rounded + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_short_and_say_the_same_view_when_they_are_read_again() {
        let mut spec = ViewSpec::default();
        spec.apply_line("-vp 12.3456789123 0.1 -1e-12 -vd .6 .8 0 -vu 0 0 1 -vh 60").unwrap();
        let line = options(&spec);
        assert_eq!(line, "-vtv -vp 12.34568 0.1 0 -vd 0.6 0.8 0 -vu 0 0 1 -vh 60");
        let mut again = ViewSpec::default();
        again.apply_line(&line).unwrap();
        assert_eq!(options(&again), line);
    }

    #[test]
    fn large_and_small_numbers_keep_their_digits() {
        assert_eq!([0.0, 1e-320].map(|value| rounded(value, value)), [0.0, 1e-320]);
        assert_eq!(rounded(123_456_789.0, 123_456_789.0), 123_456_800.0);
        assert_eq!(rounded(1.234_567_89e-9, 1.234_567_89e-9), 1.234_568e-9);
    }
}
