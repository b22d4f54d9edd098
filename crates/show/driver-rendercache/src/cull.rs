//! The depth cull (Walter et al. 1999, §3.1): removes points that show through gaps of a nearer
//! surface.
//!
//! Invariants:
//! - A sample of the current view stays, because its ray has reached it.
//! - All points are tested before any is removed.

use rayon::prelude::*;

use crate::colour;
use crate::planes::{PixelPlanes, ROWS, rows_of};

/// Removes points that are deeper than 1 + `threshold` times the mean over 3×3 pixels.
pub(crate) fn cull(planes: &mut PixelPlanes, threshold: f32) {
    let (width, height, depth) = (planes.width, planes.height, &planes.depth);
    let bands = planes.colour.par_chunks_mut(width * ROWS).enumerate();
    bands.for_each(|(band, colour)| {
        // Sums down three rows of depths and of numbers of points, with 0 beside the picture.
        let [mut sums, mut counts] = [(); 2].map(|()| vec![0.0; width + 2]);
        for (row, colour) in rows_of(band, height).zip(colour.chunks_exact_mut(width)) {
            sums.fill(0.0);
            counts.fill(0.0);
            for row in row.saturating_sub(1)..(row + 2).min(height) {
                let (sums, counts) = (sums[1..].iter_mut(), &mut counts[1..]);
                for ((sum, count), depth) in sums.zip(counts).zip(&depth[row * width..][..width]) {
                    *sum += depth.abs();
                    *count += if *depth == 0.0 { 0.0 } else { 1.0 };
                }
            }
            let depth = &depth[row * width..][..width];
            for x in 0..width {
                let sum = sums[x] + sums[x + 1] + sums[x + 2];
                let count = counts[x] + counts[x + 1] + counts[x + 2];
                let is_old = depth[x] < 0.0;
                let is_deep = depth[x].abs() * count > (1.0 + threshold) * sum;
                colour[x] = if is_old & is_deep { colour::NONE } else { colour[x] };
            }
        }
    });
}
