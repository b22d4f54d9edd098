//! The driver that knows the scene: true edges, and light from every sample that lies on what is seen (Larson & Simmons 1999,
//! §2.4.4, the driver whose edges came from graphics hardware).
//!
//! A ray caster tells every pixel's surface. Samples, wherever they were looking from, go to the pixel whose surface they
//! lie on; light is reconstructed along each surface and multiplied by its material.
//!
//! What always holds:
//! - The picture is a function of the set of samples: their order and batches change no bit of it.
//! - No light crosses from one surface to another.
//! - As samples grow, every pixel tends to the mean of the samples of its surface within it.
//! - A pixel whose ray meets nothing is the sky, exactly.

mod beams;
mod deposit;
mod edges;
mod guess;
mod labels;
mod reconstruct;
mod shade;
mod surfaces;
mod tiles;

use crate::Frame;
use crate::camera::Camera;
use crate::candidates::is_covered;
use crate::quadtree::reproject::{DistanceTable, PlacedSection};
use deposit::{Beam, Depositor, Sums};
use guess::Guesses;
use holo_picture::{Picture, View};
use holo_raycast::Raycaster;
use holo_section::{BeamId, Sample, Section};
use shade::Shadings;
use std::sync::Arc;
use surfaces::{Caster, NO_IMAGE, SKY, Seen, Surfaces};
use tiles::for_parts;

/// A picture, and how much of it is a guess.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The picture and what is known of it.
    pub frame: Frame,
    /// Pixels of surfaces of which nothing at all is known, shown as if the eye carried a lamp.
    pub guessed_pixels: u64,
}

/// One surface a pixel, with its samples.
struct Layer {
    surfaces: Surfaces,
    sums: Vec<Sums>,
}

/// The geometry-guided driver: samples in, pictures out.
pub struct Voronoi {
    sections: Arc<[Section]>,
    placed: Vec<PlacedSection>,
    raycaster: Arc<Raycaster>,
    shadings: Shadings,
    view: View,
    camera: Camera,
    size: (u32, u32),
    distances: DistanceTable,
    /// As [`Caster::surfaces`] has them.
    layers: Vec<Layer>,
    covered: Vec<bool>,
    samples: u64,
    paths: u16,
}

impl Voronoi {
    /// What the view sees, without light yet; `size` as from [`View::resolve`], which bounds it: memory is in proportion.
    pub fn new(sections: Arc<[Section]>, raycaster: Arc<Raycaster>, view: View, size: (u32, u32)) -> Self {
        let camera = Camera::new(&view, size);
        let layers = Caster::new(&raycaster, &view, &camera, size).surfaces().into_iter();
        let layers = layers.map(|surfaces| Layer { sums: bytemuck::zeroed_vec(surfaces.seen.len()), surfaces });
        let layers = layers.collect();
        let covered = covered(&sections, &view, size);
        Self {
            placed: sections.iter().map(|section| PlacedSection::new(section, &camera)).collect(),
            shadings: Shadings::new(raycaster.scene()),
            distances: DistanceTable::new(),
            sections,
            raycaster,
            view,
            camera,
            size,
            layers,
            covered,
            samples: 0,
            paths: 1,
        }
    }

    /// The view shown.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// Distance from the eye of what each pixel sees, as [`Frame::depth`].
    pub fn depth(&self) -> Vec<f32> {
        let depth = |seen: &Seen| if seen.triangle == SKY { f32::INFINITY } else { seen.position.length() };
        self.layers.iter().take(1).flat_map(|layer| layer.surfaces.seen.iter().map(depth)).collect()
    }

    /// Adds samples of one beam, each the mean of `paths` paths. Samples of an unknown section or beam are left out.
    pub fn insert(&mut self, section: u16, beam: BeamId, paths: u16, samples: &[Sample]) {
        let number = usize::from(section);
        let Some((known, placed)) = self.sections.get(number).zip(self.placed.get(number)) else { return };
        let Some(pair) = known.cells(beam) else { return };
        for layer in &mut self.layers {
            let depositor = Depositor {
                camera: &self.camera,
                distances: &self.distances,
                surfaces: &layer.surfaces,
                shadings: &self.shadings,
                caster: Caster::new(&self.raycaster, &self.view, &self.camera, self.size),
            };
            self.samples += depositor.insert(&Beam { section: placed, pair, paths }, samples, &mut layer.sums);
        }
        self.paths = self.paths.max(paths);
    }

    /// The picture of all samples so far.
    pub fn draw(&self) -> Drawn {
        let mut picture = Picture::new(self.size.0, self.size.1);
        picture.view = Some(self.view);
        let mut frame = Frame {
            depth: self.depth(),
            picture,
            uncovered_pixels: self.covered.iter().filter(|&&covered| !covered).count() as u64,
            empty_pixels: 0,
            unseen_pixels: 0,
            samples_used: self.samples,
        };
        let drawn: Vec<Lit> = self.layers.iter().map(|layer| Lit::new(self, layer)).collect();
        let mut guessed_pixels = 0;
        for (number, lit) in drawn.iter().enumerate().take(POLISHED) {
            for (pixel, colour) in frame.picture.pixels.iter_mut().enumerate() {
                let seen = &lit.layer.surfaces.seen[pixel];
                let Some(share) = lit.share(pixel, number > 0) else { continue };
                if let Some(plain) = plainly(&drawn, pixel) {
                    *colour = plain;
                    continue;
                }
                let is_sky = seen.triangle == SKY;
                frame.empty_pixels += u64::from(number == 0 && lit.layer.sums[pixel].weight == 0 && !is_sky);
                let light = match drawn.first().filter(|_| seen.image == NO_IMAGE) {
                    Some(main) => main.light(seen, main.directly(&self.camera, seen)),
                    None => lit.light(seen, Some(pixel)),
                };
                if light.is_none() && !is_sky {
                    if !self.covered[pixel] {
                        continue;
                    }
                    guessed_pixels += 1;
                }
                let part = lit.colour(seen, light);
                *colour = [0, 1, 2].map(|channel| colour[channel] + part[channel] * share[channel]);
            }
        }
        if let Some(lit) = drawn.first() {
            let caster = Caster::new(&self.raycaster, &self.view, &self.camera, self.size);
            let point = |seen: &Seen, like: Option<usize>| {
                let light = lit.light(seen, like)?;
                Some(lit.colour(seen, Some(light)))
            };
            let (surfaces, colours) = (&lit.layer.surfaces, &frame.picture.pixels);
            frame.picture.pixels = edges::smooth(&caster, surfaces, colours, self.shadings.sky, point);
        }
        Drawn { frame, guessed_pixels }
    }
}

/// Whether some section covers each pixel's middle.
fn covered(sections: &[Section], view: &View, size: (u32, u32)) -> Vec<bool> {
    let (width, height) = (size.0 as usize, size.1 as usize);
    let mut covered = vec![false; width * height];
    for_parts(&mut covered, width, 8, |part, rows| {
        let mut hint = 0;
        for (offset, covered) in rows.iter_mut().enumerate() {
            let (column, row) = (offset % width, part * 8 + offset / width);
            let x = (column as f64 + 0.5) / width as f64;
            let (eye, along) = view.ray(x, 1.0 - (row as f64 + 0.5) / height as f64);
            *covered = is_covered(sections, eye, along, &mut hint);
        }
    });
    covered
}

/// The layer of mirrors and panes themselves.
const POLISHED: usize = 2;

/// What samples of the mirror or pane itself show along the eye's ray, for a pixel that looks through one at something of
/// which there is no sample: stored rays end at panes, so what stands behind all panes has none.
fn plainly(drawn: &[Lit], pixel: usize) -> Option<[f32; 3]> {
    let (main, polished) = drawn.first().zip(drawn.get(POLISHED))?;
    let behind = &main.layer.surfaces.seen[pixel];
    if !behind.through || behind.triangle == SKY || behind.image == NO_IMAGE || main.guesses.knows(behind) {
        return None;
    }
    let seen = &polished.layer.surfaces.seen[pixel];
    polished.light[pixel].map(|light| polished.colour(seen, Some(light)))
}

/// A layer whose light is known.
struct Lit<'a> {
    layer: &'a Layer,
    shadings: &'a Shadings,
    light: Vec<Option<[f32; 3]>>,
    guesses: Guesses,
}

impl<'a> Lit<'a> {
    fn new(voronoi: &'a Voronoi, layer: &'a Layer) -> Self {
        let Layer { surfaces, sums } = layer;
        Self {
            layer,
            shadings: &voronoi.shadings,
            light: reconstruct::light(surfaces, sums, voronoi.paths),
            guesses: Guesses::new(surfaces, sums),
        }
    }

    /// Light on a surface: that of a pixel that sees it, else what is known of such surfaces.
    fn light(&self, seen: &Seen, pixel: Option<usize>) -> Option<[f32; 3]> {
        pixel.and_then(|pixel| self.light[pixel]).or_else(|| self.guesses.alike(seen))
    }

    /// The pixel that sees directly what is seen here in a mirror without samples of its own.
    fn directly(&self, camera: &Camera, seen: &Seen) -> Option<usize> {
        let surfaces = &self.layer.surfaces;
        let (x, y) = camera.pixel(seen.position)?;
        let (width, height) = surfaces.size;
        let inside = x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32;
        let pixel = inside.then(|| y as usize * width + x as usize)?;
        let there = &surfaces.seen[pixel];
        (there.triangle == seen.triangle && there.image == 0).then_some(pixel)
    }

    /// Radiance of a surface in this light; without any, as if the eye carried a lamp.
    fn colour(&self, seen: &Seen, light: Option<[f32; 3]>) -> [f32; 3] {
        if seen.triangle == SKY {
            return self.shadings.sky;
        }
        let shading = &self.shadings.materials[seen.material as usize];
        let unit = self.shadings.unit;
        match light {
            Some(light) => [0, 1, 2].map(|channel| light[channel] * unit * shading.scale[channel]),
            None if shading.emits => shading.emission,
            None => {
                let towards = -seen.normal.dot(seen.position.normalize_or_zero());
                let bright = self.guesses.typical().unwrap_or(unit.recip()) * unit;
                shading.scale.map(|scale| scale * bright * (0.25 + 0.75 * towards.max(0.0)))
            }
        }
    }

    /// What of a pixel's light comes through the mirrors and panes before it; `None` if the layer has no such pixel.
    fn share(&self, pixel: usize, is_sparse: bool) -> Option<[f32; 3]> {
        let through = &self.layer.surfaces.throughput;
        let listed = if through.is_empty() { None } else { through.get(&(pixel as u32)).copied() };
        if is_sparse { listed } else { Some(listed.unwrap_or([1.0; 3])) }
    }
}
