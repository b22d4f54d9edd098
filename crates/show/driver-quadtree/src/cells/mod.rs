//! Cells of samples, bounded by the samples' own depth: a Voronoi diagram without a scene (Larson &
//! Simmons 1999, §2.4.4).
//!
//! Samples are projected and summed as in the [`Quadtree`]. A pixel with samples shows the same as
//! in the quadtree: the mean over as many pixels as noise needs. If only few samples are around,
//! and they are clean, the pixel shows the nearest ones instead, which are better than a mean
//! ([`local`]). A pixel without samples belongs to the sample nearest to it in the picture
//! ([`nearest`]). Samples that a nearer surface hides are left out ([`hidden`]). The pixel shows
//! the colour of its sample ([`Filling::Constant`]), or a colour that is interpolated between
//! samples of the same surface ([`fill`]).
//!
//! Smooth pictures have no holes. The paper's constant cells have a greatest radius ([`radius`]).
//! Between them the paper showed the scene; here those pixels stay black.
//!
//! Invariants:
//! - The picture is a function of the set of samples. Their order and batches change no bit of it.
//! - A pixel between samples shows the surface of its nearest sample. Depths separate surfaces
//!   ([`step`]).
//! - As the number of samples grows, a smooth pixel tends to the mean of its own samples. A
//!   constant pixel tends to one sample near its middle.
//! - A pixel that no section covers is 0. A pixel whose best beam sees nothing is the sky, or black
//!   if the view clips it.

mod fill;
mod hidden;
mod local;
mod nearest;
mod radius;
mod sites;
mod squares;
mod step;
mod window;

use crate::pixels::{PixelState, bin_of};
use crate::{Quadtree, QuadtreeParams};
use fill::{NEIGHBOURS, PixelSample, between};
use holo_display::Frame;
use holo_picture::View;
use holo_section::{BeamKey, Sample, Section, rgbe};
use nearest::TiledPoints;
use radius::Radii;
use sites::{Site, Sites};
use std::sync::Arc;
use step::DepthSteps;
use window::Near;

/// How cells are filled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filling {
    /// Colours are interpolated between samples, and there are no holes. Pixels with samples show
    /// the same as in a [`Quadtree`], or the nearest samples if only few are around and they are
    /// clean.
    #[default]
    Smooth,
    /// The paper's cells. Each cell shows the colour of one sample: of a pixel's nearest depth bin,
    /// the sample nearest to the pixel's middle. A cell covers at most 0.01 % to 10 % of the
    /// picture's area, less where samples are dense. Pixels that no cell reaches are 0.
    Constant,
}

/// Samples of one view, and pictures of their cells.
pub struct ViewCells {
    tree: Quadtree,
    sites: Sites,
    filling: Filling,
}

/// The state of the pixels of a picture, row by row.
struct Pixels {
    known: Vec<PixelState>,
    /// Depth of the pixel's sample, or of the picture if the pixel has none.
    depth: Vec<f32>,
    /// True if a nearer surface hides the surface of the pixel's sample.
    hidden: Vec<bool>,
    /// True if the quadtree shows a nearer surface than the pixel's sample, because most samples
    /// around belong to it.
    disputed: Vec<bool>,
}

impl Pixels {
    /// Returns whether a pixel shows a sample of its own surface.
    fn shows_sample(&self, pixel: usize) -> bool {
        !self.hidden[pixel]
            && !self.disputed[pixel]
            && matches!(self.known[pixel], PixelState::Afar | PixelState::Near)
    }

    /// Returns whether a pixel is to be filled from the samples around it.
    fn is_open(&self, pixel: usize) -> bool {
        self.hidden[pixel] || self.disputed[pixel] || self.known[pixel] == PixelState::Nothing
    }
}

impl ViewCells {
    /// Returns empty cells for a picture of `size` pixels. Memory is in proportion to the size,
    /// which [`View::resolve`] bounds. `params` are those of the quadtree.
    pub fn new(
        sections: Arc<[Section]>,
        view: View,
        size: (u32, u32),
        filling: Filling,
        params: QuadtreeParams,
    ) -> Self {
        Self {
            tree: Quadtree::new(sections, view, size, params),
            sites: Sites::new(size.0 as usize * size.1 as usize),
            filling,
        }
    }

    /// Adds samples as [`Quadtree::insert`] does.
    pub fn insert(&mut self, key: BeamKey, paths: u16, samples: &[Sample]) {
        let sites = &mut self.sites;
        self.tree.insert_with(key, paths, samples, |pixel, landing, rgbe| {
            sites.add(pixel, Site::new(landing, rgbe));
        });
    }

    /// Marks a beam as unseen, as [`Quadtree::insert_unseen`] does.
    pub fn insert_unseen(&mut self, key: BeamKey) {
        self.tree.insert_unseen(key);
    }

    /// Returns the quadtree of the same samples.
    pub fn quadtree(&self) -> &Quadtree {
        &self.tree
    }

    /// Draws the picture of all samples so far.
    pub fn draw(&self) -> Frame {
        match self.filling {
            Filling::Smooth => self.smooth(),
            Filling::Constant => self.constant(),
        }
    }

    /// Draws smooth cells: the quadtree's picture, with other colours between its samples.
    fn smooth(&self) -> Frame {
        let mut frame = self.tree.draw();
        let pixels = self.pixels(&frame);
        let points = TiledPoints::new(self.size(), |pixel| pixels.shows_sample(pixel));
        self.sharpen(&pixels, &points, &mut frame);
        self.fill(&pixels, &points, &mut frame);
        frame
    }

    /// Replaces the quadtree's means by single samples where these predict colours better.
    fn sharpen(&self, pixels: &Pixels, points: &TiledPoints, frame: &mut Frame) {
        let has_few = self.tree.has_few();
        let is_candidate = |pixel: usize| {
            let is_shown = |site: &Site| site.depth() == pixels.depth[pixel];
            has_few[pixel]
                && pixels.shows_sample(pixel)
                && points.count_around(pixel) <= local::MANY
                && self.sites.of(pixel).is_some_and(is_shown)
        };
        let candidates: Vec<bool> = (0..has_few.len()).map(is_candidate).collect();
        let single = |pixel: usize| {
            let site = self.sites.of(pixel);
            PixelSample {
                colour: site.map_or(frame.picture.pixels[pixel], |site| rgbe::decode(site.rgbe)),
                depth: pixels.depth[pixel],
                aside: site.map_or([0.0; 2], Site::aside),
            }
        };
        let mean = |pixel: usize| frame.picture.pixels[pixel];
        let steps = DepthSteps(&self.tree);
        let sharp = local::local(points, self.size(), &candidates, single, mean, &steps);
        for (colour, sharp) in frame.picture.pixels.iter_mut().zip(sharp) {
            *colour = sharp.unwrap_or(*colour);
        }
    }

    /// Fills the pixels between samples.
    fn fill(&self, pixels: &Pixels, points: &TiledPoints, frame: &mut Frame) {
        let seen = |pixel: usize| PixelSample {
            colour: frame.picture.pixels[pixel],
            depth: pixels.depth[pixel],
            aside: self.sites.of(pixel).map_or([0.0; 2], Site::aside),
        };
        // A disputed sample that is not hidden belongs to the pixel's own surface.
        let own = |pixel: usize| {
            let is_own = pixels.disputed[pixel] && !pixels.hidden[pixel];
            let site = self.sites.of(pixel).filter(|_| is_own)?;
            Some(PixelSample {
                colour: rgbe::decode(site.rgbe),
                depth: site.depth(),
                aside: site.aside(),
            })
        };
        let steps = DepthSteps(&self.tree);
        let mut filled: Vec<Option<PixelSample>> = vec![None; pixels.known.len()];
        points.for_each::<NEIGHBOURS, _>(
            &mut filled,
            |pixel| pixels.is_open(pixel),
            |pixel, nearest, filled| *filled = between(nearest, own(pixel), seen, &steps),
        );
        let shown = frame.picture.pixels.iter_mut().zip(&mut frame.depth);
        for ((colour, depth), filled) in shown.zip(filled) {
            if let Some(filled) = filled {
                (*colour, *depth) = (filled.colour, filled.depth);
            }
        }
    }

    /// Draws constant cells.
    fn constant(&self) -> Frame {
        let known = self.tree.known();
        let depth = |pixel: usize| self.sites.of(pixel).map_or(0.0, Site::depth);
        let depth: Vec<f32> = (0..known.len()).map(depth).collect();
        let hidden = self.hidden(&known, &depth);
        let has_site = |pixel: usize| self.sites.of(pixel).is_some() && !hidden[pixel];
        let points = TiledPoints::new(self.size(), has_site);
        let radii = Radii::new(self.size(), (0..known.len()).filter(|&pixel| has_site(pixel)));
        // Sites are found by the middles of their pixels, but compared by their exact places.
        let squared = |near: &Near| {
            let [right, down] = self.sites.of(near.pixel as usize).map_or([0.0; 2], Site::aside);
            (near.offset[0] + right).powi(2) + (near.offset[1] + down).powi(2)
        };
        let mut cells: Vec<Option<u32>> = vec![None; known.len()];
        points.for_each::<NEIGHBOURS, _>(
            &mut cells,
            |pixel| !matches!(known[pixel], PixelState::Uncovered | PixelState::Unseen),
            |pixel, nearest, cell| {
                let near = nearest.iter().map(|near| (squared(near), near.pixel));
                let nearest = near.min_by(|a, b| a.0.total_cmp(&b.0));
                let nearest = nearest.filter(|(squared, _)| *squared <= radii.squared_at(pixel));
                *cell = nearest.map(|(_, site)| site);
            },
        );
        let mut frame = self.tree.frame_of(&known);
        frame.samples_used = points.count() as u64;
        for (pixel, cell) in cells.into_iter().enumerate() {
            if let Some(site) = cell.and_then(|cell| self.sites.of(cell as usize)) {
                frame.picture.pixels[pixel] = rgbe::decode(site.rgbe);
                frame.depth[pixel] = site.depth();
            }
        }
        frame
    }

    /// Returns columns and rows of the picture.
    fn size(&self) -> (usize, usize) {
        (self.tree.size.0 as usize, self.tree.size.1 as usize)
    }

    /// Returns the state of the pixels of the quadtree's picture.
    fn pixels(&self, frame: &Frame) -> Pixels {
        let known = self.tree.known();
        // Samples in front hide a pixel's sample only if they surround it. Otherwise their surface
        // would grow by a pixel on all sides.
        let is_disputed = |pixel: usize| {
            let shown = bin_of(frame.depth[pixel]).saturating_add(1);
            let site = self.sites.of(pixel);
            known[pixel] == PixelState::Afar && site.is_some_and(|site| shown < site.bin())
        };
        let disputed: Vec<bool> = (0..known.len()).map(is_disputed).collect();
        // The site's depth is more exact, unless the pixel shows another surface.
        let depth = |pixel: usize| {
            let shown = frame.depth[pixel];
            let is_shown = |site: &&Site| disputed[pixel] || site.bin() == bin_of(shown);
            self.sites.of(pixel).filter(is_shown).map_or(shown, Site::depth)
        };
        let depth: Vec<f32> = (0..known.len()).map(depth).collect();
        let hidden = self.hidden(&known, &depth);
        Pixels { known, depth, hidden, disputed }
    }

    /// Returns the pixels whose sample lies on a surface that a nearer one hides.
    fn hidden(&self, known: &[PixelState], depth: &[f32]) -> Vec<bool> {
        if !known.contains(&PixelState::Afar) {
            return vec![false; known.len()];
        }
        let has_site = |pixel: usize| {
            matches!(known[pixel], PixelState::Afar | PixelState::Near | PixelState::Mixture)
        };
        let may_be = |pixel: usize| known[pixel] == PixelState::Afar;
        hidden::hidden(self.size(), depth, &DepthSteps(&self.tree), may_be, has_site)
    }
}
