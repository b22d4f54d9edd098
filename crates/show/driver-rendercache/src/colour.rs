//! Colours in four bytes: three mantissas and a common exponent, as RGBE has them, with the
//! exponent placed for fast decoding.
//!
//! Invariants:
//! - An encoded colour is never [`NONE`], not even black.
//! - Decoding gives the encoded colour within 0.2 % of its largest channel.

/// No point: decodes to 0.
pub(crate) const NONE: u32 = 0;
/// No light: what [`encode`] gives for it.
pub(crate) const BLACK: u32 = 1 << 24;
/// Largest radiance that is kept: sums over the widest filter do not overflow.
pub(crate) const LARGEST: f32 = 1e30;
/// Bias of the exponent of an f32, and number of its mantissa's bits.
const BIAS: u32 = 127;
const MANTISSA: u32 = 23;

/// Packs a radiance whose channels are between 0 and [`LARGEST`].
pub(crate) fn encode(rgb: [f32; 3]) -> u32 {
    let largest = rgb[0].max(rgb[1]).max(rgb[2]);
    // The step with which the largest channel takes 8 bits, or one more if it is rounded up.
    let step = ((largest.to_bits() >> MANTISSA).saturating_sub(7)).max(1);
    let mantissas = |step: u32| {
        let scale = f32::from_bits((2 * BIAS - step) << MANTISSA);
        rgb.map(|channel| (channel * scale + 0.5) as u32)
    };
    let fits = mantissas(step).iter().all(|&mantissa| mantissa < 256);
    let step = if fits { step } else { step + 1 };
    let [red, green, blue] = mantissas(step);
    step << 24 | red | green << 8 | blue << 16
}

/// Returns the three channels.
#[inline(always)]
pub(crate) fn decode(colour: u32) -> [f32; 3] {
    let step = f32::from_bits(colour >> 24 << MANTISSA);
    let channel = |shift: u32| (colour >> shift & 255) as f32 * step;
    [channel(0), channel(8), channel(16)]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn colours_come_back_within_a_fifth_of_a_percent(
            rgb in prop::array::uniform3(prop_oneof![0f32..1.0, 0f32..1e30]),
        ) {
            let largest = rgb[0].max(rgb[1]).max(rgb[2]);
            let colour = encode(rgb);
            prop_assert_ne!(colour, NONE);
            for (back, rgb) in decode(colour).into_iter().zip(rgb) {
                prop_assert!((back - rgb).abs() <= largest / 256.0, "{back} for {rgb}");
            }
        }
    }

    #[test]
    fn black_is_a_colour_and_no_point_is_dark() {
        assert_eq!((encode([0.0; 3]), decode(BLACK)), (BLACK, [0.0; 3]));
        assert_ne!(BLACK, NONE);
        assert_eq!(decode(NONE), [0.0; 3]);
        assert!(encode([f32::MIN_POSITIVE / 8.0; 3]) != NONE);
    }
}
