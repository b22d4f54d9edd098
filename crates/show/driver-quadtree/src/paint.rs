//! Draws pictures: bands of rows on all cores.
//!
//! Invariant: the colour of a pixel depends on the leaves and on the pixels before it in its band,
//! because [`Agreement`] remembers its answers. The number of threads changes no bit.

use crate::Quadtree;
use crate::agreement::Agreement;
use crate::bins::{bin_distance, merged};
use crate::blend::beside;
use crate::leaf::LeafReader;
use crate::pyramid::{PyramidLevel, pyramid};
use crate::surface::{Bins, LeafSurface, gap_allowed, of_pixel};
use holo_display::Frame;
use rayon::prelude::*;
use std::ops::Range;

/// Number of rows that one thread draws at a time.
const BAND: usize = 16;

/// What a pixel shows.
#[derive(Clone, Copy)]
pub(crate) struct PixelContent {
    pub colour: [f32; 3],
    /// Distance from the eye; 0 where nothing is known.
    pub depth: f32,
}

impl PixelContent {
    pub const NOTHING: Self = Self { colour: [0.0; 3], depth: 0.0 };
}

/// Numbers of pixels and samples for a frame's report.
#[derive(Clone, Copy, Default)]
pub(crate) struct FrameCounts {
    pub empty: u64,
    pub unseen: u64,
    pub samples: u64,
}

impl FrameCounts {
    fn plus(self, other: Self) -> Self {
        Self {
            empty: self.empty + other.empty,
            unseen: self.unseen + other.unseen,
            samples: self.samples + other.samples,
        }
    }
}

/// The leaves that a picture is drawn from.
pub(crate) struct Pyramids {
    /// Leaves of all samples.
    all: Vec<PyramidLevel>,
    /// Leaves of aligned samples; `None` if all are aligned.
    aligned: Option<Vec<PyramidLevel>>,
}

impl Quadtree {
    fn leaves_of_aligned(&self) -> Vec<PyramidLevel> {
        let size = (self.size.0 as usize, self.size.1 as usize);
        pyramid(size, |pixel, surfaces| of_pixel(self.aligned.of(pixel), surfaces))
    }

    /// Returns the leaves of all samples, level by level.
    pub(crate) fn leaves_of_all(&self) -> Vec<PyramidLevel> {
        let Some(oblique) = &self.oblique else { return self.leaves_of_aligned() };
        let size = (self.size.0 as usize, self.size.1 as usize);
        pyramid(size, |pixel, surfaces| of_pixel(merged(&self.aligned, oblique, pixel), surfaces))
    }
}

/// Draws the pixels of one band.
pub(crate) struct BandPainter<'a> {
    pub tree: &'a Quadtree,
    /// For each pixel, whether its beam is unseen; empty if no unseen beam is known.
    unseen: &'a [bool],
    pub all: LeafReader<'a>,
    /// The same for aligned samples alone; `None` if all are aligned.
    aligned: Option<(LeafReader<'a>, Agreement)>,
}

impl<'a> BandPainter<'a> {
    fn new(
        tree: &'a Quadtree,
        unseen: &'a [bool],
        pyramids: &'a Pyramids,
        rows: Range<usize>,
    ) -> Self {
        let leaf = tree.params.leaf;
        let all = LeafReader::new(&pyramids.all, leaf);
        let aligned = pyramids.aligned.as_ref().map(|aligned| {
            (LeafReader::new(aligned, leaf), Agreement::new(tree.size.0 as usize, rows))
        });
        Self { tree, unseen, all, aligned }
    }

    /// Draws a pixel and counts it.
    #[inline(always)]
    fn paint(&mut self, column: usize, row: usize, counts: &mut FrameCounts) -> PixelContent {
        let pixel = row * self.tree.size.0 as usize + column;
        if !self.tree.covered[pixel] {
            return PixelContent::NOTHING;
        }
        if self.unseen.get(pixel) == Some(&true) {
            counts.unseen += 1;
            return self.tree.sky(pixel);
        }
        let own = self.all.leaf(0, column, row);
        if own.is_empty() {
            counts.empty += 1;
        }
        counts.samples += own.iter().map(|surface| u64::from(surface.count)).sum::<u64>();
        self.shown(column, row, own)
    }

    /// Returns what a pixel with this surface shows. The surface has `bins` in the leaf of `level`,
    /// which is the smallest leaf that is used.
    #[inline(always)]
    pub fn surface(&mut self, column: usize, row: usize, level: usize, bins: Bins) -> PixelContent {
        let colour = self.colour(column, row, level, bins);
        PixelContent { colour, depth: bin_distance(bins.first) }
    }

    /// Returns the colour of a surface as [`LeafReader::colour`] does, of all samples, or of
    /// aligned ones where the others differ.
    #[inline(always)]
    pub fn colour(&mut self, column: usize, row: usize, level: usize, bins: Bins) -> [f32; 3] {
        let all = self.all.colour(column, row, level, bins);
        let Some((aligned, agreement)) = &mut self.aligned else { return all };
        let share = agreement.of(&mut self.all, aligned, (column, row), bins);
        if share == 1.0 {
            return all;
        }
        // The smallest leaf with aligned samples. Its few samples may all lie one bin beside
        // `bins`.
        let found = (level..aligned.levels.len()).find_map(|level| {
            let surface = beside(aligned.leaf(level, column, row), bins, gap_allowed(level))?;
            Some((level, surface.bins))
        });
        let Some((level, bins)) = found else { return all };
        let own = aligned.colour(column, row, level, bins);
        [0, 1, 2].map(|channel| own[channel] + share * (all[channel] - own[channel]))
    }

    /// Returns the surfaces of a leaf from aligned samples, which show occlusion best. If the leaf
    /// has no aligned samples, uses all samples.
    pub fn leaf_seen(&self, level: usize, column: usize, row: usize) -> &[LeafSurface] {
        let aligned = self.aligned.as_ref().map(|(reader, _)| reader.leaf(level, column, row));
        let aligned = aligned.filter(|leaf| !leaf.is_empty());
        aligned.unwrap_or_else(|| self.all.leaf(level, column, row))
    }
}

impl Quadtree {
    /// Draws the picture of all samples so far.
    pub fn draw(&self) -> Frame {
        let width = self.size.0 as usize;
        let aligned = self.oblique.is_some().then(|| self.leaves_of_aligned());
        let pyramids = Pyramids { all: self.leaves_of_all(), aligned };
        let unseen = self.unseen_pixels();
        let mut frame = self.empty_frame();
        let colours = frame.picture.pixels.par_chunks_mut((BAND * width).max(1));
        let depths = frame.depth.par_chunks_mut((BAND * width).max(1));
        let draw_band = |(band, (colours, depths)): (usize, (&mut [[f32; 3]], &mut [f32]))| {
            let rows = band * BAND..(band + 1) * BAND;
            let mut painter = BandPainter::new(self, &unseen, &pyramids, rows.clone());
            let mut counts = FrameCounts::default();
            for (at, (colour, depth)) in colours.iter_mut().zip(depths).enumerate() {
                let (column, row) = (at % width, rows.start + at / width);
                let shown = painter.paint(column, row, &mut counts);
                (*colour, *depth) = (shown.colour, shown.depth);
            }
            counts
        };
        let bands = colours.zip(depths).enumerate().map(draw_band);
        let counts = bands.reduce(FrameCounts::default, FrameCounts::plus);
        frame.empty_pixels = counts.empty;
        frame.unseen_pixels = counts.unseen;
        frame.samples_used = counts.samples;
        frame
    }
}
