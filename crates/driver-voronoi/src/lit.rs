//! One layer's light, and what is known of surfaces that have none: looked up by pixel, and by what is seen.
//!
//! Invariant: light is kept from the last picture only as far as no new samples have a part in it.

use super::blocks::{self, Mask};
use super::guess::{Guesses, Mean};
use super::indirect::Indirect;
use super::light::Light;
use super::reconstruct;
use super::shade::Shadings;
use super::surfaces::{NO_IMAGE, Seen, Surfaces};
use super::{Layer, Made, MadeFrom, Voronoi};
use holo_cpu::zeroed;
use holo_display::Camera;
use holo_display::for_bands;
use rustc_hash::FxHashSet;
use std::sync::{Arc, PoisonError};

/// A material's number where the sky is seen through nothing.
const PLAIN_SKY: u32 = u32::MAX;

/// A material's number where a mirror or pane is looked through.
const NOT_PLAIN: u32 = u32::MAX - 1;

/// Pixels a side of blocks in which a surface without samples near has one light.
pub(crate) const BLOCK: usize = 8;

/// A layer whose light is known.
pub(crate) struct Lit<'a> {
    pub layer: &'a Layer,
    pub camera: &'a Camera,
    pub shadings: &'a Shadings,
    pub light: Arc<Light>,
    pub guesses: Arc<Guesses>,
    /// What it is made of; made for this very picture, or kept from the last one.
    from: MadeFrom,
    pub is_new: bool,
}

/// By pixel, the material of what is seen through nothing, or [`PLAIN_SKY`], or [`NOT_PLAIN`].
pub(crate) fn plain(surfaces: &Surfaces) -> Vec<u32> {
    let width = surfaces.size.0;
    let mut plain: Vec<u32> = zeroed(surfaces.seen.len());
    for_bands(&mut plain, width, BLOCK, |part, plain| {
        for (plain, seen) in plain.iter_mut().zip(&surfaces.seen[part * BLOCK * width..]) {
            *plain = match seen {
                _ if seen.through => NOT_PLAIN,
                _ if seen.is_sky() => PLAIN_SKY,
                _ => seen.material,
            };
        }
    });
    plain
}

impl<'a> Lit<'a> {
    pub fn new(voronoi: &'a Voronoi, layer: &'a Layer) -> Self {
        let Layer { surfaces, sums, .. } = layer;
        let from =
            MadeFrom { samples: layer.samples, paths: voronoi.paths, records: voronoi.records() };
        let (camera, shadings) = (&voronoi.camera, &voronoi.shadings);
        let mut made = layer.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(made) = made.as_ref().filter(|made| made.from == from) {
            let (light, guesses) = (Arc::clone(&made.light), Arc::clone(&made.guesses));
            return Self { layer, camera, shadings, light, guesses, from, is_new: false };
        }
        // What metals reflect follows from more than the samples near.
        let metals = voronoi.once.metals.get().map_or(&[][..], Vec::as_slice);
        let metals: FxHashSet<usize> =
            metals.iter().map(|&pixel| blocks::of(pixel, surfaces.size.0)).collect();
        // Its memory is used again: new memory from the system took a tenth of the time.
        let before = made.take().filter(|made| made.from.paths == from.paths).map(|made| {
            let is_new =
                |block: usize| layer.changes[block] > made.from.samples || metals.contains(&block);
            (Arc::unwrap_or_clone(made.light), Mask::new(surfaces.size, is_new))
        });
        let mut scratch = voronoi.scratch.lock().unwrap_or_else(PoisonError::into_inner);
        let light = reconstruct::light(surfaces, sums, voronoi.paths, before, &mut scratch);
        Self {
            layer,
            camera,
            shadings,
            light: Arc::new(light),
            guesses: Arc::new(Guesses::new(
                surfaces,
                sums,
                shadings,
                reconstruct::weight_of_one(voronoi.paths),
            )),
            from,
            is_new: true,
        }
    }

    /// Keeps it for the next picture.
    pub fn keep(&self) {
        let made = Made {
            from: self.from,
            light: Arc::clone(&self.light),
            guesses: Arc::clone(&self.guesses),
        };
        *self.layer.made.lock().unwrap_or_else(PoisonError::into_inner) = Some(made);
    }

    /// Colours of pixels from `first` on whose light is known and that are seen through nothing; gives the others.
    pub fn paint_plain(
        &self,
        first: usize,
        plain: &[u32],
        colours: &mut [[f32; 3]],
        others: &mut Vec<usize>,
    ) {
        let Shadings { materials, nothing, .. } = self.shadings;
        let known = self.light.rows(first..first + colours.len());
        for (at, (colour, &material)) in colours.iter_mut().zip(plain).enumerate() {
            if material == PLAIN_SKY {
                *colour = *nothing;
            } else if let Some(light) =
                known.at(at).filter(|_| (material as usize) < materials.len())
            {
                *colour = self.shadings.lit(material, light);
            } else {
                others.push(first + at);
            }
        }
    }

    /// The first pixel of the block around a pixel that sees the same surface.
    pub fn first_alike(&self, pixel: usize) -> usize {
        let (surfaces, width) = (&self.layer.surfaces, self.layer.surfaces.size.0);
        let (left, top) = (pixel % width / BLOCK * BLOCK, pixel / width / BLOCK * BLOCK);
        let rows = (top..=pixel / width).map(|row| row * width);
        let mut all = rows.flat_map(|row| row + left..row + (left + BLOCK).min(width));
        all.find(|&other| surfaces.labels[other] == surfaces.labels[pixel]).unwrap_or(pixel)
    }

    /// Light of a surface without samples near, by what is known of such surfaces.
    pub fn guess(&self, seen: &Seen, indirect: Option<&Indirect>) -> Option<[f32; 3]> {
        let narrow =
            self.layer.narrow.get(&seen.side()).filter(|_| seen.image == 0 && !seen.through);
        let narrow = narrow.map(|sums| Mean {
            light: sums.light.map(|sum| sum as f32 / sums.weight as f32),
            samples: sums.weight as f32 / reconstruct::weight_of_one(self.from.paths),
        });
        self.guesses.alike(seen, narrow, &self.layer.surfaces, indirect)
    }

    /// Whether something is seen through a mirror or pane that ought to have samples and has none.
    pub fn is_unknown(&self, behind: &Seen) -> bool {
        behind.through
            && !behind.is_sky()
            && behind.image != NO_IMAGE
            && !self.guesses.knows(behind)
    }

    /// Whether something is seen in a mirror whose image has no place that samples could be put into: a curved one.
    pub fn is_unplaced(&self, behind: &Seen) -> bool {
        behind.through && behind.image == NO_IMAGE && !self.is_certain(behind)
    }

    /// Whether its colour is known without samples: the sky's, a lamp's.
    pub fn is_certain(&self, seen: &Seen) -> bool {
        seen.is_sky() || self.shadings.materials[seen.material as usize].emits
    }

    /// Radiance of a surface in this light; without any, as if the eye carried a lamp.
    pub fn colour(&self, seen: &Seen, light: Option<[f32; 3]>) -> [f32; 3] {
        if seen.is_sky() {
            return if seen.through { self.shadings.sky } else { self.shadings.nothing };
        }
        let shading = &self.shadings.materials[seen.material as usize];
        let unit = self.shadings.unit;
        match light {
            Some(light) => self.shadings.lit(seen.material, light),
            None if shading.emits => shading.emission,
            None => {
                let towards =
                    -seen.normal.dot(self.camera.sight(seen.position).normalize_or_zero());
                let bright = self.guesses.typical().unwrap_or(unit.recip()) * unit;
                shading.scale.map(|scale| scale * bright * (0.25 + 0.75 * towards.max(0.0)))
            }
        }
    }

    /// What of a pixel's light comes through the mirrors and panes before it; `None` if the layer has no such pixel.
    pub fn share(&self, pixel: usize, is_sparse: bool) -> Option<[f32; 3]> {
        let Surfaces { seen, throughput, .. } = &*self.layer.surfaces;
        // Most pixels look through nothing: looking that up for each took a tenth of a picture's time.
        match seen[pixel].through {
            true => throughput.get(&(pixel as u32)).copied(),
            false if is_sparse => None,
            false => Some([1.0; 3]),
        }
    }
}
