//! Lines of equal luminance, as `falsecolor -cl` of Radiance draws them.

use rayon::prelude::*;

use super::legend::Legend;
use crate::picture::Picture;
use holo_color::luminance;

/// Draws the contours of a picture over its image.
///
/// A pixel is on a line if one of the legend's luminances lies between those of its left and right
/// or its upper and lower neighbours. Lines have the colours of their luminance. Over false
/// colours, lines are white on dark colours and black on others.
pub(super) fn draw(picture: &Picture, legend: &Legend, over_colors: bool, rgb: &mut [u8]) {
    let levels: Vec<f32> = legend.ticks.iter().map(|tick| tick.luminance).collect();
    let colors: Vec<[u8; 3]> = legend
        .ticks
        .iter()
        .map(|tick| match over_colors {
            true => {
                if tick.place < 0.5 {
                    [255; 3]
                } else {
                    [0; 3]
                }
            }
            false => legend.color(tick.place),
        })
        .collect();
    // Number of lines that a pixel is above. NaN is above none.
    let above = |&rgb: &[f32; 3]| {
        let luminance = luminance(rgb);
        levels.partition_point(|level| luminance >= *level) as u8
    };
    let (width, height) = (picture.width as usize, picture.height as usize);
    let bands: Vec<u8> = picture.pixels.par_iter().with_min_len(width).map(above).collect();
    rgb.par_chunks_exact_mut(3 * width).enumerate().for_each(|(row, shown)| {
        let band_row = |row: usize| &bands[row * width..][..width];
        let (here, upper) = (band_row(row), band_row(row.saturating_sub(1)));
        let lower = band_row((row + 1).min(height - 1));
        for (column, shown) in shown.chunks_exact_mut(3).enumerate() {
            let left = here[column.saturating_sub(1)];
            let right = here[(column + 1).min(width - 1)];
            let (up, down) = (upper[column], lower[column]);
            if left != right || up != down {
                // The highest of the lines that lie between the neighbours.
                let highest = if left != right { left.max(right) } else { up.max(down) };
                shown.copy_from_slice(&colors[usize::from(highest) - 1]);
            }
        }
    });
}
