//! The prefilter (Walter et al. 2002, §3.3): means over the points of 7×7 pixels, for gaps that
//! 3×3 pixels do not fill.
//!
//! Every sum is made anew, in the same order. With a sum that slides over the picture, a lamp that
//! left the window would leave a rounding error behind.

use rayon::prelude::*;

use crate::planes::{Light, Planes, ROWS};

/// Shows in every pixel the mean over the points of `window` × `window` pixels around it. A pixel
/// without any becomes 0 if `black`, else it keeps what it showed.
pub(crate) fn prefilter(planes: &mut Planes, window: usize, black: bool) {
    let (width, margin) = (planes.width, Light::MARGIN - window / 2);
    let Planes { light, picture, .. } = planes;
    picture.pixels.par_chunks_mut(width * ROWS).enumerate().for_each(|(band, pixels)| {
        let mut down = vec![[0.0; 4]; width + window - 1];
        for (row, pixels) in (band * ROWS..).zip(pixels.chunks_mut(width)) {
            down.fill([0.0; 4]);
            for row in row + margin..row + margin + window {
                add(&mut down, &light.row(row)[margin..]);
            }
            for (pixel, sums) in pixels.iter_mut().zip(down.windows(window)) {
                let mut sum = [0.0; 4];
                sums.iter().for_each(|other| (0..4).for_each(|i| sum[i] += other[i]));
                let [red, green, blue, count] = sum;
                if count > 0.0 {
                    *pixel = [red / count, green / count, blue / count];
                } else if black {
                    *pixel = [0.0; 3];
                }
            }
        }
    });
}

fn add(sums: &mut [[f32; 4]], other: &[[f32; 4]]) {
    for (sum, other) in sums.iter_mut().zip(other) {
        (0..4).for_each(|i| sum[i] += other[i]);
    }
}
