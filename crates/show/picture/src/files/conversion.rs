//! Conversion between primaries.

use glam::{DMat3, DVec3};

/// Converts the channels of a radiance. No colour gets a negative channel.
pub(super) fn converted(conversion: DMat3, rgb: [f32; 3]) -> [f32; 3] {
    let rgb = conversion * DVec3::from_array(rgb.map(f64::from));
    rgb.to_array().map(|channel| channel.max(0.0) as f32)
}
