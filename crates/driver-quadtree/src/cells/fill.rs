//! What lies between samples: colours that go smoothly from one to the next of a surface.
//!
//! A pixel is of the surface of the sample nearest to it. Its colour is that of a plane through the nearest samples of this surface, fitted
//! by least squares with weights that grow without bound at a sample and fall to nothing at the farthest (Franke & Nielson 1980, modified
//! Shepard interpolation): samples come in and leave as one goes from pixel to pixel, and no step is seen.
//!
//! Invariant: a colour is within the range of those that it is made of: no light is invented.

use super::nearest::Near;
use super::step::Steps;

/// Samples that a pixel's colour is made of, at the most.
pub(super) const NEIGHBOURS: usize = 8;
/// What is added to the squares of distances in the fit, as their share: samples that lie in a line tell nothing across it, and a fit to
/// noise is no better than a mean.
const STIFFNESS: f32 = 0.05;

/// Distance below which a sample is no nearer, pixels: weights stay finite.
const LEAST: f32 = 1e-3;

/// A sample as seen from a pixel's middle.
#[derive(Clone, Copy)]
struct Sample {
    offset: [f32; 2],
    squared: f32,
    seen: Seen,
}

const NOTHING: Seen = Seen { colour: [0.0; 3], depth: 0.0, aside: [0.0; 2] };

/// What is known of a pixel.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    pub colour: [f32; 3],
    pub depth: f32,
    /// How far from the pixel's middle that is: columns and rows.
    pub aside: [f32; 2],
}

/// What a pixel shows by the samples nearest to it, at least one; `own` is a sample of its own, if it has one: then it is of its surface.
///
/// They are found by the middles of their pixels, which is quicker, but are where they are: 0.3 dB at one sample a pixel.
pub(super) fn between(
    nearest: &[Near],
    own: Option<Seen>,
    seen: impl Fn(usize) -> Seen,
    steps: &Steps,
) -> Option<Seen> {
    let mut samples =
        [Sample { offset: [0.0; 2], squared: f32::INFINITY, seen: NOTHING }; NEIGHBOURS];
    // Nothing is nearer than a sample of its own.
    let mut own = own.map_or(samples[0], |seen| Sample { offset: seen.aside, squared: -1.0, seen });
    for (sample, near) in samples.iter_mut().zip(nearest) {
        let seen = seen(near.pixel as usize);
        let offset = [near.offset[0] + seen.aside[0], near.offset[1] + seen.aside[1]];
        *sample = Sample { offset, squared: offset[0] * offset[0] + offset[1] * offset[1], seen };
        if sample.squared < own.squared {
            own = *sample;
        }
    }
    let count = nearest.len().min(NEIGHBOURS);
    // Where there are no more than that, the farthest counts, too.
    let farther = if count < NEIGHBOURS { 1.5 } else { 1.0 };
    let reach = nearest.last()?.squared.sqrt() * farther + 0.5;
    let mut used = [(0.0_f32, [0.0_f32; 2], [0.0_f32; 3]); NEIGHBOURS];
    let mut len = 0;
    for Sample { offset, squared, seen } in &samples[..count] {
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
    Some(Seen { colour, depth: own.seen.depth, aside: [0.0; 2] })
}

/// The value at the origin of a plane fitted to colours at places, by weights. `None` if all weights are 0.
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
    // About the middle of the samples, where mean and slope know nothing of each other.
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
