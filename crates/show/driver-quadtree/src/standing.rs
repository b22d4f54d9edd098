//! Finds objects between the eye and a section that the eye looks into from outside.
//!
//! Rays of a section begin on its wall. So a ray that passes near the eye does not hit a door frame
//! between the eye and the wall. It shows the surface behind the frame. Samples of other sections
//! may have seen the frame.
//!
//! Invariant: nothing changes for an eye in a section, nor for surfaces beyond the wall.

use crate::Quadtree;
use crate::bins::{FAR, depth_bin};
use crate::blend::{beside, neighbours};
use crate::paint::BandPainter;
use crate::shown::CLEARLY_IN_FRONT;
use crate::surface::{Bins, LeafSurface, gap_allowed};
use holo_section::LineHit;

/// Level of the largest leaves that are searched for a standing surface.
const LARGEST: usize = 4;
/// Largest number of samples of a surface in a leaf for which the leaf is used. With more, smaller
/// leaves show where the surface ends. With 16, a quarter of the leaf has four on average, and none
/// in one case of fifty.
const MANY: u32 = 16;
/// A pixel has a surface only if at least this many of the four leaves around it have the surface.
const LEAVES_AROUND: usize = 3;

impl Quadtree {
    /// Returns whether the stored rays of some pixels may begin ahead of the eye.
    pub(crate) fn looks_from_outside(&self) -> bool {
        let (eye, along) = self.middle(self.size.0 as usize / 2, self.size.1 as usize / 2);
        let has_one_eye = self.view.kind.has_eye() && self.view.vo == 0.0;
        let is_around = |hit: LineHit| hit.entry_t <= 0.0 && hit.exit_t > 0.0;
        let is_inside = |hit: Option<LineHit>| hit.is_some_and(is_around);
        !(has_one_eye && self.sections.iter().any(|section| is_inside(section.line(eye, along))))
    }

    /// Returns the depth bin of the first wall that a pixel's ray meets ahead of the eye; 0 if the
    /// ray begins in a section.
    fn wall(&self, column: usize, row: usize) -> u16 {
        let (eye, along) = self.middle(column, row);
        let hits = self.sections.iter().filter_map(|section| section.line(eye, along));
        let ahead = hits.filter(|hit| hit.exit_t > 0.0);
        let first = ahead.map(|hit| hit.entry_t.max(0.0)).fold(f64::INFINITY, f64::min);
        if !(first > 0.0 && first.is_finite()) {
            return 0;
        }
        let point = self.camera.to_camera(eye + along * first - self.camera.eye);
        depth_bin((point - self.camera.eye_of(point)).length_squared())
    }
}

impl BandPainter<'_> {
    /// Returns level and bins of a surface that stands before the wall at a pixel, from the samples
    /// in the pixel and around it.
    #[inline(always)]
    pub fn standing(
        &self,
        column: usize,
        row: usize,
        own: &[LeafSurface],
    ) -> Option<(usize, Bins)> {
        if !self.tree.is_outside {
            return None;
        }
        let front = own.first().map_or(Bins::of(FAR), |front| front.bins);
        let is_in_front = |bin: u16| bin.saturating_add(CLEARLY_IN_FRONT) < front.first;
        // The surfaces of the largest leaf hold those of all smaller ones.
        let largest = LARGEST.min(self.all.levels.len() - 1);
        let nearest = self.all.leaf(largest, column, row).first();
        let may_stand = nearest.is_some_and(|nearest| is_in_front(nearest.bins.first));
        if !(own.len() > 1 || may_stand) {
            return None;
        }
        let wall = self.tree.wall(column, row);
        if front.last < wall {
            return (own.len() > 1).then_some((0, front));
        }
        (1..=largest).find_map(|level| {
            let nearest = self.all.leaf(level, column, row).first()?;
            let stands = nearest.count <= MANY
                && nearest.bins.last < wall
                && is_in_front(nearest.bins.last)
                && self.continues(column, row, level, nearest.bins);
            stands.then_some((level, nearest.bins))
        })
    }

    /// Returns whether a surface of a pixel's leaf continues in the leaves around the pixel. A
    /// surface in the pixel's own leaf alone may end before the pixel.
    fn continues(&self, column: usize, row: usize, level: usize, bins: Bins) -> bool {
        let leaves = &self.all.levels[level];
        let columns = neighbours(column, level, leaves.width);
        let rows = neighbours(row, level, leaves.height);
        let around = rows.iter().flat_map(|&row| columns.map(|column| leaves.leaf(column, row)));
        around.filter(|leaf| beside(leaf, bins, gap_allowed(level)).is_some()).count()
            >= LEAVES_AROUND
    }
}
