//! The limit of a bright sample: a share of the light around it, until others confirm it.

use super::sums::Sum;
use crate::behind::BehindPanes;
use crate::estimate::LightSums;
use crate::light_store::{Sums, luminance};
use crate::planes::{SquareLayout, Weights};

/// Most light of one sample, as a share of the light of its wide neighbourhood.
const MOST_SHARE: f32 = 0.1;

/// Weight of the picture's mean in the light around a sample, in samples. Without it, a sample
/// alone in its neighbourhood would have darkness around it, and would be cut to nothing.
const MEAN_AROUND: f32 = 4.0;

/// What limits bright samples.
pub(super) struct Limit<'a> {
    /// The weights of all scales up to the wide neighbourhood.
    pub weights: &'a [Weights],
    /// The mean luminance of the picture.
    pub mean: f32,
    pub behind: &'a BehindPanes,
}

impl Limit<'_> {
    /// Returns `own`, the sums of squares, with their brightest samples limited, and without the
    /// light that panes mirror.
    pub fn brightest(&self, layout: &SquareLayout, own: &Sum, sums: &[Sums]) -> Sum {
        let widen = |lit: Sum, (scale, weights): (usize, &Weights)| {
            layout.widened(&lit, 1 << scale, weights, None)
        };
        let wide = self.weights.iter().enumerate().fold(own.clone(), widen);
        layout.planes(|at| {
            let (own, wide) = (own.at(at).into(), wide.at(at).into());
            let limited = limit_brightest(&own, &wide, &sums[at.number], self.mean);
            self.behind.taken_out(at.number, limited).to_array()
        })
    }
}

/// Returns the sums of a square with its brightest sample cut to a share of the light around. That
/// sample does not raise its own limit. `mean`, the mean luminance of the picture, does.
fn limit_brightest(raw: &LightSums, wide: &LightSums, sums: &Sums, mean: f32) -> LightSums {
    let bright = sums.brightest();
    let others = (wide.count - 1.0).max(0.0) + MEAN_AROUND;
    let light = (luminance(wide.light.to_array()) - bright).max(0.0) + MEAN_AROUND * mean;
    let around = light / others;
    let most = around * (MOST_SHARE * others).max(2.0);
    if sums.count == 0 || bright <= most {
        return *raw;
    }
    let share = (bright - most) / luminance(raw.light.to_array()).max(1e-9);
    LightSums {
        light: raw.light * (1.0 - share).max(0.0),
        square: (raw.square - (bright * bright - most * most)).max(0.0),
        ..*raw
    }
}
