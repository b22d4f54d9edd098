//! Standard errors of traced pictures: noise, and the error that neighbouring pixels share, because
//! their paths end in the same cells (engine `gather`).
//!
//! Paths of even and of odd number use cells of their own. The means of both halves differ by noise
//! and by the errors of both sets of cells. In the mean of a block of pixels the noise is small and
//! known, so the rest of the squared difference is the error of cells.
//!
//! It leaves out what both sets have in common: the bias of the cells' width. Paths of a half are
//! stratified, so their noise is smaller than stated. The shared error is therefore stated too
//! small, by at most the noise of a block's mean.

use crate::sums::TracedPicture;

/// Side of a block, pixels. The noise of its mean is a sixteenth of that of a pixel.
const BLOCK: usize = 16;

/// Blocks on each side that count too. A single difference would say little.
const AROUND: usize = 1;

/// One block of pixels.
#[derive(Clone, Copy, Default)]
struct PixelBlock {
    /// Sum over pixels of half the difference of both means, by channel.
    difference: [f64; 3],
    /// Sum over pixels of that difference's variance by noise.
    noise: [f64; 3],
    /// Number of pixels with both means.
    pixels: f64,
}

impl PixelBlock {
    /// Adds a pixel, if it has paths of both halves.
    fn add(&mut self, picture: &TracedPicture, pixel: usize) {
        let (sums, difference) = (&picture.sums[pixel], &picture.differences[pixel]);
        let odd = f64::from(sums.paths / 2);
        let even = f64::from(sums.paths.div_ceil(2));
        if odd == 0.0 {
            return;
        }
        self.pixels += 1.0;
        let noise = picture.noise(pixel);
        for channel in 0..3 {
            let (sum, minus) = (sums.first[channel], difference[channel]);
            let means = [(sum + minus) / 2.0 / even, (sum - minus) / 2.0 / odd];
            self.difference[channel] += (means[0] - means[1]) / 2.0;
            // The variance of a mean of all paths, for two means of parts of them.
            self.noise[channel] += noise[channel] * (even + odd) * (1.0 / even + 1.0 / odd) / 4.0;
        }
    }

    /// Returns the squared error of the block's mean by cells, by channel. Its expectation is
    /// right; it may be negative.
    fn variance(&self) -> [f64; 3] {
        let squared = self.pixels * self.pixels;
        std::array::from_fn(|channel| {
            (self.difference[channel] * self.difference[channel] - self.noise[channel]) / squared
        })
    }
}

/// Returns the standard errors of all pixels, with the error that they share, if paths of even and
/// odd number have cells of their own. Paths of a pixel are taken for independent.
pub fn standard_errors(picture: &TracedPicture) -> Vec<[f32; 3]> {
    let shared = variances(picture);
    let of_pixel = |pixel: usize| {
        let noise = picture.noise(pixel);
        let shared = shared.get(pixel).copied().unwrap_or_default();
        std::array::from_fn(|channel| (noise[channel] + shared[channel]).sqrt() as f32)
    };
    (0..picture.squares.len()).map(of_pixel).collect()
}

/// Returns the variance of each pixel's mean by the error of cells, by channel. Empty if paths of
/// even and odd number share their cells.
fn variances(picture: &TracedPicture) -> Vec<[f64; 3]> {
    let (width, height) = (picture.size.0 as usize, picture.size.1 as usize);
    let (columns, rows) = (width.div_ceil(BLOCK), height.div_ceil(BLOCK));
    let mut blocks = vec![PixelBlock::default(); columns * rows];
    let block_of = |pixel: usize| pixel / width / BLOCK * columns + pixel % width / BLOCK;
    for pixel in 0..picture.differences.len() {
        blocks[block_of(pixel)].add(picture, pixel);
    }
    let near = |at: usize, count: usize| at.saturating_sub(AROUND)..(at + AROUND + 1).min(count);
    let around = |number: usize| {
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for row in near(number / columns, rows) {
            for column in near(number % columns, columns) {
                let block = &blocks[row * columns + column];
                if block.pixels > 0.0 {
                    crate::sums::add(&mut sum, block.variance());
                    count += 1.0;
                }
            }
        }
        sum.map(|sum: f64| (sum / f64::max(count, 1.0)).max(0.0))
    };
    let of_blocks: Vec<[f64; 3]> = (0..blocks.len()).map(around).collect();
    (0..picture.differences.len()).map(|pixel| of_blocks[block_of(pixel)]).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::time::Duration;

    use holo_picture::ViewSpec;
    use holo_scenes::Bundled;
    use holo_tracer::{Settings, Tracer};

    use super::*;
    use crate::passes::{TraceJob, WorkLimit};
    use crate::sums::PictureSums;

    /// Returns numbers from -1 to 1 of variance 1/3, always the same ones.
    fn numbers() -> impl Iterator<Item = f64> {
        (0_u64..).map(|n| (holo_sobol::mix(n) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0)
    }

    /// Returns a picture with as many paths in each pixel. They have noise of this size, and each
    /// half of them an error of this size, the same in all pixels.
    fn picture(
        paths: u32,
        [noise, shared]: [f64; 2],
        numbers: &mut impl Iterator<Item = f64>,
    ) -> TracedPicture {
        let mut made = TracedPicture::new((48, 48), true, true);
        let mut next = |size: f64| size * 3_f64.sqrt() * numbers.next().unwrap_or_default();
        let of_halves = [next(shared), next(shared)];
        for pixel in 0..made.sums.len() {
            made.sums[pixel] = PictureSums { paths, ..PictureSums::default() };
            for path in 0..paths as usize {
                let value = 10.0 + of_halves[path % 2] + next(noise);
                let sign = if path % 2 == 0 { 1.0 } else { -1.0 };
                made.sums[pixel].first = made.sums[pixel].first.map(|sum| sum + value);
                made.squares[pixel] = made.squares[pixel].map(|sum| sum + value * value);
                made.differences[pixel] = made.differences[pixel].map(|sum| sum + sign * value);
            }
        }
        made
    }

    #[test]
    fn the_error_of_both_halves_is_found_beneath_noise() {
        for (paths, shared) in [(4, 0.3), (7, 0.1), (64, 0.02)] {
            let mut numbers = numbers();
            let found: Vec<f64> = (0..200)
                .map(|_| {
                    let made = picture(paths, [1.0, shared], &mut numbers);
                    variances(&made)[0][1]
                })
                .collect();
            // The mean of both halves has half of the variance of each. One path more in one half
            // changes that by a fiftieth.
            let expected = shared * shared / 2.0;
            let count = found.len() as f64;
            let mean = found.iter().sum::<f64>() / count;
            let spread = found.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (count - 1.0);
            let off = (mean - expected).abs();
            assert!(off < 3.5 * (spread / count).sqrt() + 0.02 * expected, "{mean} {expected}");
        }
    }

    #[test]
    fn without_a_second_half_nothing_is_shared() {
        let mut numbers = numbers();
        let one = picture(1, [1.0, 1.0], &mut numbers);
        assert!(variances(&one).iter().all(|variance| *variance == [0.0; 3]));
        let mut alone = picture(4, [1.0, 1.0], &mut numbers);
        alone.differences.clear();
        assert!(variances(&alone).is_empty());
        assert_eq!(standard_errors(&alone).len(), alone.sums.len());
    }

    #[test]
    fn pictures_differ_by_as_much_as_their_standard_errors_state() {
        const RUNS: u64 = 16;
        let folder = tempfile::tempdir().unwrap();
        let written = holo_scenes::write(Bundled::Cornell, folder.path()).unwrap();
        let scene = Arc::new(holo_scene::load(&written.obj, &Default::default()).unwrap().scene);
        let mut spec = ViewSpec::default();
        spec.apply_line("-vp 2.78 2.73 -2 -vd 0 0 1 -vu 0 1 0 -vh 50").unwrap();
        let (view, size) = spec.resolve((48, 48)).unwrap();
        let tracer = || Tracer::new(Arc::clone(&scene), Settings::default()).unwrap().with_gather();
        let runs: Vec<TracedPicture> = (0..RUNS)
            .map(|seed| {
                let (tracer, twin) = (tracer(), Some(tracer()));
                let limit = WorkLimit::Paths(8);
                // One thread: what cells know when they are asked is then a function of the seed.
                let threads = 1;
                let has_errors = true;
                TraceJob { tracer, twin, view, size, seed, threads, limit, has_errors }.run(
                    || Duration::ZERO,
                    || false,
                    |_| {},
                )
            })
            .collect();
        // Of each run: the means of all blocks, and what the halves say of their variance.
        let of_run = |run: &TracedPicture| {
            let mut blocks = vec![(0.0, PixelBlock::default()); 9];
            for pixel in 0..run.sums.len() {
                let (mean, block) = &mut blocks[pixel / 48 / 16 * 3 + pixel % 48 / 16];
                *mean += f64::from(run.sums[pixel].mean()[1]) / 256.0;
                block.add(run, pixel);
            }
            let variance =
                |(_, block): &(f64, PixelBlock)| block.variance()[1] + block.noise[1] / 65536.0;
            let variance = blocks.iter().map(variance).sum::<f64>() / 9.0;
            (blocks.iter().map(|(mean, _)| *mean).collect(), variance)
        };
        let runs: Vec<(Vec<f64>, f64)> = runs.iter().map(of_run).collect();
        let count = RUNS as f64;
        let average = |values: &[f64]| values.iter().sum::<f64>() / count;
        let standard_error = |values: &[f64]| {
            let mean = average(values);
            let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
            (squares / (count - 1.0) / count).sqrt()
        };
        let middle: Vec<f64> =
            (0..9).map(|block| runs.iter().map(|run| run.0[block]).sum::<f64>() / count).collect();
        let differ = |run: &(Vec<f64>, f64)| {
            let squares = run.0.iter().zip(&middle).map(|(one, middle)| (one - middle).powi(2));
            squares.sum::<f64>() / 9.0 * count / (count - 1.0) - run.1
        };
        let differ: Vec<f64> = runs.iter().map(differ).collect();
        let (off, error) = (average(&differ), standard_error(&differ));
        assert!(off.abs() < 3.5 * error, "{off} {error}");
    }
}
