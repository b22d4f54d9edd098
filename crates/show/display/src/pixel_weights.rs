//! Weights of a picture's pixels, by the error that a further sample would remove.
//!
//! Invariants:
//! - The mean of all weights is 1, and none is below [`UNIFORM_SHARE`], so that no beam starves.
//! - The weight of a tile does not depend on the samples of that tile. Otherwise a tile whose first
//!   samples missed a lamp would get few more samples and stay too dark: the mean of a number of
//!   samples that depends on their values has a bias.

use rayon::prelude::*;

/// Side of a tile of pixels with one weight, pixels.
const TILE: u32 = 8;

/// Share of all samples that are spread evenly.
const UNIFORM_SHARE: f32 = 0.5;

/// Greatest error of a tile, relative to the mean of all tiles. A few tiles with rare bright
/// samples would otherwise get most samples of a view.
const MOST_ERROR: f32 = 8.0;

/// Weights of the pixels of a picture, as multiples of the mean.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelWeights {
    /// The number of tiles in a row and in a column.
    size: (usize, usize),
    /// The size of a tile, as a share of the picture's width and height.
    tile: (f64, f64),
    /// The weights of tiles, row by row from the top.
    weights: Vec<f32>,
}

impl PixelWeights {
    /// Returns the weights of a picture of `size` pixels. `error` is the error of one pixel as a
    /// person sees it, multiplied by the square root of its number of samples: samples in
    /// proportion to it make the sum of squared errors least (Neyman 1934). Pixels for which it is
    /// `None` do not count.
    ///
    /// `None` if no error is known or all are 0.
    pub fn new(
        size: (u32, u32),
        error: impl Fn(usize) -> Option<f32> + Sync,
    ) -> Option<PixelWeights> {
        let tiles = [size.0, size.1].map(|side| side.div_ceil(TILE) as usize);
        let known =
            |pixel: u32| error(pixel as usize).filter(|error| error.is_finite() && *error >= 0.0);
        let of_tile = |tile: usize| {
            let [left, top] = [tile % tiles[0], tile / tiles[0]].map(|at| at as u32 * TILE);
            let (right, bottom) = ((left + TILE).min(size.0), (top + TILE).min(size.1));
            let row = |row: u32| (left..right).map(move |column| row * size.0 + column);
            mean((top..bottom).flat_map(row).filter_map(known))
        };
        let errors: Vec<Option<f32>> =
            (0..tiles[0] * tiles[1]).into_par_iter().map(of_tile).collect();
        let mean = mean(errors.iter().flatten().copied()).filter(|mean| *mean > 0.0)?;
        let around = |tile: usize| around(&errors, (tiles[0], tiles[1]), tile);
        let mut weights: Vec<f32> = (0..errors.len())
            .map(|tile| around(tile).map_or(1.0, |error| (error / mean).min(MOST_ERROR)))
            .collect();
        let total = weights.iter().sum::<f32>() / weights.len() as f32;
        for weight in &mut weights {
            *weight = UNIFORM_SHARE + (1.0 - UNIFORM_SHARE) * *weight / total;
        }
        let tile = [size.0, size.1].map(|side| f64::from(TILE) / f64::from(side));
        Some(PixelWeights { size: (tiles[0], tiles[1]), tile: (tile[0], tile[1]), weights })
    }

    /// Returns the weight at a point of the picture: `x` from the left and `y` from the bottom, 0
    /// to 1.
    pub fn at(&self, x: f64, y: f64) -> f32 {
        let tile =
            |at: f64, side: f64, count: usize| ((at / side).max(0.0) as usize).min(count - 1);
        let column = tile(x, self.tile.0, self.size.0);
        let row = tile(1.0 - y, self.tile.1, self.size.1);
        self.weights[row * self.size.0 + column]
    }
}

/// Returns the mean error of the eight tiles around one. `None` if none of them has any.
fn around(errors: &[Option<f32>], size: (usize, usize), tile: usize) -> Option<f32> {
    let (row, column) = (tile / size.0, tile % size.0);
    let rows = row.saturating_sub(1)..(row + 2).min(size.1);
    let columns = column.saturating_sub(1)..(column + 2).min(size.0);
    let tiles = rows.flat_map(|row| columns.clone().map(move |column| row * size.0 + column));
    mean(tiles.filter(|other| *other != tile).filter_map(|other| errors[other]))
}

/// Returns the mean of some numbers, if there are any.
fn mean(values: impl Iterator<Item = f32>) -> Option<f32> {
    let (mut sum, mut count) = (0.0f64, 0u32);
    for value in values {
        sum += f64::from(value);
        count += 1;
    }
    (count > 0).then(|| (sum / f64::from(count)) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::split_mix;

    /// A picture of 64 x 32 pixels whose right half has four times the error.
    fn halves() -> PixelWeights {
        let error = |pixel: usize| Some(if pixel % 64 < 32 { 1.0 } else { 4.0 });
        PixelWeights::new((64, 32), error).unwrap()
    }

    #[test]
    fn half_of_the_samples_follow_the_error_and_half_are_spread_evenly() {
        let weights = halves();
        assert!((weights.at(0.1, 0.5) - (0.5 + 0.5 / 2.5)).abs() < 1e-6);
        assert!((weights.at(0.9, 0.5) - (0.5 + 0.5 * 4.0 / 2.5)).abs() < 1e-6);
        let mean = weights.weights.iter().sum::<f32>() / weights.weights.len() as f32;
        assert!((mean - 1.0).abs() < 1e-6, "{mean}");
    }

    #[test]
    fn a_tile_does_not_weigh_itself() {
        let spot = |height: f32| {
            let error = move |pixel: usize| {
                let (column, row) = (pixel % 64, pixel / 64);
                Some(if column / 8 == 3 && row / 8 == 1 { height } else { 1.0 })
            };
            PixelWeights::new((64, 32), error).unwrap()
        };
        let at = |weights: &PixelWeights, column: f64, row: f64| {
            weights.at(column / 64.0, 1.0 - row / 32.0) / weights.at(0.99, 0.01)
        };
        let (low, high) = (spot(1.0), spot(6.0));
        assert_eq!(at(&low, 28.0, 12.0), at(&high, 28.0, 12.0));
        assert!(at(&high, 20.0, 12.0) > 1.1 * at(&low, 20.0, 12.0));
    }

    /// Tiles of a picture whose samples are 50 with probability 0.02, and 0 otherwise.
    struct RareLight {
        sums: Vec<(f64, u32)>,
        random: u64,
    }

    impl RareLight {
        fn add(&mut self, tile: usize, samples: u32) {
            for _ in 0..samples {
                self.random += 1;
                let is_lit = split_mix(self.random).is_multiple_of(50);
                let (sum, count) = &mut self.sums[tile];
                *sum += if is_lit { 50.0 } else { 0.0 };
                *count += 1;
            }
        }

        fn means(&self) -> impl Iterator<Item = f64> {
            self.sums.iter().map(|&(sum, count)| sum / f64::from(count))
        }
    }

    #[test]
    fn samples_that_follow_the_error_have_no_bias() {
        const TILES: usize = 256;
        let (mut sum, mut square, mut count) = (0.0, 0.0, 0.0);
        for run in 0..300_u64 {
            let mut light = RareLight { sums: vec![(0.0, 0); TILES], random: run << 32 };
            (0..TILES).for_each(|tile| light.add(tile, 8));
            for _ in 0..4 {
                // The deviation of one sample, from the tile's own samples.
                let deviation: Vec<f32> =
                    light.means().map(|mean| (50.0 * mean).sqrt() as f32).collect();
                let error = |pixel: usize| Some(deviation[pixel / 128 / 8 * 16 + pixel % 128 / 8]);
                let Some(weights) = PixelWeights::new((128, 128), error) else { continue };
                for tile in 0..TILES {
                    light.add(tile, (8.0 * weights.weights[tile]).round() as u32);
                }
            }
            for mean in light.means() {
                (sum, square, count) = (sum + mean, square + mean * mean, count + 1.0);
            }
        }
        let mean: f64 = sum / count;
        let error = ((square / count - mean * mean) / count).sqrt();
        assert!((mean - 1.0).abs() < 4.0 * error, "{mean} ± {error}");
    }

    #[test]
    fn no_weight_is_small_or_no_number_whatever_the_errors_are() {
        let error = |pixel: usize| match pixel % 5 {
            0 => None,
            1 => Some(f32::INFINITY),
            2 => Some(f32::NAN),
            3 => Some(1e30),
            _ => Some(0.0),
        };
        let weights = PixelWeights::new((61, 35), error).unwrap();
        assert!(weights.weights.iter().all(|weight| (UNIFORM_SHARE..=16.0).contains(weight)));
        assert!(weights.at(-1.0, 2.0).is_finite() && weights.at(1.0, 0.0).is_finite());
        assert_eq!(PixelWeights::new((61, 35), |_| None), None);
        assert_eq!(PixelWeights::new((61, 35), |_| Some(0.0)), None);
        assert_eq!(PixelWeights::new((0, 0), |_| Some(1.0)), None);
    }
}
