//! What stands between the eye and a section that it looks into from outside.
//!
//! Rays of a section begin on its wall. One that passes near the eye sees what the eye sees only from there on: of a door frame before
//! the wall it knows nothing, and shows what is behind it. Samples of other sections may have seen the frame.
//!
//! Invariant: nothing changes for an eye in a section, nor for what lies beyond the wall.

use super::Quadtree;
use super::bins::{FAR, depth_bin};
use super::leaf::{beside, neighbours};
use super::paint::{CLEARLY_IN_FRONT, Painter};
use super::surface::{Bins, Surface, gap_allowed};
use holo_section::LineHit;

/// Level of the largest leaves around a pixel in which something that stands there is looked for.
const LARGEST: usize = 4;
/// Samples of a surface in a leaf from which on smaller leaves tell where it ends: a quarter of the leaf has four on average, and none
/// in one of fifty.
const MANY: u32 = 16;
/// Of the four leaves that a pixel lies between, how many have to have a surface that goes on between them.
const LEAVES_AROUND: usize = 3;

impl Quadtree {
    /// Whether rays of some pixels may begin ahead of the eye.
    pub(super) fn looks_from_outside(&self) -> bool {
        let (eye, along) = self.middle(self.size.0 / 2, self.size.1 / 2);
        let has_one_eye = self.view.kind.has_eye() && self.view.vo == 0.0;
        let is_around = |hit: LineHit| hit.entry_t <= 0.0 && hit.exit_t > 0.0;
        !(has_one_eye
            && self.sections.iter().any(|section| section.line(eye, along).is_some_and(is_around)))
    }

    /// Depth bin of the first wall that a pixel's ray meets ahead of the eye; that of no distance in a section.
    fn wall(&self, column: usize, row: usize) -> u16 {
        let (eye, along) = self.middle(column as u32, row as u32);
        let ahead = self
            .sections
            .iter()
            .filter_map(|section| section.line(eye, along))
            .filter(|hit| hit.exit_t > 0.0);
        let first = ahead.map(|hit| hit.entry_t.max(0.0)).fold(f64::INFINITY, f64::min);
        if !(first > 0.0 && first.is_finite()) {
            return 0;
        }
        let point = self.camera.to_camera(eye + along * first - self.camera.eye);
        depth_bin((point - self.camera.eye_of(point)).length_squared())
    }

    /// Level and bins of a surface that stands before the wall at a pixel, by the samples of its own and around it.
    pub(super) fn standing(
        &self,
        painter: &Painter,
        column: usize,
        row: usize,
        own: &[Surface],
    ) -> Option<(usize, Bins)> {
        let front = own.first().map_or(Bins::of(FAR), |front| front.bins);
        if !(self.is_outside && (own.len() > 1 || may_stand(painter, column, row, front))) {
            return None;
        }
        let wall = self.wall(column, row);
        if front.last < wall {
            return (own.len() > 1).then_some((0, front));
        }
        (1..=LARGEST).find_map(|level| {
            let leaves = painter.all.levels.get(level)?;
            let nearest = leaves.leaf(column >> level, row >> level).first()?;
            if nearest.count > MANY
                || nearest.bins.last >= wall
                || !is_clearly_behind(front, nearest)
            {
                return None;
            }
            // In the own leaf alone it may end before the pixel.
            let (columns, _) = neighbours(column, level, leaves.width);
            let (rows, _) = neighbours(row, level, leaves.height);
            let goes_on = |column, row| {
                beside(leaves.leaf(column, row), nearest.bins, gap_allowed(level)).is_some()
            };
            let around = rows.iter().flat_map(|&row| columns.map(|column| goes_on(column, row)));
            (around.filter(|&goes_on| goes_on).count() >= LEAVES_AROUND)
                .then_some((level, nearest.bins))
        })
    }
}

/// Whether anything around a pixel lies so far in front of its front surface that it may be found standing before it.
#[inline(always)]
pub(super) fn may_stand(painter: &Painter, column: usize, row: usize, front: Bins) -> bool {
    let level = LARGEST.min(painter.all.levels.len() - 1);
    // Its surfaces hold those of all smaller leaves.
    let nearest = painter.all.levels[level].leaf(column >> level, row >> level).first();
    nearest.is_some_and(|nearest| nearest.bins.first.saturating_add(CLEARLY_IN_FRONT) < front.first)
}

fn is_clearly_behind(front: Bins, nearest: &Surface) -> bool {
    nearest.bins.last.saturating_add(CLEARLY_IN_FRONT) < front.first
}
