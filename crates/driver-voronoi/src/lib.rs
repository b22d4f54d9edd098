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
//! - A pixel whose ray meets nothing is the sky (black if the view clips it), exactly; one that has no ray, in the corners of a fisheye, is 0.

mod beams;
mod blocks;
mod cast;
mod deposit;
mod drawing;
mod edges;
mod follow;
mod guess;
mod indirect;
mod labels;
mod light;
mod lit;
mod live;
mod lone;
mod portals;
mod reconstruct;
mod session;
mod shade;
mod stand_ins;
mod surfaces;
mod tents;
mod upscale;

use deposit::{Beam, Depositor, Deposits, SideSums, Sums};
use drawing::Drawing;
use edges::EdgePoints;
use guess::Guesses;
use holo_cpu::{copied, zeroed};
use holo_display::{Camera, DistanceTable, Frame, PlacedSection, Resolution, covered, for_bands};
use holo_light::Store;
use holo_picture::{Picture, View};
use holo_raycast::Raycaster;
use holo_section::{BeamKey, Sample, Section};
use light::Light;
use reconstruct::Scratch;
pub use session::{MakeDriver, VoronoiDriver};
use shade::Shadings;
pub use stand_ins::{StandIn, StandIns};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use surfaces::{Caster, Seen, Surfaces};
use upscale::{FinePoints, Scale, upscale};

/// Rows of which depths are found together.
const DEPTH_ROWS: usize = 32;

/// One surface a pixel, with its samples.
struct Layer {
    surfaces: Arc<Surfaces>,
    sums: Vec<Sums>,
    /// Samples in the sums.
    samples: u64,
    /// By block, how many there were with the last one that came into it.
    changes: Vec<u64>,
    /// Sums of faces that only points next to edges see.
    narrow: SideSums,
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

/// What is found once for a view, with its first picture: samples do not change it.
#[derive(Default)]
struct Once {
    edge_points: OnceLock<EdgePoints>,
    fine_points: OnceLock<FinePoints>,
    /// Pixels that see smooth metals.
    metals: OnceLock<Vec<usize>>,
    /// By pixel, what it takes to paint most of them.
    plain: OnceLock<Vec<u32>>,
    depths: OnceLock<Vec<f32>>,
}

/// The geometry-guided driver: samples in, pictures out.
pub struct Voronoi {
    sections: Arc<[Section]>,
    placed: Vec<PlacedSection>,
    raycaster: Arc<Raycaster>,
    portals: Option<Arc<Raycaster>>,
    /// By pixel cast, whether it looks through a portal; empty if none does.
    beyond: Vec<bool>,
    shadings: Shadings,
    view: View,
    camera: Camera,
    /// Pixels cast.
    size: (u32, u32),
    /// How a picture of more pixels lies on these.
    scale: Option<Scale>,
    distances: DistanceTable,
    /// As [`Caster::surfaces`] has them.
    layers: Vec<Layer>,
    /// By pixel of the picture, whether some section covers it.
    covered: Vec<bool>,
    uncovered: u64,
    samples: u64,
    paths: u16,
    records: Option<Arc<Store>>,
    once: Arc<Once>,
    scratch: Mutex<Scratch>,
    painted: Mutex<Painted>,
}

/// The pixels cast, as last painted: what is drawn again with nothing new is copied.
#[derive(Default)]
struct Painted {
    pixels: Vec<[f32; 3]>,
    empty_pixels: u64,
    guessed_pixels: u64,
    /// Of how many records of indirect light, if no samples came since.
    of: Option<usize>,
}

impl Voronoi {
    /// What the view sees, without light yet; `size` as from [`View::resolve`], which bounds it: memory is in proportion.
    pub fn new(
        sections: Arc<[Section]>,
        raycaster: Arc<Raycaster>,
        view: View,
        size: (u32, u32),
    ) -> Self {
        Self::through_portals(sections, raycaster, None, view, size)
    }

    /// The same with surfaces that are invisible, but of what lies beyond them nothing is known: samples that are seen through them
    /// are drawn as a quadtree does, by their own depth.
    pub fn through_portals(
        sections: Arc<[Section]>,
        raycaster: Arc<Raycaster>,
        portals: Option<Arc<Raycaster>>,
        view: View,
        size: (u32, u32),
    ) -> Self {
        Self::at_resolution(sections, raycaster, portals, view, size, Resolution::Full)
    }

    /// The same with surfaces and light at fewer pixels than the picture's `size`, if so wanted.
    pub fn at_resolution(
        sections: Arc<[Section]>,
        raycaster: Arc<Raycaster>,
        portals: Option<Arc<Raycaster>>,
        view: View,
        shown: (u32, u32),
        resolution: Resolution,
    ) -> Self {
        let size = resolution.computed(shown);
        let scale = (size != shown).then(|| Scale::new(shown, size));
        let camera = Camera::new(&view, size);
        let caster = Caster::new(&raycaster, &view, &camera, size).with_portals(portals.as_deref());
        let layers = caster.surfaces();
        let beyond = match layers.first() {
            Some(main) if portals.is_some() => portals::beyond(&caster, &main.seen),
            _ => Vec::new(),
        };
        let layers = layers.into_iter();
        let layers = layers.map(|surfaces| Layer {
            sums: zeroed(surfaces.seen.len()),
            changes: vec![0; blocks::count(surfaces.size)],
            narrow: SideSums::default(),
            surfaces: Arc::new(surfaces),
            samples: 0,
            made: Mutex::default(),
        });
        let layers = layers.collect();
        let covered = covered(&sections, &view, size);
        let covered = match &scale {
            Some(scale) => scale.spread(&covered),
            None => covered,
        };
        Self {
            placed: sections.iter().map(|section| PlacedSection::new(section, &camera)).collect(),
            shadings: Shadings::new(raycaster.scene(), view.clips_sky()),
            distances: DistanceTable::new(),
            sections,
            raycaster,
            portals,
            beyond,
            view,
            camera,
            size,
            layers,
            uncovered: covered.iter().filter(|&&covered| !covered).count() as u64,
            scale,
            covered,
            samples: 0,
            paths: 1,
            records: None,
            once: Arc::default(),
            scratch: Mutex::default(),
            painted: Mutex::default(),
        }
    }

    /// Takes indirect light from these records where there are no samples. Records of the samples' own settings: lengths
    /// relative to the scene's origin.
    #[must_use]
    pub fn with_records(self, records: Arc<Store>) -> Self {
        Self { records: Some(records), painted: Mutex::default(), ..self }
    }

    fn caster(&self) -> Caster<'_> {
        let caster = Caster::new(&self.raycaster, &self.view, &self.camera, self.size);
        caster.with_portals(self.portals.as_deref())
    }

    /// The view shown.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// At how many pixels surfaces are cast.
    pub fn resolution(&self) -> Resolution {
        if self.scale.is_some() { Resolution::Half } else { Resolution::Full }
    }

    /// Whether some section covers a pixel that is cast.
    fn is_covered(&self, pixel: usize) -> bool {
        self.covered[self.scale.as_ref().map_or(pixel, |scale| scale.first_held(pixel))]
    }

    /// Distance from the eye of what each pixel sees, as [`Frame::depth`].
    ///
    /// At a lower resolution that of the pixel cast nearest to each.
    pub fn depth(&self) -> Vec<f32> {
        let depths = self.once.depths.get_or_init(|| self.find_depth());
        self.scale.as_ref().map_or_else(|| depths.clone(), |scale| scale.spread(depths))
    }

    fn find_depth(&self) -> Vec<f32> {
        let sight = |seen: &Seen| self.camera.sight(seen.position).length();
        let Some(main) = self.layers.first() else { return Vec::new() };
        let mut depths: Vec<f32> = zeroed(main.surfaces.seen.len());
        for_bands(&mut depths, main.surfaces.size.0, DEPTH_ROWS, |part, depths| {
            let first = part * DEPTH_ROWS * main.surfaces.size.0;
            for (depth, seen) in depths.iter_mut().zip(&main.surfaces.seen[first..]) {
                *depth = if seen.is_sky() { f32::INFINITY } else { sight(seen) };
            }
        });
        depths
    }

    /// Adds samples of one beam, each the mean of `paths` paths. Samples of an unknown section or beam are left out.
    pub fn insert(&mut self, key: BeamKey, paths: u16, samples: &[Sample]) {
        let (number, beam) = (usize::from(key.section), key.beam);
        let Some(pair) = self.sections.get(number).and_then(|section| section.cells(beam)) else {
            return;
        };
        self.deposit(paths, |placed, depositor, to| {
            let section = placed.get(number);
            section
                .map_or(0, |section| depositor.insert(&Beam { section, pair, paths }, samples, to))
        });
    }

    /// Has each layer take what has come; `put` says how many of it found a pixel.
    fn deposit(
        &mut self,
        paths: u16,
        put: impl Fn(&[PlacedSection], &Depositor, &mut Deposits) -> u64,
    ) {
        for layer in &mut self.layers {
            let depositor = Depositor {
                camera: &self.camera,
                distances: &self.distances,
                surfaces: &layer.surfaces,
                shadings: &self.shadings,
                caster: Caster::new(&self.raycaster, &self.view, &self.camera, self.size),
            };
            let Layer { sums, changes, narrow, samples: before, .. } = layer;
            let used = put(
                &self.placed,
                &depositor,
                &mut Deposits { sums, changes, narrow, samples: *before },
            );
            layer.samples += used;
            self.samples += used;
        }
        self.paths = self.paths.max(paths);
        self.painted.get_mut().unwrap_or_else(PoisonError::into_inner).of = None;
    }

    /// Records of indirect light that there are.
    fn records(&self) -> usize {
        self.records.as_deref().map_or(0, Store::len)
    }

    /// Paints the pixels that are cast.
    fn paint(&self, drawing: &Drawing, painted: &mut Painted) {
        let count = self.size.0 as usize * self.size.1 as usize;
        if painted.pixels.len() != count {
            painted.pixels = zeroed(count);
        }
        (painted.empty_pixels, painted.guessed_pixels) = drawing.paint(&mut painted.pixels);
        if self.scale.is_none() {
            drawing.smooth(&mut painted.pixels);
        }
        painted.of = Some(self.records());
    }

    /// The picture of all samples so far. At a lower resolution, pixels that are counted are those cast, by how many of the picture's
    /// there are for each.
    pub fn draw(&self) -> Frame {
        let mut painted = self.painted.lock().unwrap_or_else(PoisonError::into_inner);
        let is_current = painted.of == Some(self.records());
        let drawing = (!is_current || self.scale.is_some()).then(|| Drawing::new(self));
        if let Some(drawing) = drawing.as_ref().filter(|_| !is_current) {
            self.paint(drawing, &mut painted);
        }
        let picture = Picture::new(0, 0);
        let (width, height) = self.size;
        let mut frame = Frame {
            certainty: Vec::new(),
            depth: copied(self.once.depths.get_or_init(|| self.find_depth())),
            picture: Picture {
                width,
                height,
                pixels: copied(&painted.pixels),
                view: Some(self.view),
                ..picture
            },
            uncovered_pixels: self.uncovered,
            empty_pixels: painted.empty_pixels,
            unseen_pixels: 0,
            guessed_pixels: painted.guessed_pixels,
            samples_used: self.samples,
        };
        drop(painted);
        if let Some((scale, drawing)) = self.scale.as_ref().zip(drawing) {
            let (width, height) = scale.fine;
            let of_all = |pixels: u64| {
                pixels * (width * height) as u64 / (scale.coarse.0 * scale.coarse.1) as u64
            };
            frame.empty_pixels = of_all(frame.empty_pixels);
            frame.guessed_pixels = of_all(frame.guessed_pixels);
            frame.depth = scale.spread(&frame.depth);
            let points = &self.once.fine_points;
            let pixels = upscale(&drawing, points, scale, &frame.picture.pixels);
            frame.picture = Picture { pixels, ..Picture::new(width as u32, height as u32) };
            frame.picture.view = Some(self.view);
        }
        frame.blank_corners(&self.view);
        frame
    }
}
