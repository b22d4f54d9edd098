//! The z-buffer, tile by tile (Walter et al. 2002, §3.2): determines the nearest of the points that
//! fall into a pixel.

use rayon::prelude::*;

use crate::colour;
use crate::map::BEYOND;
use crate::planes::PixelPlanes;
use crate::project::{Buckets, ProjectedPoint};

/// Makes the point image from the points of all buckets: slot, depth, colour and age of each
/// pixel's nearest point.
pub(crate) fn fill(planes: &mut PixelPlanes, buckets: &Buckets) {
    let pixels = planes.width * buckets.tile_rows;
    let PixelPlanes { slot, depth, colour, priority, .. } = planes;
    let tiles = slot
        .par_chunks_mut(pixels)
        .zip(depth.par_chunks_mut(pixels))
        .zip(colour.par_chunks_mut(pixels))
        .zip(priority.par_chunks_mut(pixels))
        .enumerate();
    let zbuffer = || vec![ProjectedPoint::NONE; pixels];
    tiles.for_each_init(zbuffer, |nearest, (tile, (((slot, depth), colour), priority))| {
        nearest.fill(ProjectedPoint::NONE);
        for records in buckets.tile(tile) {
            for record in records {
                let pixel = &mut nearest[record.pixel()];
                if record.key < pixel.key {
                    *pixel = *record;
                }
            }
        }
        let planes = slot.iter_mut().zip(depth).zip(colour).zip(priority);
        for ((((slot, depth), colour), priority), nearest) in planes.zip(&*nearest) {
            let has_point = nearest.colour != colour::NONE;
            let is_black = nearest.depth().abs() >= BEYOND;
            *slot = nearest.slot();
            *depth = if has_point { nearest.depth() } else { 0.0 };
            *colour = if is_black { colour::BLACK } else { nearest.colour };
            *priority = nearest.age();
        }
    });
}
