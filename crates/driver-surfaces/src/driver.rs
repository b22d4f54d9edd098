//! The driver of a whole session: one store of light, and a view of it at a time.
//!
//! Unlike other drivers it keeps every sample for the whole session: a frame depends on the set of
//! samples inserted since the session began, in any order.

use crate::place::Placed;
use crate::{Materials, Placer, RaySample, Seen, Store, View};
use glam::DVec3;
use holo_display::{
    Driver, DriverError, End, Frame, LiveSample, Look, Resolution, SurfaceAt, beams_ending_on,
    beams_mostly_ending_on, covered, uncovered_pixels,
};
use holo_raycast::Raycaster;
use holo_section::{BeamKey, Sample, Section};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// The driver's name.
const NAME: &str = "surfaces";

/// Cells kept at the most, 96 bytes each.
const MOST_CELLS: usize = 8_000_000;

/// Width of the finest cells, as a share of the scene's size. A room of 10 m gets cells of 1 cm.
const FINEST: f64 = 1e-3;

/// Samples that wait before they are placed together.
const BATCH: usize = 1 << 16;

/// Pixels a side of the squares that share one look-up, at full and at half resolution.
const SQUARES: (usize, usize) = (4, 2);

/// Beams that are asked for first.
const FIRST_BEAMS: f64 = 8_000.0;

/// How far behind a section's wall a point may seem to lie that lies on it, relative to the ray.
const SLACK: f64 = 0.01;

/// Rounding of a live ray's distance, relative.
const LIVE_ROUNDING: f64 = 1e-5;

/// Draws light that is kept on the scene's surfaces.
pub struct SurfacesDriver {
    sections: Arc<[Section]>,
    raycaster: Arc<Raycaster>,
    materials: Arc<Materials>,
    store: Store,
    /// Samples that are not in the store yet, and the beams that they belong to, in pieces.
    waiting: Vec<Sample>,
    waiting_of: Vec<(BeamKey, Range<usize>)>,
    shown: Option<Shown>,
}

/// The view that is shown.
struct Shown {
    look: Look,
    view: View,
    covered: Vec<bool>,
}

impl SurfacesDriver {
    /// Returns a driver that keeps light on the surfaces of `raycaster`'s scene.
    pub fn new(sections: Arc<[Section]>, raycaster: Arc<Raycaster>) -> Self {
        let (low, high) = raycaster.scene().bounds();
        let finest = (FINEST * low.distance(high)).max(f64::from(f32::MIN_POSITIVE)) as f32;
        Self {
            sections,
            materials: Arc::new(Materials::new(raycaster.scene())),
            raycaster,
            store: Store::new(finest, MOST_CELLS),
            waiting: Vec::new(),
            waiting_of: Vec::new(),
            shown: None,
        }
    }

    /// Puts all samples that wait into the store.
    fn place_waiting(&mut self) {
        let placer = Placer::new(&self.raycaster, &self.materials);
        let place = |mut placed: Vec<Placed>, (key, range): &(BeamKey, Range<usize>)| {
            if let Some(section) = self.sections.get(usize::from(key.section)) {
                let samples = &self.waiting[range.clone()];
                placer.place_beam(section, key.beam, samples, &mut placed);
            }
            placed
        };
        let placed: Vec<Vec<Placed>> = self.waiting_of.par_iter().fold(Vec::new, place).collect();
        self.store.add(&placed.concat());
        self.waiting.clear();
        self.waiting_of.clear();
    }
}

impl Shown {
    /// Returns the distance that a surface was seen at, scene units.
    fn distance(&self, seen: &Seen) -> f32 {
        if !seen.is_surface() {
            return f32::INFINITY;
        }
        let size = (self.view.size.0 as u32, self.view.size.1 as u32);
        seen.width / self.look.view.pixel_footprint(size, 1.0) as f32
    }

    fn depth(&self) -> Vec<f32> {
        self.view.seen.iter().map(|seen| self.distance(seen)).collect()
    }

    /// Returns the surface points that are seen, in the scene.
    fn ends(&self, origin: DVec3) -> Vec<End> {
        let surfaces = self.view.seen.iter().filter(|seen| seen.is_surface());
        let end = |seen: &Seen| End {
            point: origin + seen.point.as_dvec3(),
            normal: Some(seen.normal.as_dvec3()),
        };
        surfaces.map(end).collect()
    }
}

impl Driver for SurfacesDriver {
    fn name(&self) -> &'static str {
        NAME
    }

    fn keeps_samples(&self) -> bool {
        true
    }

    fn look(&mut self, look: &Look) -> Result<(), DriverError> {
        if look.view.is_clipped() {
            let reason = "views with -vo or -va are not drawn; use --driver voronoi".to_owned();
            return Err(DriverError { driver: NAME, reason });
        }
        let size = look.resolution.computed(look.size);
        let raycaster = Arc::clone(&self.raycaster);
        let view = View::new(raycaster, Arc::clone(&self.materials), &look.view, size);
        let covered = covered(&self.sections, &look.view, size);
        self.store.begin_round();
        self.shown = Some(Shown { look: *look, view, covered });
        Ok(())
    }

    fn insert(&mut self, beam: BeamKey, _paths: u16, samples: &[Sample]) {
        let begin = self.waiting.len();
        self.waiting.extend_from_slice(samples);
        self.waiting_of.push((beam, begin..self.waiting.len()));
        if self.waiting.len() >= BATCH {
            self.place_waiting();
        }
    }

    fn insert_unseen(&mut self, _beam: BeamKey) {
        // The scene tells what such a beam shows.
    }

    fn insert_live(&mut self, _paths: u16, rays: &[LiveSample]) {
        let rays: Vec<RaySample> = rays
            .iter()
            .map(|ray| RaySample {
                origin: ray.origin,
                direction: ray.direction,
                distance: ray.distance,
                uncertainty: LIVE_ROUNDING * ray.distance,
                radiance: ray.radiance,
            })
            .collect();
        let mut placed = Vec::with_capacity(rays.len());
        Placer::new(&self.raycaster, &self.materials).place_rays(&rays, &mut placed);
        self.store.add(&placed);
    }

    fn draw(&mut self, _stage_ended: &mut dyn FnMut(&'static str)) -> Frame {
        self.place_waiting();
        let Some(shown) = &self.shown else { return Frame::black((1, 1)) };
        let Look { view, size, resolution } = shown.look;
        let squares = if resolution == Resolution::Full { SQUARES.0 } else { SQUARES.1 };
        let drawn = shown.view.draw(&self.store, squares);
        let mut frame = Frame::black(resolution.computed(size));
        frame.picture.view = Some(view);
        frame.picture.pixels = drawn.pixels;
        frame.depth = shown.depth();
        frame.samples_used = self.store.samples();
        let count = |is: &dyn Fn(usize) -> bool| (0..frame.depth.len()).filter(|&p| is(p)).count();
        frame.uncovered_pixels = count(&|pixel| !shown.covered[pixel]) as u64;
        frame.empty_pixels = count(&|pixel| drawn.errors[pixel].is_infinite()) as u64;
        if resolution != Resolution::Full {
            frame = frame.enlarged(size);
        }
        frame.blank_corners(&view);
        frame
    }

    fn depth(&mut self) -> Vec<f32> {
        self.shown.as_ref().map_or_else(Vec::new, Shown::depth)
    }

    fn knows_depth(&self) -> bool {
        true
    }

    fn surface_at(&mut self, column: u32, row: u32) -> Option<SurfaceAt> {
        let shown = self.shown.as_ref()?;
        let (size, cast) = (shown.look.size, shown.view.size);
        if column >= size.0 || row >= size.1 {
            return None;
        }
        let at = |at: u32, size: u32, cast: usize| at as usize * cast / size as usize;
        let pixel = at(row, size.1, cast.1) * cast.0 + at(column, size.0, cast.0);
        let distance = shown.distance(&shown.view.seen[pixel]);
        Some(SurfaceAt { distance, triangle: None })
    }

    fn uncovered(&self) -> Vec<u32> {
        match &self.shown {
            Some(shown) if shown.look.resolution == Resolution::Full => {
                uncovered_pixels(&shown.covered, &shown.look.view, shown.look.size)
            }
            _ => Vec::new(),
        }
    }

    fn best_surface_beams(&self, _samples_per_beam: &dyn Fn(u16) -> f64) -> Vec<BeamKey> {
        let Some(shown) = &self.shown else { return Vec::new() };
        let ends = shown.ends(self.raycaster.scene().origin);
        beams_mostly_ending_on(&self.sections, &ends, SLACK, FIRST_BEAMS, |_| 1.0)
    }

    fn surface_beams(&self) -> Vec<BeamKey> {
        let Some(shown) = &self.shown else { return Vec::new() };
        beams_ending_on(&self.sections, &shown.ends(self.raycaster.scene().origin), SLACK)
    }
}
