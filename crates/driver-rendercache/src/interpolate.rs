//! Interpolation and smoothing over 3×3 pixels weighted 4-2-1, and the priority of each pixel
//! (Walter et al. 1999, §3.1 and §4).
//!
//! Invariant: a pixel with a point has its point's age as priority. A pixel without has 255 if no
//! neighbour has a point either, and less the more neighbours have.

use std::ops::Range;

use holo_cpu::{Isa, Kernel};
use rayon::prelude::*;

use crate::params::{PointImageParams, Smoothing};
use crate::planes::{Planes, ROWS, bands, rows_of};
use crate::points::Points;
use crate::rows::{COUNT, Rows};

/// How a picture is made from the point image.
#[derive(Clone, Copy)]
pub(crate) struct Looks {
    /// Weight of the middle one of three pixels, the others having 1. The 3×3 weights are its
    /// square, itself and 1.
    centre: f32,
    /// Priority that a pixel without a point loses per unit of its neighbours' weight.
    per_weight: u8,
    /// Weight of what the picture shows already, the prefilter's mean, beside the points.
    prior: f32,
    /// Whether gaps are filled at all.
    fills: bool,
    /// Whether pixels that nothing fills become 0.
    black: bool,
    /// Whether pixels with a point show it alone.
    points_alone: bool,
}

impl Looks {
    /// Returns the looks for a weight `prior` of the prefilter's mean. `black` says that pixels
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
pub(crate) fn interpolate(planes: &mut Planes, looks: &Looks) {
    let (isa, width, height) = (Isa::best(), planes.width, planes.height);
    let Planes { colour, priority, picture, .. } = planes;
    let bands = bands(picture, width).zip(priority.par_chunks_mut(width * ROWS)).enumerate();
    bands.for_each(|(band, (picture, priority))| {
        let rows = rows_of(band, height);
        isa.run(Interpolate { picture, priority, rows, width, colour, looks });
    });
}

/// Filters some rows.
struct Interpolate<'a> {
    picture: [&'a mut [f32]; 3],
    priority: &'a mut [u8],
    rows: Range<usize>,
    width: usize,
    /// Of the whole picture.
    colour: &'a [u32],
    looks: &'a Looks,
}

impl Kernel for Interpolate<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { mut picture, priority, rows, width, colour, looks } = self;
        let lines = Rows::around(colour, width, rows.clone(), 1);
        let [mut weights, mut sums] = [(); 2].map(|()| vec![0.0; width]);
        for row in 0..rows.len() {
            let pixels = row * width..(row + 1) * width;
            let has_point = &lines.channel(row + 1, COUNT)[1..];
            filter(&lines, row, COUNT, looks.centre, &mut weights);
            prioritise(&mut priority[pixels.clone()], &weights, has_point, looks.per_weight);
            for (channel, plane) in picture.iter_mut().enumerate() {
                let plane = &mut plane[pixels.clone()];
                filter(&lines, row, channel, looks.centre, &mut sums);
                show(plane, &sums, &weights, looks);
                if looks.points_alone {
                    show_own(plane, &lines.channel(row + 1, channel)[1..], has_point);
                }
            }
        }
    }
}

/// Makes the weighted sums of a channel over 3×3 pixels.
#[inline(always)]
fn filter(lines: &Rows, row: usize, channel: usize, centre: f32, sums: &mut [f32]) {
    let wide = sums.len() + 2;
    let above = &lines.channel(row, channel)[..wide];
    let here = &lines.channel(row + 1, channel)[..wide];
    let below = &lines.channel(row + 2, channel)[..wide];
    for (x, sum) in sums.iter_mut().enumerate() {
        let mut down = [0.0; 3];
        for (down, x) in down.iter_mut().zip(x..) {
            *down = (above[x] + below[x]) + centre * here[x];
        }
        *sum = (down[0] + down[2]) + centre * down[1];
    }
}

/// Sets the priorities of pixels without a point.
#[inline(always)]
fn prioritise(priority: &mut [u8], weights: &[f32], has_point: &[f32], per_weight: u8) {
    for ((priority, weight), has_point) in priority.iter_mut().zip(weights).zip(has_point) {
        // A pixel without a point adds nothing to its own weight.
        let gap = f32::from(u8::MAX) - f32::from(per_weight) * weight;
        *priority = if *has_point > 0.0 { *priority } else { gap as i32 as u8 };
    }
}

/// Shows the weighted means of a channel where there are points.
#[inline(always)]
fn show(plane: &mut [f32], sums: &[f32], weights: &[f32], looks: &Looks) {
    let Looks { prior, fills, black, .. } = *looks;
    for ((shown, sum), weight) in plane.iter_mut().zip(sums).zip(weights) {
        let is_filled = fills & (*weight > 0.0);
        if prior > 0.0 {
            let mean = (sum + prior * *shown) / (weight + prior);
            *shown = if is_filled { mean } else { *shown };
        } else {
            let kept = if black { 0.0 } else { *shown };
            let mean = sum / weight;
            *shown = if is_filled { mean } else { kept };
        }
    }
}

/// Shows the points alone.
#[inline(always)]
fn show_own(plane: &mut [f32], own: &[f32], has_point: &[f32]) {
    for ((shown, own), has_point) in plane.iter_mut().zip(own).zip(has_point) {
        *shown = if *has_point > 0.0 { *own } else { *shown };
    }
}

/// Shows the mean of its own samples in each pixel whose point is a sample of this view: packed
/// colours round it. A few noisy samples are mixed with the smoothed picture, which fades as they
/// grow.
pub(crate) fn show_means(planes: &mut Planes, points: &Points, prior: f32) {
    let Planes { width, depth, slot, picture, .. } = planes;
    let length = *width * ROWS;
    let bands = bands(picture, *width).zip(depth.par_chunks(length).zip(slot.par_chunks(length)));
    bands.for_each(|(mut picture, (depth, slot))| {
        for (pixel, (depth, slot)) in depth.iter().zip(slot).enumerate() {
            if *depth > 0.0 {
                let details = &points.details[*slot as usize];
                let share = details.own_share(prior);
                for (plane, mean) in picture.iter_mut().zip(details.mean) {
                    plane[pixel] += share * (mean - plane[pixel]);
                }
            }
        }
    });
}
