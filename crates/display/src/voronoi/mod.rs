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
//! - A pixel whose ray meets nothing is the sky, exactly; one that has no ray, in the corners of a fisheye, is 0.

mod beams;
mod cast;
mod covered;
mod deposit;
mod drawing;
mod edges;
mod guess;
mod indirect;
mod labels;
mod reconstruct;
mod shade;
mod surfaces;

use crate::Frame;
use crate::camera::Camera;
use crate::quadtree::reproject::{DistanceTable, PlacedSection};
use deposit::{Beam, Depositor, Sums};
use drawing::Drawing;
use edges::EdgePoints;
use guess::Guesses;
use holo_light::Store;
use holo_picture::{Picture, View};
use holo_raycast::Raycaster;
use holo_section::{BeamId, Sample, Section};
use reconstruct::Light;
use shade::Shadings;
use std::sync::{Arc, Mutex, OnceLock};
use surfaces::{Caster, Seen, Surfaces};

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
    /// Samples in the sums.
    samples: u64,
    /// What was made of them for the last picture: nothing is done again for layers that have no new samples.
    made: Mutex<Option<Made>>,
}

/// Light made of a layer's samples, and what it was made of.
struct Made {
    from: MadeFrom,
    light: Arc<Light>,
    guesses: Arc<Guesses>,
}

/// What a layer's light is a function of, besides what never changes.
#[derive(Clone, Copy, PartialEq, Eq)]
struct MadeFrom {
    samples: u64,
    paths: u16,
    records: usize,
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
    records: Option<Arc<Store>>,
    /// Made with the first picture.
    edge_points: OnceLock<EdgePoints>,
}

impl Voronoi {
    /// What the view sees, without light yet; `size` as from [`View::resolve`], which bounds it: memory is in proportion.
    pub fn new(sections: Arc<[Section]>, raycaster: Arc<Raycaster>, view: View, size: (u32, u32)) -> Self {
        let camera = Camera::new(&view, size);
        let layers = Caster::new(&raycaster, &view, &camera, size).surfaces().into_iter();
        let layers = layers.map(|surfaces| Layer {
            sums: bytemuck::zeroed_vec(surfaces.seen.len()),
            surfaces,
            samples: 0,
            made: Mutex::default(),
        });
        let layers = layers.collect();
        let covered = covered::covered(&sections, &view, size);
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
            records: None,
            edge_points: OnceLock::new(),
        }
    }

    /// Takes indirect light from these records where there are no samples. Records of the samples' own settings: lengths
    /// relative to the scene's origin.
    #[must_use]
    pub fn with_records(self, records: Arc<Store>) -> Self {
        Self { records: Some(records), ..self }
    }

    /// The view shown.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// Distance from the eye of what each pixel sees, as [`Frame::depth`].
    pub fn depth(&self) -> Vec<f32> {
        let sight = |seen: &Seen| self.camera.sight(seen.position).length();
        let depth = |seen: &Seen| if seen.is_sky() { f32::INFINITY } else { sight(seen) };
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
            let used = depositor.insert(&Beam { section: placed, pair, paths }, samples, &mut layer.sums);
            layer.samples += used;
            self.samples += used;
        }
        self.paths = self.paths.max(paths);
    }

    /// Corners of fisheyes look nowhere.
    fn blank_corners(&self, frame: &mut Frame) {
        let (width, _) = self.size;
        for ((number, pixel), depth) in (0..).zip(&mut frame.picture.pixels).zip(&mut frame.depth) {
            let (x, y) = View::pixel_centre(self.size, number % width, number / width);
            if self.view.try_ray(x, y).is_none() {
                (*pixel, *depth) = ([0.0; 3], 0.0);
            }
        }
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
        let drawing = Drawing::new(self);
        let guessed_pixels;
        (frame.empty_pixels, guessed_pixels) = drawing.paint(&mut frame.picture.pixels);
        if !self.camera.is_perspective() {
            self.blank_corners(&mut frame);
        }
        Drawn { frame, guessed_pixels }
    }
}
