//! Determines which surface a pixel shows, or which mixture, from its own samples and those around
//! it.

use crate::bins::BINS_PER_OCTAVE;
use crate::paint::{BandPainter, PixelContent};
use crate::sums::NEAR_CLASSES;
use crate::surface::{Bins, LeafSurface};

/// Least share of a leaf's samples that a surface needs for the leaf's empty pixels to show it.
const SEEN_SHARE: f32 = 0.25;
/// Least number of depth bins between a surface and one that hides it: a fifth of the distance.
pub(crate) const CLEARLY_IN_FRONT: u16 = 8;
/// Largest mean number of samples of a surface per pixel of a leaf for which a pixel without such
/// samples may still have the surface. With a mean of two, one pixel in seven has none.
const MANY_PER_PIXEL: u32 = 2;

impl BandPainter<'_> {
    /// Returns what a covered pixel shows, given its own surfaces.
    #[inline(always)]
    pub fn shown(&mut self, column: usize, row: usize, own: &[LeafSurface]) -> PixelContent {
        if let Some((level, bins)) = self.standing(column, row, own) {
            return self.surface(column, row, level, bins);
        }
        match own {
            [] => self.filled(column, row),
            [only] if !self.may_be_covered(column, row, only.bins) => {
                self.surface(column, row, 0, only.bins)
            }
            [front, ..] => self.mixed(column, row, front.bins, own),
        }
    }

    /// Returns what a pixel without samples shows: a surface of the smallest leaf around it that
    /// has samples.
    fn filled(&mut self, column: usize, row: usize) -> PixelContent {
        let found = (1..self.all.levels.len())
            .find_map(|level| Some((level, seen_surface(self.all.leaf(level, column, row))?.bins)));
        let Some((level, bins)) = found else { return PixelContent::NOTHING };
        let (level, bins) = self.covering(column, row, bins).unwrap_or((level, bins));
        self.surface(column, row, level, bins)
    }

    /// Returns what a pixel with samples shows.
    ///
    /// Samples that pass near the eye see exactly this pixel. Each surface covers the pixel by its
    /// share of them, which makes silhouettes smooth. Without such samples, the pixel shows its
    /// nearest surface, because samples of farther ones have looked past that surface's edge.
    fn mixed(
        &mut self,
        column: usize,
        row: usize,
        front: Bins,
        own: &[LeafSurface],
    ) -> PixelContent {
        let near = |surface: &LeafSurface| self.near_count(column, row, surface.bins, front);
        let near: Vec<f32> = own.iter().map(near).collect();
        let all: f32 = near.iter().sum();
        if all == 0.0 {
            let (level, bins) = self.covering(column, row, front).unwrap_or((0, front));
            return self.surface(column, row, level, bins);
        }
        let mut shown = PixelContent::NOTHING;
        for (surface, near) in own.iter().zip(near) {
            let coverage = near / all;
            if coverage > 0.0 {
                let part = self.surface(column, row, 0, surface.bins);
                for (sum, part) in shown.colour.iter_mut().zip(part.colour) {
                    *sum += coverage * part;
                }
                shown.depth = if shown.depth == 0.0 { part.depth } else { shown.depth };
            }
        }
        shown
    }

    /// Returns how many samples of a pixel's surface see past the front surface as the eye does.
    /// These are samples whose rays pass very near to the eye.
    ///
    /// The radius is a pixel's footprint at the samples' own distance, halved for each whole
    /// doubling of distance from the front surface. Without the halving, samples at eight times the
    /// front's distance would look behind its edge by seven pixels. Pictures of batch samples then
    /// became worse with more samples. With it, they look behind by less than a pixel and a half.
    fn near_count(&self, column: usize, row: usize, bins: Bins, front: Bins) -> f32 {
        let halvings = usize::from(bins.first.saturating_sub(front.first) / BINS_PER_OCTAVE);
        let halvings = halvings.min(NEAR_CLASSES - 1);
        // All samples near the eye are aligned.
        let of_pixel = self.tree.aligned.of(row * self.tree.size.0 as usize + column);
        let own = of_pixel.filter(|(bin, _)| bins.first <= *bin && *bin <= bins.last);
        own.flat_map(|(_, sums)| &sums.near[halvings..]).map(|&count| count as f32).sum()
    }

    /// Returns whether the leaves around a pixel have a surface that may hide the pixel's own,
    /// because it lies clearly in front.
    #[inline(always)]
    fn may_be_covered(&self, column: usize, row: usize, front: Bins) -> bool {
        [2, 1].into_iter().filter(|&level| level < self.all.levels.len()).any(|level| {
            let nearest = self.all.leaf(level, column, row).first();
            nearest.is_some_and(|nearest| hides(nearest, front))
        })
    }

    /// Returns level and bins of a surface that hides a pixel's front surface, although the pixel
    /// has no sample of it.
    ///
    /// If samples are few, a far surface shows through between the samples of a near one. The
    /// reason is that some rays looked past the near surface's edge (the paper's Figure 6). A
    /// nearer surface hides the pixel if it has most samples of the 4 × 4 or 2 × 2 pixels around.
    /// It does not if it has so many samples that one would lie in this pixel. If a leaf has
    /// aligned samples, only these count: oblique ones may look from behind the surface, as from
    /// the next room. Pixels with samples near the eye do not need this test. Gains and costs are
    /// in docs/notes/quadtree.md.
    fn covering(&self, column: usize, row: usize, front: Bins) -> Option<(usize, Bins)> {
        if !self.may_be_covered(column, row, front) {
            return None;
        }
        [2, 1].into_iter().filter(|&level| level < self.all.levels.len()).find_map(|level| {
            let leaf = self.all.leaf(level, column, row);
            let seen = self.leaf_seen(level, column, row);
            let all: f32 = seen.iter().map(|surface| surface.count as f32).sum();
            let is_most = |surface: &LeafSurface| {
                let bins = surface.bins;
                let parts = seen
                    .iter()
                    .filter(|part| bins.first <= part.bins.first && part.bins.last <= bins.last);
                parts.map(|part| part.count as f32).sum::<f32>() >= 0.5 * all
            };
            let hiding = leaf.iter().find(|surface| {
                hides(surface, front)
                    && is_most(surface)
                    && surface.count <= MANY_PER_PIXEL << (2 * level)
            })?;
            Some((level, hiding.bins))
        })
    }
}

/// Returns whether a surface lies clearly in front of another one's bins.
#[inline(always)]
fn hides(nearer: &LeafSurface, front: Bins) -> bool {
    nearer.bins.last.saturating_add(CLEARLY_IN_FRONT) < front.first
}

/// Returns the nearest surface of a leaf that has at least [`SEEN_SHARE`] of the leaf's samples.
pub(crate) fn seen_surface(leaf: &[LeafSurface]) -> Option<&LeafSurface> {
    let all: f32 = leaf.iter().map(|surface| surface.count as f32).sum();
    leaf.iter().find(|surface| surface.count as f32 >= SEEN_SHARE * all)
}
