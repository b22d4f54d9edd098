//! Interpolates colours between the samples of a surface.
//!
//! A pixel belongs to the surface of the sample nearest to it. Its colour is that of a plane
//! through the nearest samples of this surface, fitted by least squares. The weights grow without
//! bound at a sample and fall to 0 at the farthest (Franke & Nielson 1980, modified Shepard
//! interpolation). So no step is visible where the set of nearest samples changes.
//!
//! Invariant: each channel of a colour is within the range of the samples that it is made from.

use super::step::DepthSteps;
use super::window::Near;

/// Largest number of samples that a pixel's colour is made from.
pub(super) const NEIGHBOURS: usize = 8;
/// Regularisation of the fit: this share is added to the sums of squared distances. Samples in a
/// line do not determine the slope across it, and a fit to noise is no better than a mean.
const STIFFNESS: f32 = 0.05;

/// Least distance of a sample, pixels, so that weights stay finite.
const LEAST: f32 = 1e-3;

/// A sample as seen from a pixel's middle.
#[derive(Clone, Copy)]
struct MidpointSample {
    offset: [f32; 2],
    squared: f32,
    seen: PixelSample,
}

const NOTHING: PixelSample = PixelSample { colour: [0.0; 3], depth: 0.0, aside: [0.0; 2] };

/// The sample of a pixel, as the pixel shows it.
#[derive(Clone, Copy)]
pub(super) struct PixelSample {
    pub colour: [f32; 3],
    pub depth: f32,
    /// Columns and rows from the pixel's middle to the sample.
    pub aside: [f32; 2],
}

/// Returns the colour and depth of a pixel from the samples nearest to it; `None` without samples.
/// If the pixel has a sample of its `own`, it belongs to the surface of that sample.
///
/// The nearest samples are found by the middles of their pixels, but weighed by their exact places.
/// The exact places gain 0.3 dB at one sample for each pixel.
pub(super) fn between(
    nearest: &[Near],
    own: Option<PixelSample>,
    seen: impl Fn(usize) -> PixelSample,
    steps: &DepthSteps,
) -> Option<PixelSample> {
    let mut samples =
        [MidpointSample { offset: [0.0; 2], squared: f32::INFINITY, seen: NOTHING }; NEIGHBOURS];
    // A sample of the pixel's own is always the nearest.
    let mut own =
        own.map_or(samples[0], |seen| MidpointSample { offset: seen.aside, squared: -1.0, seen });
    for (sample, near) in samples.iter_mut().zip(nearest) {
        let seen = seen(near.pixel as usize);
        let offset = [near.offset[0] + seen.aside[0], near.offset[1] + seen.aside[1]];
        *sample =
            MidpointSample { offset, squared: offset[0] * offset[0] + offset[1] * offset[1], seen };
        if sample.squared < own.squared {
            own = *sample;
        }
    }
    let count = nearest.len().min(NEIGHBOURS);
    // If there are fewer samples than wanted, the farthest also has a weight.
    let farther = if count < NEIGHBOURS { 1.5 } else { 1.0 };
    let reach = nearest.last()?.squared.sqrt() * farther + 0.5;
    let mut used = [(0.0_f32, [0.0_f32; 2], [0.0_f32; 3]); NEIGHBOURS];
    let mut len = 0;
    for MidpointSample { offset, squared, seen } in &samples[..count] {
        let (across, down) = (offset[0] - own.offset[0], offset[1] - own.offset[1]);
        if steps.is_one_surface(own.seen.depth, seen.depth, (across * across + down * down).sqrt())
        {
            let distance = squared.sqrt().max(LEAST);
            let falling = (reach - distance).max(0.0) / (reach * distance);
            used[len] = (falling * falling, *offset, seen.colour);
            len += 1;
        }
    }
    let colour = plane(&used[..len]).unwrap_or(own.seen.colour);
    Some(PixelSample { colour, depth: own.seen.depth, aside: [0.0; 2] })
}

/// Returns the value at the origin of a plane fitted to colours at places, by weights. `None` if
/// all weights are 0.
fn plane(used: &[(f32, [f32; 2], [f32; 3])]) -> Option<[f32; 3]> {
    let (mut sum, mut x, mut y, mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for &(weight, [across, down], _) in used {
        sum += weight;
        x += weight * across;
        y += weight * down;
        xx += weight * across * across;
        xy += weight * across * down;
        yy += weight * down * down;
    }
    if sum == 0.0 {
        return None;
    }
    // About the mean place of the samples, where mean and slope are independent.
    let (x, y) = (x / sum, y / sum);
    let stiff = STIFFNESS * (xx + yy);
    let (xx, xy, yy) = (xx - sum * x * x + stiff, xy - sum * x * y, yy - sum * y * y + stiff);
    let determinant = xx * yy - xy * xy;
    let (right, down) = if determinant > 0.0 {
        ((yy * -x + xy * y) / determinant, (xx * -y + xy * x) / determinant)
    } else {
        (0.0, 0.0)
    };
    let (mut value, mut low, mut high) = ([0.0; 3], [f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for &(weight, place, colour) in used {
        let share = weight / sum + weight * (right * (place[0] - x) + down * (place[1] - y));
        for channel in 0..3 {
            value[channel] += share * colour[channel];
            low[channel] = low[channel].min(colour[channel]);
            high[channel] = high[channel].max(colour[channel]);
        }
    }
    Some([0, 1, 2].map(|channel| value[channel].max(low[channel]).min(high[channel])))
}
