//! Colours with a shared exponent: four bytes R, G, B, E, with channel = byte · 2^(E-136) (after
//! Ward, "Real Pixels", Graphics Gems II, 1991).
//!
//! Decoding adds no half step, so that exact values stay exact. Invariant: the largest channel is
//! rounded to nearest, within 0.4 %. For the others, the mean of `decode(encode(x))` over all
//! dither values is x.

use crate::hash::mix32;

/// Largest channel value: 255·2¹¹⁹.
pub const MAX_CHANNEL: f32 = 255.0 * ((1u128 << 119) as f32);

/// Returns 2 to the power `exponent`, which must be a normal `f64` exponent.
fn exp2i(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// Encodes a radiance.
///
/// Negative and NaN channels become 0, and channels above [`MAX_CHANNEL`] become that. Colours
/// below 2⁻¹²⁸ become black.
///
/// The largest channel is rounded to nearest. The 32 uniform bits of `dither` round the others up
/// or down at random. Their expectation is then exact to 2⁻³² of a step.
pub fn encode(rgb: [f32; 3], dither: u32) -> [u8; 4] {
    let rgb = rgb.map(|v| if v > 0.0 { v.min(MAX_CHANNEL) } else { 0.0 });
    let largest =
        if rgb[0] >= rgb[1] && rgb[0] >= rgb[2] { 0 } else { 1 + usize::from(rgb[2] > rgb[1]) };
    let peak = f64::from(rgb[largest]);
    // The exponent of the power of 2 above the peak; every nonzero f32 is a normal f64. Zero has
    // the least exponent and becomes black.
    let above = (peak.to_bits() >> 52) as i32 - 1022;
    let mut exponent = above + 128;
    // With a peak above 255 steps, a dithered channel could round up to 256. A greater exponent
    // avoids that.
    if peak * exp2i((136 - exponent).min(1000)) > 255.0 {
        exponent += 1;
    }
    if exponent < 1 {
        return [0; 4];
    }
    let scale = exp2i(136 - exponent);
    // Over all dither values both numbers are exactly uniform: the first is the dither, the second
    // a bijection of it.
    let mut random = [dither, mix32(dither ^ 0x5bd1_e995)].into_iter();
    let mut bytes = [0, 0, 0, exponent as u8];
    for (channel, &value) in rgb.iter().enumerate() {
        let steps = f64::from(value) * scale;
        bytes[channel] = if channel == largest {
            steps.round() as u8
        } else {
            let whole = steps.floor();
            let threshold = ((steps - whole) * 4_294_967_296.0) as u64;
            whole as u8 + u8::from(u64::from(random.next().unwrap_or(0)) < threshold)
        };
    }
    bytes
}

/// Returns the radiance of a stored colour; black if E is 0.
pub fn decode(rgbe: [u8; 4]) -> [f32; 3] {
    let [r, g, b, e] = rgbe;
    if e == 0 {
        return [0.0; 3];
    }
    let scale = exp2i(i32::from(e) - 136);
    [r, g, b].map(|byte| (f64::from(byte) * scale) as f32)
}
