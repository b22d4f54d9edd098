//! The depth cull (Walter et al. 1999, §3.1): removes points that show through gaps of a nearer
//! surface.
//!
//! What always holds:
//! - A sample of this very view stays: its ray was seen to reach it.
//! - Whether a point stays depends on what was there before any was removed.

use rayon::prelude::*;

use crate::planes::{Planes, ROWS};

/// Removes the light of points that are deeper than 1 + `threshold` times the mean over 3×3 pixels.
pub(crate) fn cull(planes: &mut Planes, threshold: f32) {
    let (width, factor) = (planes.width, 1.0 + threshold);
    let Planes { nearest, depth, light, .. } = planes;
    light.bands_mut(ROWS).enumerate().for_each(|(band, light)| {
        // Of three rows: the sum of depths, and the number of points; 0 beside the picture.
        let mut sums = vec![(0.0, 0.0); width + 2];
        for (row, light) in (band * ROWS..).zip(light) {
            add_rows(depth, width, row, &mut sums[1..=width]);
            let keys = &nearest[row * width..];
            for (((key, depth), light), sums) in
                keys.iter().zip(&depth[row * width..]).zip(light).zip(sums.windows(3))
            {
                let (sum, count) =
                    sums.iter().fold((0.0, 0.0), |(s, c), (sum, count)| (s + sum, c + count));
                if depth * count > factor * sum && !key.is_fresh() {
                    *light = [0.0; 4];
                }
            }
        }
    });
}

/// Adds the rows around `row`, column by column.
fn add_rows(depth: &[f32], width: usize, row: usize, sums: &mut [(f32, f32)]) {
    sums.fill((0.0, 0.0));
    for row in row.saturating_sub(1)..(row + 2).min(depth.len() / width) {
        for ((sum, count), &depth) in sums.iter_mut().zip(&depth[row * width..]) {
            *sum += depth;
            *count += if depth > 0.0 { 1.0 } else { 0.0 };
        }
    }
}
