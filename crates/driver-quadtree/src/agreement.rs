//! Finds out whether samples that look from elsewhere show what the eye sees.
//!
//! They do on diffuse surfaces, and there are many more of them. A gloss or a mirror looks
//! different from elsewhere. So the aligned samples are compared with all samples, over leaves of
//! growing size. This is Lepski's rule again, with the angle in place of the size. A difference
//! that the comparison misses is smaller than the noise of the samples.
//!
//! Invariant: as aligned samples grow, every difference is found, and the picture is made of them
//! alone.

use crate::blend::own_surface;
use crate::leaf::{KAPPA, KAPPA_LINEAR, Reader};
use crate::surface::Bins;
use glam::Vec4;
use std::ops::Range;

/// Effective samples that a comparison needs.
const FEWEST: f32 = 8.0;
/// Effective samples that are enough: larger leaves add nothing about this place.
const PLENTY: f32 = 256.0;
/// Differences in half-widths of the interval. Up to the first all samples are used, from the
/// second on only the aligned ones; between them, a mixture.
const SAME: f32 = 1.2;
const DIFFERENT: f32 = 1.8;
/// Level of the smallest leaves that are compared. All pixels of one have the same answer.
const SMALLEST: usize = 2;

/// Answers for one band of rows, by smallest leaf: the nearest bin of the surface asked for, and
/// the share.
pub(crate) struct Agreement {
    across: usize,
    /// The first row of smallest leaves.
    first: usize,
    known: Vec<Option<(u16, f32)>>,
}

impl Agreement {
    /// Returns an agreement that knows nothing, for these rows of a picture of `width`
    /// columns.
    pub fn new(width: usize, rows: Range<usize>) -> Self {
        let across = width.div_ceil(1 << SMALLEST);
        let first = rows.start >> SMALLEST;
        let down = rows.end.div_ceil(1 << SMALLEST) - first;
        Self { across, first, known: vec![None; across * down] }
    }

    /// Returns how far all samples of a surface may be used at a pixel: 1 wholly, 0 not at all.
    pub fn of(
        &mut self,
        all: &mut Reader,
        aligned: &mut Reader,
        (column, row): (usize, usize),
        bins: Bins,
    ) -> f32 {
        let place = ((row >> SMALLEST) - self.first) * self.across + (column >> SMALLEST);
        if let Some((bin, share)) = self.known[place]
            && bin.abs_diff(bins.first) <= 1
        {
            return share;
        }
        // From the leaf's middle, whichever of its pixels asks, as far as the picture goes.
        let middle = |pixel: usize, size: usize| {
            ((pixel >> SMALLEST << SMALLEST) + (1 << SMALLEST) / 2).min(size - 1)
        };
        let pixels = &all.levels[0];
        let at = (middle(column, pixels.width), middle(row, pixels.height));
        let share = agreement(all, aligned, at, bins);
        self.known[place] = Some((bins.first, share));
        share
    }
}

/// Compares the samples around one pixel.
fn agreement(
    all: &mut Reader,
    aligned: &mut Reader,
    (column, row): (usize, usize),
    bins: Bins,
) -> f32 {
    let mut share = 1.0_f32;
    for level in SMALLEST..all.levels.len() {
        let Some(own) = aligned.blend(column, row, level, bins) else { continue };
        let effective = own.error_squared.recip();
        if effective < FEWEST {
            continue;
        }
        let Some(whole) = all.blend(column, row, level, bins) else { break };
        let Some(leaf) = own_surface(aligned.leaf(level, column, row), bins) else { continue };
        // With the picture's own variation: where it varies, samples that fall elsewhere in the
        // leaf differ by chance.
        let (relative, root) = leaf.total_deviation();
        let variation = (KAPPA_LINEAR * relative * own.mean).with_w(KAPPA * root);
        let half = aligned.noise(column, row, level, bins).half_widths.max(variation);
        let least = Vec4::splat(f32::MIN_POSITIVE);
        let apart = (own.mean - whole.mean).abs() / (half * own.error_squared.sqrt()).max(least);
        let worst = apart.max_element();
        share = share.min(((DIFFERENT - worst) / (DIFFERENT - SAME)).clamp(0.0, 1.0));
        if share == 0.0 || effective > PLENTY {
            break;
        }
    }
    share
}
