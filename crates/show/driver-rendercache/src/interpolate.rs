//! Interpolation and smoothing over 3×3 pixels weighted 4-2-1, and the priority of each pixel
//! (Walter et al. 1999, §3.1 and §4).
//!
//! Invariant: a pixel with a point has its point's age as priority. A pixel without has 255 if no
//! neighbour has a point either, and less the more neighbours have.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use crate::params::{PointImageParams, Smoothing};
use crate::planes::{PixelPlanes, ROWS, rows_of};
use crate::points::PointSlots;
use crate::rows::Rows;

/// Settings of the 3×3 filter.
#[derive(Clone, Copy)]
pub(crate) struct CacheFilter {
    /// Weight of the middle of three pixels; the other two have weight 1. The weights over 3×3
    /// pixels are its square, itself and 1.
    centre: f32,
    /// Priority that a pixel without a point loses per unit of its neighbours' weight.
    per_weight: u8,
    /// Weight of the prefilter's mean, which the picture shows already, beside the points.
    prior: f32,
    /// True if gaps are filled.
    fills: bool,
    /// True if pixels with no point among 3×3 become 0.
    black: bool,
    /// True if a pixel with a point shows this point alone.
    points_alone: bool,
}

impl CacheFilter {
    /// Returns the settings for a weight `prior` of the prefilter's mean. `black` says that pixels
    /// which nothing fills become 0.
    pub fn new(params: &PointImageParams, prior: f32, black: bool) -> Self {
        let (centre, fills) = (params.centre_weight, params.stages.interpolation);
        Self {
            centre: centre.into(),
            // Four neighbours have the centre's weight, and four have weight 1.
            per_weight: (u8::MAX - params.gap_priority) / (4 * centre + 4),
            prior: if fills { prior } else { 0.0 },
            fills,
            black,
            points_alone: !fills || params.smoothing == Smoothing::Gaps,
        }
    }
}

/// Makes the picture and the priorities from the point image.
pub(crate) fn interpolate(planes: &mut PixelPlanes, filter: &CacheFilter) {
    let PixelPlanes { width, height, colour, priority, picture, .. } = planes;
    let (width, height) = (*width, *height);
    let priority = priority.par_chunks_mut(width * ROWS);
    let bands = picture.par_chunks_mut(width * ROWS).zip(priority).enumerate();
    bands.for_each(|(band, (picture, priority))| {
        let lines = Rows::around(colour, width, rows_of(band, height), 1);
        let mut down = vec![Vec4::ZERO; width + 2];
        let rows = picture.chunks_exact_mut(width).zip(priority.chunks_exact_mut(width));
        for (row, (picture, priority)) in rows.enumerate() {
            let [above, here, below] = [0, 1, 2].map(|line| lines.row(row + line));
            for (((down, above), here), below) in down.iter_mut().zip(above).zip(here).zip(below) {
                *down = (*above + *below) + filter.centre * *here;
            }
            let pixels = picture.iter_mut().zip(priority).zip(&here[1..]);
            for (((pixel, priority), own), down) in pixels.zip(down.windows(3)) {
                let sum = (down[0] + down[2]) + filter.centre * down[1];
                *pixel = filter.pixel(*pixel, sum, *own);
                if own.w == 0.0 {
                    // The pixel adds nothing to its own weight.
                    *priority = (255.0 - f32::from(filter.per_weight) * sum.w) as u8;
                }
            }
        }
    });
}

impl CacheFilter {
    /// Returns what a pixel shows, given what it `shows` already, the weighted `sum` over 3×3
    /// pixels, and its `own` point. The fourth numbers are the weights.
    #[inline]
    fn pixel(&self, shows: [f32; 3], sum: Vec4, own: Vec4) -> [f32; 3] {
        if self.points_alone && own.w > 0.0 {
            own.truncate().to_array()
        } else if self.fills && sum.w > 0.0 {
            let mean = (sum.truncate() + self.prior * Vec3::from(shows)) / (sum.w + self.prior);
            mean.to_array()
        } else if self.black {
            [0.0; 3]
        } else {
            shows
        }
    }
}

/// Shows the mean of the pixel's own samples in each pixel whose point is a sample of this view.
///
/// The point image has this mean only in packed form, which rounds it. If samples are noisy, the
/// smoothed picture has a share that falls as their number grows.
pub(crate) fn show_means(planes: &mut PixelPlanes, points: &PointSlots, prior: f32) {
    let PixelPlanes { width, depth, slot, picture, .. } = planes;
    let length = *width * ROWS;
    let bands = picture.par_chunks_mut(length);
    bands.zip(depth.par_chunks(length).zip(slot.par_chunks(length))).for_each(
        |(picture, (depth, slot))| {
            for (pixel, (depth, slot)) in picture.iter_mut().zip(depth.iter().zip(slot)) {
                if *depth > 0.0 {
                    let details = &points.details[*slot as usize];
                    let share = details.own_share(prior);
                    for (shown, mean) in pixel.iter_mut().zip(details.mean) {
                        *shown += share * (mean - *shown);
                    }
                }
            }
        },
    );
}
