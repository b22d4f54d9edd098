//! Whether samples that look from elsewhere may stand for what the eye sees.
//!
//! They may on diffuse surfaces, and there are many more of them. A gloss or a mirror looks different
//! from elsewhere. The samples themselves tell: the aligned ones are compared with all, over leaves
//! of growing size (Lepski's rule again, the angle in place of the size). A difference that the
//! comparison cannot find is below the noise of the samples that it concerns.
//!
//! Invariant: as aligned samples grow, every difference is found, and the picture is made of them
//! alone.

use crate::blend::own_surface;
use crate::leaf::{KAPPA, KAPPA_LINEAR, Reader};
use crate::paint::BAND;
use crate::surface::Bins;
use glam::Vec4;

/// Effective samples that a comparison needs.
const FEWEST: f32 = 8.0;
/// Effective samples from which on larger leaves tell nothing more of this place.
const PLENTY: f32 = 256.0;
/// Differences, in half-widths of the interval, up to which all samples are taken, and from which on
/// only the aligned ones are.
const SAME: f32 = 1.2;
const DIFFERENT: f32 = 1.8;
/// Level of the smallest leaves that are compared. All pixels of one have the same answer.
const SMALLEST: usize = 2;

/// Answers for one band of rows, by smallest leaf: the nearest bin of the surface asked for, and the
/// share.
pub(crate) struct Agreement {
    across: usize,
    known: Vec<Option<(u16, f32)>>,
}

impl Agreement {
    /// Returns an agreement that knows nothing, for a picture of so many columns.
    pub fn new(width: usize) -> Self {
        let across = width.div_ceil(1 << SMALLEST);
        Self { across, known: vec![None; across * (BAND >> SMALLEST)] }
    }

    /// Returns how far all samples of a surface may be used at a pixel: 1 wholly, 0 not at all.
    pub fn of(
        &mut self,
        all: &mut Reader,
        aligned: &mut Reader,
        (column, row): (usize, usize),
        bins: Bins,
    ) -> f32 {
        let place = ((row % BAND) >> SMALLEST) * self.across + (column >> SMALLEST);
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
