//! Units of light.

/// Luminous efficacy for converting radiance to luminance, lm/W (Ward 1994).
pub(crate) const EFFICACY: f64 = 179.0;
