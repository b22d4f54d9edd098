//! Where samples are so clean that what is nearest tells more than a mean over many.
//!
//! A quadtree's leaf cannot tell noise from detail where samples are few, and takes a mean. Both are put to the proof: each sample is
//! foretold by the samples nearest to it, and by the mean; over a neighbourhood, whichever comes nearer is believed (leave-one-out
//! cross-validation, Stone 1974). Noise adds the same to both errors, and more to that of the few.
//!
//! Of noisy samples most are too dark and few much too bright: where there is none of those, the others foretell each other well.
//! Chosen by these alone, pictures of a room of one one-path sample for ten pixels were darker than their leaves' by 2 %. So the nearest
//! have to do better than the mean in a wide region, too, which has some of all.
//!
//! Invariant: as samples grow, the tree's mean of a pixel's own samples foretells them ever better, and is what is shown.

use super::fill::{NEIGHBOURS, Seen, between};
use super::nearest::Points;
use super::squares::Squares;
use super::step::Steps;

/// What the mean's error must be at the least, in errors of the nearest, for those to be believed.
const CLEARLY: f32 = 8.0;
/// Square of the distance, pixels, within which so many samples are dense enough for means.
const DENSE: f32 = 8.0;
/// Side of the squares, pixels, of which 3 × 3 are a region.
const SQUARE: usize = 32;
/// Samples in 32 × 32 pixels of which nearly all are as dense as that, so that none need be looked at: 25 ms of 94 at 512².
pub(super) const MANY: usize = 480;

/// Squared errors of the two ways to foretell a sample.
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

/// Colours for pixels whose samples are clean, `None` for others: `single` is one sample of a pixel, `mean` what the tree shows of it. Only
/// `few` pixels are looked at.
pub(super) fn local(
    points: &Points,
    size: (usize, usize),
    few: impl Fn(usize) -> bool + Sync,
    single: impl Fn(usize) -> Seen + Sync,
    mean: impl Fn(usize) -> [f32; 3] + Sync,
    steps: &Steps,
) -> Vec<Option<[f32; 3]>> {
    let mut foretold = vec![(Errors::default(), [0.0; 3]); size.0 * size.1];
    points.for_each::<{ NEIGHBOURS + 1 }, _>(&mut foretold, &few, |pixel, nearest, item| {
        if nearest.last().is_none_or(|last| last.squared < DENSE) {
            return;
        }
        let own = single(pixel);
        let others = nearest.get(1..).unwrap_or_default();
        let Some(Seen { colour, .. }) = between(others, Some(own), &single, steps) else { return };
        let error = |other: [f32; 3]| {
            (0..3).map(|channel| (own.colour[channel] - other[channel]).powi(2)).sum()
        };
        *item = (Errors { nearest: error(colour), mean: error(mean(pixel)) }, colour);
    });
    let errors = foretold.iter().map(|(errors, _)| *errors).enumerate();
    let regions = Squares::<Errors, SQUARE>::new(size, Errors::default(), errors, Errors::plus);
    let mut colours = vec![None; foretold.len()];
    points.for_each::<{ NEIGHBOURS + 1 }, _>(&mut colours, &few, |pixel, nearest, item| {
        if nearest.last().is_none_or(|last| last.squared < DENSE) {
            return;
        }
        let mut sum = Errors::default();
        for near in nearest.iter().filter(|near| few(near.pixel as usize)) {
            sum = sum.plus(foretold[near.pixel as usize].0);
        }
        let region = regions.around(pixel);
        if sum.mean > CLEARLY * sum.nearest && region.mean > region.nearest {
            let (own, around) = (single(pixel).colour, foretold[pixel].1);
            *item = Some([0, 1, 2].map(|channel| 0.5 * (own[channel] + around[channel])));
        }
    });
    colours
}
