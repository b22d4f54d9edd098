//! The prefilter (Walter et al. 2002, §3.3): means over the points of 7×7 pixels, for gaps that
//! 3×3 pixels do not fill.
//!
//! Every sum is made anew, in the same order. With a sum that slides over the picture, a lamp that
//! left the window would leave a rounding error behind.

use std::ops::Range;

use holo_cpu::{Isa, Kernel};
use rayon::prelude::*;

use crate::planes::{Planes, bands, rows_of};
use crate::rows::{COUNT, Rows};

/// Shows in every pixel the mean over the points of `window` × `window` pixels around it: 3, 5, 7
/// or 9. A pixel without any becomes 0 if `black`, else it keeps what it showed.
///
/// With `gaps_only`, pixels with a point among 3×3 may be left out.
pub(crate) fn prefilter(planes: &mut Planes, window: u32, black: bool, gaps_only: bool) {
    // Loops are compiled for each, so that their sums stay in registers.
    match window {
        3 => filter::<3>(planes, black, gaps_only),
        5 => filter::<5>(planes, black, gaps_only),
        7 => filter::<7>(planes, black, gaps_only),
        _ => filter::<9>(planes, black, gaps_only),
    }
}

fn filter<const WINDOW: usize>(planes: &mut Planes, black: bool, gaps_only: bool) {
    let (isa, width, height) = (Isa::best(), planes.width, planes.height);
    let colour = &planes.colour;
    bands(&mut planes.picture, width).enumerate().for_each(|(band, picture)| {
        let rows = rows_of(band, height);
        isa.run(Prefilter::<WINDOW> { picture, rows, width, colour, black, gaps_only });
    });
}

/// Filters some rows.
struct Prefilter<'a, const WINDOW: usize> {
    picture: [&'a mut [f32]; 3],
    rows: Range<usize>,
    width: usize,
    /// Of the whole picture.
    colour: &'a [u32],
    black: bool,
    gaps_only: bool,
}

impl<const WINDOW: usize> Kernel for Prefilter<'_, WINDOW> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { mut picture, rows, width, colour, black, gaps_only } = self;
        let lines = Rows::around(colour, width, rows.clone(), WINDOW / 2);
        // Sums of a channel down the columns and over the whole window.
        let mut down = vec![0.0; width + WINDOW - 1];
        let [mut sums, mut counts] = [(); 2].map(|()| vec![0.0; width]);
        for row in 0..rows.len() {
            let columns = if gaps_only {
                gaps::<WINDOW>(&lines, row, &mut down, &mut counts)
            } else {
                0..width
            };
            if columns.is_empty() {
                continue;
            }
            let pixels = row * width + columns.start..row * width + columns.end;
            let (sums, counts) = (&mut sums[columns.clone()], &mut counts[columns.clone()]);
            let down = &mut down[..columns.len() + WINDOW - 1];
            add_rows::<WINDOW>(&lines, row, COUNT, columns.start, down);
            add_columns::<WINDOW>(down, counts);
            for (channel, plane) in picture.iter_mut().enumerate() {
                add_rows::<WINDOW>(&lines, row, channel, columns.start, down);
                add_columns::<WINDOW>(down, sums);
                let pixels = plane[pixels.clone()].iter_mut();
                for ((pixel, sum), count) in pixels.zip(&*sums).zip(&*counts) {
                    let kept = if black { 0.0 } else { *pixel };
                    // Both are computed: processors cannot foretell whether there are points.
                    let mean = sum / count;
                    *pixel = if *count > 0.0 { mean } else { kept };
                }
            }
        }
    }
}

/// Returns the columns of a row from the first to the last pixel without a point among 3×3.
#[inline(always)]
fn gaps<const WINDOW: usize>(
    lines: &Rows,
    row: usize,
    down: &mut [f32],
    counts: &mut [f32],
) -> Range<usize> {
    let margin = WINDOW / 2 - 1;
    add_rows::<3>(lines, row + margin, COUNT, 0, down);
    add_columns::<3>(&down[margin..], counts);
    let mut has_gap = false;
    for count in counts.iter() {
        has_gap |= *count == 0.0;
    }
    if !has_gap {
        return 0..0;
    }
    let is_gap = |count: &f32| *count == 0.0;
    let first = counts.iter().position(is_gap).unwrap_or(0);
    first..counts.iter().rposition(is_gap).map_or(0, |last| last + 1)
}

/// Adds `WINDOW` rows of a channel, from a column on.
#[inline(always)]
fn add_rows<const WINDOW: usize>(
    lines: &Rows,
    row: usize,
    channel: usize,
    column: usize,
    sums: &mut [f32],
) {
    let mut all = [lines.channel(row, channel); WINDOW];
    for (number, line) in all.iter_mut().enumerate() {
        *line = &lines.channel(row + number, channel)[column..][..sums.len()];
    }
    for (x, sum) in sums.iter_mut().enumerate() {
        *sum = 0.0;
        for line in &all {
            *sum += line[x];
        }
    }
}

/// Adds `WINDOW` numbers for each sum.
#[inline(always)]
fn add_columns<const WINDOW: usize>(numbers: &[f32], sums: &mut [f32]) {
    for (sum, numbers) in sums.iter_mut().zip(numbers.windows(WINDOW)) {
        *sum = 0.0;
        for number in numbers {
            *sum += number;
        }
    }
}

#[cfg(test)]
mod tests {
    use holo_display::pair;

    use super::*;
    use crate::colour;

    const SIZE: (usize, usize) = (130, 60);

    /// Returns planes with points in a third of the pixels at the top, and in most at the bottom.
    fn planes() -> Planes {
        let mut planes = Planes::new(SIZE);
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
    fn around(planes: &Planes, pixel: usize, reach: usize) -> Vec<[f32; 3]> {
        let (column, row) = (pixel % SIZE.0, pixel / SIZE.0);
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(SIZE.1);
        let columns = column.saturating_sub(reach)..(column + reach + 1).min(SIZE.0);
        rows.flat_map(|row| columns.clone().map(move |column| planes.colour[row * SIZE.0 + column]))
            .filter(|&colour| colour != colour::NONE)
            .map(colour::decode)
            .collect()
    }

    #[test]
    fn pixels_show_the_mean_of_their_window_and_gaps_do_so_alone_too() {
        for window in [3, 5, 7, 9] {
            let (mut all, mut gaps) = (planes(), planes());
            prefilter(&mut all, window, true, false);
            prefilter(&mut gaps, window, true, true);
            let mut found = 0;
            for pixel in 0..SIZE.0 * SIZE.1 {
                let points = around(&all, pixel, window as usize / 2);
                let is_gap = around(&all, pixel, 1).is_empty();
                for channel in 0..3 {
                    let sum: f64 = points.iter().map(|point| f64::from(point[channel])).sum();
                    let mean = sum / points.len().max(1) as f64;
                    let shown = all.picture[channel][pixel];
                    // A rounding of an f32 for each of the window's pixels at most, and a few.
                    let roundings = f64::from(window * window + 11);
                    let allowed = roundings * f64::from(f32::EPSILON) * mean;
                    assert!((f64::from(shown) - mean).abs() <= allowed, "{window}: {pixel}");
                    assert!(!is_gap || shown == gaps.picture[channel][pixel], "{window}: {pixel}");
                }
                found += usize::from(is_gap);
            }
            // 0.67⁹ of 3,900, and more at the edges.
            assert!(found > 50, "{found} gaps");
        }
    }
}
