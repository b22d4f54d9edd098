//! The z-buffer, tile by tile (Walter et al. 2002, §3.2): of the points that fall into a pixel, the
//! nearest.

use rayon::prelude::*;

use crate::map::BEYOND;
use crate::planes::{Key, Planes};
use crate::points::Points;
use crate::project::Buckets;

/// Makes the point image from the points of all buckets: depth, radiance and age of each pixel.
pub(crate) fn fill(planes: &mut Planes, buckets: &Buckets, points: &Points) {
    let (width, rows) = (planes.width, buckets.tile_rows);
    let Planes { nearest, depth, light, priority, .. } = planes;
    let tiles = nearest
        .par_chunks_mut(width * rows)
        .zip(depth.par_chunks_mut(width * rows))
        .zip(priority.par_chunks_mut(width * rows))
        .zip(light.bands_mut(rows));
    tiles.enumerate().for_each(|(tile, (((nearest, depth), priority), light))| {
        nearest.fill(Key::NONE);
        for record in buckets.tile(tile) {
            let pixel = &mut nearest[record.pixel as usize];
            *pixel = record.key.min(*pixel);
        }
        let pixels = nearest.iter().zip(depth).zip(priority).zip(light.flatten());
        for (((&key, depth), priority), light) in pixels {
            if key == Key::NONE {
                (*depth, *light) = (0.0, [0.0; 4]);
                continue;
            }
            let [red, green, blue] =
                if key.depth() < BEYOND { points.colour[key.slot()] } else { [0.0; 3] };
            (*depth, *priority) = (key.depth(), points.age[key.slot()]);
            *light = [red, green, blue, 1.0];
        }
    });
}
