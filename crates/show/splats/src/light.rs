//! Light of a node in 31 bits: luminance, chromaticity, and the luminance's standard error.
//!
//! Invariants: grey stays grey, bit for bit. Decoding and encoding again gives the same code.

use holo_color::{WEIGHTS, relative_luminance};

/// Bits of the luminance. Code 0 is black.
const LUMINANCE_BITS: u32 = 12;

/// The greatest luminance code.
const BRIGHTEST: u32 = (1 << LUMINANCE_BITS) - 1;

/// Steps for each doubling of luminance: one is 0.54 %.
const STEPS_PER_OCTAVE: f32 = 128.0;

/// Steps of the shares of red and of blue. A third, the share of grey, is one of them.
const SHARES: f32 = 126.0;

/// Bits of a share.
const SHARE_BITS: u32 = 7;

/// The greatest code of an error. Code 0 is an unknown error.
const LARGEST_ERROR: u32 = 31;

/// Binary logarithm of the error with code 0, were it not unknown.
const LEAST_ERROR: f32 = -10.0;

/// Steps for each doubling of an error.
const ERROR_STEPS: f32 = 2.5;

/// The code of light: 31 bits.
///
/// Bits 0 to 11 are the luminance, 12 to 18 the share of red in the sum of channels, 19 to 25 that
/// of blue, 26 to 30 the standard error of the luminance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightCode(pub u32);

impl LightCode {
    /// Encodes a radiance and the standard error of its luminance as a share of it. `peak` is the
    /// binary logarithm of the greatest luminance that can be encoded; 2⁻³² of it and less is
    /// black. Luminance has a relative error of at most 0.27 %, the standard error of 15 %.
    pub fn new(rgb: [f32; 3], error: f32, peak: f32) -> LightCode {
        let rgb = rgb.map(|channel| if channel > 0.0 { channel } else { 0.0 });
        let luminance = relative_luminance(rgb);
        let place = BRIGHTEST as f32 + (luminance.log2() - peak) * STEPS_PER_OCTAVE;
        // The conversion saturates, and NaN, of infinite over infinite, becomes 0.
        let code = (place.round() as u32).min(BRIGHTEST);
        let sum = rgb[0] + rgb[1] + rgb[2];
        let share = |channel: f32| match sum > 0.0 && sum.is_finite() {
            true => (channel / sum * SHARES).round() as u32,
            false => (SHARES / 3.0).round() as u32,
        };
        let (red, mut blue) = (share(rgb[0]), share(rgb[2]));
        // Two halves that were both rounded up leave less than nothing to green.
        blue = blue.min(SHARES as u32 - red);
        let error = ((error.log2() - LEAST_ERROR) * ERROR_STEPS).round();
        let error =
            if error.is_finite() { error.clamp(1.0, LARGEST_ERROR as f32) as u32 } else { 0 };
        let shares = red | blue << SHARE_BITS;
        LightCode(code | shares << LUMINANCE_BITS | error << (LUMINANCE_BITS + 2 * SHARE_BITS))
    }

    /// Returns the luminance in the unit of radiance.
    pub fn luminance(self, peak: f32) -> f32 {
        match self.0 & BRIGHTEST {
            0 => 0.0,
            code => (peak - (BRIGHTEST - code) as f32 / STEPS_PER_OCTAVE).exp2(),
        }
    }

    /// Returns the radiance.
    pub fn rgb(self, peak: f32) -> [f32; 3] {
        let share =
            |at: u32| self.0 >> (LUMINANCE_BITS + at * SHARE_BITS) & ((1 << SHARE_BITS) - 1);
        let all = SHARES as u32;
        let (red, blue) = (share(0).min(all), share(1));
        let blue = blue.min(all - red);
        let [red, green, blue] = [red, all - red - blue, blue].map(|code| code as f32 / SHARES);
        let relative = WEIGHTS[0] * red + WEIGHTS[1] * green + WEIGHTS[2] * blue;
        let sum = self.luminance(peak) / relative.max(f32::MIN_POSITIVE);
        [red * sum, green * sum, blue * sum]
    }

    /// Returns the standard error of the luminance as a share of it; infinite if it is unknown.
    pub fn error(self) -> f32 {
        match self.0 >> (LUMINANCE_BITS + 2 * SHARE_BITS) & LARGEST_ERROR {
            0 => f32::INFINITY,
            code => (LEAST_ERROR + code as f32 / ERROR_STEPS).exp2(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_keeps_its_luminance_colour_and_error() {
        let peak = 10.0;
        for rgb in [[1.0, 1.0, 1.0], [900.0, 20.0, 0.5], [1e-4, 3e-4, 2e-5], [0.0, 0.0, 7.0]] {
            for error in [0.002, 0.05, 0.9, 4.0] {
                let code = LightCode::new(rgb, error, peak);
                let (back, before) = (code.rgb(peak), relative_luminance(rgb));
                assert!((relative_luminance(back) / before - 1.0).abs() < 2.8e-3, "{rgb:?}");
                let sum: f32 = rgb.iter().sum();
                for (was, is) in rgb.iter().zip(back) {
                    assert!((was - is).abs() < 0.02 * sum, "{rgb:?} {back:?}");
                }
                assert!((code.error() / error).log2().abs() < 0.21, "{error} {}", code.error());
                assert_eq!(LightCode::new(back, code.error(), peak), code);
            }
        }
        let grey = LightCode::new([0.3; 3], 1.0, 0.0).rgb(0.0);
        assert!(grey[0] == grey[1] && grey[1] == grey[2], "{grey:?}");
    }

    #[test]
    fn what_is_no_light_is_black_and_what_is_no_error_is_unknown() {
        for bad in [0.0, -1.0, f32::NAN] {
            assert_eq!(LightCode::new([bad; 3], f32::NAN, 3.0).rgb(3.0), [0.0; 3]);
        }
        assert_eq!(LightCode::new([1.0; 3], f32::INFINITY, 3.0).error(), f32::INFINITY);
        assert_eq!(LightCode::new([1e30; 3], 0.1, 3.0).luminance(3.0), 8.0);
    }
}
