//! The picture from the buckets, slab after slab: a slab's rows go through all stages while they are in the second cache.
//!
//! A band of rows is one thread's. Culling needs a row beyond, filters up to four more: so each stage lags behind the one before, and the rows
//! on both sides of where two bands meet are made in the end.
//!
//! Always true: what is written to a row is a function of that row and its neighbours, so bands and slabs change no bit.

use super::cull::{self, Cull};
use super::interpolate::{self, Interpolate, Looks};
use super::parallel;
use super::params::Stage;
use super::planes::Planes;
use super::prefilter::{self, Prefilter};
use super::zbuffer::{self, Fill, Rows};
use holo_cpu::Isa;
use std::ops::Range;

/// Pixels of a slab, about: their planes take 410 kB.
const SLAB_PIXELS: usize = 1 << 14;
/// Rows of a slab, and of a band, at least.
const LEAST_ROWS: usize = 16;
/// Rows beside a seam that wait for those beyond: those around a pixel on which its colour depends, and one for the cull.
const SEAM: usize = prefilter::WIDEST / 2 + 1;

/// What one thread needs to make rows.
#[derive(Debug)]
pub(super) struct Scratch {
    zbuffer: zbuffer::Scratch,
    cull: cull::Scratch,
    prefilter: prefilter::Scratch,
    interpolate: interpolate::Scratch,
}

impl Scratch {
    /// For pictures of this width, in tiles of `tile_rows` rows; `no_slot` stands for no point.
    pub fn new(width: usize, tile_rows: usize, no_slot: u32) -> Self {
        Self {
            zbuffer: zbuffer::Scratch::new(width * tile_rows, no_slot),
            cull: cull::Scratch::new(width),
            prefilter: prefilter::Scratch::new(),
            interpolate: interpolate::Scratch::new(width),
        }
    }
}

/// A frame's work on rows.
#[derive(Clone, Copy)]
pub(super) struct Work<'a> {
    pub isa: Isa,
    /// Of the picture.
    pub size: (usize, usize),
    pub fill: Fill<'a>,
    /// None: no cull.
    pub cull_threshold: Option<f32>,
    /// Pixels along the window's side, whether pixels without points nearby become 0, and whether only gaps matter. None: no prefilter.
    pub prefilter: Option<(usize, bool, bool)>,
    pub looks: Looks,
}

/// Consecutive rows of the planes.
struct Band<'a> {
    rows: Range<usize>,
    colour: &'a mut [u32],
    depth: &'a mut [u32],
    slot: &'a mut [u32],
    priority: &'a mut [u8],
    picture: [&'a mut [f32]; 3],
}

impl Work<'_> {
    /// Makes the picture, on as many threads as there is scratch memory.
    pub fn run(self, planes: &mut Planes, scratch: &mut [Scratch], ended: &mut dyn FnMut(Stage)) {
        let unit = self.fill.buckets.tile_rows.max(LEAST_ROWS);
        let bands = parallel::bands(self.size.1, unit, scratch.len());
        let parts = cut(planes, &bands).into_iter().zip(&mut *scratch);
        parallel::for_each_telling(parts.collect(), ended, |(band, scratch), ended| {
            self.make(band, scratch, ended)
        });
        let whole = 0..self.size.1;
        if let (Some(mut band), Some(scratch)) = (cut(planes, &[whole]).pop(), scratch.first_mut())
        {
            for seam in bands.iter().skip(1).map(|rows| rows.start) {
                self.cull(&mut band, seam - 1..(seam + 1).min(self.size.1), scratch, ended);
                self.filter(&mut band, seam - SEAM..(seam + SEAM).min(self.size.1), scratch, ended);
            }
        }
    }

    /// Makes the rows of a band but those at its seams.
    fn make(&self, mut band: Band, scratch: &mut Scratch, ended: &mut dyn FnMut(Stage)) {
        let (width, height) = self.size;
        let tile_rows = self.fill.buckets.tile_rows;
        let slab = (SLAB_PIXELS / width).max(LEAST_ROWS).next_multiple_of(tile_rows);
        let (first, count) = (band.rows.start, band.rows.len());
        // Rows of the band up to which points are culled, and up to which the picture is made.
        let is_top = first == 0;
        let (mut culled, mut made) = if is_top { (0, 0) } else { (1, SEAM) };
        for start in (0..count).step_by(slab) {
            let end = (start + slab).min(count);
            for row in (start..end).step_by(tile_rows) {
                let at = row * width..(row + tile_rows).min(end) * width;
                let rows = Rows {
                    colour: &mut band.colour[at.clone()],
                    depth: &mut band.depth[at.clone()],
                    slot: &mut band.slot[at.clone()],
                    age: &mut band.priority[at],
                };
                self.fill.tile((first + row) / tile_rows, rows, &mut scratch.zbuffer);
            }
            ended(Stage::ZBufferTiles);
            let is_bottom = first + end == height;
            let cull_to = if is_bottom { end } else { end - 1 };
            let make_to = if is_bottom { end } else { end - SEAM };
            self.cull(&mut band, culled..cull_to, scratch, ended);
            self.filter(&mut band, made..make_to, scratch, ended);
            (culled, made) = (cull_to, make_to);
        }
    }

    fn cull(
        &self,
        band: &mut Band,
        rows: Range<usize>,
        scratch: &mut Scratch,
        ended: &mut dyn FnMut(Stage),
    ) {
        let Some(threshold) = self.cull_threshold.filter(|_| !rows.is_empty()) else { return };
        let width = self.size.0;
        let colour = &mut band.colour[rows.start * width..rows.end * width];
        let (from, depth, scratch) = (rows.start, &*band.depth, &mut scratch.cull);
        self.isa.run(Cull { width, from, colour, depth, threshold, scratch });
        ended(Stage::DepthCull);
    }

    fn filter(
        &self,
        band: &mut Band,
        rows: Range<usize>,
        scratch: &mut Scratch,
        ended: &mut dyn FnMut(Stage),
    ) {
        if rows.is_empty() {
            return;
        }
        let width = self.size.0;
        let (from, first_row) = (rows.start, band.rows.start);
        let at = rows.start * width..rows.end * width;
        let colour = &*band.colour;
        if let Some((window, black, gaps_only)) = self.prefilter {
            let (picture, scratch) = (
                band.picture.each_mut().map(|plane| &mut plane[at.clone()]),
                &mut scratch.prefilter,
            );
            self.isa.run(Prefilter {
                width,
                window,
                from,
                first_row,
                colour,
                picture,
                black,
                gaps_only,
                scratch,
            });
            ended(Stage::Prefilter);
        }
        let (picture, scratch) =
            (band.picture.each_mut().map(|plane| &mut plane[at.clone()]), &mut scratch.interpolate);
        let (priority, looks) = (&mut band.priority[at], self.looks);
        self.isa.run(Interpolate { width, from, colour, picture, priority, looks, scratch });
        ended(Stage::Interpolate);
    }
}

/// The planes' rows band by band.
fn cut<'a>(planes: &'a mut Planes, bands: &[Range<usize>]) -> Vec<Band<'a>> {
    let width = planes.size.0;
    let lengths = || bands.iter().map(|rows| rows.len() * width);
    let colour = parallel::cut(&mut planes.colour, lengths());
    let depth = parallel::cut(&mut planes.depth, lengths());
    let slot = parallel::cut(&mut planes.slot, lengths());
    let priority = parallel::cut(&mut planes.priority, lengths());
    let [red, green, blue] = planes.picture.each_mut().map(|plane| parallel::cut(plane, lengths()));
    let picture =
        red.into_iter().zip(green).zip(blue).map(|((red, green), blue)| [red, green, blue]);
    let parts = bands.iter().zip(colour).zip(depth).zip(slot).zip(priority).zip(picture);
    parts
        .map(|(((((rows, colour), depth), slot), priority), picture)| {
            let rows = rows.clone();
            Band { rows, colour, depth, slot, priority, picture }
        })
        .collect()
}
