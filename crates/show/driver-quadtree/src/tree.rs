//! The quadtree: sums the samples of one view and draws pictures of them.

use crate::bins::PixelBins;
use crate::reproject::{BeamProjector, Landing};
use crate::sums::Colour;
use glam::DVec3;
use holo_display::{Camera, DistanceTable, Frame, PlacedSection, SkyView, best_beam, covered};
use holo_picture::View;
use holo_section::{BeamKey, Sample, Section};
use rayon::prelude::*;
use std::collections::HashSet;
use std::sync::Arc;

/// Largest number of paths that a sample counts for, so that no sample overflows a sum.
pub(crate) const MAX_PATHS: u16 = 1024;

/// The size of leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LeafSize {
    /// Leaves are as large as the samples' noise needs and the picture allows.
    #[default]
    Adaptive,
    /// 2ⁿ pixels a side everywhere, and larger where there are no samples. 0 shows each pixel's own
    /// samples. For comparison.
    Fixed(u8),
}

/// Settings of a [`Quadtree`].
#[derive(Clone, Debug, Default)]
pub struct QuadtreeParams {
    /// How large the leaves are.
    pub leaf: LeafSize,
    /// What rays that hit nothing show, and with them unseen beams.
    pub sky: SkyView,
}

/// Samples of one view, summed by pixel and depth, and the pictures of them.
pub struct Quadtree {
    pub(crate) sections: Arc<[Section]>,
    placed: Vec<PlacedSection>,
    pub(crate) view: View,
    pub(crate) camera: Camera,
    pub(crate) size: (u32, u32),
    pub(crate) params: QuadtreeParams,
    distances: DistanceTable,
    /// Aligned samples: those that look in nearly the same direction as the eye.
    pub(crate) aligned: PixelBins,
    /// Oblique samples: all others. `None` before the first one.
    pub(crate) oblique: Option<PixelBins>,
    /// For each pixel, whether some section covers its middle.
    pub(crate) covered: Vec<bool>,
    /// True if the stored rays of some pixels may begin ahead of the eye.
    pub(crate) is_outside: bool,
    unseen: HashSet<BeamKey>,
    /// Best beam of every pixel's middle. Empty while no unseen beam is known: most scenes have
    /// none.
    best: Vec<Option<BeamKey>>,
}

impl Quadtree {
    /// Returns an empty quadtree for a picture of `size` pixels. Memory is in proportion to the
    /// size, which [`View::resolve`] bounds.
    pub fn new(
        sections: Arc<[Section]>,
        view: View,
        size: (u32, u32),
        params: QuadtreeParams,
    ) -> Self {
        let camera = Camera::new(&view, size);
        let covered = covered(&sections, &view, size);
        let mut tree = Self {
            placed: sections.iter().map(|section| PlacedSection::new(section, &camera)).collect(),
            distances: DistanceTable::new(),
            aligned: PixelBins::new(covered.len()),
            oblique: None,
            covered,
            is_outside: false,
            unseen: HashSet::new(),
            best: Vec::new(),
            sections,
            view,
            camera,
            size,
            params,
        };
        tree.is_outside = tree.looks_from_outside();
        // If the eye is outside all sections, `standing` finds objects before them pixel by pixel.
        for (placed, section) in tree.placed.iter_mut().zip(tree.sections.iter()) {
            placed.is_elsewhere = !tree.is_outside && !section.contains(view.vp);
        }
        tree
    }

    /// Adds samples of one beam, each the mean of `paths` paths. Ignores unknown sections and
    /// beams.
    pub fn insert(&mut self, key: BeamKey, paths: u16, samples: &[Sample]) {
        self.insert_with(key, paths, samples, |_, _, _| {});
    }

    /// Adds samples as [`insert`](Self::insert) does. Calls `landed` with the pixel, landing and
    /// colour of each sample that lands in the picture.
    pub(crate) fn insert_with(
        &mut self,
        key: BeamKey,
        paths: u16,
        samples: &[Sample],
        mut landed: impl FnMut(usize, &Landing, [u8; 4]),
    ) {
        let number = usize::from(key.section);
        let (Some(section), Some(placed)) = (self.sections.get(number), self.placed.get(number))
        else {
            return;
        };
        let Some(pair) = section.cells(key.beam) else { return };
        let projector = BeamProjector::new(placed, pair, &self.camera, self.size, &self.distances);
        let (width, pixels) = (self.size.0 as usize, self.covered.len());
        let paths = u32::from(paths.clamp(1, MAX_PATHS));
        for sample in samples {
            let Some(landing) = projector.land(sample) else { continue };
            let pixel = landing.row * width + landing.column;
            let bins = if landing.is_aligned {
                &mut self.aligned
            } else {
                self.oblique.get_or_insert_with(|| PixelBins::new(pixels))
            };
            let rgbe = if landing.is_black { [0; 4] } else { sample.rgbe };
            let colour = Colour::from_rgbe(rgbe);
            bins.add(pixel, landing.bin, &colour, landing.weight * paths, landing.near);
            landed(pixel, &landing, rgbe);
        }
    }

    /// Marks a beam as unseen: its rays hit nothing. Pixels with this beam as best beam show
    /// exactly the sky. Ignores unknown sections and beams.
    pub fn insert_unseen(&mut self, key: BeamKey) {
        if key.section_in(&self.sections).is_none() {
            return;
        }
        if self.best.is_empty() {
            let best = |pixel: usize| {
                let width = self.size.0 as usize;
                let (eye, along) = self.middle(pixel % width, pixel / width);
                best_beam(&self.sections, eye, along)
            };
            self.best = (0..self.covered.len()).into_par_iter().map(best).collect();
        }
        self.unseen.insert(key);
    }

    /// Returns the beams whose rays hit nothing.
    pub(crate) fn unseen(&self) -> &HashSet<BeamKey> {
        &self.unseen
    }

    /// Returns for each pixel whether its best beam is unseen. Empty if no unseen beam is known.
    pub(crate) fn unseen_pixels(&self) -> Vec<bool> {
        let is_unseen =
            |best: &Option<BeamKey>| best.is_some_and(|best| self.unseen.contains(&best));
        self.best.iter().map(is_unseen).collect()
    }

    /// Returns a picture that shows nothing yet.
    pub(crate) fn empty_frame(&self) -> Frame {
        let mut frame = Frame::black(self.size);
        frame.picture.view = Some(self.view);
        frame.uncovered_pixels = self.covered.iter().filter(|&&covered| !covered).count() as u64;
        frame
    }

    /// Returns the view ray of a pixel's middle: its origin and its unit direction. The direction
    /// is 0 in the corners of a fisheye, which show nothing.
    pub(crate) fn middle(&self, column: usize, row: usize) -> (DVec3, DVec3) {
        let (x, y) = View::pixel_centre(self.size, column as u32, row as u32);
        let ray = self.view.clipped_ray(x, y);
        ray.map_or((self.view.vp, DVec3::ZERO), |(origin, direction, _)| (origin, direction))
    }
}
