//! Luminance: the weight of a colour in random choices.

/// Returns the luminance of radiance, with Radiance's photopic weights.
#[inline]
pub(crate) fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.265 * r + 0.670 * g + 0.065 * b
}
