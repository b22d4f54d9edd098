//! Determines whether oblique samples show the same light as aligned ones.
//!
//! They do on diffuse surfaces, and there are many more of them. A glossy surface or a mirror looks
//! different from elsewhere. So the aligned samples are compared with all samples, over leaves of
//! growing size. This is Lepski's rule again, with the angle in place of the size. A difference
//! that the comparison misses is smaller than the noise of the samples.
//!
//! Invariant: as the number of aligned samples grows, every difference is found. The picture then
//! uses the aligned samples alone.

use crate::blend::own_surface;
use crate::leaf::{KAPPA, KAPPA_LINEAR, LeafReader};
use crate::surface::Bins;
use glam::Vec4;
use std::ops::Range;

/// Least number of effective samples for a comparison.
const FEWEST: f32 = 8.0;
/// Number of effective samples above which no larger leaf is compared, because it would add nothing
/// about this place.
const PLENTY: f32 = 256.0;
/// Differences in half-widths of the interval. Below `SAME` all samples are used, above `DIFFERENT`
/// only the aligned ones, and between them a mixture.
const SAME: f32 = 1.2;
const DIFFERENT: f32 = 1.8;
/// Level of the smallest leaves that are compared. All pixels of such a leaf have the same answer.
const SMALLEST: usize = 2;

/// Answers so far for one band of rows. For each smallest leaf: the first bin of the last surface,
/// and its share.
pub(crate) struct Agreement {
    across: usize,
    /// The first row of smallest leaves.
    first: usize,
    known: Vec<Option<(u16, f32)>>,
}

impl Agreement {
    /// Returns an agreement without answers, for these rows of a picture of `width` columns.
    pub fn new(width: usize, rows: Range<usize>) -> Self {
        let across = width.div_ceil(1 << SMALLEST);
        let first = rows.start >> SMALLEST;
        let down = rows.end.div_ceil(1 << SMALLEST) - first;
        Self { across, first, known: vec![None; across * down] }
    }

    /// Returns the share, 0 to 1, of the mean over all samples of a surface in its colour at a
    /// pixel. The mean over aligned samples has the rest.
    pub fn of(
        &mut self,
        all: &mut LeafReader,
        aligned: &mut LeafReader,
        (column, row): (usize, usize),
        bins: Bins,
    ) -> f32 {
        let place = ((row >> SMALLEST) - self.first) * self.across + (column >> SMALLEST);
        if let Some((bin, share)) = self.known[place]
            && bin.abs_diff(bins.first) <= 1
        {
            return share;
        }
        // The comparison is made at the leaf's middle, or at the picture's edge if that is nearer.
        // So it does not depend on the pixel.
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
    all: &mut LeafReader,
    aligned: &mut LeafReader,
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
        // The picture's own variation counts too, because samples at other places in the leaf
        // differ by it.
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
