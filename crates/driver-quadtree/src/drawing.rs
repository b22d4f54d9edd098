//! Pictures in a burst of samples: only what has changed enough is drawn again.
//!
//! The pyramid of leaves stays from picture to picture. A leaf is worked out again, in place, and the pixels that were averaged
//! over it are drawn again, once its samples have grown by a quarter: a mean of n samples that goes without n/4 more is off by
//! less than half of its standard error. While bursts follow each other faster than pictures are wanted, each draws some
//! thousand pixels only, going on where the last one ended. Once no more samples come, everything is drawn as
//! [`Quadtree::draw`] does.
//!
//! A whole picture of one to sixteen samples a pixel takes 60 to 65 ns a pixel of one core where samples are clean and 83 to 88 where
//! they are of one path each: what is more goes to colours averaged over more levels. The first, whose memory is new, takes up to a
//! quarter more; one after few samples a tenth to a fifth less, since leaves to which none came are kept. A third of it is the
//! pyramid's, most of that for the sums of pixels. All cores share it. In a burst a leaf takes about 200, a pixel 250, so where nearly all
//! pixels have grown everything is drawn.
//! Tried: pixels of the pyramid eight side by side, for the sake of their divisions, took 15 % longer, and sixteen, their sums turned into rows
//! of numbers, half as long again: collecting those of one bin takes more than is won; the noise of four pixels side by side, as long; sums of
//! 64 bytes in place of 128, with what they carry elsewhere, 5 to 10 % longer, as did insertions; all leaves kept in rows of numbers, one for each
//! thing that is known of them, 5 to 15 % less at one sample a pixel and up to a fifth more at sixteen, since every pixel is scattered over ten
//! rows; what pixels show told for a whole tile side by side, 5 % less at one sample a pixel and up to 6 % more at sixteen; leaves of a tile turned
//! into rows where colours are found, with fewer divisions, 5 % less with one path and up to 8 % more with clean samples.
//!
//! What always holds:
//! - Each surface of a leaf lies within one of its parent, as in a pyramid that was made at once.
//! - A picture drawn while samples come is one of samples that came, if 33 ms were over at least four fifths of those of every
//!   leaf.
//! - While nothing changes, nothing is done.

use super::bins::merged;
use super::leaf::own_surface;
use super::paint::{Counts, TILE, TilePainter, UnseenPixels, tile_count, tile_pixels, tile_rows};
use super::pyramid::Level;
use super::surface::{Surface, of_pixel};
use super::tile::TileColours;
use super::wide::{Agreement, SMALLEST};
use super::{Frame, Pyramids, Quadtree};
use holo_cpu::zeroed;
use std::ops::Range;
use std::time::Duration;

/// New samples after which a picture is drawn (Larson & Simmons 1999, appendix B).
const BURST_SAMPLES: u64 = 50_000;
/// Time after which it is drawn with fewer: two frames of a screen.
const BURST_TIME: Duration = Duration::from_millis(33);
/// Leaves worked out, and pixels drawn, in one picture of a burst: some milliseconds.
const BURST_WORK: usize = 8192;
/// A leaf is worked out again when one in so many of its samples is new.
const GROWTH: u32 = 4;
/// Pixels for each new sample from which on samples are counted one by one.
const FEW: usize = 64;
/// One pixel in so many is due when everything is drawn: neighbours of all have grown, then. Where one in six was, and leaves in place of
/// all others, 512×512 pixels took 24 ms of one core, and all of them 10 of two.
const MANY: usize = 16;
/// Levels whose leaves lie within a tile.
const TILE_LEVELS: usize = TILE.ilog2() as usize + 1;
/// Stands for a reach in pixels that are to be drawn again.
const AGAIN: u8 = u8::MAX;

/// New samples that a leaf of so many is due with.
fn enough(known: u32) -> u32 {
    (known / GROWTH).max(1)
}

/// A picture, what it was drawn from, and what has changed since.
pub(super) struct Drawing {
    frame: Frame,
    pyramids: Pyramids,
    agreement: Option<Agreement>,
    /// Samples that came to each leaf since it was worked out, level by level; of no leaf before samples come.
    growth: Vec<Vec<u32>>,
    /// Of each pixel: what it is counted as, and the highest level that it was averaged over.
    counts: Vec<Counts>,
    reach: Vec<u8>,
    /// Pixels of samples that came since.
    landed: Vec<u32>,
    /// Of them, by leaf of one level after the other; scratch.
    fresh: Vec<u32>,
    /// The tile with which drawing goes on.
    next_tile: usize,
    unseen_known: usize,
    /// Whether all samples are in the picture.
    is_whole: bool,
    parts: Vec<Surface>,
    surfaces: Vec<Surface>,
}

impl Drawing {
    /// Takes in which pixels samples came to; false if they have become so many that to draw everything is less work.
    pub fn has_landed(&mut self, pixels: impl Iterator<Item = usize>) -> bool {
        self.landed.extend(pixels.map(|pixel| pixel as u32));
        self.landed.len() <= self.reach.len()
    }

    /// Draws everything. The memory of another drawing is used again.
    fn new(tree: &Quadtree, old: Option<Box<Self>>) -> Box<Self> {
        let mut drawing = match old {
            Some(mut old) => {
                old.pyramids = Pyramids::new(tree, Some(std::mem::take(&mut old.pyramids)));
                old.frame.start(tree);
                old
            }
            None => {
                let (frame, pyramids) = (tree.empty_frame(), Pyramids::new(tree, None));
                let pixels = frame.depth.len();
                Box::new(Self {
                    frame,
                    pyramids,
                    agreement: None,
                    growth: Vec::new(),
                    counts: zeroed(pixels),
                    reach: zeroed(pixels),
                    landed: Vec::new(),
                    fresh: Vec::new(),
                    next_tile: 0,
                    unseen_known: 0,
                    is_whole: true,
                    parts: Vec::new(),
                    surfaces: Vec::new(),
                })
            }
        };
        drawing.growth.clear();
        drawing.landed.clear();
        drawing.paint_all(tree);
        drawing
    }

    /// Draws everything, given that all samples that came since are counted: leaves to which none came are what they were.
    fn complete(&mut self, tree: &Quadtree) {
        let growth = &self.growth;
        let is_stale = |number: usize, index: usize| {
            let level: &[u32] = growth.get(number).map_or(&[], Vec::as_slice);
            level.get(index).is_some_and(|&new| new > 0)
        };
        self.pyramids.renew(tree, &is_stale);
        self.growth.iter_mut().for_each(|growth| growth.fill(0));
        self.frame.start(tree);
        self.paint_all(tree);
    }

    /// Paints every pixel.
    fn paint_all(&mut self, tree: &Quadtree) {
        let Self { frame, pyramids, agreement, counts, reach, .. } = self;
        *agreement = tree.agreement(pyramids);
        tree.paint_all(pyramids, agreement.as_ref(), frame, counts, reach);
        self.next_tile = 0;
        self.unseen_known = tree.unseen.len();
        self.is_whole = true;
    }

    /// Counts the samples that have landed. Whether so many pixels have grown by them that to draw everything is less work than to
    /// find out what need not be drawn.
    fn take_in(&mut self, width: u32) -> bool {
        if self.growth.is_empty() {
            self.growth =
                self.pyramids.all().iter().map(|level| zeroed(level.samples.len())).collect();
        }
        self.grow(width);
        let pixels = self.growth.iter().zip(self.pyramids.all()).take(1);
        let due = pixels
            .flat_map(|(growth, level)| growth.iter().zip(&level.samples))
            .filter(|&(&new, &known)| new >= enough(known));
        due.count() * MANY > self.reach.len()
    }

    fn is_due(&self, number: usize, index: usize) -> bool {
        self.growth[number][index] >= enough(self.pyramids.all()[number].samples[index])
    }

    /// Draws again what has changed: tile by tile until there have been about `most` leaves and pixels.
    fn update(&mut self, tree: &Quadtree, most: usize) {
        self.is_whole = false;
        if self.unseen_known != tree.unseen.len() {
            self.unseen_known = tree.unseen.len();
            let mut unseen = UnseenPixels::default();
            for (pixel, (reach, counts)) in self.reach.iter_mut().zip(&self.counts).enumerate() {
                if counts.is_unseen() != unseen.has(tree, pixel) {
                    *reach = AGAIN;
                }
            }
        }
        let tiles = tile_count(tree.size);
        let (first, mut count, mut work) = (self.next_tile, 0, 0);
        while count < tiles && work < most {
            work += self.work_out_tile(tree, (first + count) % tiles);
            count += 1;
        }
        for number in TILE_LEVELS..self.growth.len() {
            for index in 0..self.growth[number].len() {
                if self.is_due(number, index) {
                    self.work_out(tree, number, index);
                }
            }
        }
        self.next_tile = (first + count) % tiles;
        self.paint(tree, (0..count).map(|number| (first + number) % tiles));
    }

    /// Works out what is due of the leaves within a tile; how many these are, and pixels to be drawn.
    fn work_out_tile(&mut self, tree: &Quadtree, tile: usize) -> usize {
        let across = (tree.size.0 as usize).div_ceil(TILE);
        let (tile_column, tile_row) = (tile % across, tile / across);
        let mut work = 0;
        for number in 0..TILE_LEVELS.min(self.growth.len()) {
            let Level { width, height, .. } = self.pyramids.all()[number];
            let side = TILE >> number;
            let columns = tile_column * side..((tile_column + 1) * side).min(width);
            for row in tile_row * side..((tile_row + 1) * side).min(height) {
                let leaves = row * width + columns.start..row * width + columns.end;
                if number == 0 {
                    leaves
                        .clone()
                        .filter(|&pixel| self.is_due(0, pixel))
                        .for_each(|pixel| tree.prefetch(pixel));
                }
                for index in leaves {
                    if self.is_due(number, index) {
                        self.work_out(tree, number, index);
                        work += 1;
                    }
                }
            }
        }
        let again = |pixels: Range<usize>| {
            self.reach[pixels].iter().filter(|&&reach| reach == AGAIN).count()
        };
        work + tile_rows(tree.size, tile).map(again).sum::<usize>()
    }

    /// Counts the samples that have landed, leaf by leaf.
    fn grow(&mut self, width: u32) {
        let levels = self.pyramids.all();
        if self.landed.len() * FEW < self.reach.len() {
            for &pixel in &self.landed {
                let (column, row) = ((pixel % width) as usize, (pixel / width) as usize);
                for (number, (level, growth)) in levels.iter().zip(&mut self.growth).enumerate() {
                    let new = &mut growth[(row >> number) * level.width + (column >> number)];
                    *new = new.saturating_add(1);
                }
            }
        } else {
            // Leaf by leaf in order takes a quarter of the time of sample by sample.
            self.fresh.clear();
            self.fresh.resize(self.reach.len(), 0);
            self.landed.iter().for_each(|&pixel| self.fresh[pixel as usize] += 1);
            for (number, (level, growth)) in levels.iter().zip(&mut self.growth).enumerate() {
                if number > 0 {
                    halve(&mut self.fresh, levels[number - 1].width, level.width);
                }
                growth
                    .iter_mut()
                    .zip(&self.fresh)
                    .for_each(|(growth, &fresh)| *growth = growth.saturating_add(fresh));
            }
        }
        self.landed.clear();
    }

    /// Works a leaf out from its children, which are as they are to be, and has the pixels drawn that were averaged over it.
    fn work_out(&mut self, tree: &Quadtree, number: usize, index: usize) {
        let width = self.pyramids.all()[number].width;
        let (column, row) = (index % width, index / width);
        let mut is_new = false;
        let Self { pyramids, parts, surfaces, .. } = self;
        let mut put = |levels: &mut [Level], of_pixel: &dyn Fn(&mut Vec<Surface>)| {
            surfaces.clear();
            let (below, rest) = levels.split_at_mut(number);
            match below.last() {
                Some(below) => below.of_children(number, column, row, parts, surfaces),
                None => of_pixel(surfaces),
            }
            let [level, above @ ..] = rest else { return };
            level.put(column, row, surfaces);
            is_new |= above.first().is_some_and(|above| {
                let above = above.leaf(column / 2, row / 2);
                surfaces.iter().any(|surface| {
                    own_surface(above, surface.bins)
                        .is_none_or(|own| surface.bins.last > own.bins.last)
                })
            });
        };
        put(&mut pyramids.narrow, &|surfaces| of_pixel(tree.narrow.of(index), surfaces));
        if let Some(all) = &mut pyramids.all {
            put(all, &|surfaces| of_pixel(merged(&tree.narrow, &tree.wide, index), surfaces));
        }
        if is_new && let Some(level) = self.pyramids.all().get(number + 1) {
            let parent = (row / 2) * level.width + column / 2;
            let new = &mut self.growth[number + 1][parent];
            *new = enough(level.samples[parent]).max(*new);
        }
        if number == SMALLEST
            && let Some(agreement) = &self.agreement
        {
            agreement.forget(column, row);
        }
        self.growth[number][index] = self.kept_back(number, column, row);
        self.mark(number, column, row);
    }

    /// New samples that the children of a leaf that has been worked out keep back from it.
    fn kept_back(&self, number: usize, column: usize, row: usize) -> u32 {
        let Some(below) = number.checked_sub(1) else { return 0 };
        let (growth, level) = (&self.growth[below], &self.pyramids.all()[below]);
        let rows = 2 * row..(2 * row + 2).min(level.height);
        let columns = 2 * column..(2 * column + 2).min(level.width);
        let new = rows
            .flat_map(|row| columns.clone().map(move |column| growth[row * level.width + column]));
        new.fold(0, u32::saturating_add)
    }

    /// Has the pixels of a leaf drawn again that were averaged over leaves of its level.
    fn mark(&mut self, number: usize, column: usize, row: usize) {
        let (width, height) =
            (self.frame.picture.width as usize, self.frame.picture.height as usize);
        let columns = column << number..((column + 1) << number).min(width);
        for row in row << number..((row + 1) << number).min(height) {
            for reach in &mut self.reach[row * width..][columns.clone()] {
                *reach = if usize::from(*reach) >= number { AGAIN } else { *reach };
            }
        }
    }

    /// Draws the pixels of some tiles that are to be drawn again.
    fn paint(&mut self, tree: &Quadtree, tiles: impl Iterator<Item = usize>) {
        let Self { frame, pyramids, agreement, counts, reach, .. } = self;
        let mut painter = TilePainter::new(tree, pyramids, agreement.as_ref());
        for tile in tiles {
            // Most tiles have none: asked row by row, they take no time.
            if !tile_rows(tree.size, tile).any(|pixels| reach[pixels].contains(&AGAIN)) {
                continue;
            }
            painter.paint(tile, |pixel| reach[pixel] == AGAIN);
            for (column, row) in tile_pixels(tree.size, tile) {
                let pixel = row * tree.size.0 as usize + column;
                if reach[pixel] == AGAIN {
                    let (painted, level) = painter.painted(TileColours::lane(column, row));
                    frame.hide(counts[pixel]);
                    frame.show(pixel, &painted);
                    counts[pixel] = painted.counts;
                    reach[pixel] = level as u8;
                }
            }
        }
    }
}

/// Puts the sums of 2 × 2 numbers, row by row of `width`, in the place of rows of numbers. `half` is half the width, rounded up.
fn halve(numbers: &mut Vec<u32>, width: usize, half: usize) {
    let rows = numbers.len() / width;
    for row in 0..rows.div_ceil(2) {
        for column in 0..half {
            let pair = |row: usize| {
                let start = row * width + 2 * column;
                numbers[start] + if 2 * column + 1 < width { numbers[start + 1] } else { 0 }
            };
            let sum = pair(2 * row) + if 2 * row + 1 < rows { pair(2 * row + 1) } else { 0 };
            numbers[row * half + column] = sum;
        }
    }
    numbers.truncate(rows.div_ceil(2) * half);
}

impl Quadtree {
    /// The picture, if it is time to draw it: what changed it since the last time is 50,000 samples, or anything at all and
    /// 33 ms are over. `since` is the time since the last picture that this gave.
    ///
    /// Pixels are left as they are that few of the new samples belong to; if 33 ms are not over, only some thousand others are
    /// drawn, and more the next time, so that many samples do not wait for pictures. 33 ms after the last sample comes the
    /// picture that [`draw`](Self::draw) gives, and then none: no work is done while nothing changes.
    ///
    /// The first picture of a view that has samples is a [`draft`](Self::draft): while the camera moves every picture is the first of its view.
    pub fn redraw(&mut self, since: Duration) -> Option<&Frame> {
        let is_whole = self.drawing.as_ref().is_some_and(|drawing| drawing.is_whole);
        let is_late = since >= BURST_TIME;
        if !(self.changes >= BURST_SAMPLES || is_late && (self.changes > 0 || !is_whole)) {
            return None;
        }
        let has_samples = !(self.narrow.is_empty() && self.wide.is_empty());
        if !self.is_begun && has_samples && self.has_drafts() {
            (self.is_begun, self.changes) = (true, 0);
            return Some(self.draft());
        }
        let old = match self.drawing.take() {
            // With the first samples from elsewhere there is another pyramid.
            Some(mut drawing) if drawing.pyramids.all.is_some() != self.wide.is_empty() => {
                let is_much = drawing.take_in(self.size.0);
                if self.changes == 0 || is_much && is_late {
                    drawing.complete(self);
                } else {
                    drawing.update(self, if is_late { usize::MAX } else { BURST_WORK });
                }
                self.changes = 0;
                return Some(&self.drawing.insert(drawing).frame);
            }
            old => old.or_else(|| self.old.take()),
        };
        let drawing = Drawing::new(self, old);
        (self.is_begun, self.changes) = (true, 0);
        Some(&self.drawing.insert(drawing).frame)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::QuadtreeParams;
    use crate::room;
    use glam::DVec3;
    use holo_picture::View;
    use holo_section::{BeamId, RayCoords, Sample};
    use std::sync::Arc;

    const LATE: Duration = Duration::from_secs(1);

    #[test]
    fn sums_of_two_by_two_numbers_leave_nothing_out_at_odd_sizes() {
        let mut numbers: Vec<u32> = (1..=15).collect();
        halve(&mut numbers, 5, 3);
        assert_eq!(numbers, [1 + 2 + 6 + 7, 3 + 4 + 8 + 9, 5 + 10, 11 + 12, 13 + 14, 15]);
        halve(&mut numbers, 3, 2);
        halve(&mut numbers, 2, 1);
        assert_eq!(numbers, [120]);
    }

    /// Any samples, so that surfaces of all depths come and join.
    #[test]
    fn leaves_contain_their_childrens_surfaces_and_lack_less_than_a_quarter_of_what_they_have() {
        let (size, section) = ((37, 21), room());
        let view = View::new(DVec3::new(1.0, 1.5, 1.4), DVec3::X, DVec3::Z, Some(70.0), None, size)
            .unwrap();
        let beams = section.beam_count();
        let mut tree = Quadtree::new(Arc::from([section]), view, size, QuadtreeParams::default());
        let mut state = 7_u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as u32
        };
        for burst in 0..40 {
            for _ in 0..[3, 30, 400, 2000][burst % 4] {
                let coords = RayCoords(random().to_le_bytes());
                let rgbe = [100, 120, 140, 120 + (random() % 8) as u8];
                let sample = Sample::from_codes(coords, rgbe, (random() % 3000) as u16);
                tree.insert(0, BeamId(u64::from(random()) % beams), 1, &[sample]);
            }
            tree.redraw(LATE);
            let drawing = tree.drawing.as_ref().unwrap();
            let pyramids = std::iter::once(&drawing.pyramids.narrow).chain(&drawing.pyramids.all);
            for levels in pyramids {
                for (below, above) in levels.iter().zip(&levels[1..]) {
                    for (column, row) in (0..below.height)
                        .flat_map(|row| (0..below.width).map(move |column| (column, row)))
                    {
                        let parent = above.leaf(column / 2, row / 2);
                        for surface in below.leaf(column, row) {
                            let own = own_surface(parent, surface.bins).unwrap();
                            assert!(
                                own.bins.first <= surface.bins.first
                                    && surface.bins.last <= own.bins.last
                            );
                        }
                    }
                }
            }
            let levels = || drawing.growth.iter().zip(drawing.pyramids.all());
            for (&new, &known) in
                levels().flat_map(|(growth, level)| growth.iter().zip(&level.samples))
            {
                assert!(new == 0 || 4 * new < known, "{new} of {known}");
            }
            assert!(drawing.reach.iter().all(|&reach| reach != AGAIN));
            // What levels know and lack together is the same: all that has landed, but for bins that pixels do not keep.
            let sums =
                levels().map(|(growth, level)| growth.iter().chain(&level.samples).sum::<u32>());
            let sums: Vec<u32> = sums.collect();
            assert!(sums.iter().all(|sum| sum.abs_diff(sums[0]) * 4 <= sums[0]), "{sums:?}");
        }
    }
}
