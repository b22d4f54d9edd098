//! What a pixel shows: the colours of its surfaces, in the shares that its samples tell.
//!
//! Invariant: a pixel is a function of the leaves and, by the noise found last, of the pixels of its tile before it: tiles are drawn on all
//! cores, in any order.

use super::bins::bin_distance_squared;
use super::leaf::{Reader, beside};
use super::shown::Shown;
use super::standing::may_stand;
use super::sums::NEAR_CLASSES;
use super::surface::{Bins, Surface, gap_allowed};
use super::tile::TileColours;
use super::wide::Agreement;
use super::{Frame, LeafSize, MultiDepth, Pyramids, Quadtree, QuadtreeParams};
use holo_display::for_bands;
use holo_cpu::Kernel;
use bytemuck::Zeroable;
use holo_section::BeamId;
use std::ops::Range;

/// Side of the squares of pixels that are drawn one after the other.
pub(super) const TILE: usize = 16;

/// Depth bins between a surface and one that hides it: a fifth of the distance.
pub(super) const CLEARLY_IN_FRONT: u16 = 8;

/// How many tiles a picture has.
pub(super) fn tile_count((width, height): (u32, u32)) -> usize {
    (width as usize).div_ceil(TILE) * (height as usize).div_ceil(TILE)
}

/// Columns and rows of a tile's pixels. Drawn tile by tile, neighbours in both directions mostly have the same noise.
pub(super) fn tile_pixels(size: (u32, u32), number: usize) -> impl Iterator<Item = (usize, usize)> {
    let (columns, rows) = tile_place(size, number);
    rows.flat_map(move |row| columns.clone().map(move |column| (column, row)))
}

/// A tile's pixels by their numbers in the picture, row by row.
pub(super) fn tile_rows(size: (u32, u32), number: usize) -> impl Iterator<Item = Range<usize>> {
    let (columns, rows) = tile_place(size, number);
    let width = size.0 as usize;
    rows.map(move |row| row * width + columns.start..row * width + columns.end)
}

/// Columns and rows of a tile.
fn tile_place((width, height): (u32, u32), number: usize) -> (Range<usize>, Range<usize>) {
    let (width, height) = (width as usize, height as usize);
    let across = width.div_ceil(TILE);
    let (left, top) = (number % across * TILE, number / across * TILE);
    (left..(left + TILE).min(width), top..(top + TILE).min(height))
}

/// A pixel of a picture.
#[derive(Clone, Copy, Default)]
pub(super) struct Painted {
    pub colour: [f32; 3],
    pub depth: f32,
    pub counts: Counts,
}

/// What a pixel is counted as: the samples of its own, and above them whether it is empty or unseen. One number: all pixels of a picture are
/// added up.
#[derive(Clone, Copy, Default, Zeroable)]
pub(super) struct Counts(u32);

impl Counts {
    const EMPTY: u32 = 1 << 30;
    const UNSEEN: u32 = 1 << 31;

    /// A pixel that has so many samples, as far as they can be counted.
    #[inline(always)]
    pub fn samples(samples: u32) -> Self {
        Self(samples.min(Self::EMPTY - 1))
    }

    /// One that is filled from others' samples, if there are any.
    #[inline(always)]
    pub fn empty() -> Self {
        Self(Self::EMPTY)
    }

    /// One whose beam sees nothing.
    pub fn unseen() -> Self {
        Self(Self::UNSEEN)
    }

    pub fn is_unseen(self) -> bool {
        self.0 & Self::UNSEEN != 0
    }

    fn is_empty(self) -> bool {
        self.0 & Self::EMPTY != 0
    }

    fn own_samples(self) -> u64 {
        u64::from(self.0 & (Self::EMPTY - 1))
    }
}

impl MultiDepth {
    fn add(&mut self, more: &Self) {
        self.by_near_samples += more.by_near_samples;
        self.by_leaves += more.by_leaves;
        self.remaining += more.remaining;
    }
}

impl Frame {
    /// Shows a pixel that is not counted.
    pub(super) fn show(&mut self, pixel: usize, painted: &Painted) {
        self.picture.pixels[pixel] = painted.colour;
        self.depth[pixel] = painted.depth;
        self.empty_pixels += u64::from(painted.counts.is_empty());
        self.unseen_pixels += u64::from(painted.counts.is_unseen());
        self.samples_used += painted.counts.own_samples();
    }

    /// Counts nothing, before all pixels are drawn.
    pub(super) fn start(&mut self, tree: &Quadtree) {
        self.picture.view = Some(tree.view);
        self.uncovered_pixels = tree.uncovered_pixels;
        (self.empty_pixels, self.unseen_pixels, self.samples_used) = (0, 0, 0);
    }

    /// No longer counts a pixel.
    pub(super) fn hide(&mut self, counts: Counts) {
        self.empty_pixels -= u64::from(counts.is_empty());
        self.unseen_pixels -= u64::from(counts.is_unseen());
        self.samples_used -= counts.own_samples();
    }
}

/// Which pixels' best beams are known to see nothing, of pixels in order: neighbouring ones mostly have the same beam.
#[derive(Default)]
pub(super) struct UnseenPixels {
    last: (Option<(u16, BeamId)>, bool),
}

impl UnseenPixels {
    pub fn has(&mut self, tree: &Quadtree, pixel: usize) -> bool {
        let Some(best) = tree.best.get(pixel) else { return false };
        if self.last.0 != *best {
            self.last = (*best, tree.sees_nothing(pixel));
        }
        self.last.1
    }
}

/// Reads colours from all samples, or from those that look as the eye does where the others differ.
pub(super) struct Painter<'a> {
    pub all: Reader<'a>,
    /// None: all are.
    narrow: Option<(Reader<'a>, &'a Agreement)>,
}

impl<'a> Painter<'a> {
    pub fn new(
        pyramids: &'a Pyramids,
        agreement: Option<&'a Agreement>,
        params: &'a QuadtreeParams,
    ) -> Self {
        let narrow = agreement.map(|agreement| (Reader::new(&pyramids.narrow, params), agreement));
        Self { all: Reader::new(pyramids.all(), params), narrow }
    }

    /// Forgets what other tiles' pixels found.
    pub fn begin_tile(&self) {
        self.all.begin_tile();
        self.narrow.iter().for_each(|(narrow, _)| narrow.begin_tile());
    }

    /// The highest level that colours were read from since this was last asked.
    pub fn reach(&self) -> usize {
        let narrow = self.narrow.as_ref().map_or(0, |(narrow, _)| narrow.reach.take());
        self.all.reach.take().max(narrow)
    }
}

impl Painter<'_> {
    /// As [`Reader::colour`].
    pub fn colour(&self, column: usize, row: usize, start: usize, bins: Bins) -> [f32; 3] {
        let all = self.all.colour(column, row, start, bins);
        self.narrow_part(column, row, start, bins).map_or(all, |part| part.mixed_with(all))
    }

    /// Whether a pixel of one surface shows it, as far as can be told at once: others are looked at closer. Which samples pass near the
    /// eye no processor can tell beforehand: both conditions are looked at.
    #[inline(always)]
    fn shows_own(&self, column: usize, row: usize, own: &Surface) -> bool {
        (own.near() != [0; NEAR_CLASSES]) | !self.may_be_covered(column, row, own)
    }

    /// Whether a surface around lies so far in front of a pixel's that it may be found covering it.
    #[inline(always)]
    fn may_be_covered(&self, column: usize, row: usize, front: &Surface) -> bool {
        let covers = |level: usize| {
            let Some(leaves) = self.all.levels.get(level) else { return false };
            // The nearest comes first.
            let nearest = leaves.leaf(column >> level, row >> level).first();
            nearest.is_some_and(|nearest| {
                nearest.bins.last.saturating_add(CLEARLY_IN_FRONT) < front.bins.first
            })
        };
        covers(2) | covers(1)
    }

    /// The surfaces of a leaf by those samples that tell best what hides what: those that look as the eye does, if there are any.
    pub fn leaf_seen(&self, level: usize, column: usize, row: usize) -> &[Surface] {
        let narrow = self
            .narrow
            .as_ref()
            .map(|(narrow, _)| narrow.levels[level].leaf(column >> level, row >> level));
        narrow
            .filter(|leaf| !leaf.is_empty())
            .unwrap_or_else(|| self.all.levels[level].leaf(column >> level, row >> level))
    }

    /// What samples that look as the eye does show, where the others may not stand for it.
    fn narrow_part(
        &self,
        column: usize,
        row: usize,
        start: usize,
        bins: Bins,
    ) -> Option<NarrowPart> {
        let (narrow, agreement) = self.narrow.as_ref()?;
        let share = agreement.of(&self.all, narrow, column, row, bins);
        if share == 1.0 {
            return None;
        }
        // From the smallest leaf that has any: the comparison found one. Few as they are there, they may all lie a bin beside.
        let start = (start..narrow.levels.len()).find_map(|level| {
            let leaf = narrow.levels[level].leaf(column >> level, row >> level);
            beside(leaf, bins, gap_allowed(level)).map(|surface| (level, surface.bins))
        });
        let (start, bins) = start?;
        Some(NarrowPart { own: narrow.colour(column, row, start, bins), share })
    }
}

/// A colour of samples that look as the eye does, and how far that of all may be used.
struct NarrowPart {
    own: [f32; 3],
    share: f32,
}

impl NarrowPart {
    fn mixed_with(&self, all: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|channel| self.own[channel] + self.share * (all[channel] - self.own[channel]))
    }
}

/// Draws pixels tile by tile.
pub(super) struct TilePainter<'a> {
    tree: &'a Quadtree,
    painter: Painter<'a>,
    unseen: UnseenPixels,
    colours: Box<TileColours>,
    /// What samples that look as the eye does show, by pixel of the tile.
    narrow: Vec<(usize, NarrowPart)>,
    /// Of each pixel of the tile.
    distances_squared: [f32; TILE * TILE],
    counts: [Counts; TILE * TILE],
    /// How several depths were resolved so far.
    pub depths: MultiDepth,
}

impl<'a> TilePainter<'a> {
    pub fn new(
        tree: &'a Quadtree,
        pyramids: &'a Pyramids,
        agreement: Option<&'a Agreement>,
    ) -> Self {
        Self {
            tree,
            painter: Painter::new(pyramids, agreement, &tree.params),
            unseen: UnseenPixels::default(),
            colours: Box::new(TileColours::new()),
            narrow: Vec::new(),
            distances_squared: [0.0; TILE * TILE],
            counts: [Counts::default(); TILE * TILE],
            depths: MultiDepth::default(),
        }
    }

    /// Draws those pixels of a tile that are wanted, by their number in the picture: [`painted`](Self::painted) has them.
    #[inline(always)]
    pub fn paint(&mut self, tile: usize, is_wanted: impl Fn(usize) -> bool) {
        let width = self.tree.size.0 as usize;
        self.painter.begin_tile();
        for (column, row) in tile_pixels(self.tree.size, tile) {
            let pixel = row * width + column;
            if !is_wanted(pixel) {
                continue;
            }
            // The next tile's.
            self.painter.all.levels[0].prefetch(pixel + TILE);
            let lane = TileColours::lane(column, row);
            let is_unseen = self.unseen.has(self.tree, pixel);
            // What most pixels show is told here: of all that a pixel may show, it would be written to memory and read again.
            match self.painter.all.levels[0].leaf(column, row) {
                [own]
                    if !is_unseen
                        && self.tree.covered[pixel]
                        && self.painter.shows_own(column, row, own)
                        && !(self.tree.is_outside
                            && may_stand(&self.painter, column, row, own.bins)) =>
                {
                    self.counts[lane] = Counts::samples(own.count);
                    self.show_own(lane, column, row, own);
                }
                [] if !is_unseen
                    && self.tree.covered[pixel]
                    && !self.tree.is_outside
                    && let Some([around]) = self
                        .painter
                        .all
                        .levels
                        .get(1)
                        .map(|level| level.leaf(column / 2, row / 2))
                    && !self.painter.may_be_covered(column, row, around) =>
                {
                    self.counts[lane] = Counts::empty();
                    self.show(lane, column, row, 1, around.bins);
                }
                leaf => self.paint_other(lane, column, row, leaf, is_unseen),
            }
        }
        let across = width.div_ceil(TILE);
        self.colours.find(
            &self.painter.all,
            tile % across * TILE,
            tile / across * TILE,
            self.tree.isa,
        );
        for (lane, part) in self.narrow.drain(..) {
            let (all, reach) = self.colours.get(lane);
            self.colours.set(lane, part.mixed_with(all), reach);
        }
    }

    /// A pixel that has been drawn, and the highest level that it was averaged over.
    #[inline(always)]
    pub fn painted(&self, lane: usize) -> (Painted, usize) {
        let (colour, reach) = self.colours.get(lane);
        (
            Painted {
                colour,
                depth: self.distances_squared[lane].sqrt(),
                counts: self.counts[lane],
            },
            reach,
        )
    }

    /// Shows a pixel's own surface, with samples of its own.
    #[inline(always)]
    fn show_own(&mut self, lane: usize, column: usize, row: usize, own: &Surface) {
        self.distances_squared[lane] = bin_distance_squared(own.bins.first);
        if matches!(self.tree.params.leaf, LeafSize::Fixed(_)) {
            self.colours.set(
                lane,
                self.painter.colour(column, row, 0, own.bins),
                self.painter.reach(),
            );
        } else {
            self.colours.ask_own(lane, own, &self.painter.all.noise(column, row, 0, own.bins));
            self.ask_narrow(lane, column, row, 0, own.bins);
        }
    }

    /// Shows a surface as from larger leaves of a level on, by its bins there.
    #[inline(always)]
    fn show(&mut self, lane: usize, column: usize, row: usize, level: usize, bins: Bins) {
        self.distances_squared[lane] = bin_distance_squared(bins.first);
        if matches!(self.tree.params.leaf, LeafSize::Fixed(_)) {
            self.colours.set(
                lane,
                self.painter.colour(column, row, level, bins),
                self.painter.reach(),
            );
        } else {
            self.colours.ask(lane, level, bins, &self.painter.all.noise(column, row, level, bins));
            self.ask_narrow(lane, column, row, level, bins);
        }
    }

    #[inline(always)]
    fn ask_narrow(&mut self, lane: usize, column: usize, row: usize, level: usize, bins: Bins) {
        if self.painter.narrow.is_some() {
            let part = self.painter.narrow_part(column, row, level, bins);
            self.narrow.extend(part.map(|part| (lane, part)));
            self.colours.depends(lane, self.painter.reach());
        }
    }

    /// Draws a pixel that may show anything.
    #[inline(never)]
    fn paint_other(
        &mut self,
        lane: usize,
        column: usize,
        row: usize,
        leaf: &[Surface],
        is_unseen: bool,
    ) {
        let (counts, shown) =
            self.tree.shown(&self.painter, column, row, leaf, is_unseen, &mut self.depths);
        self.counts[lane] = counts;
        match shown {
            Shown::Own(own) => self.show_own(lane, column, row, own),
            Shown::Surface(level, bins) => self.show(lane, column, row, level, bins),
            Shown::Mixed(colour, bin) => {
                self.distances_squared[lane] = bin_distance_squared(bin);
                self.colours.set(lane, colour, self.painter.reach());
            }
            Shown::Known(colour, distance) => {
                self.distances_squared[lane] = distance;
                self.colours.set(lane, colour, 0);
            }
        }
    }
}

/// Some whole rows of a picture that is drawn, and what is known of their pixels.
struct RowsDrawn<'a> {
    colours: &'a mut [[f32; 3]],
    depths: &'a mut [f32],
    counts: &'a mut [Counts],
    reach: &'a mut [u8],
    /// What all of them are counted as, once they are drawn.
    sum: Counted,
}

impl RowsDrawn<'_> {
    /// Takes in a tile that has been drawn, which begins at a column.
    #[inline(always)]
    fn take(&mut self, painter: &TilePainter, first: usize, width: usize) {
        let across = TILE.min(width - first);
        for row in 0..self.depths.len() / width {
            let pixels = row * width + first..row * width + first + across;
            let lanes = row * TILE..row * TILE + across;
            painter.colours.copy(
                lanes.clone(),
                &mut self.colours[pixels.clone()],
                &mut self.reach[pixels.clone()],
            );
            let squared = &painter.distances_squared[lanes.clone()];
            self.depths[pixels.clone()]
                .iter_mut()
                .zip(squared)
                .for_each(|(depth, squared)| *depth = squared.sqrt());
            self.counts[pixels].copy_from_slice(&painter.counts[lanes]);
        }
    }

    /// What all its pixels are counted as. At the end: a sum kept in memory from tile to tile waits for all that is written between.
    #[inline(always)]
    fn counted(&self, depths: MultiDepth) -> Counted {
        let sum = |of: fn(Counts) -> u64| self.counts.iter().map(|&counts| of(counts)).sum();
        Counted {
            empty: sum(|counts| u64::from(counts.is_empty())),
            unseen: sum(|counts| u64::from(counts.is_unseen())),
            samples: sum(Counts::own_samples),
            depths,
        }
    }
}

/// Draws all tiles of some rows.
struct PaintRows<'a, 'b> {
    painter: TilePainter<'a>,
    part: &'a mut RowsDrawn<'b>,
    tiles: Range<usize>,
    width: usize,
}

impl Kernel for PaintRows<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { mut painter, part, tiles, width } = self;
        for tile in tiles.clone() {
            painter.paint(tile, |_| true);
            part.take(&painter, (tile - tiles.start) * TILE, width);
        }
        part.sum = part.counted(painter.depths);
    }
}

/// How many pixels, and samples, are counted as what.
#[derive(Clone, Copy, Default)]
struct Counted {
    empty: u64,
    unseen: u64,
    samples: u64,
    depths: MultiDepth,
}

impl Quadtree {
    /// Draws a picture: every pixel of `frame`, what each is counted as, and the highest level that each was averaged over. How several
    /// depths were resolved. By all cores: no tile knows of others.
    pub(super) fn paint_all(
        &self,
        pyramids: &Pyramids,
        agreement: Option<&Agreement>,
        frame: &mut Frame,
        counts: &mut [Counts],
        reach: &mut [u8],
    ) -> MultiDepth {
        let width = self.size.0 as usize;
        let (across, most) = (width.div_ceil(TILE), (TILE * width).max(1));
        let rows = frame.picture.pixels.chunks_mut(most).zip(frame.depth.chunks_mut(most));
        let mut parts: Vec<RowsDrawn> = rows
            .zip(counts.chunks_mut(most).zip(reach.chunks_mut(most)))
            .map(|((colours, depths), (counts, reach))| RowsDrawn {
                colours,
                depths,
                counts,
                reach,
                sum: Counted::default(),
            })
            .collect();
        for_bands(&mut parts, 1, 1, |number, parts| {
            for part in parts {
                let painter = TilePainter::new(self, pyramids, agreement);
                self.isa.run(PaintRows {
                    painter,
                    part,
                    tiles: number * across..(number + 1) * across,
                    width,
                });
            }
        });
        let mut depths = MultiDepth::default();
        let sums: Vec<Counted> = parts.iter().map(|part| part.sum).collect();
        for sum in sums {
            frame.empty_pixels += sum.empty;
            frame.unseen_pixels += sum.unseen;
            frame.samples_used += sum.samples;
            depths.add(&sum.depths);
        }
        depths
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
#[path = "paint_tests.rs"]
mod tests;
