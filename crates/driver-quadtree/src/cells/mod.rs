//! The `voronoi` driver where there is no scene (Larson & Simmons 1999, §2.4.4): cells of samples, bounded by the samples' own depth.
//!
//! Samples are reprojected and summed as in the [`Quadtree`], which also says what a pixel with samples shows: their mean, over as many
//! pixels around as noise asks, unless so few are around and so clean that those nearest to one tell more ([`local`]). Each other pixel belongs to the sample nearest to it on the picture, of those that no nearer surface
//! hides ([`hidden`]): a Voronoi diagram, found exactly ([`nearest`]). It shows that sample's colour ([`Filling::Constant`]), or one that
//! goes smoothly on to those of the same surface around it ([`fill`]).
//!
//! Smooth pictures have no holes: what is far from all samples is filled, too, since a display has nothing better to show. Of the
//! paper's constant cells the greatest radius is a part ([`radius`]), and it showed the scene between them; here that stays black.
//!
//! Whole pictures of 512 × 512 pixels with 200,000 clean samples on one core take 28 ms (constant) and 76 (smooth, of which the tree's
//! part is 26); of one path each 29 and 124 (84); with 377,000 from all around 39 and 132 (63). Of a burst of samples the tree draws
//! little ([`Quadtree::redraw`]); what is between them is filled anew, by all cores.
//!
//! What always holds:
//! - The picture is a function of the set of samples: their order and batches change no bit of it.
//! - No pixel between samples has anything of another surface than its nearest sample's, as far as depths tell ([`step`]).
//! - As samples grow, every pixel tends to the mean of its own samples (smooth), or to one in its middle (constant).
//! - A pixel that no section covers is 0; one whose best beam sees nothing is the sky (black if the view clips it).

mod fill;
mod hidden;
mod local;
mod nearest;
mod radius;
mod sites;
mod squares;
mod step;

use crate::pixels::{Known, bin_of};
use crate::{Quadtree, QuadtreeParams};
use fill::{NEIGHBOURS, Seen, between};
use holo_display::Frame;
use holo_picture::View;
use holo_section::{BeamId, Sample, Section, rgbe};
use nearest::Points;
use radius::Radii;
use sites::{Site, Sites};
use std::sync::Arc;
use step::Steps;

/// What a cell shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filling {
    /// Pixels with samples show what a [`Quadtree`] does, their mean if they are many, or the nearest samples where few are clean; what is between goes smoothly from sample to
    /// sample. There is no hole.
    #[default]
    Smooth,
    /// The paper's: the colour of one sample, that which is nearest to a pixel's middle, of its nearest depth bin. At least 0.01 % of the picture's area and
    /// at most 10 %, by how many samples are around; what no cell reaches is 0.
    Constant,
}

/// The driver of cells: samples in, pictures out.
pub struct Cells {
    tree: Quadtree,
    sites: Sites,
    filling: Filling,
}

impl Cells {
    /// Returns empty cells for a picture of `size` pixels, as from [`View::resolve`], which bounds
    /// it: memory is in proportion. `params` says how samples are summed, and what pixels with
    /// samples show.
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

    /// As [`Quadtree::insert`].
    pub fn insert(&mut self, section: u16, beam: BeamId, paths: u16, samples: &[Sample]) {
        let sites = &mut self.sites;
        self.tree.insert_and_tell(section, beam, paths, samples, |pixel, landing, rgbe| {
            sites.add(pixel, Site::new(landing, rgbe));
        });
    }

    /// As [`Quadtree::insert_unseen`].
    pub fn insert_unseen(&mut self, section: u16, beam: BeamId) {
        self.tree.insert_unseen(section, beam);
    }

    /// Returns the sums of the samples.
    pub fn quadtree(&self) -> &Quadtree {
        &self.tree
    }

    /// Draws the picture of all samples so far.
    pub fn draw(&self) -> Frame {
        match self.filling {
            Filling::Smooth => self.filled(self.tree.draw()),
            Filling::Constant => self.constant(),
        }
    }

    /// A quadtree's picture with what is between its samples put right.
    fn filled(&self, mut frame: Frame) -> Frame {
        let known = self.tree.known();
        let disputed: Vec<bool> = (0..)
            .zip(&frame.depth)
            .map(|(pixel, &shown)| self.is_disputed(pixel, known[pixel], shown))
            .collect();
        let depth: Vec<f32> = (0..)
            .zip(&frame.depth)
            .map(|(pixel, &shown)| self.depth_of(pixel, shown, disputed[pixel]))
            .collect();
        let hidden = self.hidden(&known, &depth);
        let is_sample = |pixel: usize| {
            // In a burst some pixels with samples have not been drawn yet.
            let is_drawn = frame.depth[pixel] > 0.0;
            is_drawn
                && !hidden[pixel]
                && !disputed[pixel]
                && matches!(known[pixel], Known::Afar | Known::Near)
        };
        let points = Points::new(self.size(), is_sample);
        let mut filled: Vec<Option<Seen>> = vec![None; known.len()];
        let aside = |pixel: usize| self.sites.of(pixel).map_or([0.0; 2], Site::aside);
        let single = |pixel: usize| {
            let site = self.sites.of(pixel);
            let colour = site.map_or(frame.picture.pixels[pixel], |site| rgbe::decode(site.rgbe));
            Seen { colour, depth: depth[pixel], aside: aside(pixel) }
        };
        let has_few = self.tree.has_few();
        let few = |pixel: usize| {
            let is_shown = |site: &Site| site.depth() == depth[pixel];
            let are_many = points.count_around(pixel) > local::MANY;
            !are_many
                && has_few[pixel]
                && is_sample(pixel)
                && self.sites.of(pixel).is_some_and(is_shown)
        };
        let few: Vec<bool> = (0..known.len()).map(few).collect();
        let few = |pixel: usize| few[pixel];
        let mean = |pixel: usize| frame.picture.pixels[pixel];
        let local = local::local(&points, self.size(), few, single, mean, &Steps(&self.tree));
        for (colour, local) in frame.picture.pixels.iter_mut().zip(local) {
            *colour = local.unwrap_or(*colour);
        }
        let seen = |pixel: usize| Seen {
            colour: frame.picture.pixels[pixel],
            depth: depth[pixel],
            aside: aside(pixel),
        };
        let own = |pixel: usize| {
            let site = self.sites.of(pixel).filter(|_| disputed[pixel] && !hidden[pixel])?;
            Some(Seen { colour: rgbe::decode(site.rgbe), depth: site.depth(), aside: site.aside() })
        };
        let steps = Steps(&self.tree);
        points.for_each::<NEIGHBOURS, _>(
            &mut filled,
            |pixel| hidden[pixel] || disputed[pixel] || known[pixel] == Known::Nothing,
            |pixel, nearest, filled| *filled = between(nearest, own(pixel), seen, &steps),
        );
        let shown = frame.picture.pixels.iter_mut().zip(&mut frame.depth);
        for ((colour, depth), filled) in shown.zip(filled) {
            if let Some(filled) = filled {
                (*colour, *depth) = (filled.colour, filled.depth);
            }
        }
        frame
    }

    /// A picture of constant cells.
    fn constant(&self) -> Frame {
        let known = self.tree.known();
        let depth: Vec<f32> =
            (0..known.len()).map(|pixel| self.sites.of(pixel).map_or(0.0, Site::depth)).collect();
        let hidden = self.hidden(&known, &depth);
        let site = |pixel: usize| self.sites.of(pixel).filter(|_| !hidden[pixel]);
        let points = Points::new(self.size(), |pixel| site(pixel).is_some());
        let with_sites = (0..known.len()).filter(|&pixel| site(pixel).is_some());
        let radii = Radii::new(self.size(), with_sites);
        let mut frame = self.tree.frame_of(&known);
        frame.samples_used = points.count() as u64;
        let mut cells: Vec<Option<u32>> = vec![None; known.len()];
        points.for_each::<1, _>(
            &mut cells,
            |pixel| !matches!(known[pixel], Known::Uncovered | Known::Unseen),
            |pixel, nearest, cell| {
                *cell = nearest
                    .first()
                    .filter(|near| near.squared <= radii.squared_at(pixel))
                    .map(|near| near.pixel);
            },
        );
        for (pixel, cell) in cells.into_iter().enumerate() {
            if let Some(site) = cell.and_then(|cell| self.sites.of(cell as usize)) {
                frame.picture.pixels[pixel] = rgbe::decode(site.rgbe);
                frame.depth[pixel] = site.depth();
            }
        }
        frame
    }

    /// Columns and rows.
    fn size(&self) -> (usize, usize) {
        let (width, height) = self.tree.size;
        (width as usize, height as usize)
    }

    /// Which pixels' samples are of what a nearer surface hides.
    fn hidden(&self, known: &[Known], depth: &[f32]) -> Vec<bool> {
        if !known.contains(&Known::Afar) {
            return vec![false; known.len()];
        }
        let has_site =
            |pixel: usize| matches!(known[pixel], Known::Afar | Known::Near | Known::Mixture);
        let points = Points::new(self.size(), has_site);
        let may_be = |pixel: usize| known[pixel] == Known::Afar;
        hidden::hidden(&points, self.size(), depth, &Steps(&self.tree), may_be, has_site)
    }

    /// Whether the tree takes a pixel's samples for hidden by what most around it are of. Where those do not stand around it, they do not
    /// hide it: they would grow by a pixel all around.
    fn is_disputed(&self, pixel: usize, known: Known, shown: f32) -> bool {
        known == Known::Afar
            && self.sites.of(pixel).is_some_and(|site| bin_of(shown).saturating_add(1) < site.bin())
    }

    /// Depth of a pixel's sample: its site's, which is finer, unless the pixel shows what is of another surface.
    fn depth_of(&self, pixel: usize, shown: f32, is_disputed: bool) -> f32 {
        let of_site = |site: &&Site| is_disputed || site.bin() == bin_of(shown);
        self.sites.of(pixel).filter(of_site).map_or(shown, Site::depth)
    }
}
