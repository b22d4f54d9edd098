//! Whether samples that look from elsewhere may stand for what the eye sees.
//!
//! They may on diffuse surfaces, and are many more. A gloss or a mirror looks different from there. The samples themselves
//! tell: those that look as the eye does are compared with all, over leaves of growing size (Lepski's rule again, the angle in
//! place of the size). What the comparison cannot tell apart is below the noise of the samples that it would be replaced by.
//!
//! Invariant: as samples that look as the eye does grow, every difference is found, and the picture is made of them alone.

use crate::leaf::{KAPPA, KAPPA_LINEAR, Reader, own_surface};
use crate::surface::Bins;
use glam::Vec4;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Samples whose ray passes the eye at less than this part of their distance from it look as the eye does: 5.7 degrees.
pub(crate) const NARROW: f64 = 0.1;

/// Effective samples that a comparison needs.
const FEWEST: f32 = 8.0;
/// Effective samples from which larger leaves tell nothing more of this place.
const PLENTY: f32 = 256.0;
/// Differences, in half-widths of the interval, up to which all samples are taken, and from which only narrow ones are.
const SAME: f32 = 1.2;
const DIFFERENT: f32 = 1.8;

/// Level of the smallest leaves that are compared; all pixels of one have the same answer.
pub(crate) const SMALLEST: usize = 2;

/// What is known of a leaf of which nothing is; else the nearest bin of the surface that was asked for last, above 32 bits of the answer.
const NOTHING: u64 = u64::MAX;

/// Compares all samples with the narrow ones, remembering what it found in each leaf.
pub(crate) struct Agreement {
    width: usize,
    /// Of each smallest leaf: see [`NOTHING`]. Atomic only so that a picture can be looked at by several threads.
    known: Vec<AtomicU64>,
}

impl Agreement {
    /// For a picture of `width` × `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let (width, height) = (width.div_ceil(1 << SMALLEST), height.div_ceil(1 << SMALLEST));
        Self { width, known: (0..width * height).map(|_| AtomicU64::new(NOTHING)).collect() }
    }

    /// Forgets what was found in a smallest leaf.
    pub fn forget(&self, column: usize, row: usize) {
        self.known
            .get(row * self.width + column)
            .into_iter()
            .for_each(|known| known.store(NOTHING, Relaxed));
    }

    /// How far all samples of a surface may be used at a pixel: 1 wholly, 0 not at all.
    pub fn of(&self, all: &Reader, narrow: &Reader, column: usize, row: usize, bins: Bins) -> f32 {
        let Some(known) = self.known.get((row >> SMALLEST) * self.width + (column >> SMALLEST))
        else {
            return 1.0;
        };
        let last = known.load(Relaxed);
        if last != NOTHING && ((last >> 32) as u16).abs_diff(bins.first) <= 1 {
            return f32::from_bits(last as u32);
        }
        // From the leaf's middle, whichever of its pixels asks, as far as the picture goes.
        let middle = |pixel: usize, size: usize| {
            ((pixel >> SMALLEST << SMALLEST) + (1 << SMALLEST) / 2).min(size - 1)
        };
        let (column, row) =
            (middle(column, all.levels[0].width), middle(row, all.levels[0].height));
        let share = agreement(all, narrow, column, row, bins);
        known.store(u64::from(bins.first) << 32 | u64::from(share.to_bits()), Relaxed);
        share
    }
}

/// The comparison around one pixel.
fn agreement(all: &Reader, narrow: &Reader, column: usize, row: usize, bins: Bins) -> f32 {
    let mut share = 1.0_f32;
    for level in SMALLEST..all.levels.len().min(narrow.levels.len()) {
        let Some(own) = narrow.blend(column, row, level, bins) else { continue };
        let own_error = own.error;
        let effective = own_error.powi(-2);
        if effective < FEWEST {
            continue;
        }
        let Some(whole) = all.blend(column, row, level, bins) else { break };
        let Some(leaf) =
            own_surface(narrow.levels[level].leaf(column >> level, row >> level), bins)
        else {
            continue;
        };
        // With the picture's own variation: where it varies, samples that fall elsewhere in the leaf differ by chance.
        let (relative, compressed) = leaf.total_deviation();
        let own_variation = Vec4::new(
            KAPPA_LINEAR * relative * own.mean.x,
            KAPPA_LINEAR * relative * own.mean.y,
            KAPPA_LINEAR * relative * own.mean.z,
            KAPPA * compressed,
        );
        let half = narrow.noise(column, row, level, bins).half_widths.max(own_variation);
        let apart =
            (own.mean - whole.mean).abs() / (half * own_error).max(Vec4::splat(f32::MIN_POSITIVE));
        let worst = apart.max_element();
        share = share.min(((DIFFERENT - worst) / (DIFFERENT - SAME)).clamp(0.0, 1.0));
        if share == 0.0 || effective > PLENTY {
            break;
        }
    }
    share
}
