//! The depth cull (Walter et al. 1999, §3.1): removes points that show through gaps of a nearer
//! surface.
//!
//! Invariants:
//! - A sample of the current view stays, because its ray has reached it.
//! - All points are tested before any is removed.

use rayon::prelude::*;

use crate::colour;
use crate::planes::{PixelPlanes, ROWS, rows_of};

/// Pixels along the side of a cell of [`cull_behind`].
const CELL: usize = 8;
/// Age below which a point is new there. Ages grow by 8 at least at a time, so a sixteenth to an
/// eighth of the cache is new.
const NEW: u8 = 16;
/// Least number of new points around a cell that say where its surfaces are.
const LEAST_NEW: u32 = 2;
/// Ratio of depths from which on an old point is behind new ones. Depths of a floor differ less
/// over three cells, except near the horizon.
const BEHIND: f32 = 1.04;

/// Removes old points that are far behind all new ones of the 3×3 cells around. If the eye has just
/// gone through a door, points of the room before would show through the new one's walls, of which
/// few points are known yet.
///
/// A point that is seen after all is soon confirmed, because its pixel is requested like other
/// gaps.
pub(crate) fn cull_behind(planes: &mut PixelPlanes) {
    let (width, height) = (planes.width, planes.height);
    let (columns, rows) = (width.div_ceil(CELL), height.div_ceil(CELL));
    // The number of new points of each cell, and the depth of the farthest.
    let mut cells = vec![(0_u32, 0.0_f32); columns * rows];
    let band = width * CELL;
    let pixels = planes.depth.par_chunks(band).zip(planes.priority.par_chunks(band));
    cells.par_chunks_mut(columns).zip(pixels).for_each(|(cells, (depths, ages))| {
        for (depths, ages) in depths.chunks_exact(width).zip(ages.chunks_exact(width)) {
            let pieces = depths.chunks(CELL).zip(ages.chunks(CELL));
            for ((count, farthest), (depths, ages)) in cells.iter_mut().zip(pieces) {
                for (depth, age) in depths.iter().zip(ages) {
                    let is_new = *depth != 0.0 && *age < NEW;
                    *count += u32::from(is_new);
                    *farthest = farthest.max(if is_new { depth.abs() } else { 0.0 });
                }
            }
        }
    });
    let limits: Vec<f32> = (0..cells.len())
        .map(|cell| {
            let (column, row) = (cell % columns, cell / columns);
            let (mut count, mut farthest) = (0, 0.0_f32);
            for row in row.saturating_sub(1)..(row + 2).min(rows) {
                let line = &cells[row * columns..][..columns];
                for (new, depth) in &line[column.saturating_sub(1)..(column + 2).min(columns)] {
                    count += new;
                    farthest = farthest.max(*depth);
                }
            }
            if count < LEAST_NEW { f32::INFINITY } else { BEHIND * farthest }
        })
        .collect();
    let (depth, age) = (&planes.depth, &planes.priority);
    planes.colour.par_chunks_mut(width).enumerate().for_each(|(row, colours)| {
        let limits = &limits[row / CELL * columns..][..columns];
        let pixels = depth[row * width..].iter().zip(&age[row * width..]);
        for (column, (colour, (depth, age))) in colours.iter_mut().zip(pixels).enumerate() {
            // A sample of the current view stays, because its ray has reached it.
            if *depth < 0.0 && *age >= NEW && -*depth > limits[column / CELL] {
                *colour = colour::NONE;
            }
        }
    });
}

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

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 40;
    const OLD: u8 = 100;

    /// Returns which pixels show a point after the cull. Points of age 0 at depth 4 lie in some
    /// pixels, and others of this age and depth everywhere else.
    fn shown(new_pixels: &[usize], depth: f32, age: u8) -> Vec<bool> {
        let mut planes = PixelPlanes::new((SIDE, SIDE));
        planes.colour.fill(colour::BLACK);
        planes.depth.fill(depth);
        planes.priority.fill(age);
        for &pixel in new_pixels {
            (planes.depth[pixel], planes.priority[pixel]) = (-4.0, 0);
        }
        cull_behind(&mut planes);
        planes.colour.iter().map(|colour| *colour != colour::NONE).collect()
    }

    #[test]
    fn old_points_far_behind_all_new_ones_around_are_not_shown() {
        // Two new points near the upper left corner, so the cells of the first 16 pixels know them.
        let new = [0, SIDE + 1];
        let left = shown(&new, -6.0, OLD);
        for (pixel, is_shown) in left.iter().enumerate() {
            let is_near = pixel % SIDE < 16 && pixel / SIDE < 16 && !new.contains(&pixel);
            assert_eq!(*is_shown, !is_near, "{pixel}");
        }
        // Not far behind, nearer, new, or samples of the view.
        for (depth, age) in [(-4.1, OLD), (-3.0, OLD), (-6.0, NEW - 1), (6.0, OLD)] {
            assert!(shown(&new, depth, age).iter().all(|is_shown| *is_shown), "{depth} {age}");
        }
    }

    #[test]
    fn one_new_point_says_nothing_about_what_is_behind_it() {
        assert!(shown(&[0], -6.0, OLD).iter().all(|is_shown| *is_shown));
    }
}
