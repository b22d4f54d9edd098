//! What lies between samples: colours that go smoothly from one to the next of a surface.
//!
//! A pixel is of the surface of the sample nearest to it. Its colour is that of a plane through the nearest samples of this surface, fitted
//! by least squares with weights that grow without bound at a sample and fall to nothing at the farthest (Franke & Nielson 1980, modified
//! Shepard interpolation): samples come in and leave as one goes from pixel to pixel, and no step is seen.
//!
//! Invariant: a colour is within the range of those that it is made of: no light is invented.

use super::near::Near;
use super::step::Steps;

/// Samples that a pixel's colour is made of, at the most.
pub(super) const NEIGHBOURS: usize = 10;
/// What is added to the squares of distances in the fit, as their share: samples that lie in a line tell nothing across it, and a fit to
/// noise is no better than a mean.
const STIFFNESS: f32 = 0.1;

/// What is known of a pixel.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    pub colour: [f32; 3],
    pub depth: f32,
}

/// What a pixel shows by the samples nearest to it, at least one, the nearest first.
pub(super) fn between(nearest: &[Near], seen: impl Fn(usize) -> Seen, steps: &Steps) -> Option<Seen> {
    let (first, last) = (nearest.first()?, nearest.last()?);
    let own = seen(first.pixel as usize);
    // Half as far again as the last if there are no more: it counts, too.
    let reach = last.squared.sqrt() * if nearest.len() < NEIGHBOURS { 1.5 } else { 1.0 };
    let mut used = [(0.0_f32, [0.0_f32; 2], [0.0_f32; 3]); NEIGHBOURS];
    let mut count = 0;
    for near in nearest {
        let other = seen(near.pixel as usize);
        let (across, down) = (near.offset[0] - first.offset[0], near.offset[1] - first.offset[1]);
        if !steps.is_one_surface(own.depth, other.depth, across.hypot(down)) {
            continue;
        }
        let distance = near.squared.sqrt().max(1e-3);
        let falling = (reach - distance).max(0.0) / (reach * distance);
        used[count] = (falling * falling, near.offset, other.colour);
        count += 1;
    }
    let colour = plane(&used[..count]).unwrap_or(own.colour);
    Some(Seen { colour, depth: own.depth })
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
    // Also refuses NaN.
    if !(sum > 0.0) {
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
