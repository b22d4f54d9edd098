//! Colours in four bytes: three mantissas and an exponent, as RGBE, with the exponent placed for fast decoding.
//!
//! Always true: a colour that was encoded is never [`NONE`], so that 0 says "no point here"; decoding gives the encoded value
//! within 0.2 % of its largest channel (the mantissas are rounded), 0 for channels below 2⁻¹²⁶.

/// No colour: decodes to 0.
pub(super) const NONE: u32 = 0;
/// No light: what [`encode`] gives for it.
pub(super) const BLACK: u32 = 1 << 24;
/// Largest radiance kept: above it sums of 49 would overflow.
pub(super) const LARGEST: f32 = 1e30;
/// Exponents of powers of two in f32.
const BIAS: i32 = 127;

/// Packs a radiance; negative channels and NaN become 0, large ones [`LARGEST`].
#[inline]
#[allow(clippy::manual_clamp)] // `clamp` would keep NaN.
pub(super) fn encode(rgb: [f32; 3]) -> u32 {
    // `max` first: it turns NaN into 0.
    let rgb = rgb.map(|channel| channel.max(0.0).min(LARGEST));
    let largest = rgb[0].max(rgb[1]).max(rgb[2]);
    // 2^exponent > largest, so that mantissas of 8 bits are below 256.
    let exponent = (largest.to_bits() >> 23) as i32 - BIAS + 1;
    let mut step = (exponent - 8 + BIAS).max(1);
    let mantissa = |step: i32| {
        rgb.map(|channel| {
            (channel * f32::from_bits((2 * BIAS - step) as u32 * (1 << 23)) + 0.5) as u32
        })
    };
    let mut mantissas = mantissa(step);
    if mantissas.iter().any(|&mantissa| mantissa > 255) {
        step += 1;
        mantissas = mantissa(step);
    }
    (step as u32) << 24 | mantissas[0] | mantissas[1] << 8 | mantissas[2] << 16
}

/// The three channels.
#[inline(always)]
pub(super) fn decode(colour: u32) -> [f32; 3] {
    let step = f32::from_bits(colour >> 24 << 23);
    // Through i32: conversion from unsigned takes longer on processors without AVX-512.
    let channel = |shift: u32| (colour >> shift & 255) as i32 as f32 * step;
    [channel(0), channel(8), channel(16)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn colours_come_back_within_a_fifth_of_a_percent(rgb in prop::array::uniform3(1e-30f32..1e30)) {
            let largest = rgb[0].max(rgb[1]).max(rgb[2]);
            let back = decode(encode(rgb));
            for (back, rgb) in back.into_iter().zip(rgb) {
                prop_assert!((back - rgb).abs() <= largest / 256.0, "{back} for {rgb}");
            }
        }

        #[test]
        fn anything_at_all_becomes_a_colour(rgb in prop::array::uniform3(any::<u32>())) {
            let colour = encode(rgb.map(f32::from_bits));
            prop_assert_ne!(colour, NONE);
            prop_assert!(decode(colour).iter().all(|&channel| (0.0..=1.01 * LARGEST).contains(&channel)));
        }
    }

    #[test]
    fn black_is_a_colour() {
        assert_ne!(encode([0.0; 3]), NONE);
        assert_eq!(encode([0.0; 3]), BLACK);
        assert_eq!(decode(encode([0.0; 3])), [0.0; 3]);
        assert_eq!(decode(NONE), [0.0; 3]);
    }
}
