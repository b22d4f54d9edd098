//! The colours of false-colour pictures: from dark violet over blue, teal and green to light
//! yellow.
//!
//! The table follows a line of Oklab (Ottosson 2020, "A perceptual color space for image
//! processing") on which lightness grows evenly and hue turns evenly. So equal steps of luminance
//! look equal. Lightness alone gives their order, also for colour-blind people and in grey prints.

use std::sync::LazyLock;

use super::bytes::CLIPPED;

/// Number of colours.
pub(super) const COLORS: usize = 256;

/// Lightness of the first and the last colour.
const LIGHTNESS: [f64; 2] = [0.24, 0.95];

/// Hue of the first and the last colour, in degrees.
const HUE: [f64; 2] = [305.0, 105.0];

/// Greatest chroma. If sRGB lacks a colour, its chroma is reduced until sRGB has it.
const CHROMA: f64 = 0.16;

/// Colours from the low end of a scale to its high one, sRGB.
pub(super) static TABLE: LazyLock<[[u8; 3]; COLORS]> = LazyLock::new(|| {
    std::array::from_fn(|index| {
        let share = index as f64 / (COLORS - 1) as f64;
        let on_line = |[from, to]: [f64; 2]| from + (to - from) * share;
        let (lightness, hue) = (on_line(LIGHTNESS), on_line(HUE).to_radians());
        let color = |chroma: f64| linear_rgb(lightness, chroma * hue.cos(), chroma * hue.sin());
        let is_shown = |rgb: [f64; 3]| rgb.iter().all(|value| (0.0..=1.0).contains(value));
        let (mut low, mut high) = (0.0, CHROMA);
        if is_shown(color(high)) {
            low = high;
        }
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if is_shown(color(middle)) { low = middle } else { high = middle }
        }
        CLIPPED.color(color(low).map(|value| value as f32))
    })
});

/// Returns the colour of a place on a scale, from 0 to 1.
#[inline]
pub(super) fn color(place: f32) -> [u8; 3] {
    TABLE[((place * (COLORS - 1) as f32 + 0.5) as usize).min(COLORS - 1)]
}

/// Converts Oklab to linear sRGB.
fn linear_rgb(lightness: f64, a: f64, b: f64) -> [f64; 3] {
    let cube = |by_a: f64, by_b: f64| (lightness + by_a * a + by_b * b).powi(3);
    let l = cube(0.396_337_777_4, 0.215_803_757_3);
    let m = cube(-0.105_561_345_8, -0.063_854_172_8);
    let s = cube(-0.089_484_177_5, -1.291_485_548_0);
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::look::bytes::linear;

    /// Colours as seen by people without one kind of cones, in linear sRGB (Machado, Oliveira &
    /// Fernandes 2009, Table 1, "A Physiologically-based Model for Simulation of Color Vision
    /// Deficiency").
    const BLINDNESS: [[[f64; 3]; 3]; 4] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ],
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ],
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ],
    ];

    /// Lightness as CIE L*.
    fn lightness(rgb: [f64; 3]) -> f64 {
        let y = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        if y > 0.008_856 { 116.0 * y.cbrt() - 16.0 } else { 903.3 * y }
    }

    #[test]
    fn everybody_sees_lighter_colours_for_more_light() {
        for eye in BLINDNESS {
            let seen = |&color: &[u8; 3]| {
                let rgb = color.map(|byte| linear(f64::from(byte) / 255.0));
                lightness(eye.map(|row| (0..3).map(|i| row[i] * rgb[i]).sum::<f64>().max(0.0)))
            };
            let seen: Vec<f64> = TABLE.iter().map(seen).collect();
            // Sixteenths of the scale look 2 to 9 steps of L* apart, where 1 can be seen.
            for pair in seen.iter().step_by(COLORS / 16).collect::<Vec<_>>().windows(2) {
                assert!((2.0..9.0).contains(&(pair[1] - pair[0])), "{pair:?}");
            }
        }
    }

    #[test]
    fn the_ends_are_dark_violet_and_light_yellow() {
        let [red, green, blue] = color(0.0);
        assert!(blue > red && red > green && blue < 120);
        let [red, green, blue] = color(1.0);
        assert!(red > 230 && green > 230 && blue < 200);
    }
}
