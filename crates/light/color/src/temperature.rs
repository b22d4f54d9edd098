//! The colours of lamps: chromaticities of glowing bodies and of daylight, and their channels.

use glam::DVec3;

use crate::{Primaries, WEIGHTS, xyz};

/// Range of colour temperatures, kelvin.
pub const TEMPERATURES: std::ops::RangeInclusive<f64> = 1000.0..=25_000.0;

/// Temperature from which white light counts as daylight, kelvin (CIE 13.3).
const DAYLIGHT_FROM: f64 = 5000.0;

/// First and second radiation constant over visible wavelengths: c₂ in nanometre kelvin.
const SECOND_RADIATION: f64 = 1.438_776_877e7;

/// Returns the chromaticity of white light of a correlated colour temperature: that of a glowing
/// body below 5000 K, and that of daylight from there (CIE 15:2004, §3.1).
#[must_use]
pub fn chromaticity_of(kelvin: f64) -> [f64; 2] {
    if kelvin < DAYLIGHT_FROM {
        return glowing_body(kelvin);
    }
    let t = 1000.0 / kelvin;
    let x = match kelvin {
        ..=7000.0 => 0.244_063 + 0.099_11 * t + 2.967_8 * t.powi(2) - 4.607 * t.powi(3),
        _ => 0.237_04 + 0.247_48 * t + 1.901_8 * t.powi(2) - 2.006_4 * t.powi(3),
    };
    [x, -3.0 * x * x + 2.87 * x - 0.275]
}

/// Returns the chromaticity of a glowing body, from Planck's law.
fn glowing_body(kelvin: f64) -> [f64; 2] {
    let mut sum = DVec3::ZERO;
    for nanometres in (380..=780).step_by(5) {
        let wavelength = f64::from(nanometres);
        let power = wavelength.powi(-5) / ((SECOND_RADIATION / (wavelength * kelvin)).exp_m1());
        sum += observer(wavelength) * power;
    }
    [sum.x / sum.element_sum(), sum.y / sum.element_sum()]
}

/// Returns the responses of the CIE's standard observer, as sums of bells (Wyman, Sloan and Shirley
/// 2013, "Simple Analytic Approximations to the CIE XYZ Color Matching Functions").
fn observer(nanometres: f64) -> DVec3 {
    let bell = |height: f64, middle: f64, [below, above]: [f64; 2]| {
        let width = if nanometres < middle { below } else { above };
        height * (-0.5 * ((nanometres - middle) / width).powi(2)).exp()
    };
    DVec3::new(
        bell(1.056, 599.8, [37.9, 31.0]) + bell(0.362, 442.0, [16.0, 26.7])
            - bell(0.065, 501.1, [20.4, 26.2]),
        bell(0.821, 568.8, [46.9, 40.5]) + bell(0.286, 530.9, [16.3, 31.1]),
        bell(1.217, 437.0, [11.8, 36.0]) + bell(0.681, 459.0, [26.0, 13.8]),
    )
}

/// Returns the channels of light of a chromaticity whose relative luminance is 1, and whether a
/// channel had to be raised to 0 because the colour lies outside of the primaries. `None` if there
/// is no such colour.
#[must_use]
pub fn channels_of(chromaticity: [f64; 2]) -> Option<([f32; 3], bool)> {
    let [x, y] = chromaticity;
    if !(x >= 0.0 && y > 1e-3 && x + y <= 1.0) {
        return None;
    }
    let channels = Primaries::REC709.to_xyz().inverse() * xyz([x, y]);
    let is_outside = channels.min_element() < 0.0;
    let inside = channels.max(DVec3::ZERO);
    let luminance = inside.dot(DVec3::from_array(WEIGHTS.map(f64::from)));
    (luminance > 0.0).then(|| ((inside / luminance).as_vec3().to_array(), is_outside))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_white_lights_have_their_chromaticity() {
        // Illuminant A, D65, D50 and two points of the Planckian locus.
        for (kelvin, expected) in [
            (2855.5, [0.4476, 0.4074]),
            (6504.0, [0.3127, 0.3290]),
            (5003.0, [0.3457, 0.3585]),
            (4000.0, [0.3805, 0.3768]),
            (2000.0, [0.5267, 0.4133]),
        ] {
            let [x, y] = chromaticity_of(kelvin);
            let error = (x - expected[0]).abs().max((y - expected[1]).abs());
            assert!(error < 2.5e-3, "{kelvin}: {x:.4} {y:.4}");
        }
    }

    #[test]
    fn channels_have_luminance_1_and_d65_is_white() {
        let (white, is_outside) = channels_of([0.3127, 0.329]).unwrap();
        assert!(white.iter().all(|channel| (channel - 1.0).abs() < 1e-3) && !is_outside);
        for kelvin in [1000.0, 2700.0, 4999.0, 5000.0, 9000.0, 25_000.0] {
            let (channels, _) = channels_of(chromaticity_of(kelvin)).unwrap();
            let luminance: f32 = channels.iter().zip(WEIGHTS).map(|(c, w)| c * w).sum();
            assert!((luminance - 1.0).abs() < 1e-5 && channels.iter().all(|c| *c >= 0.0));
            assert!((channels[0] > channels[2]) == (kelvin < 6400.0), "{kelvin}: {channels:?}");
        }
        assert!(channels_of([0.7, 0.299]).unwrap().1, "a red of one wavelength");
        for bad in [[0.0, 0.0], [0.6, 0.6], [f64::NAN, 0.3]] {
            assert_eq!(channels_of(bad), None);
        }
    }
}
