//! The limits of an adapted human eye (Larson, Rushmeier & Piatko 1997): contrast, detail and
//! colour. Luminances are in cd/m².

use holo_color::luminance;

/// Least change of the automatic exposure, as a binary logarithm, that anybody sees: 2 %. Smaller
/// changes would alter every pixel of a picture at rest for nothing.
pub(crate) const SEEN_STEP: f32 = 0.03;

/// Luminance below which only rods see, and above which only cones do (§5.2).
const MESOPIC: [f32; 2] = [5.62e-3, 5.62];

/// Weights of the channels in scotopic luminance (Radiance's primaries and the CIE's scotopic
/// observer of 1951). They sum to 1, so that the luminance of grey does not change.
const SCOTOPIC: [f32; 3] = [0.062, 0.608, 0.330];

/// Returns the least difference of luminance that an eye adapted to `adaptation` detects (§4.3,
/// Table 1, from Ferwerda et al. 1996).
pub(super) fn threshold(adaptation: f64) -> f64 {
    let log = adaptation.max(1e-30).log10();
    let log_threshold = if log < -3.94 {
        -2.86
    } else if log < -1.44 {
        (0.405 * log + 1.6).powf(2.18) - 2.86
    } else if log < -0.0184 {
        log - 0.395
    } else if log < 1.9 {
        (0.249 * log + 0.65).powf(2.7) - 0.72
    } else {
        log - 1.255
    };
    10_f64.powf(log_threshold)
}

/// Returns the greatest slope of a tone curve from log luminance `world` to log luminance `display`
/// (§4.3). With a greater one, the display would show contrast that an eye cannot see in the scene.
pub(super) fn most_slope(world: f64, display: f64) -> f64 {
    let world = world.max(1e-30);
    (threshold(display) / display) / (threshold(world) / world)
}

/// Returns the finest grating that an eye adapted to `adaptation` resolves, in cycles per degree
/// (§5.3, fitted to Shlaer 1937).
///
/// Below 1e-4 cd/m², where the fit ends, it is that of 1e-4.
pub(super) fn acuity(adaptation: f32) -> f32 {
    17.25 * (1.4 * adaptation.max(1e-4).log10() + 0.35).atan() + 25.72
}

/// Returns the colour that an eye sees: grey in the dark, where only rods work, and whole in the
/// light (§5.2).
#[inline]
pub(super) fn seen_color(rgb: [f32; 3]) -> [f32; 3] {
    let [scotopic, photopic] = MESOPIC;
    let cones = ((luminance(rgb) - scotopic) / (photopic - scotopic)).clamp(0.0, 1.0);
    if cones == 1.0 {
        return rgb;
    }
    let rods: f32 = (0..3).map(|channel| SCOTOPIC[channel] * rgb[channel]).sum();
    rgb.map(|value| cones * value + (1.0 - cones) * rods)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_rise_with_light_without_a_jump() {
        let logs = (-800..800).map(|i| f64::from(i) * 0.01);
        let thresholds: Vec<f64> = logs.map(|log| threshold(10_f64.powf(log)).log10()).collect();
        assert!(thresholds.windows(2).all(|pair| (-0.01..0.02).contains(&(pair[1] - pair[0]))));
        // By day, an eye detects 5.6 % (10^-1.255).
        assert!((threshold(1000.0) - 55.6).abs() < 0.1);
    }

    #[test]
    fn a_display_as_bright_as_the_scene_may_show_its_contrast() {
        assert!((most_slope(30.0, 30.0) - 1.0).abs() < 1e-12);
        // By night an eye sees less contrast than on a display.
        assert!(most_slope(1e-3, 10.0) < 0.2);
    }

    #[test]
    fn fine_gratings_need_light() {
        assert!((2.0..4.0).contains(&acuity(1e-3)), "{}", acuity(1e-3));
        assert!((45.0..52.0).contains(&acuity(1000.0)));
        assert!(acuity(0.0) > 1.0);
    }

    #[test]
    fn colours_fade_in_the_dark_and_grey_keeps_its_luminance() {
        let red = [1.0, 0.1, 0.1];
        let scaled = |factor: f32| red.map(|value: f32| value * factor);
        assert_eq!(seen_color(scaled(1.0)), scaled(1.0));
        let night = seen_color(scaled(1e-5));
        assert!(night[0] == night[1] && night[1] == night[2]);
        // Rods hardly see red.
        assert!(luminance(night) < 0.6 * luminance(scaled(1e-5)));
        let dusk = seen_color(scaled(1e-2));
        let ratio = dusk[0] / dusk[1];
        assert!((1.0..10.0).contains(&ratio), "{ratio}");
        let grey = seen_color([1e-4; 3]);
        assert!((luminance(grey) / luminance([1e-4; 3]) - 1.0).abs() < 1e-4);
    }
}
