//! The depth cull (Walter et al. 1999, §3.1): removes points that show through gaps of a nearer
//! surface.
//!
//! What always holds:
//! - A sample of this very view stays: its ray was seen to reach it.
//! - Whether a point stays depends on what was there before any was removed.

use holo_cpu::{Isa, Kernel};
use rayon::prelude::*;

use crate::colour;
use crate::planes::{Planes, ROWS};

/// Removes points that are deeper than 1 + `threshold` times the mean over 3×3 pixels.
pub(crate) fn cull(planes: &mut Planes, threshold: f32) {
    let (isa, width, depth) = (Isa::best(), planes.width, &planes.depth);
    let bands = planes.colour.par_chunks_mut(width * ROWS).enumerate();
    bands.for_each(|(band, colour)| {
        isa.run(Cull { colour, first: band * ROWS, width, depth, factor: 1.0 + threshold });
    });
}

/// Culls the rows from `first` on, as many as `colour` has.
struct Cull<'a> {
    colour: &'a mut [u32],
    first: usize,
    width: usize,
    /// Of the whole picture.
    depth: &'a [f32],
    factor: f32,
}

impl Kernel for Cull<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { colour, first, width, depth, factor } = self;
        // Of three rows the sums of depths and numbers of points, 0 beside the picture.
        let [mut sums, mut counts] = [(); 2].map(|()| vec![0.0; width + 2]);
        for (row, colour) in (first..).zip(colour.chunks_exact_mut(width)) {
            sums.fill(0.0);
            counts.fill(0.0);
            for row in row.saturating_sub(1)..(row + 2).min(depth.len() / width) {
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
                let is_deep = depth[x].abs() * count > factor * sum;
                colour[x] = if is_old & is_deep { colour::NONE } else { colour[x] };
            }
        }
    }
}
