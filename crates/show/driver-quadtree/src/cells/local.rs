//! Finds pixels whose samples are so clean that the nearest ones are better than a mean over many.
//!
//! With few samples, a quadtree's leaf cannot distinguish noise from detail, and shows a mean. Here
//! each sample is predicted twice: from the samples nearest to it, and by the mean. In each
//! neighbourhood, the better prediction is used (leave-one-out cross-validation, Stone 1974). Noise
//! adds equally to both errors, and adds more to the prediction from few samples.
//!
//! Most noisy samples are too dark, and few are much too bright. If no bright one is near, the dark
//! ones predict each other well. Pictures of one-path samples (one for ten pixels) were then darker
//! than the quadtree's by 2 %. So the nearest samples must also predict better than the mean in a
//! wide region, which has some samples of both kinds.
//!
//! Invariant: as samples grow, the quadtree's mean over a pixel's own samples predicts them better,
//! and is shown.

use super::fill::{NEIGHBOURS, PixelSample, between};
use super::nearest::TiledPoints;
use super::squares::SquareSums;
use super::step::DepthSteps;

/// Least ratio of the mean's squared error to that of the nearest samples for which these are used.
const CLEARLY: f32 = 8.0;
/// Squared distance, pixels, within which samples are so dense that the mean is used.
const DENSE: f32 = 8.0;
/// Side of the squares, pixels. A region has 3 × 3 squares.
const SQUARE: usize = 32;
/// Number of samples in 32 × 32 pixels above which nearly all are so dense, and none is tested.
pub(super) const MANY: usize = 480;

/// Squared errors of the two ways to predict a sample.
#[derive(Clone, Copy, Default)]
struct Errors {
    nearest: f32,
    mean: f32,
}

impl Errors {
    fn plus(self, other: Self) -> Self {
        Self { nearest: self.nearest + other.nearest, mean: self.mean + other.mean }
    }
}

/// Returns colours for pixels whose samples are clean, `None` for others. `single` returns one
/// sample of a pixel, `mean` the colour that the quadtree shows. Only `candidates` are tested.
pub(super) fn local(
    points: &TiledPoints,
    size: (usize, usize),
    candidates: &[bool],
    single: impl Fn(usize) -> PixelSample + Sync,
    mean: impl Fn(usize) -> [f32; 3] + Sync,
    steps: &DepthSteps,
) -> Vec<Option<[f32; 3]>> {
    let is_candidate = |pixel: usize| candidates[pixel];
    let mut predicted = vec![(Errors::default(), [0.0; 3]); size.0 * size.1];
    points.for_each::<{ NEIGHBOURS + 1 }, _>(
        &mut predicted,
        is_candidate,
        |pixel, nearest, item| {
            if nearest.last().is_none_or(|last| last.squared < DENSE) {
                return;
            }
            let own = single(pixel);
            let others = nearest.get(1..).unwrap_or_default();
            let Some(PixelSample { colour, .. }) = between(others, Some(own), &single, steps)
            else {
                return;
            };
            let error = |other: [f32; 3]| {
                (0..3).map(|channel| (own.colour[channel] - other[channel]).powi(2)).sum()
            };
            *item = (Errors { nearest: error(colour), mean: error(mean(pixel)) }, colour);
        },
    );
    let errors = predicted.iter().map(|(errors, _)| *errors).enumerate();
    let regions = SquareSums::<Errors, SQUARE>::new(size, Errors::default(), errors, Errors::plus);
    let mut colours = vec![None; predicted.len()];
    points.for_each::<{ NEIGHBOURS + 1 }, _>(&mut colours, is_candidate, |pixel, nearest, item| {
        if nearest.last().is_none_or(|last| last.squared < DENSE) {
            return;
        }
        let mut sum = Errors::default();
        for near in nearest.iter().filter(|near| candidates[near.pixel as usize]) {
            sum = sum.plus(predicted[near.pixel as usize].0);
        }
        let region = regions.around(pixel);
        if sum.mean > CLEARLY * sum.nearest && region.mean > region.nearest {
            let (own, around) = (single(pixel).colour, predicted[pixel].1);
            *item = Some([0, 1, 2].map(|channel| 0.5 * (own[channel] + around[channel])));
        }
    });
    colours
}
