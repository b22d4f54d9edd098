//! Tone mapping: radiance to the bytes of a display.
//!
//! Always true: black stays black, and more light never gives a smaller byte. An automatic exposure
//! follows the picture: a picture that is k times as bright everywhere looks the same.

use crate::picture::{Picture, luminance};

/// Linear display value of the log-average luminance: the photographer's grey card (Reinhard et al.
/// 2002, "Photographic tone reproduction for digital images", §2).
const KEY: f64 = 0.18;

/// Display value at which the shoulder begins. Below, display values are proportional to radiance.
/// Above, they bend towards 1, so that a lamp keeps some shape instead of clipping.
const SHOULDER: f32 = 0.6;

/// Greatest factor between a luminance and the median that counts for the exposure. So neither a
/// lamp nor a dark crack decides how a room is shown.
const OUTLIER: f32 = 100.0;

/// A global tone curve: exposure, a soft shoulder, sRGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToneMap {
    exposure: f32,
}

impl ToneMap {
    /// Returns a curve that multiplies radiance by `exposure`; a value that is not positive and
    /// finite is taken as 1.
    pub fn with_exposure(exposure: f32) -> ToneMap {
        ToneMap { exposure: if exposure.is_finite() && exposure > 0.0 { exposure } else { 1.0 } }
    }

    /// Returns the curve that maps the log-average luminance of all pixels above 0 to a middle
    /// grey.
    pub fn auto(picture: &Picture) -> ToneMap {
        let lit = |&rgb: &[f32; 3]| Some(luminance(rgb)).filter(|l| l.is_finite() && *l > 0.0);
        let mut luminances: Vec<f32> = picture.pixels.iter().filter_map(lit).collect();
        if luminances.is_empty() {
            return ToneMap::with_exposure(1.0);
        }
        let middle = luminances.len() / 2;
        let median = *luminances.select_nth_unstable_by(middle, f32::total_cmp).1;
        let (low, high) = (median / OUTLIER, median * OUTLIER);
        let log_sum: f64 = luminances.iter().map(|l| f64::from(l.max(low).min(high)).ln()).sum();
        let log_average = (log_sum / luminances.len() as f64).exp();
        // Grey of radiance 1 has luminance 179.
        ToneMap::with_exposure((KEY * 179.0 / log_average) as f32)
    }

    /// Returns the factor that radiance is multiplied by.
    pub fn exposure(&self) -> f32 {
        self.exposure
    }

    /// Returns the sRGB bytes of a radiance. NaN is black.
    #[inline]
    pub fn map(&self, rgb: [f32; 3]) -> [u8; 3] {
        rgb.map(|radiance| to_byte(srgb(shoulder(radiance * self.exposure))))
    }

    /// Returns the display colours of a picture: 3 bytes per pixel, rows from the top.
    pub fn apply(&self, picture: &Picture) -> Vec<u8> {
        picture.pixels.iter().flat_map(|&rgb| self.map(rgb)).collect()
    }
}

/// Identity up to [`SHOULDER`], then an exponential approach to 1 that starts with slope 1.
fn shoulder(x: f32) -> f32 {
    let rest = 1.0 - SHOULDER;
    if x <= SHOULDER { x } else { SHOULDER + rest * (1.0 - ((SHOULDER - x) / rest).exp()) }
}

/// The transfer function of IEC 61966-2-1.
fn srgb(x: f32) -> f32 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

fn to_byte(x: f32) -> u8 {
    // The cast saturates and takes NaN to 0.
    (x * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Picture {
        let pixels = (0..256).map(|i| [1e-3 * 1.05f32.powi(i); 3]).collect();
        Picture::from_pixels(16, 16, pixels).unwrap()
    }

    #[test]
    fn a_grey_card_is_shown_at_the_key_whatever_its_brightness() {
        // sRGB of 0.18 by IEC 61966-2-1: 255 * (1.055 * 0.18^(1/2.4) - 0.055) = 117.6.
        for brightness in [1e-20, 1e-4, 1.0, 3e5, 1e30] {
            let card = Picture::from_pixels(2, 1, vec![[brightness; 3]; 2]).unwrap();
            assert_eq!(ToneMap::auto(&card).map([brightness; 3]), [118; 3], "{brightness}");
        }
    }

    #[test]
    fn more_light_never_gives_a_smaller_byte_and_lamps_keep_their_shape() {
        let tone = ToneMap::auto(&ramp());
        let bytes: Vec<u8> = ramp().pixels.iter().map(|&rgb| tone.map(rgb)[1]).collect();
        assert!(bytes.is_sorted());
        // A value of 1.5 would be clipped without the shoulder; with it, it still differs from 2.
        let linear = ToneMap::with_exposure(1.0);
        assert!(linear.map([1.5; 3])[0] < linear.map([2.0; 3])[0] && linear.map([2.0; 3])[0] < 255);
    }

    #[test]
    fn a_lamp_and_empty_pixels_hardly_move_the_exposure() {
        let plain = ToneMap::auto(&ramp()).exposure();
        let mut with_lamp = ramp();
        with_lamp.pixels.truncate(255);
        with_lamp.pixels.push([1e9; 3]);
        let lamp = ToneMap::auto(&with_lamp).exposure();
        // One pixel of 256 counts at most as a factor of OUTLIER^(1/256) = 1.018; so does the pixel
        // it replaced.
        assert!((lamp / plain).ln().abs() < 2.0 * OUTLIER.ln() / 256.0, "{plain} {lamp}");
        let mut empty = ramp();
        empty.height = 32;
        empty.pixels.resize(512, [0.0; 3]);
        assert_eq!(ToneMap::auto(&empty).exposure(), plain);
    }

    #[test]
    fn black_and_nan_are_black() {
        let tone = ToneMap::auto(&Picture::new(4, 4));
        assert_eq!(tone.exposure(), 1.0);
        assert_eq!(tone.map([0.0, f32::NAN, -1.0]), [0, 0, 0]);
        assert_eq!(tone.map([f32::INFINITY; 3]), [255; 3]);
    }
}
