//! Means of one surface over the leaves around a pixel.
//!
//! Invariant: only samples of one surface are averaged: those in bins connected to the pixel's own.

use crate::pyramid::PyramidLevel;
use crate::surface::{Bins, LeafSurface, gap_allowed};
use glam::Vec4;

/// Weighted mean over neighbouring leaves of one level, of one surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafBlend {
    /// Mean colour and, last, mean root of luminance.
    pub mean: Vec4,
    /// Squared standard error for samples of unit deviation: Σw² / (Σw)². Infinite if few samples
    /// make the mean of one of the leaves.
    pub error_squared: f32,
    /// True if quarters of one of the leaves differ by more than noise.
    pub is_mixed: bool,
}

/// Sums over the parts of a surface in two leaves, one above the other.
#[derive(Clone, Copy)]
struct LeafPair {
    /// Weighted sums of colour and root.
    sum: Vec4,
    weight: f32,
    error_squared: f32,
    is_mixed: bool,
}

const NOTHING: LeafPair =
    LeafPair { sum: Vec4::ZERO, weight: 0.0, error_squared: 0.0, is_mixed: false };

/// Vertical sums that the pixels of one row in one leaf share.
#[derive(Clone, Copy)]
struct RowSums {
    /// Column of the leaf and row of the pixels.
    column: usize,
    row: usize,
    /// The surface's bins in the leaf.
    bins: Bins,
    /// The columns of leaves on the left, in the middle and on the right. In each, the leaf in the
    /// row and the one above or below it, whichever is nearer.
    pairs: [LeafPair; 3],
}

const NO_AROUND: RowSums = RowSums {
    column: usize::MAX,
    row: usize::MAX,
    bins: Bins { first: 1, last: 0 },
    pairs: [NOTHING; 3],
};

/// Blends leaves of a pyramid. Stores the sums that neighbouring pixels of a row share.
pub(crate) struct Blender<'a> {
    levels: &'a [PyramidLevel],
    /// The last sums of each level.
    around: Vec<RowSums>,
}

impl<'a> Blender<'a> {
    pub fn new(levels: &'a [PyramidLevel]) -> Self {
        Self { levels, around: vec![NO_AROUND; levels.len()] }
    }

    /// Returns the mean of one surface around a pixel at one level, leaves weighted bilinearly by
    /// the nearness of their middles. `None` if the pixel's leaf does not have the surface.
    ///
    /// Bilinear weights centre the mean on the pixel. So a gradient is not biased, and no blocks
    /// show.
    #[inline(always)]
    pub fn blend(
        &mut self,
        column: usize,
        row: usize,
        level: usize,
        bins: Bins,
    ) -> Option<LeafBlend> {
        if level == 0 {
            let own = own_surface(self.levels[0].leaf(column, row), bins)?;
            let error_squared = own.weight_squared / (own.weight * own.weight);
            let mean = Vec4::from_array(own.mean);
            return Some(LeafBlend { mean, error_squared, is_mixed: false });
        }
        let around = &mut self.around[level];
        let is_known = around.column == column >> level
            && around.row == row
            && around.bins.first <= bins.first
            && bins.first <= around.bins.last;
        if !is_known {
            around.find(&self.levels[level], level, (column >> level, row), bins)?;
        }
        let (x, is_right) = offset(column, level);
        let [left, own, right] = &around.pairs;
        let beside = if is_right { right } else { left };
        let y = 1.0 - x;
        let scale = (y * own.weight + x * beside.weight).recip();
        let error_squared = y * y * own.error_squared + x * x * beside.error_squared;
        Some(LeafBlend {
            mean: (y * own.sum + x * beside.sum) * scale,
            error_squared: error_squared * scale * scale,
            is_mixed: own.is_mixed | beside.is_mixed,
        })
    }
}

impl RowSums {
    /// Computes the sums for the pixels of a row in the leaf of a column. `None` if the leaf does
    /// not have the surface.
    #[inline(never)]
    fn find(
        &mut self,
        leaves: &PyramidLevel,
        level: usize,
        (column, row): (usize, usize),
        bins: Bins,
    ) -> Option<()> {
        let own = own_surface(leaves.leaf(column, row >> level), bins)?.bins;
        (self.column, self.row, self.bins) = (column, row, own);
        let gap = gap_allowed(level);
        let (near, far) = (own.first.saturating_sub(gap), own.last.saturating_add(gap));
        let (y, _) = offset(row, level);
        let columns = [column.saturating_sub(1), column, (column + 1).min(leaves.width - 1)];
        let [row, beside] = neighbours(row, level, leaves.height);
        for (pair, column) in self.pairs.iter_mut().zip(&columns) {
            *pair = NOTHING;
            for &(row, share) in &[(row, 1.0 - y), (beside, y)] {
                for surface in leaves.leaf(*column, row) {
                    if surface.bins.last < near || surface.bins.first > far {
                        continue;
                    }
                    let weight = share * surface.weight;
                    pair.weight += weight;
                    pair.sum += weight * Vec4::from_array(surface.mean);
                    pair.error_squared += share * share * surface.error_squared();
                    pair.is_mixed |= surface.is_mixed;
                }
            }
        }
        Some(())
    }
}

/// Returns the distance of a pixel's middle from its leaf's middle along one direction, in leaves.
/// Also returns whether the pixel lies on the right of the leaf's middle, or below it.
#[inline(always)]
fn offset(pixel: usize, level: usize) -> (f32, bool) {
    let size = 1_usize << level;
    let twice = 2 * (pixel & (size - 1)) + 1;
    ((twice as f32 / (2 * size) as f32 - 0.5).abs(), twice > size)
}

/// Returns the two leaves along one direction whose middles are on either side of a pixel's middle:
/// the pixel's own first, then its neighbour. At the edge of the picture, both are the pixel's own.
pub(crate) fn neighbours(pixel: usize, level: usize, leaves: usize) -> [usize; 2] {
    let own = pixel >> level;
    let (_, is_after) = offset(pixel, level);
    [own, if is_after { (own + 1).min(leaves - 1) } else { own.saturating_sub(1) }]
}

/// Returns the surface of a leaf that contains the surface `bins` of a smaller leaf in it.
#[inline(always)]
pub(crate) fn own_surface(leaf: &[LeafSurface], bins: Bins) -> Option<&LeafSurface> {
    leaf.iter().find(|surface| surface.bins.first <= bins.first && bins.first <= surface.bins.last)
}

/// Returns the nearest surface of a leaf that lies at most `gap` bins beside `bins`.
pub(crate) fn beside(leaf: &[LeafSurface], bins: Bins, gap: u16) -> Option<&LeafSurface> {
    leaf.iter().find(|surface| {
        surface.bins.first <= bins.last.saturating_add(gap)
            && bins.first <= surface.bins.last.saturating_add(gap)
    })
}
