//! Interpolation and smoothing over 3×3 pixels weighted 4-2-1, and the priority of each pixel
//! (Walter et al. 1999, §3.1 and §4).
//!
//! Invariant: a pixel with a point has its point's age as priority. A pixel without has 255 if no
//! neighbour has a point either, and less the more neighbours have.

use rayon::prelude::*;

use crate::params::{PointImageParams, Smoothing};
use crate::planes::{Light, Planes, ROWS};
use crate::points::Points;

/// How a picture is made from the point image.
pub(crate) struct Interpolate {
    /// Weight of the middle one of three pixels, the others having 1. The 3×3 weights are its
    /// square, itself and 1.
    centre: f32,
    /// Priority that a pixel without a point loses per unit of its neighbours' weight.
    per_weight: u8,
    /// Weight of what the picture shows already, the prefilter's mean, beside the points.
    prior: f32,
    /// Whether the filter fills gaps and smooths at all.
    fills: bool,
    smoothing: Smoothing,
    /// Whether a pixel that nothing fills becomes 0.
    black: bool,
}

impl Interpolate {
    /// `prior` is the weight of the prefilter's mean, and `black` tells what pixels show that
    /// nothing fills.
    pub fn new(params: &PointImageParams, prior: f32, black: bool) -> Self {
        let centre = params.centre_weight;
        Self {
            centre: centre.into(),
            // Four neighbours have the centre's weight, and four have weight 1.
            per_weight: (u8::MAX - params.gap_priority) / (4 * centre + 4),
            prior,
            fills: params.stages.interpolation,
            smoothing: params.smoothing,
            black,
        }
    }

    /// Makes the picture and the priorities.
    pub fn run(&self, planes: &mut Planes, points: &Points) {
        let width = planes.width;
        let Planes { nearest, light, priority, picture, .. } = planes;
        let pixels = picture.pixels.par_chunks_mut(width * ROWS);
        let bands = pixels.zip(priority.par_chunks_mut(width * ROWS)).enumerate();
        bands.for_each(|(band, (pixels, priority))| {
            let mut down = vec![[0.0; 4]; width + 2];
            let rows = pixels.chunks_mut(width).zip(priority.chunks_mut(width));
            for (row, (pixels, priority)) in (band * ROWS..).zip(rows) {
                let lines =
                    [0, 1, 2].map(|y| &light.row(row + Light::MARGIN + y - 1)[Light::MARGIN - 1..]);
                self.add_rows(lines, &mut down);
                let nearest = &nearest[row * width..];
                for (x, (pixel, priority)) in pixels.iter_mut().zip(priority).enumerate() {
                    let sum = self.add([down[x], down[x + 1], down[x + 2]]);
                    let own = lines[1][x + 1];
                    let has_point = own[3] > 0.0;
                    if !has_point {
                        *priority = u8::MAX - self.per_weight * sum[3] as u8;
                    }
                    let smooth = self.mean(sum, *pixel);
                    let key = nearest[x];
                    *pixel = if !has_point {
                        smooth
                    } else if !self.fills || self.smoothing == Smoothing::Gaps {
                        [own[0], own[1], own[2]]
                    } else if self.smoothing == Smoothing::WhereOld && key.is_fresh() {
                        self.own_mean(smooth, points, key.slot())
                    } else {
                        smooth
                    };
                }
            }
        });
    }

    /// Returns a pixel's colour from the weighted sum over its neighbourhood and what it shows.
    #[inline(always)]
    fn mean(&self, sum: [f32; 4], shown: [f32; 3]) -> [f32; 3] {
        if sum[3] == 0.0 || !self.fills {
            return if self.black { [0.0; 3] } else { shown };
        }
        let inverse = 1.0 / (sum[3] + self.prior);
        [0, 1, 2].map(|i| (sum[i] + self.prior * shown[i]) * inverse)
    }

    /// Returns the colour of a pixel whose point is a sample of this view: the mean of its own
    /// samples. A few noisy ones are mixed with the smoothed picture, which fades as they grow.
    fn own_mean(&self, smooth: [f32; 3], points: &Points, slot: usize) -> [f32; 3] {
        let own = points.colour[slot];
        let details = &points.details[slot];
        if self.prior == 0.0 || details.noise == 0.0 {
            return own;
        }
        let share = details.count as f32 / (details.count as f32 + self.prior);
        [0, 1, 2].map(|i| smooth[i] + share * (own[i] - smooth[i]))
    }

    fn add_rows(&self, lines: [&[[f32; 4]]; 3], down: &mut [[f32; 4]]) {
        let [above, here, below] = lines;
        for (((down, above), here), below) in down.iter_mut().zip(above).zip(here).zip(below) {
            *down = self.add([*above, *here, *below]);
        }
    }

    /// Returns the sum of three, the middle one weighted.
    #[inline(always)]
    fn add(&self, [one, middle, other]: [[f32; 4]; 3]) -> [f32; 4] {
        [0, 1, 2, 3].map(|i| (one[i] + other[i]) + self.centre * middle[i])
    }
}
