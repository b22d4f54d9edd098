//! The quadtree driver (Larson & Simmons 1999, §2.4.3), with leaves that know surfaces and noise.
//!
//! Samples are reprojected by their stored distance and summed by pixel and depth. A picture is drawn from leaves of the
//! quadtree over those sums: each pixel takes the mean of its own surface over the leaf that its samples ask for; an empty
//! leaf takes what its siblings have (the mean of its parent), as in the paper.
//!
//! The first picture of a view is a draft ([`Quadtree::draft`]), as every one is while the camera moves.
//!
//! What always holds:
//! - The picture is a function of the set of samples: their order and batches change no bit of it.
//! - No mean is taken across a jump in depth.
//! - As samples grow, every pixel tends to the mean of its own samples: the box filter. But what stands before a section that the eye is
//!   not in hides what its rays see behind.
//! - A pixel whose middle no section covers is 0, whatever its neighbours are.
//! - A pixel whose middle's best beam sees nothing is the sky (black if the view clips it), exactly: it is known, with or without samples.

mod around;
mod beams;
pub mod cells;
mod bins;
mod depths;
mod draft;
mod drawing;
mod keep;
mod leaf;
mod live;
mod paint;
mod pixels;
mod pyramid;
mod quarters;
mod reproject;
mod shown;
mod standing;
mod sums;
mod surface;
mod tile;
mod transpose;
mod wide;

use holo_cpu::{Isa, Kernel};
use holo_cpu::zeroed;
use bins::{BINS_KEPT, PixelBins, merged};
use draft::Draft;
use drawing::Drawing;
use glam::DVec3;
use holo_display::{Camera, DistanceTable, Frame, PlacedSection, best_beam, candidates, covered};
use holo_picture::{Picture, View};
use holo_section::{BeamId, Sample, Section};
use keep::Kept;
pub use keep::REFETCH_DEGREES;
use pyramid::{Level, Source};
use reproject::{BATCH, BeamProjector, Landing, Projected};
use std::collections::HashSet;
use std::sync::Arc;
use sums::Colour;
use wide::Agreement;

/// Paths a sample counts for at most: enough that more are not told apart, few enough that no sample overflows a sum.
const MAX_PATHS: u16 = 1024;
/// Share of a leaf's samples that its nearest surface needs to be what an empty pixel of the leaf shows.
const SEEN_SHARE: f32 = 0.25;

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
        Self {
            viewpoint_radius: None,
            leaf: LeafSize::Adaptive,
            max_level: 16,
            sky: [0.0; 3],
            keep: 0,
        }
    }
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
    isa: Isa,
    distances: DistanceTable,
    /// Samples that look as the eye does, and from where it is or before: not of rays that begin ahead of it.
    narrow: PixelBins,
    /// All others; of no pixels as long as there are none.
    wide: PixelBins,
    covered: Vec<bool>,
    uncovered_pixels: u64,
    /// Whether rays of some pixels may begin ahead of the eye.
    is_outside: bool,
    unseen: HashSet<(u16, BeamId)>,
    kept: Kept,
    /// The last picture that [`redraw`](Self::redraw) gave, and what it was drawn from.
    drawing: Option<Box<Drawing>>,
    /// One that is of no more use but for its memory.
    old: Option<Box<Drawing>>,
    /// The last draft.
    draft: Option<Box<Draft>>,
    /// Whether [`redraw`](Self::redraw) has given a picture of this view.
    is_begun: bool,
    /// Samples that landed, and unseen beams, since the last [`redraw`](Self::redraw); a new view is a change, too.
    changes: u64,
    /// Those of one batch that landed: pixel, landing, colour.
    arrived: Vec<(usize, Landing, [u8; 4])>,
    /// Scratch.
    projected: Box<Projected>,
    /// Best beam of every pixel's middle; empty while no unseen beam is known, since a scene may have none.
    best: Vec<Option<(u16, BeamId)>>,
}

impl Quadtree {
    /// An empty picture of `size` pixels, as from [`View::resolve`], which bounds it: memory is in proportion.
    pub fn new(
        sections: Arc<[Section]>,
        view: View,
        size: (u32, u32),
        params: QuadtreeParams,
    ) -> Self {
        let pixels = size.0 as usize * size.1 as usize;
        let mut quadtree = Self {
            placed: Vec::new(),
            camera: Camera::new(&view, size),
            distances: DistanceTable::new(),
            narrow: PixelBins::new(pixels),
            wide: PixelBins::new(0),
            covered: Vec::new(),
            uncovered_pixels: 0,
            is_outside: false,
            unseen: HashSet::new(),
            kept: Kept::default(),
            drawing: None,
            old: None,
            draft: None,
            is_begun: false,
            changes: 1,
            arrived: Vec::with_capacity(BATCH),
            projected: Box::new(Projected::new()),
            best: Vec::new(),
            sections,
            view,
            size,
            params,
            isa: Isa::best(),
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
        self.give_up_drawing();
        self.is_begun = false;
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
        self.insert_and_tell(section, beam, paths, samples, &mut |_, _, _| {});
    }

    /// Sums samples, and tells of each that landed its pixel, where in it, and its colour.
    fn land(
        &mut self,
        section: u16,
        beam: BeamId,
        paths: u16,
        samples: &[Sample],
        also: &mut impl FnMut(usize, &Landing, [u8; 4]),
    ) {
        let Some((known, placed)) =
            self.sections.get(usize::from(section)).zip(self.placed.get(usize::from(section)))
        else {
            return;
        };
        let Some(pair) = known.cells(beam) else { return };
        let radius = self.params.viewpoint_radius;
        let projector =
            BeamProjector::new(placed, pair, &self.camera, self.size, radius, &self.distances);
        let Self { narrow, wide, arrived, projected, .. } = self;
        let paths = u32::from(paths.clamp(1, MAX_PATHS));
        for samples in samples.chunks(BATCH) {
            let (narrow, wide) = (&mut *narrow, &mut *wide);
            self.isa.run(Land {
                projector: &projector,
                samples,
                paths,
                size: self.size,
                narrow,
                wide,
                arrived,
                projected,
                also,
            });
            self.changes += arrived.len() as u64;
            let landed = arrived.iter().map(|(pixel, ..)| *pixel);
            if self.drawing.as_mut().is_some_and(|drawing| !drawing.has_landed(landed)) {
                self.old = self.drawing.take();
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
        if self.sections.get(usize::from(section)).is_some_and(|known| beam.0 < known.beam_count())
        {
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
        let pyramids = Pyramids::new(self, None);
        let agreement = self.agreement(&pyramids);
        let mut frame = self.empty_frame();
        let (mut counts, mut reach) = (zeroed(frame.depth.len()), zeroed(frame.depth.len()));
        let depths =
            self.paint_all(&pyramids, agreement.as_ref(), &mut frame, &mut counts, &mut reach);
        (frame, depths)
    }

    /// Everything is to be drawn again.
    fn give_up_drawing(&mut self) {
        self.old = self.drawing.take().or(self.old.take());
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

    /// What a pyramid over some bins is made from.
    fn source<B>(&self, bins: impl Fn(usize) -> B) -> Source<impl Fn(usize) -> B, impl Fn(usize)> {
        let size = (self.size.0 as usize, self.size.1 as usize);
        let levels = usize::from(self.params.max_level);
        Source { size, levels, bins, prefetch: |pixel| self.prefetch(pixel), isa: self.isa }
    }

    /// Asks for the sums of a pixel.
    #[inline(always)]
    fn prefetch(&self, pixel: usize) {
        self.narrow.prefetch_all_sums(pixel);
        self.wide.prefetch_all_sums(pixel);
    }

    /// Works out all that depends on the view but on no sample.
    fn place(&mut self) {
        self.placed =
            self.sections.iter().map(|section| PlacedSection::new(section, &self.camera)).collect();
        self.covered = covered(&self.sections, &self.view, self.size);
        self.uncovered_pixels = self.covered.iter().filter(|&&covered| !covered).count() as u64;
        self.is_outside = self.looks_from_outside();
        let eye = self.view.vp;
        // From outside of all sections, what stands before them is looked for pixel by pixel (`standing`).
        for (placed, section) in self.placed.iter_mut().zip(self.sections.iter()) {
            placed.is_elsewhere = !self.is_outside && !section.contains(eye);
        }
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

    /// Whether pixels may show something else than samples.
    fn may_hide_pixels(&self) -> bool {
        self.uncovered_pixels > 0 || !self.best.is_empty()
    }

    /// Whether a pixel's best beam is known to see nothing.
    fn sees_nothing(&self, pixel: usize) -> bool {
        self.best
            .get(pixel)
            .is_some_and(|best| best.is_some_and(|best| self.unseen.contains(&best)))
    }

    /// The view rays of the pixels' middles, row by row.
    fn middles(&self) -> impl Iterator<Item = (DVec3, DVec3)> {
        let (width, height) = self.size;
        (0..height).flat_map(move |row| (0..width).map(move |column| self.middle(column, row)))
    }

    /// The view ray of a pixel's middle.
    fn middle(&self, column: u32, row: u32) -> (DVec3, DVec3) {
        let (x, y) = View::pixel_centre(self.size, column, row);
        let ray = self.view.clipped_ray(x, y);
        ray.map_or((self.view.vp, DVec3::ZERO), |(origin, direction, _)| (origin, direction))
    }
}

/// Sums the samples of a batch.
struct Land<'a, A> {
    projector: &'a BeamProjector<'a>,
    samples: &'a [Sample],
    paths: u32,
    size: (u32, u32),
    narrow: &'a mut PixelBins,
    wide: &'a mut PixelBins,
    /// Those that landed, once it is run.
    arrived: &'a mut Vec<(usize, Landing, [u8; 4])>,
    projected: &'a mut Projected,
    also: &'a mut A,
}

impl<A: FnMut(usize, &Landing, [u8; 4])> Kernel for Land<'_, A> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { projector, samples, paths, size, narrow, wide, arrived, projected, also } = self;
        let width = size.0 as usize;
        arrived.clear();
        projector.project(samples, projected);
        for (at, sample) in samples.iter().enumerate() {
            if let Some(landing) = projector.land(projected, at) {
                let pixel = landing.row * width + landing.column;
                if !landing.narrow && !wide.has_pixels() {
                    *wide = PixelBins::new(width * size.1 as usize);
                }
                let bins = if landing.narrow { &*narrow } else { &*wide };
                bins.prefetch_pixel(pixel);
                let rgbe = if landing.is_black { [0; 4] } else { sample.rgbe };
                arrived.push((pixel, landing, rgbe));
            }
        }
        for (pixel, landing, _) in &*arrived {
            let bins = if landing.narrow { &*narrow } else { &*wide };
            bins.prefetch_further(*pixel, landing.bin);
        }
        for (pixel, landing, rgbe) in &*arrived {
            let bins = if landing.narrow { &mut *narrow } else { &mut *wide };
            bins.add(
                *pixel,
                landing.bin,
                &Colour::from_rgbe(*rgbe),
                landing.weight * paths,
                landing.near,
            );
            also(*pixel, landing, *rgbe);
        }
    }
}

/// The leaves that a picture is drawn from.
#[derive(Default)]
struct Pyramids {
    narrow: Vec<Level>,
    /// None: narrow samples are all.
    all: Option<Vec<Level>>,
}

impl Pyramids {
    /// Of all samples so far. The memory of others is used again.
    fn new(tree: &Quadtree, memory: Option<Self>) -> Self {
        let (narrow, all) = memory.map_or((None, None), |memory| (Some(memory.narrow), memory.all));
        let narrow = tree.source(|pixel| tree.narrow.of(pixel)).pyramid(narrow);
        let merged = tree.source(|pixel| merged(&tree.narrow, &tree.wide, pixel));
        Self { narrow, all: (!tree.wide.is_empty()).then(|| merged.pyramid(all)) }
    }

    /// Makes those leaves anew, by level and number, to whose pixels samples have come.
    fn renew(&mut self, tree: &Quadtree, is_stale: &(impl Fn(usize, usize) -> bool + Sync)) {
        tree.source(|pixel| tree.narrow.of(pixel)).renew(&mut self.narrow, is_stale);
        if let Some(all) = &mut self.all {
            tree.source(|pixel| merged(&tree.narrow, &tree.wide, pixel)).renew(all, is_stale);
        }
    }

    fn all(&self) -> &[Level] {
        self.all.as_deref().unwrap_or(&self.narrow)
    }
}

const _: () = assert!(BINS_KEPT >= 2, "what is behind a silhouette needs a bin");

/// A section of a room, for tests.
#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
fn room() -> Section {
    Section::new(holo_section::SectionSpec {
        origin: [0.0; 3],
        axes: [[4.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0]],
        grid: [3; 3],
        class: holo_section::ViewClass::Interior,
        obstructions: true,
    })
    .unwrap()
}

/// A picture of the room from within, of such samples as [`add_any_samples`] adds, for tests.
#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
fn any_samples(size: (u32, u32), samples: usize) -> Quadtree {
    let view =
        View::new(DVec3::new(1.0, 1.5, 1.4), DVec3::X, DVec3::Z, Some(70.0), None, size).unwrap();
    let mut tree = Quadtree::new(Arc::from([room()]), view, size, QuadtreeParams::default());
    add_any_samples(&mut tree, samples);
    tree
}

/// Adds samples of any depth and colour, some of them equal, so that leaves have surfaces of every kind, for tests.
#[cfg(test)]
fn add_any_samples(tree: &mut Quadtree, samples: usize) {
    let beams = tree.sections[0].beam_count();
    let mut state = 11_u64;
    let mut random = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u32
    };
    for _ in 0..samples {
        let beam = u64::from(random()) % beams;
        // One half by place, so that leaves have quarters that differ.
        let exponent = [random(), beam as u32 / 5][random() as usize % 2] % 8;
        let rgbe = [100, 120, 140, 120 + exponent as u8];
        let code = [1200, random() % 3000][random() as usize % 2] as u16;
        let sample =
            Sample::from_codes(holo_section::RayCoords(random().to_le_bytes()), rgbe, code);
        tree.insert(0, BeamId(beam), 1, &[sample]);
    }
}
