//! The pyramid below the prefilter: for every pixel a colour from as wide a window as it takes
//! (Gortler, Grzeszczuk, Szeliski & Cohen 1996, §3.4: pull and push). The papers name wider
//! interpolation as what very few samples need (1999, §6.1).
//!
//! Cells of the finest level are [`CELL`] pixels wide, those of each further level twice as wide.
//! The colour of a cell is the mean over its points and over the colour of the cells around it one
//! level up, which counts as a few points. So a cell with many points shows its own colour, and one
//! without shows that of its surroundings.
//!
//! Invariant: sums are added in one order on any number of threads.

use glam::Vec4;
use rayon::prelude::*;

use crate::planes::PixelPlanes;
use crate::rows::decode;

/// Pixels along the side of a cell of the finest level. The prefilter's window is about as wide, so
/// finer cells would add nothing.
const CELL: usize = 8;

/// Colours of the finest level.
pub(crate) struct Pyramid {
    finest: Level,
    /// Number of points that a colour counts as.
    weight: f32,
}

/// A level of cells, rows from the top: three channels, and the number of points as fourth number.
struct Level {
    cells: Vec<Vec4>,
    width: usize,
    height: usize,
}

/// A row of pixels between the rows of cells above and below it.
pub(crate) struct PyramidRow {
    cells: Vec<Vec4>,
}

impl Pyramid {
    /// Makes the pyramid of a point image. A coarser colour counts as `weight` points beside finer
    /// ones: above 0. Returns `None` if there is no point at all.
    pub fn new(planes: &PixelPlanes, weight: f32) -> Option<Self> {
        let mut levels = vec![Level::of_points(planes)];
        while let Some(level) = levels.last().filter(|level| level.cells.len() > 1) {
            levels.push(level.pulled());
        }
        let mut coarse = levels.pop()?;
        let points = coarse.cells.first()?;
        if points.w == 0.0 {
            return None;
        }
        coarse.cells = vec![*points / points.w];
        while let Some(fine) = levels.pop() {
            coarse = fine.pushed(&coarse, weight);
        }
        Some(Self { finest: coarse, weight })
    }

    /// Returns the colours of a row of pixels.
    pub fn row(&self, row: usize) -> PyramidRow {
        let Level { cells, width, height } = &self.finest;
        let (above, below, share) = between(row, CELL, *height);
        let row = |row: usize| &cells[row * width..][..*width];
        let blend = |(above, below): (&Vec4, &Vec4)| self.weight * above.lerp(*below, share);
        PyramidRow { cells: row(above).iter().zip(row(below)).map(blend).collect() }
    }
}

impl PyramidRow {
    /// Returns the colour of a pixel times its weight, and the weight as fourth number.
    #[inline]
    pub fn at(&self, column: usize) -> Vec4 {
        let (left, right, share) = between(column, CELL, self.cells.len());
        self.cells[left].lerp(self.cells[right], share)
    }
}

impl Level {
    /// Returns the sums over the points of each cell.
    fn of_points(planes: &PixelPlanes) -> Self {
        let (width, height) = (planes.width.div_ceil(CELL), planes.height.div_ceil(CELL));
        let mut cells = vec![Vec4::ZERO; width * height];
        let bands = cells.par_chunks_mut(width).zip(planes.colour.par_chunks(planes.width * CELL));
        bands.for_each(|(cells, colours)| {
            for colours in colours.chunks_exact(planes.width) {
                for (cell, colours) in cells.iter_mut().zip(colours.chunks(CELL)) {
                    colours.iter().for_each(|&colour| *cell += decode(colour));
                }
            }
        });
        Self { cells, width, height }
    }

    /// Returns the sums over 2×2 cells.
    fn pulled(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut cells = vec![Vec4::ZERO; width * height];
        for (row, fine) in self.cells.chunks_exact(self.width).enumerate() {
            for (column, cell) in fine.iter().enumerate() {
                cells[row / 2 * width + column / 2] += *cell;
            }
        }
        Self { cells, width, height }
    }

    /// Returns the colours of cells from their sums and from the level of twice the size. The
    /// fourth numbers become 1.
    fn pushed(mut self, coarse: &Self, weight: f32) -> Self {
        for (row, fine) in self.cells.chunks_exact_mut(self.width).enumerate() {
            let (above, below, down) = between(row, 2, coarse.height);
            for (column, cell) in fine.iter_mut().enumerate() {
                let (left, right, along) = between(column, 2, coarse.width);
                let line = |row: usize| {
                    let cells = &coarse.cells[row * coarse.width..];
                    cells[left].lerp(cells[right], along)
                };
                let around = line(above).lerp(line(below), down);
                *cell = (*cell + weight * around) / (cell.w + weight);
            }
        }
        self
    }
}

/// Returns the two of `count` cells, each `size` wide, between whose middles lies the middle of the
/// `place`-th unit, and the share of the second cell. Beyond the first and the last middle, both
/// are the same.
#[inline]
fn between(place: usize, size: usize, count: usize) -> (usize, usize, f32) {
    let cell = place / size;
    let offset = (2 * (place % size) + 1) as f32 / (2 * size) as f32 - 0.5;
    if offset < 0.0 {
        (cell.saturating_sub(1), cell, 1.0 + offset)
    } else {
        (cell, (cell + 1).min(count - 1), offset)
    }
}

#[cfg(test)]
mod tests {
    use holo_display::pair;

    use super::*;
    use crate::colour;

    const WHITE: [f32; 3] = [0.5, 1.0, 2.0];

    /// Returns planes with points of a colour by pixel in a share of the pixels.
    fn planes(
        size: (usize, usize),
        share: f32,
        colour: impl Fn(usize, usize) -> [f32; 3],
    ) -> PixelPlanes {
        let mut planes = PixelPlanes::new(size);
        for (pixel, plane) in planes.colour.iter_mut().enumerate() {
            if pair(3, pixel as u32).0 < share {
                *plane = colour::encode(colour(pixel % size.0, pixel / size.0));
            }
        }
        planes
    }

    fn at(pyramid: &Pyramid, column: usize, row: usize) -> [f32; 3] {
        let colour = pyramid.row(row).at(column);
        assert!((colour.w - pyramid.weight).abs() < 1e-4, "{column}, {row}: {}", colour.w);
        (colour / colour.w).truncate().to_array()
    }

    #[test]
    fn one_point_colours_the_whole_picture_whatever_its_size() {
        for size in [(1, 1), (8, 8), (9, 1), (130, 61), (3, 200)] {
            let mut planes = PixelPlanes::new(size);
            assert!(Pyramid::new(&planes, 4.0).is_none());
            planes.colour[size.0 * size.1 / 2] = colour::encode(WHITE);
            let pyramid = Pyramid::new(&planes, 4.0).unwrap();
            for (column, row) in [(0, 0), (size.0 - 1, size.1 - 1), (size.0 / 2, 0)] {
                let found = at(&pyramid, column, row);
                let nearly = |(a, b): (f32, f32)| (a - b).abs() < 1e-5 * b;
                assert!(found.into_iter().zip(WHITE).all(nearly), "{size:?}: {found:?}");
            }
        }
    }

    #[test]
    fn a_colour_is_between_the_least_and_the_greatest_of_all_points() {
        let light = |column: usize, row: usize| [0.5 + (column * row % 7) as f32; 3];
        let planes = planes((101, 67), 0.02, light);
        let pyramid = Pyramid::new(&planes, 2.0).unwrap();
        for pixel in 0..101 * 67 {
            let [red, ..] = at(&pyramid, pixel % 101, pixel / 101);
            assert!((0.49..=6.6).contains(&red), "{pixel}: {red}");
        }
    }

    #[test]
    fn dense_points_show_their_own_colour_and_gaps_that_of_the_nearest() {
        // Left half dark, right half bright, and no points in a gap of 32 pixels in the right one.
        let light = |column: usize, _: usize| [if column < 128 { 0.1 } else { 1.0 }; 3];
        let mut planes = planes((256, 128), 1.0, light);
        for row in 48..80 {
            planes.colour[row * 256 + 176..][..32].fill(colour::NONE);
        }
        let pyramid = Pyramid::new(&planes, 4.0).unwrap();
        let near = |column, row, wanted: f32| {
            let [red, ..] = at(&pyramid, column, row);
            assert!((red - wanted).abs() < 0.1 * wanted, "{column}, {row}: {red}");
        };
        near(60, 60, 0.1);
        near(220, 20, 1.0);
        near(192, 64, 1.0);
    }

    #[test]
    fn few_noisy_points_are_averaged_over_more_cells() {
        // Points are 0 or 2 by chance, one in 32 pixels. The mean is 1.
        let noisy = |column: usize, row: usize| {
            [if pair(11, (row * 512 + column) as u32).1 < 0.5 { 0.0 } else { 2.0 }; 3]
        };
        let planes = planes((512, 512), 1.0 / 32.0, noisy);
        let variance = |weight: f32| {
            let pyramid = Pyramid::new(&planes, weight).unwrap();
            let errors = (0..64 * 64).map(|cell| {
                let [red, ..] = at(&pyramid, cell % 64 * 8 + 4, cell / 64 * 8 + 4);
                f64::from((red - 1.0) * (red - 1.0))
            });
            errors.sum::<f64>() / 4096.0
        };
        let (alone, wide) = (variance(0.01), variance(16.0));
        // Two points a cell on average, and cells without one: their error is near that of one.
        assert!((0.2..0.8).contains(&alone), "{alone}");
        // A colour that counts as 16 points beside two leaves a ninth of the cell's own noise, and
        // the wider means add less than their own.
        assert!(wide < alone / 8.0, "{wide} for {alone}");
    }
}
