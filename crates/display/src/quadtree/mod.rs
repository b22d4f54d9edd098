//! The quadtree driver (Larson & Simmons 1999, §2.4.3), with leaves that know surfaces and noise.
//!
//! Samples are reprojected by their stored distance and summed by pixel and depth. A picture is drawn from leaves of the
//! quadtree over those sums: each pixel takes the mean of its own surface over the leaf that its samples ask for; an empty
//! leaf takes what its siblings have (the mean of its parent), as in the paper.
//!
//! What always holds:
//! - The picture is a function of the set of samples: their order and batches change no bit of it.
//! - No mean is taken across a jump in depth.
//! - As samples grow, every pixel tends to the mean of its own samples: the box filter.
//! - A pixel whose middle no section covers is 0, whatever its neighbours are.
//! - A pixel whose middle's best beam sees nothing is the sky, exactly: it is known, with or without samples.

mod beams;
mod bins;
mod depths;
mod drawing;
mod keep;
mod leaf;
pub(crate) mod reproject;
mod surface;
mod wide;

use crate::camera::Camera;
use crate::candidates::{candidates, is_covered};
use bins::{BINS_AN_OCTAVE, BINS_KEPT, Colour, NEAR_CLASSES, PixelBins, bin_distance, merged};
use drawing::Drawing;
use glam::DVec3;
use holo_picture::{Picture, View};
use holo_section::{BeamId, Sample, Section};
use keep::Kept;
pub use keep::REFETCH_DEGREES;
use leaf::{Reader, beside, own_surface};
use reproject::{BeamProjector, DistanceTable, Landing, PlacedSection};
use std::collections::HashSet;
use std::sync::Arc;
use surface::{Level, Surface, gap_allowed, pyramid};
use wide::Agreement;

/// Paths a sample counts for at most: enough that more are not told apart, few enough that sums cannot overflow.
const MAX_PATHS: u16 = 1024;
/// Samples whose sums are fetched together: they lie anywhere, and one after another each would wait for memory twice.
const BATCH: usize = 32;
/// Side of the squares of pixels that are drawn one after the other.
const TILE: usize = 16;
/// Share of a leaf's samples that its nearest surface needs to be what an empty pixel of the leaf shows.
const SEEN_SHARE: f32 = 0.25;

/// Depth bins between a surface and one that hides it: a fifth of the distance.
const CLEARLY_IN_FRONT: u16 = 8;

/// Samples a pixel from which a surface without one is not there: with 2 expected, one pixel in seven has none.
const MANY_A_PIXEL: u32 = 2;

/// How large the leaves are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeafSize {
    /// By the samples: as large as noise asks and the picture allows.
    Adaptive,
    /// 2^n pixels a side everywhere (larger where empty): 0 shows each pixel's own samples. For comparison.
    Fixed(u8),
}

/// Settings of a [`Quadtree`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadtreeParams {
    /// How near to the eye, in scene units, a ray must pass to count as a sample of the pixel itself, which decides
    /// silhouettes. None: the pixel's footprint at the nearest surface that the pixel knows.
    pub viewpoint_radius: Option<f64>,
    /// How large the leaves are.
    pub leaf: LeafSize,
    /// Largest leaf: 2^n pixels a side. The whole picture if it is smaller, as by default: then any sample fills it.
    pub max_level: u8,
    /// Radiance of rays that meet nothing: what unseen beams show.
    pub sky: [f32; 3],
    /// Samples kept for the next view at most, some 11 bytes each; 0: none. Beyond, the older half goes.
    pub keep: usize,
}

impl Default for QuadtreeParams {
    fn default() -> Self {
        Self { viewpoint_radius: None, leaf: LeafSize::Adaptive, max_level: 16, sky: [0.0; 3], keep: 0 }
    }
}

/// A picture drawn from samples, and what is known of it.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Linear radiance, row 0 at the top; 0 where nothing is known.
    pub picture: Picture,
    /// Distance from the eye in scene units (to the depth bin, within 1.6 %) for each pixel as in `picture`: infinite
    /// where nothing was hit, 0 where nothing is known.
    pub depth: Vec<f32>,
    /// Pixels that no section covers: they are 0.
    pub uncovered_pixels: u64,
    /// Covered pixels without samples of their own: filled from larger leaves, or 0 if there is nothing at all.
    pub empty_pixels: u64,
    /// Pixels that show the sky because their beam sees nothing; neither empty nor made of samples.
    pub unseen_pixels: u64,
    /// Samples that the picture was made of.
    pub samples_used: u64,
}

/// Pixels whose samples are of several depths (Larson & Simmons 1999, Figure 6), or of one that should not be seen there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MultiDepth {
    /// Resolved by samples that pass near the eye: they see the pixel itself, and their shares are the surfaces'.
    pub by_near_samples: u64,
    /// Resolved across leaves: the surface that most samples around are of hides what the pixel's own samples saw past its edge.
    pub by_leaves: u64,
    /// What remains: the nearest surface is shown, which may cover too much of the pixel.
    pub remaining: u64,
}

/// The quadtree driver: samples in, pictures out.
pub struct Quadtree {
    sections: Arc<[Section]>,
    placed: Vec<PlacedSection>,
    view: View,
    camera: Camera,
    size: (u32, u32),
    params: QuadtreeParams,
    distances: DistanceTable,
    /// Samples that look as the eye does.
    narrow: PixelBins,
    /// All others; of no pixels as long as there are none.
    wide: PixelBins,
    covered: Vec<bool>,
    uncovered_pixels: u64,
    unseen: HashSet<(u16, BeamId)>,
    kept: Kept,
    /// The last picture that [`redraw`](Self::redraw) gave, and what it was drawn from.
    drawing: Option<Box<Drawing>>,
    /// Samples that landed, and unseen beams, since the last [`redraw`](Self::redraw); a new view is a change, too.
    changes: u64,
    /// Those of one batch that landed: pixel, landing, colour.
    arrived: Vec<(usize, Landing, [u8; 4])>,
    /// Best beam of every pixel's middle; empty while no unseen beam is known, since a scene may have none.
    best: Vec<Option<(u16, BeamId)>>,
}

impl Quadtree {
    /// An empty picture of `size` pixels, as from [`View::resolve`], which bounds it: memory is in proportion.
    pub fn new(sections: Arc<[Section]>, view: View, size: (u32, u32), params: QuadtreeParams) -> Self {
        let pixels = size.0 as usize * size.1 as usize;
        let mut quadtree = Self {
            placed: Vec::new(),
            camera: Camera::new(&view, size),
            distances: DistanceTable::new(),
            narrow: PixelBins::new(pixels),
            wide: PixelBins::new(0),
            covered: Vec::new(),
            uncovered_pixels: 0,
            unseen: HashSet::new(),
            kept: Kept::default(),
            drawing: None,
            changes: 1,
            arrived: Vec::with_capacity(BATCH),
            best: Vec::new(),
            sections,
            view,
            size,
            params,
        };
        quadtree.place();
        quadtree
    }

    /// Forgets all samples and unseen beams and takes another view of the same size.
    pub fn reset(&mut self, view: View) {
        self.view = view;
        self.camera = Camera::new(&view, self.size);
        self.narrow.clear();
        self.wide.clear();
        self.unseen.clear();
        self.kept.clear();
        self.drawing = None;
        self.changes = 1;
        self.place();
    }

    /// The view shown.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// The radius of [`QuadtreeParams::viewpoint_radius`], for samples still to come.
    pub fn set_viewpoint_radius(&mut self, radius: Option<f64>) {
        self.params.viewpoint_radius = radius;
    }

    /// Adds samples of one beam, each the mean of `paths` paths.
    ///
    /// Samples of an unknown section or beam are left out: a driver has no use for them, and nothing depends on them.
    pub fn insert(&mut self, section: u16, beam: BeamId, paths: u16, samples: &[Sample]) {
        if self.sections.get(usize::from(section)).is_some_and(|known| beam.0 < known.beam_count()) {
            self.kept.add(section, beam, paths, samples, self.params.keep);
            self.land(section, beam, paths, samples);
        }
    }

    fn land(&mut self, section: u16, beam: BeamId, paths: u16, samples: &[Sample]) {
        let Some((known, placed)) = self.sections.get(usize::from(section)).zip(self.placed.get(usize::from(section)))
        else {
            return;
        };
        let Some(pair) = known.cells(beam) else { return };
        let radius = self.params.viewpoint_radius;
        let projector = BeamProjector::new(placed, pair, &self.camera, self.size, radius, &self.distances);
        let paths = u32::from(paths.clamp(1, MAX_PATHS));
        let width = self.size.0 as usize;
        for samples in samples.chunks(BATCH) {
            self.arrived.clear();
            for sample in samples {
                if let Some(landing) = projector.land(sample) {
                    let pixel = landing.row * width + landing.column;
                    if !landing.narrow && !self.wide.has_pixels() {
                        self.wide = PixelBins::new(width * self.size.1 as usize);
                    }
                    let bins = if landing.narrow { &self.narrow } else { &self.wide };
                    bins.prefetch_pixel(pixel);
                    self.arrived.push((pixel, landing, sample.rgbe));
                }
            }
            for (pixel, landing, _) in &self.arrived {
                let bins = if landing.narrow { &self.narrow } else { &self.wide };
                bins.prefetch_sums(*pixel, landing.bin);
            }
            for (pixel, landing, rgbe) in &self.arrived {
                let bins = if landing.narrow { &mut self.narrow } else { &mut self.wide };
                bins.add(*pixel, landing.bin, &Colour::from_rgbe(*rgbe), landing.weight * paths, landing.near);
            }
            self.changes += self.arrived.len() as u64;
            let landed = self.arrived.iter().map(|(pixel, ..)| *pixel);
            if self.drawing.as_mut().is_some_and(|drawing| !drawing.has_landed(landed)) {
                self.drawing = None;
            }
        }
    }

    /// Takes in that no ray of a beam meets anything: pixels that it serves best show the sky.
    ///
    /// Unknown sections and beams are left out, as in [`insert`](Self::insert).
    pub fn insert_unseen(&mut self, section: u16, beam: BeamId) {
        if self.best.is_empty() {
            self.best = self.best_beams();
        }
        if self.sections.get(usize::from(section)).is_some_and(|known| beam.0 < known.beam_count()) {
            self.unseen.insert((section, beam));
            self.changes += 1;
        }
    }

    /// The picture of all samples so far.
    pub fn draw(&self) -> Frame {
        self.draw_and_count().0
    }

    /// The picture of all samples so far, and how samples of several depths were resolved in it.
    pub fn draw_and_count(&self) -> (Frame, MultiDepth) {
        let pyramids = Pyramids::new(self);
        let (agreement, mut depths) = (self.agreement(&pyramids), MultiDepth::default());
        let painter = Painter::new(&pyramids, agreement.as_ref(), &self.params);
        let mut frame = self.empty_frame();
        let mut unseen = UnseenPixels::default();
        for (column, row) in in_tiles(self.size) {
            let pixel = row * self.size.0 as usize + column;
            frame.show(pixel, &self.paint(&painter, column, row, unseen.has(self, pixel), &mut depths));
        }
        (frame, depths)
    }

    fn empty_frame(&self) -> Frame {
        let mut picture = Picture::new(self.size.0, self.size.1);
        picture.view = Some(self.view);
        Frame {
            depth: vec![0.0; picture.pixels.len()],
            picture,
            uncovered_pixels: self.uncovered_pixels,
            empty_pixels: 0,
            unseen_pixels: 0,
            samples_used: 0,
        }
    }

    /// What has been found of agreement between all samples and narrow ones: nothing yet.
    fn agreement(&self, pyramids: &Pyramids) -> Option<Agreement> {
        pyramids.all.is_some().then(|| Agreement::new(self.size.0 as usize, self.size.1 as usize))
    }

    /// What a pixel shows.
    fn paint(&self, painter: &Painter, column: usize, row: usize, is_unseen: bool, depths: &mut MultiDepth) -> Painted {
        if !self.covered[row * self.size.0 as usize + column] {
            return Painted::default();
        }
        if is_unseen {
            let counts = Counts { unseen: true, ..Counts::default() };
            return Painted { colour: self.params.sky, depth: f32::INFINITY, counts };
        }
        let own = painter.all.levels[0].leaf(column, row);
        // A radius that was given is that of the nearest surface already.
        let ask_nearer = self.params.viewpoint_radius.is_none();
        let shown = if own.is_empty() {
            fill(painter, column, row)
        } else {
            mix(painter, column, row, own, ask_nearer, depths)
        };
        let (colour, depth) = shown.map_or(([0.0; 3], 0.0), |(colour, bin)| (colour, bin_distance(bin)));
        let samples = own.iter().fold(0_u32, |sum, surface| sum.saturating_add(surface.count));
        Painted { colour, depth, counts: Counts { samples, empty: own.is_empty(), unseen: false } }
    }

    /// Asks for the sums of a pixel.
    fn prefetch(&self, pixel: usize) {
        self.narrow.prefetch_all_sums(pixel);
        self.wide.prefetch_all_sums(pixel);
    }

    /// Works out all that depends on the view but on no sample.
    fn place(&mut self) {
        self.placed = self.sections.iter().map(|section| PlacedSection::new(section, &self.camera)).collect();
        let mut hint = 0;
        self.covered = self.middles().map(|(eye, along)| is_covered(&self.sections, eye, along, &mut hint)).collect();
        self.uncovered_pixels = self.covered.iter().filter(|&&covered| !covered).count() as u64;
        self.best.clear();
    }

    /// The best beam for the middle of every pixel, by the rule of beam selection.
    fn best_beams(&self) -> Vec<Option<(u16, BeamId)>> {
        let mut found = Vec::new();
        let best = |(eye, along)| {
            candidates(&self.sections, eye, along, &mut found);
            found.first().map(|best| (best.section, best.beam))
        };
        self.middles().map(best).collect()
    }

    /// Whether a pixel's best beam is known to see nothing.
    fn sees_nothing(&self, pixel: usize) -> bool {
        self.best.get(pixel).is_some_and(|best| best.is_some_and(|best| self.unseen.contains(&best)))
    }

    /// The view rays of the pixels' middles, row by row.
    fn middles(&self) -> impl Iterator<Item = (DVec3, DVec3)> {
        let (width, height) = self.size;
        (0..height).flat_map(move |row| (0..width).map(move |column| self.middle(column, row)))
    }

    /// The view ray of a pixel's middle.
    fn middle(&self, column: u32, row: u32) -> (DVec3, DVec3) {
        let (x, y) = View::pixel_centre(self.size, column, row);
        self.view.ray(x, y)
    }
}

/// A pixel of a picture.
#[derive(Clone, Copy, Default)]
struct Painted {
    colour: [f32; 3],
    depth: f32,
    counts: Counts,
}

/// What a pixel is counted as.
#[derive(Clone, Copy, Default)]
struct Counts {
    /// Samples of its own.
    samples: u32,
    empty: bool,
    unseen: bool,
}

impl Frame {
    /// Shows a pixel that is not counted.
    fn show(&mut self, pixel: usize, painted: &Painted) {
        self.picture.pixels[pixel] = painted.colour;
        self.depth[pixel] = painted.depth;
        self.empty_pixels += u64::from(painted.counts.empty);
        self.unseen_pixels += u64::from(painted.counts.unseen);
        self.samples_used += u64::from(painted.counts.samples);
    }

    /// No longer counts a pixel.
    fn hide(&mut self, counts: &Counts) {
        self.empty_pixels -= u64::from(counts.empty);
        self.unseen_pixels -= u64::from(counts.unseen);
        self.samples_used -= u64::from(counts.samples);
    }
}

/// Columns and rows of a picture's pixels, tile by tile: neighbours in both directions mostly have the same noise.
fn in_tiles((width, height): (u32, u32)) -> impl Iterator<Item = (usize, usize)> {
    let (width, height) = (width as usize, height as usize);
    let tiles = (0..height).step_by(TILE).flat_map(move |top| (0..width).step_by(TILE).map(move |left| (left, top)));
    tiles.flat_map(move |(left, top)| {
        let columns = left..(left + TILE).min(width);
        (top..(top + TILE).min(height)).flat_map(move |row| columns.clone().map(move |column| (column, row)))
    })
}

/// Which pixels' best beams are known to see nothing, of pixels in order: neighbouring ones mostly have the same beam.
#[derive(Default)]
struct UnseenPixels {
    last: (Option<(u16, BeamId)>, bool),
}

impl UnseenPixels {
    fn has(&mut self, tree: &Quadtree, pixel: usize) -> bool {
        let Some(best) = tree.best.get(pixel) else { return false };
        if self.last.0 != *best {
            self.last = (*best, tree.sees_nothing(pixel));
        }
        self.last.1
    }
}

/// The leaves that a picture is drawn from.
struct Pyramids {
    narrow: Vec<Level>,
    /// None: narrow samples are all.
    all: Option<Vec<Level>>,
}

impl Pyramids {
    fn new(tree: &Quadtree) -> Self {
        let (width, height) = (tree.size.0 as usize, tree.size.1 as usize);
        let most = usize::from(tree.params.max_level);
        let narrow = pyramid(|pixel| tree.narrow.of(pixel), |pixel| tree.prefetch(pixel), width, height, most);
        let all = (!tree.wide.is_empty()).then(|| {
            pyramid(|pixel| merged(&tree.narrow, &tree.wide, pixel), |pixel| tree.prefetch(pixel), width, height, most)
        });
        Self { narrow, all }
    }

    fn all(&self) -> &[Level] {
        self.all.as_deref().unwrap_or(&self.narrow)
    }
}

/// Reads colours from all samples, or from those that look as the eye does where the others differ.
struct Painter<'a> {
    all: Reader<'a>,
    /// None: all are.
    narrow: Option<(Reader<'a>, &'a Agreement)>,
}

impl<'a> Painter<'a> {
    fn new(pyramids: &'a Pyramids, agreement: Option<&'a Agreement>, params: &'a QuadtreeParams) -> Self {
        let narrow = agreement.map(|agreement| (Reader::new(&pyramids.narrow, params), agreement));
        Self { all: Reader::new(pyramids.all(), params), narrow }
    }

    /// The highest level that colours were read from since this was last asked.
    fn reach(&self) -> usize {
        let narrow = self.narrow.as_ref().map_or(0, |(narrow, _)| narrow.reach.take());
        self.all.reach.take().max(narrow)
    }
}

impl Painter<'_> {
    /// As [`Reader::colour`].
    fn colour(&self, column: usize, row: usize, start: usize, bins: (u16, u16)) -> [f32; 3] {
        let all = self.all.colour(column, row, start, bins);
        let Some((narrow, agreement)) = &self.narrow else { return all };
        let share = agreement.of(&self.all, narrow, column, row, bins);
        if share == 1.0 {
            return all;
        }
        // From the smallest leaf that has any: the comparison found one. Few as they are there, they may all lie a bin beside.
        let start = (start..narrow.levels.len()).find_map(|level| {
            let leaf = narrow.levels[level].leaf(column >> level, row >> level);
            beside(leaf, bins, gap_allowed(level)).map(|surface| (level, surface.bins))
        });
        let Some((start, bins)) = start else { return all };
        let own = narrow.colour(column, row, start, bins);
        [0, 1, 2].map(|channel| own[channel] + share * (all[channel] - own[channel]))
    }
}

/// Colour and nearest bin of a pixel with samples of its own.
///
/// Samples that pass near the eye are samples of this very pixel: their shares are the surfaces' coverage, which is what
/// makes a silhouette smooth. With none of them the nearest surface is what is seen: whatever lies behind was seen past its
/// edge.
fn mix(
    painter: &Painter,
    column: usize,
    row: usize,
    own: &[Surface],
    ask_nearer: bool,
    depths: &mut MultiDepth,
) -> Option<([f32; 3], u16)> {
    let front = own.first()?;
    let near = |surface: &Surface| near_count(surface, front, ask_nearer);
    let all: f32 = own.iter().map(near).sum();
    let alone = || Some((painter.colour(column, row, 0, front.bins), front.bins.0));
    if all == 0.0 {
        let covered = covering(painter, column, row, front);
        depths.by_leaves += u64::from(covered.is_some());
        depths.remaining += u64::from(covered.is_none() && own.len() > 1);
        return covered.or_else(alone);
    }
    if own.len() == 1 {
        return alone();
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
    nearest.map(|bin| (colour, bin))
}

/// Colour and nearest bin of a surface that hides a pixel's front surface, though the pixel has no sample of it.
///
/// Where samples are few, those of a far surface show through between those of a near one, having looked past its edge (the
/// paper's Figure 6). A surface in front that most samples of the 4 × 4 or 2 × 2 pixels around are of is taken to go on
/// here, unless it has so many samples that it would have had one here. Only for pixels with no sample near the eye: those
/// see for themselves. On a disc before a wall eight times as far, batch samples of a 4³ grid, this took a tenth (0.4 a
/// pixel) to four tenths (1 to 3 a pixel) off the error; a third instead of a half made some worse. On a ball before a near
/// wall, 16³ grid, it costs 0.1 to 0.4 dB.
fn covering(painter: &Painter, column: usize, row: usize, front: &Surface) -> Option<([f32; 3], u16)> {
    [2, 1].into_iter().find_map(|level| {
        let leaf = painter.all.levels.get(level)?.leaf(column >> level, row >> level);
        let all: f32 = leaf.iter().map(|surface| surface.count as f32).sum();
        let hides = |surface: &&Surface| {
            surface.bins.1.saturating_add(CLEARLY_IN_FRONT) < front.bins.0
                && surface.count as f32 >= 0.5 * all
                && surface.count <= MANY_A_PIXEL << (2 * level)
        };
        let hiding = leaf.iter().find(hides)?;
        Some((painter.colour(column, row, level, hiding.bins), hiding.bins.0))
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
    surface.near.iter().skip(halvings.min(NEAR_CLASSES - 1)).map(|&count| count as f32).sum()
}

/// Colour and nearest bin of a pixel without samples: those of the smallest leaf around it that has any.
fn fill(painter: &Painter, column: usize, row: usize) -> Option<([f32; 3], u16)> {
    painter.all.levels.iter().enumerate().skip(1).find_map(|(level, leaves): (usize, &Level)| {
        let leaf = leaves.leaf(column >> level, row >> level);
        let all: f32 = leaf.iter().map(|surface| surface.count as f32).sum();
        let seen = leaf.iter().find(|surface| surface.count as f32 >= SEEN_SHARE * all)?;
        let bins = own_surface(leaf, seen.bins)?.bins;
        Some((painter.colour(column, row, level, bins), bins.0))
    })
}

const _: () = assert!(BINS_KEPT >= 2, "what is behind a silhouette needs a bin");
