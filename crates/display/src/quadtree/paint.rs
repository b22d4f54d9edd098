//! What a pixel shows: the colours of its surfaces, in the shares that its samples tell.
//!
//! Invariant: a pixel is a function of the leaves and, by the noise found last, of the pixels of its tile before it: tiles are drawn on all
//! cores, in any order.

use super::bins::{BINS_AN_OCTAVE, NEAR_CLASSES, bin_distance_squared};
use super::leaf::{Reader, beside, own_surface};
use super::pyramid::Level;
use super::surface::{Surface, gap_allowed};
use super::tile::TileColours;
use super::wide::Agreement;
use super::{Frame, LeafSize, MultiDepth, Pyramids, Quadtree, QuadtreeParams, SEEN_SHARE};
use crate::parts::for_parts;
use bytemuck::Zeroable;
use holo_section::BeamId;

/// Side of the squares of pixels that are drawn one after the other.
pub(super) const TILE: usize = 16;

/// Depth bins between a surface and one that hides it: a fifth of the distance.
const CLEARLY_IN_FRONT: u16 = 8;

/// Samples a pixel from which a surface without one is not there: with 2 expected, one pixel in seven has none.
const MANY_A_PIXEL: u32 = 2;

/// How many tiles a picture has.
pub(super) fn tile_count((width, height): (u32, u32)) -> usize {
    (width as usize).div_ceil(TILE) * (height as usize).div_ceil(TILE)
}

/// Columns and rows of a tile's pixels. Drawn tile by tile, neighbours in both directions mostly have the same noise.
pub(super) fn tile_pixels((width, height): (u32, u32), number: usize) -> impl Iterator<Item = (usize, usize)> {
    let (width, height) = (width as usize, height as usize);
    let across = width.div_ceil(TILE);
    let (left, top) = (number % across * TILE, number / across * TILE);
    let columns = left..(left + TILE).min(width);
    (top..(top + TILE).min(height)).flat_map(move |row| columns.clone().map(move |column| (column, row)))
}

/// A pixel of a picture.
#[derive(Clone, Copy, Default)]
pub(super) struct Painted {
    pub colour: [f32; 3],
    pub depth: f32,
    pub counts: Counts,
}

/// What a pixel is counted as.
#[derive(Clone, Copy, Default, Zeroable)]
pub(super) struct Counts {
    /// Samples of its own.
    pub samples: u32,
    pub empty: bool,
    pub unseen: bool,
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
        self.empty_pixels += u64::from(painted.counts.empty);
        self.unseen_pixels += u64::from(painted.counts.unseen);
        self.samples_used += u64::from(painted.counts.samples);
    }

    /// Counts nothing, before all pixels are drawn.
    pub(super) fn start(&mut self, tree: &Quadtree) {
        self.picture.view = Some(tree.view);
        self.uncovered_pixels = tree.uncovered_pixels;
        (self.empty_pixels, self.unseen_pixels, self.samples_used) = (0, 0, 0);
    }

    /// No longer counts a pixel.
    pub(super) fn hide(&mut self, counts: &Counts) {
        self.empty_pixels -= u64::from(counts.empty);
        self.unseen_pixels -= u64::from(counts.unseen);
        self.samples_used -= u64::from(counts.samples);
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
    all: Reader<'a>,
    /// None: all are.
    narrow: Option<(Reader<'a>, &'a Agreement)>,
}

impl<'a> Painter<'a> {
    pub fn new(pyramids: &'a Pyramids, agreement: Option<&'a Agreement>, params: &'a QuadtreeParams) -> Self {
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
    fn colour(&self, column: usize, row: usize, start: usize, bins: (u16, u16)) -> [f32; 3] {
        let all = self.all.colour(column, row, start, bins);
        self.narrow_part(column, row, start, bins).map_or(all, |part| part.mixed_with(all))
    }

    /// Whether a pixel of one surface shows it, as far as can be told at once: others are looked at closer. Which samples pass near the
    /// eye no processor can tell beforehand: both conditions are looked at.
    #[inline(always)]
    fn shows_own(&self, column: usize, row: usize, own: &Surface) -> bool {
        (own.near() != [0; NEAR_CLASSES]) | !self.may_be_covered(column, row, own)
    }

    /// Whether a surface around lies so far in front of a pixel's that it may be found [`covering`] it.
    #[inline(always)]
    fn may_be_covered(&self, column: usize, row: usize, front: &Surface) -> bool {
        let covers = |level: usize| {
            let Some(leaves) = self.all.levels.get(level) else { return false };
            // The nearest comes first.
            let nearest = leaves.leaf(column >> level, row >> level).first();
            nearest.is_some_and(|nearest| nearest.bins.1.saturating_add(CLEARLY_IN_FRONT) < front.bins.0)
        };
        covers(2) | covers(1)
    }

    /// What samples that look as the eye does show, where the others may not stand for it.
    fn narrow_part(&self, column: usize, row: usize, start: usize, bins: (u16, u16)) -> Option<NarrowPart> {
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

/// What a pixel shows.
enum Shown<'a> {
    /// A colour that is known, and a squared distance.
    Known([f32; 3], f32),
    /// A surface of its own.
    Own(&'a Surface),
    /// One surface, as from larger leaves of a level on, by its bins there.
    Surface(usize, (u16, u16)),
    /// A colour, and the nearest bin of what it is mixed of.
    Mixed([f32; 3], u16),
}

/// Of pixels that nothing is known of.
const NOTHING: Shown<'static> = Shown::Known([0.0; 3], 0.0);

/// What a pixel with samples of its own shows.
///
/// Samples that pass near the eye are samples of this very pixel: their shares are the surfaces' coverage, which is what
/// makes a silhouette smooth. With none of them the nearest surface is what is seen: whatever lies behind was seen past its
/// edge.
fn mix<'a>(
    painter: &Painter,
    column: usize,
    row: usize,
    own: &'a [Surface],
    ask_nearer: bool,
    depths: &mut MultiDepth,
) -> Shown<'a> {
    let Some(front) = own.first() else { return NOTHING };
    let near = |surface: &Surface| near_count(surface, front, ask_nearer);
    let all: f32 = own.iter().map(near).sum();
    let alone = Shown::Own(front);
    if all == 0.0 {
        let covered = covering(painter, column, row, front);
        depths.by_leaves += u64::from(covered.is_some());
        depths.remaining += u64::from(covered.is_none() && own.len() > 1);
        return covered.map_or(alone, |(level, bins)| Shown::Surface(level, bins));
    }
    if own.len() == 1 {
        return alone;
    }
    depths.by_near_samples += 1;
    let mut colour = [0.0; 3];
    let mut nearest = None;
    for surface in own.iter().filter(|surface| near(surface) > 0.0) {
        let coverage = near(surface) / all;
        for (sum, part) in colour.iter_mut().zip(painter.colour(column, row, 0, surface.bins)) {
            *sum += coverage * part;
        }
        nearest = nearest.or(Some(surface.bins.0));
    }
    nearest.map_or(NOTHING, |bin| Shown::Mixed(colour, bin))
}

/// Level and bins of a surface that hides a pixel's front surface, though the pixel has no sample of it.
///
/// Where samples are few, those of a far surface show through between those of a near one, having looked past its edge (the
/// paper's Figure 6). A surface in front that most samples of the 4 × 4 or 2 × 2 pixels around are of is taken to go on
/// here, unless it has so many samples that it would have had one here. Only for pixels with no sample near the eye: those
/// see for themselves. On a disc before a wall eight times as far, batch samples of a 4³ grid, this took a tenth (0.4 a
/// pixel) to four tenths (1 to 3 a pixel) off the error; a third instead of a half made some worse. On a ball before a near
/// wall, 16³ grid, it costs 0.1 to 0.4 dB.
fn covering(painter: &Painter, column: usize, row: usize, front: &Surface) -> Option<(usize, (u16, u16))> {
    [2, 1].into_iter().find_map(|level| {
        let leaf = painter.all.levels.get(level)?.leaf(column >> level, row >> level);
        let all: f32 = leaf.iter().map(|surface| surface.count as f32).sum();
        let hides = |surface: &&Surface| {
            surface.bins.1.saturating_add(CLEARLY_IN_FRONT) < front.bins.0
                && surface.count as f32 >= 0.5 * all
                && surface.count <= MANY_A_PIXEL << (2 * level)
        };
        let hiding = leaf.iter().find(hides)?;
        Some((level, hiding.bins))
    })
}

/// Samples of a surface that pass so near the eye that they see past the front surface what the eye sees.
///
/// Within the footprint of a pixel at their own distance is not near enough: with `front` at an eighth of the distance they
/// would look behind it by seven pixels (batch pictures then got worse with more samples). The radius is halved for each
/// whole doubling from the front to the surface, which keeps that below a pixel and a half.
fn near_count(surface: &Surface, front: &Surface, ask_nearer: bool) -> f32 {
    let behind = surface.bins.0.saturating_sub(front.bins.0);
    let halvings = if ask_nearer { usize::from(behind / BINS_AN_OCTAVE) } else { 0 };
    surface.near().iter().skip(halvings.min(NEAR_CLASSES - 1)).map(|&count| count as f32).sum()
}

/// What a pixel without samples shows: that of the smallest leaf around it that has any.
#[inline(always)]
fn fill(painter: &Painter, column: usize, row: usize) -> Shown<'static> {
    let filling = painter.all.levels.iter().enumerate().skip(1).find_map(|(level, leaves): (usize, &Level)| {
        let leaf = leaves.leaf(column >> level, row >> level);
        if let [only] = leaf {
            return Some((level, only.bins));
        }
        let all: f32 = leaf.iter().map(|surface| surface.count as f32).sum();
        let seen = leaf.iter().find(|surface| surface.count as f32 >= SEEN_SHARE * all)?;
        Some((level, own_surface(leaf, seen.bins)?.bins))
    });
    filling.map_or(NOTHING, |(level, bins)| Shown::Surface(level, bins))
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
    pub fn new(tree: &'a Quadtree, pyramids: &'a Pyramids, agreement: Option<&'a Agreement>) -> Self {
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
                [own] if !is_unseen && self.tree.covered[pixel] && self.painter.shows_own(column, row, own) => {
                    self.counts[lane] = Counts { samples: own.count, empty: false, unseen: false };
                    self.show_own(lane, column, row, own);
                }
                leaf => self.paint_other(lane, column, row, leaf, is_unseen),
            }
        }
        let across = width.div_ceil(TILE);
        self.colours.find(&self.painter.all, tile % across * TILE, tile / across * TILE, self.tree.isa);
        for (lane, part) in self.narrow.drain(..) {
            let (all, reach) = self.colours.get(lane);
            self.colours.set(lane, part.mixed_with(all), reach);
        }
    }

    /// A pixel that has been drawn, and the highest level that it was averaged over.
    #[inline(always)]
    pub fn painted(&self, lane: usize) -> (Painted, usize) {
        let (colour, reach) = self.colours.get(lane);
        (Painted { colour, depth: self.distances_squared[lane].sqrt(), counts: self.counts[lane] }, reach)
    }

    /// Shows a pixel's own surface, with samples of its own.
    #[inline(always)]
    fn show_own(&mut self, lane: usize, column: usize, row: usize, own: &Surface) {
        self.distances_squared[lane] = bin_distance_squared(own.bins.0);
        if matches!(self.tree.params.leaf, LeafSize::Fixed(_)) {
            self.colours.set(lane, self.painter.colour(column, row, 0, own.bins), self.painter.reach());
        } else {
            self.colours.ask_own(lane, own, &self.painter.all.noise(column, row, 0, own.bins));
            self.ask_narrow(lane, column, row, 0, own.bins);
        }
    }

    #[inline(always)]
    fn ask_narrow(&mut self, lane: usize, column: usize, row: usize, level: usize, bins: (u16, u16)) {
        if self.painter.narrow.is_some() {
            let part = self.painter.narrow_part(column, row, level, bins);
            self.narrow.extend(part.map(|part| (lane, part)));
            self.colours.depends(lane, self.painter.reach());
        }
    }

    /// Draws a pixel that may show anything.
    #[inline(never)]
    fn paint_other(&mut self, lane: usize, column: usize, row: usize, leaf: &[Surface], is_unseen: bool) {
        let (counts, shown) = self.tree.shown(&self.painter, column, row, leaf, is_unseen, &mut self.depths);
        self.counts[lane] = counts;
        let is_fixed = matches!(self.tree.params.leaf, LeafSize::Fixed(_));
        match shown {
            Shown::Own(own) => self.show_own(lane, column, row, own),
            Shown::Surface(level, bins) => {
                self.distances_squared[lane] = bin_distance_squared(bins.0);
                if is_fixed {
                    self.colours.set(lane, self.painter.colour(column, row, level, bins), self.painter.reach());
                } else {
                    self.colours.ask(lane, level, bins, &self.painter.all.noise(column, row, level, bins));
                    self.ask_narrow(lane, column, row, level, bins);
                }
            }
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
    sum: Counted,
}

impl RowsDrawn<'_> {
    /// Takes in a tile that has been drawn, which begins at a column.
    fn take(&mut self, painter: &TilePainter, first: usize, width: usize) {
        let across = TILE.min(width - first);
        for row in 0..self.depths.len() / width {
            let pixels = row * width + first..row * width + first + across;
            let lanes = row * TILE..row * TILE + across;
            painter.colours.copy(lanes.clone(), &mut self.colours[pixels.clone()], &mut self.reach[pixels.clone()]);
            let squared = &painter.distances_squared[lanes.clone()];
            self.depths[pixels.clone()].iter_mut().zip(squared).for_each(|(depth, squared)| *depth = squared.sqrt());
            self.counts[pixels].copy_from_slice(&painter.counts[lanes.clone()]);
            for counts in &painter.counts[lanes] {
                self.sum.empty += u64::from(counts.empty);
                self.sum.unseen += u64::from(counts.unseen);
                self.sum.samples += u64::from(counts.samples);
            }
        }
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
        for_parts(&mut parts, 1, 1, |number, parts| {
            for part in parts {
                let mut painter = TilePainter::new(self, pyramids, agreement);
                for tile in 0..across {
                    painter.paint(number * across + tile, |_| true);
                    part.take(&painter, tile * TILE, width);
                }
                part.sum.depths = painter.depths;
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

    /// What a pixel shows, given its leaf, and as what it is counted.
    fn shown<'a>(
        &self,
        painter: &Painter,
        column: usize,
        row: usize,
        own: &'a [Surface],
        is_unseen: bool,
        depths: &mut MultiDepth,
    ) -> (Counts, Shown<'a>) {
        if !self.covered[row * self.size.0 as usize + column] {
            return (Counts::default(), NOTHING);
        }
        if is_unseen {
            let colour = if self.view.clips_sky() { [0.0; 3] } else { self.params.sky };
            return (Counts { unseen: true, ..Counts::default() }, Shown::Known(colour, f32::INFINITY));
        }
        // A radius that was given is that of the nearest surface already.
        let ask_nearer = self.params.viewpoint_radius.is_none();
        let shown = match own {
            [] => fill(painter, column, row),
            _ => mix(painter, column, row, own, ask_nearer, depths),
        };
        let samples = painter.all.levels[0].samples_of(row * self.size.0 as usize + column);
        (Counts { samples, empty: own.is_empty(), unseen: false }, shown)
    }
}
