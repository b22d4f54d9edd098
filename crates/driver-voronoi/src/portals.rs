//! Pixels that look through portals: invisible surfaces beyond which the scene at hand lacks
//! geometry (Larson & Simmons 1999, §2.4.4). Another driver draws these pixels from samples alone.

use super::surfaces::{Caster, Seen};
use holo_display::for_bands;

/// Rows of one piece of work.
const ROWS: usize = 16;

/// Returns, for each pixel cast, whether it looks through a portal; empty if none does. Such a
/// pixel sees nothing of the scene.
pub fn beyond(caster: &Caster, seen: &[Seen]) -> Vec<bool> {
    let width = caster.size.0;
    let mut pixels = vec![false; seen.len()];
    for_bands(&mut pixels, width, ROWS, |band, pixels| {
        for (is_beyond, pixel) in pixels.iter_mut().zip(band * ROWS * width..) {
            let middle = ((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
            *is_beyond = seen[pixel].is_sky() && caster.is_beyond(middle.0, middle.1, &seen[pixel]);
        }
    });
    if pixels.contains(&true) { pixels } else { Vec::new() }
}
