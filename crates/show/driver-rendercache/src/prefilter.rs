//! The prefilter (Walter et al. 2002, §3.3): means over the points of 7×7 pixels, for gaps that
//! 3×3 pixels do not fill. Where there are few points, the pyramid's colour is averaged in.
//!
//! Every sum starts from 0 and adds in the same order. A sum that slides over the picture would
//! retain a rounding error from each lamp that has left the window.

use glam::Vec4;
use rayon::prelude::*;

use crate::planes::{PixelPlanes, ROWS, rows_of};
use crate::pyramid::Pyramid;
use crate::rows::Rows;

/// Points in a window from which on the pyramid's colour does not count.
const ENOUGH: f32 = 8.0;

/// Shows in every pixel the mean over the points of the `window` × `window` pixels around it, and
/// over the colour of `wide`. That colour counts most in windows without a point, which show it
/// alone, and not at all in windows of [`ENOUGH`] points. If `black`, windows without a point are 0
/// instead. Without `wide`, they stay as they were otherwise.
pub(crate) fn prefilter(
    planes: &mut PixelPlanes,
    window: usize,
    black: bool,
    wide: Option<&Pyramid>,
) {
    let PixelPlanes { width, height, colour, picture, .. } = planes;
    let (width, height, reach) = (*width, *height, window / 2);
    picture.par_chunks_mut(width * ROWS).enumerate().for_each(|(band, picture)| {
        let lines = Rows::around(colour, width, rows_of(band, height), reach);
        let mut down = vec![Vec4::ZERO; width + 2 * reach];
        for (row, pixels) in picture.chunks_exact_mut(width).enumerate() {
            down.fill(Vec4::ZERO);
            for line in (row..row + window).map(|row| lines.row(row)) {
                down.iter_mut().zip(line).for_each(|(sum, pixel)| *sum += *pixel);
            }
            let wide = wide.map(|wide| wide.row(band * ROWS + row));
            for (column, (pixel, down)) in pixels.iter_mut().zip(down.windows(window)).enumerate() {
                let mut sum: Vec4 = down.iter().sum();
                if let Some(wide) = &wide
                    && sum.w < ENOUGH
                    && !(black && sum.w == 0.0)
                {
                    sum += (1.0 - sum.w / ENOUGH) * wide.at(column);
                }
                if sum.w > 0.0 {
                    *pixel = (sum / sum.w).truncate().to_array();
                } else if black {
                    *pixel = [0.0; 3];
                }
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use holo_display::pair;

    use super::*;
    use crate::colour;

    const SIZE: (usize, usize) = (130, 60);

    /// Returns planes with points in a third of the pixels at the top, and in most at the bottom.
    fn planes() -> PixelPlanes {
        let mut planes = PixelPlanes::new(SIZE);
        for (pixel, colour) in planes.colour.iter_mut().enumerate() {
            let chance = if pixel / SIZE.0 < SIZE.1 / 2 { 0.33 } else { 0.8 };
            let (is_there, light) = pair(7, pixel as u32);
            if is_there < chance {
                *colour = colour::encode([light, 0.3, 5.0 * light]);
            }
        }
        planes
    }

    /// Returns the colours of the points of a window that reaches so far from a pixel.
    fn around(planes: &PixelPlanes, pixel: usize, reach: usize) -> Vec<[f32; 3]> {
        let (column, row) = (pixel % SIZE.0, pixel / SIZE.0);
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(SIZE.1);
        let columns = column.saturating_sub(reach)..(column + reach + 1).min(SIZE.0);
        rows.flat_map(|row| columns.clone().map(move |column| planes.colour[row * SIZE.0 + column]))
            .filter(|&colour| colour != colour::NONE)
            .map(colour::decode)
            .collect()
    }

    #[test]
    fn pixels_show_the_mean_of_their_window() {
        for window in [3, 5, 7, 9] {
            let mut all = planes();
            prefilter(&mut all, window, true, None);
            for pixel in 0..SIZE.0 * SIZE.1 {
                let points = around(&all, pixel, window / 2);
                for channel in 0..3 {
                    let sum: f64 = points.iter().map(|point| f64::from(point[channel])).sum();
                    let mean = sum / points.len().max(1) as f64;
                    let shown = all.picture[pixel][channel];
                    // A rounding of an f32 for each of the window's pixels at most, and a few.
                    let roundings = (window * window + 11) as f64;
                    let allowed = roundings * f64::from(f32::EPSILON) * mean;
                    assert!((f64::from(shown) - mean).abs() <= allowed, "{window}: {pixel}");
                }
            }
        }
    }

    #[test]
    fn the_pyramid_fills_windows_without_points_and_leaves_those_with_enough() {
        let mut sparse = planes();
        // Nothing on the left, one pixel of 40 in the middle, a third and more on the right.
        for (pixel, colour) in sparse.colour.iter_mut().enumerate() {
            let column = pixel % SIZE.0;
            if column < 40 || column < 80 && pixel % 40 != 0 {
                *colour = colour::NONE;
            }
        }
        let shown = |black: bool, wide: Option<&Pyramid>| {
            let mut planes = PixelPlanes::new(SIZE);
            planes.colour.clone_from(&sparse.colour);
            prefilter(&mut planes, 7, black, wide);
            planes.picture
        };
        let wide = Pyramid::new(&sparse, 0.5).unwrap();
        let (alone, filled, black) =
            (shown(false, None), shown(false, Some(&wide)), shown(true, Some(&wide)));
        let mut seen = [0; 3];
        for pixel in 0..SIZE.0 * SIZE.1 {
            let points = around(&sparse, pixel, 3).len();
            if points == 0 {
                let colour = wide.row(pixel / SIZE.0).at(pixel % SIZE.0);
                let colour = (colour / colour.w).truncate().to_array();
                assert_eq!((filled[pixel], black[pixel]), (colour, [0.0; 3]), "{pixel}");
                seen[0] += 1;
            } else if points as f32 >= ENOUGH {
                assert_eq!(filled[pixel], alone[pixel], "{pixel}");
                seen[1] += 1;
            } else {
                seen[2] += usize::from(filled[pixel] != alone[pixel]);
            }
        }
        assert!(seen.iter().all(|&many| many > 500), "{seen:?}");
    }
}
