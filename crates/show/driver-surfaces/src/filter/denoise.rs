//! Open Image Denoise in place of the filter's light.

use super::{Filtered, OfSquares};
use crate::behind::BehindPanes;
use crate::coats::mean_of_samples;
use crate::estimate::Estimate;
use crate::squares::Squares;
use glam::Vec3;
use holo_denoise::Denoiser;
use holo_display::Interrupt;
use rayon::prelude::*;

/// Fixed-point steps that the denoiser sees as 1.
const SCALE: f32 = 1024.0;

/// Side of the place in which samples around a square are counted, squares.
const AROUND: usize = 9;

/// Samples per square below which the light is that of wider squares alone.
const SPARSE: f32 = 0.5;

/// Samples per square above which wider squares do not count.
const DENSE: f32 = 1.4;

/// Share of squares among which samples must be few for wider squares to be worth their time.
const WORTH: f32 = 0.02;

impl Squares {
    /// Returns how much the light of wider squares counts in each square: 1 where samples are few,
    /// 0 where there are enough. `None` if there are enough almost everywhere.
    pub fn weights_of_wider(&self, sums: &OfSquares) -> Option<Vec<f32>> {
        let all = sums.from_all.as_ref().unwrap_or(&sums.towards_eye);
        let counts = self.seen.iter().zip(all).map(|(seen, sums)| match seen.is_surface() {
            true => [sums.count as f32, 1.0],
            false => [0.0; 2],
        });
        let counts: Vec<[f32; 2]> = counts.collect();
        let (width, height) = self.size;
        let add = |a: [f32; 2], b: &[f32; 2]| [a[0] + b[0], a[1] + b[1]];
        let around =
            |at: usize, size: usize| at.saturating_sub(AROUND / 2)..(at + AROUND / 2 + 1).min(size);
        let of_rows: Vec<[f32; 2]> = (0..counts.len())
            .into_par_iter()
            .map(|number| {
                let (row, x) = (number / width * width, number % width);
                around(x, width).map(|x| &counts[row + x]).fold([0.0; 2], add)
            })
            .collect();
        let weight = |number: usize| {
            let (y, x) = (number / width, number % width);
            let [samples, squares] =
                around(y, height).map(|y| &of_rows[y * width + x]).fold([0.0; 2], add);
            let dense = samples / squares.max(1.0);
            ((DENSE - dense) / (DENSE - SPARSE)).clamp(0.0, 1.0)
        };
        let weights: Vec<f32> = (0..counts.len()).into_par_iter().map(weight).collect();
        let sum: f32 = weights.iter().sum();
        (sum > WORTH * weights.len() as f32).then_some(weights)
    }

    /// Replaces the filtered light by the denoised means of all samples. If a square has no
    /// samples, its filtered light is denoised. If the library fails or is interrupted, the light
    /// stays filtered.
    pub fn denoise(
        &self,
        OfSquares { towards_eye, from_all }: &OfSquares,
        behind: &BehindPanes,
        Filtered { mut lights, beyond }: Filtered,
        denoiser: &mut Denoiser,
        interrupt: &Interrupt,
    ) -> Vec<Estimate> {
        let goes_on = || !interrupt.is_set();
        let of_samples = |number: usize| {
            let own = &towards_eye[number];
            match from_all {
                Some(all) => mean_of_samples(own, &all[number], &beyond[number]),
                None => (own.count > 0).then(|| own.mean()),
            }
        };
        let light = |number: usize| {
            let light = match of_samples(number) {
                None => lights[number].light,
                Some(mean) => behind.of(number).map_or(mean, |pane| pane.light(mean)),
            };
            (light.max(Vec3::ZERO) / SCALE).to_array()
        };
        let mut pixels: Vec<[f32; 3]> = (0..towards_eye.len()).map(light).collect();
        let normals: Vec<[f32; 3]> = self.seen.iter().map(|seen| seen.normal.to_array()).collect();
        if denoiser.denoise_light(&mut pixels, &normals, self.size, &goes_on).is_ok() {
            for (light, pixel) in lights.iter_mut().zip(pixels) {
                light.light = Vec3::from_array(pixel).max(Vec3::ZERO) * SCALE;
            }
        }
        lights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light_store::Sums;
    use crate::visible::VisiblePoint;

    /// Returns the weights for squares on a plane that have these numbers of samples.
    fn weights(counts: impl Fn(usize, usize) -> u32) -> Option<Vec<f32>> {
        let size = (40, 30);
        let seen = |_| VisiblePoint { normal: Vec3::Z, material: 0, ..VisiblePoint::NOTHING };
        let squares = Squares::new(seen, size, 1);
        let of_square = |number: usize| {
            let mut sums = Sums::default();
            sums.count = counts(number % size.0, number / size.0);
            sums
        };
        let sums = (0..size.0 * size.1).map(of_square).collect();
        squares.weights_of_wider(&OfSquares { towards_eye: sums, from_all: None })
    }

    #[test]
    fn wider_squares_count_where_samples_are_few_and_nowhere_else() {
        assert!(weights(|_, _| 2).is_none(), "there are enough");
        assert!(weights(|x, y| u32::from(x == 3 && y == 5)).unwrap().iter().all(|w| *w == 1.0));
        let half = weights(|x, y| 3 * ((x + y) % 2) as u32);
        assert!(half.is_none(), "there are enough, although half of the squares have none");
        let left = weights(|x, _| if x < 20 { 0 } else { 5 }).unwrap();
        for row in left.chunks(40) {
            assert!(row[..15].iter().all(|w| *w == 1.0) && row[25..].iter().all(|w| *w == 0.0));
            assert!(row.windows(2).all(|pair| pair[0] >= pair[1]), "it falls evenly");
        }
    }
}
