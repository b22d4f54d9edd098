//! The driver of a whole session: one store of light, and one view of it at a time.
//!
//! Unlike other drivers it stores every sample for the whole session. A frame at rest depends on
//! the set of samples inserted since the session began, in any order. Only the first frame of a
//! view may show light that earlier frames found.

use crate::draw::Drawn;
use crate::known::Known;
use crate::parts::PartsSource;
use crate::place::Placed;
use crate::shown::{Edges, Refined, Shown};
use crate::waits::Waits;
use crate::{Gathered, Materials, Placer, RaySample, Store, View};
use holo_denoise::Denoiser;
use holo_display::{
    BeamSearch, Certainty, Driver, DriverError, Frame, Interrupt, LiveSample, Look, PartsPlan,
    Resolution, Search, SurfaceAt, beams_ending_on, covered, uncovered_pixels,
};
use holo_picture::Picture;
use holo_raycast::Raycaster;
use holo_section::{BeamKey, Sample, Section};
use std::ops::Range;
use std::sync::Arc;

const NAME: &str = "surfaces";

/// Most bytes for samples.
const MOST_BYTES: usize = 1 << 30;

/// Most bytes for live rays.
const MOST_LIVE_BYTES: usize = 1 << 27;

/// Rounding of a sample's place, relative to the scene's size: 0.2 mm in a house of 20 m.
const FINEST: f64 = 1e-5;

/// Number of waiting samples at which they are placed together.
const BATCH: usize = 1 << 16;

/// Fewest waiting samples that are placed while no more arrive.
const LEAST_BATCH: usize = 1 << 12;

/// Greatest unknown share of a frame of known light, while the eye moves or has just stopped.
const MOST_UNKNOWN: f32 = 0.5;

/// The same in a glance.
const FEW_UNKNOWN: f32 = 0.25;

/// Least side of the filtered squares in a glance and while the eye moves, pixels. In the cabin at
/// 480 × 360, squares of one pixel delay a glance by 0.3 s.
const LEAST_STEP: usize = 2;

/// Side of the squares in a view's first frame of all pixels, so that it appears soon, pixels.
const FIRST_STEP: usize = 4;

/// Number of a pixel's own samples from which the light that a glossy surface sends to the eye is
/// no guess. Fewer are mostly those of other directions and of pixels around.
const ENOUGH_FOR_GLEAMS: u32 = 4;

/// How far behind a section's wall a point on that wall may seem to lie, relative to the ray.
const SLACK: f64 = 0.01;

/// Relative rounding of a live ray's distance.
const LIVE_ROUNDING: f64 = 1e-5;

/// Draws light that is stored on the scene's surfaces.
pub struct SurfacesDriver {
    sections: Arc<[Section]>,
    raycaster: Arc<Raycaster>,
    materials: Arc<Materials>,
    denoiser: Option<Denoiser>,
    store: Store,
    /// Samples traced for pixels that no section covers. In the best frames, only those pixels show
    /// them.
    live: Store,
    /// Light that frames have found.
    known: Known,
    /// Samples that are not in the store yet.
    waiting: Waits,
    /// The same of samples of the scene before an edit.
    earlier: Waits,
    /// Samples among those that are still in the store and must leave it.
    leaving: Waits,
    shown: Option<Shown>,
    /// Ends the drawing of frames at rest.
    interrupt: Interrupt,
}

impl SurfacesDriver {
    /// Returns a driver that stores light on the surfaces of `raycaster`'s scene. A denoiser is
    /// used at rest.
    pub fn new(
        sections: Arc<[Section]>,
        raycaster: Arc<Raycaster>,
        denoiser: Option<Denoiser>,
    ) -> Self {
        let (low, high) = raycaster.scene().bounds();
        let finest = (FINEST * low.distance(high)).max(f64::from(f32::MIN_POSITIVE)) as f32;
        Self {
            sections,
            materials: Arc::new(Materials::new(raycaster.scene())),
            raycaster,
            denoiser,
            store: Store::new(finest, MOST_BYTES),
            live: Store::new(finest, MOST_LIVE_BYTES),
            known: Known::default(),
            waiting: Waits::default(),
            earlier: Waits::default(),
            leaving: Waits::default(),
            shown: None,
            interrupt: Interrupt::default(),
        }
    }

    /// Replaces the scene, and forgets all samples.
    pub(crate) fn change_scene(&mut self, raycaster: Arc<Raycaster>) {
        let interrupt = std::mem::take(&mut self.interrupt);
        *self = Self::new(Arc::clone(&self.sections), raycaster, self.denoiser.take());
        self.interrupt = interrupt;
    }

    /// Puts all waiting samples into the store, and removes those that must leave it.
    fn place_waiting(&mut self) {
        let placed = self.waiting.take_placed(&self.sections, &self.raycaster, &self.materials);
        self.keep(&placed);
        if self.earlier.len() == 0 && self.leaving.len() == 0 {
            return;
        }
        let [earlier, leaving] = [&mut self.earlier, &mut self.leaving]
            .map(|waits| waits.take_placed(&self.sections, &self.raycaster, &self.materials));
        self.store.add_earlier(&earlier);
        // Whatever was rounded when they came is rounded in the same way again.
        self.store.remove_earlier(&leaving);
        self.has_faded();
    }

    /// Notes that what was found by earlier samples is no longer right.
    fn has_faded(&mut self) {
        self.known = Known::default();
        self.shown.iter_mut().for_each(|shown| shown.gathered = None);
    }

    /// Draws the current view. If there are live rays, also returns the sums that include them,
    /// from which pixels outside all sections are drawn.
    ///
    /// While the eye moves, the view shows light that earlier frames found, if enough of it is
    /// known. `None` without a view, or if the frame was interrupted.
    fn drawn(&mut self) -> Option<(Drawn, Option<Gathered>)> {
        if let Some(drawn) = self.drawn_from_known() {
            return Some((drawn, None));
        }
        self.place_waiting();
        self.drawn_from_samples()
    }

    /// Draws the current view from known light, if it is to be shown now.
    fn drawn_from_known(&mut self) -> Option<Drawn> {
        let shown = self.shown.as_mut()?;
        let drawn = shown.view.draw_known(&self.store, shown.known.as_ref()?);
        if shown.look.resolution != Resolution::Moving {
            (shown.known, shown.drawn) = (None, Some(Refined::KNOWN));
            shown.is_refined = true;
        }
        Some(drawn)
    }

    /// Draws the current view from all samples in the store. Returns what [`drawn`](Self::drawn)
    /// does.
    fn drawn_from_samples(&mut self) -> Option<(Drawn, Option<Gathered>)> {
        let shown = self.shown.as_mut()?;
        let Look { resolution, .. } = shown.look;
        if shown.look.is_small() {
            while shown.look_into_edges(&self.store) {}
        }
        let samples = self.store.samples() + self.live.samples();
        let is_best = shown.draws_best(samples);
        let is_for_file = std::mem::take(&mut shown.is_for_file);
        let mut refined = shown.refined(self.denoiser.is_some());
        let never = Interrupt::default();
        let is_first = shown.drawn.is_none();
        let can_end_early = resolution != Resolution::Moving && !is_for_file && !is_first;
        let interrupt = if can_end_early { &self.interrupt } else { &never };
        let (view, store) = (&shown.view, &self.store);
        let gathered = shown.gathered.get_or_insert_with(|| Gathered::new(view, store));
        let mut denoiser = self.denoiser.as_mut().filter(|_| refined.is_denoised);
        let is_soon = !shown.is_refined;
        let least = match resolution {
            Resolution::Full if is_soon => FIRST_STEP,
            Resolution::Full => 1,
            Resolution::Half | Resolution::Moving => LEAST_STEP,
        };
        let has_live = self.live.samples() > 0 && shown.covered.contains(&false);
        let density = gathered.density(view);
        let step = density.step(is_best, denoiser.is_some());
        let best_step = density.step(true, denoiser.is_some());
        refined.is_best &= is_best || (step == best_step && !is_soon && !has_live);
        let step = step.max(least);
        let known = &mut self.known;
        let mut draw = |gathered: &Gathered, denoiser: Option<&mut Denoiser>| {
            gathered.draw_and_learn((view, store), step, denoiser, known, interrupt)
        };
        let all = has_live.then(|| gathered.with(view, &self.live));
        let drawn = match &all {
            None => draw(gathered, denoiser)?,
            // To appear soon, the frame is drawn once, from all samples.
            Some(all) if !is_best => draw(all, denoiser)?,
            Some(all) => {
                let mut drawn = draw(gathered, denoiser.as_deref_mut())?;
                let with_live = draw(all, denoiser)?;
                for pixel in (0..drawn.pixels.len()).filter(|&pixel| !shown.covered[pixel]) {
                    drawn.pixels[pixel] = with_live.pixels[pixel];
                    drawn.errors[pixel] = with_live.errors[pixel];
                }
                drawn
            }
        };
        shown.is_refined |= resolution != Resolution::Moving;
        (shown.drawn, shown.drawn_from) = (Some(refined), Some(samples));
        Some((drawn, all))
    }

    fn parts(&mut self) -> PartsSource<'_> {
        PartsSource {
            sections: &self.sections,
            raycaster: &self.raycaster,
            materials: &self.materials,
            store: &self.store,
            live: &self.live,
            denoiser: self.denoiser.as_mut(),
            interrupt: &self.interrupt,
        }
    }

    /// Looks into some of the view's pixels on edges. Returns true if more are left.
    fn look_into_edges(&mut self) -> bool {
        let looks =
            |shown: &&mut Shown| shown.look.resolution == Resolution::Full && shown.known.is_none();
        let Some(shown) = self.shown.as_mut().filter(looks) else { return false };
        shown.look_into_edges(&self.store)
    }

    /// Adds placed samples to the store, and to the current view.
    fn keep(&mut self, placed: &[Placed]) {
        if self.store.add(placed) {
            self.has_faded();
        }
        if let Some(Shown { view, gathered: Some(gathered), .. }) = &mut self.shown {
            gathered.add(view, placed);
        }
    }
}

impl Driver for SurfacesDriver {
    fn name(&self) -> &'static str {
        NAME
    }

    fn keeps_samples(&self) -> bool {
        true
    }

    fn room(&self) -> u64 {
        self.store.most_samples() as u64 / 4 * 3
    }

    fn look(&mut self, look: &Look) -> Result<(), DriverError> {
        let size = look.resolution.computed(look.size);
        let raycaster = Arc::clone(&self.raycaster);
        let view = View::new(raycaster, Arc::clone(&self.materials), &look.view, size);
        let covered = covered(&self.sections, &look.view, size);
        self.store.begin_round();
        self.live.begin_round();
        let look = *look;
        let glanced = |shown: &Shown| {
            let Look { view, resolution, .. } = shown.look;
            view == look.view && resolution == Resolution::Half && shown.is_refined
        };
        let is_refined = look.is_small() || self.shown.as_ref().is_some_and(glanced);
        let moved = |shown: &Shown| shown.look.resolution == Resolution::Moving;
        let has_stopped = self.shown.as_ref().is_some_and(moved);
        let lit = (&self.store, &self.known);
        let known = match look.resolution {
            Resolution::Moving => view.known(lit, 2, MOST_UNKNOWN),
            Resolution::Half => view.known(lit, 2, FEW_UNKNOWN),
            Resolution::Full if has_stopped => view.known(lit, FIRST_STEP, MOST_UNKNOWN),
            Resolution::Full => None,
        };
        self.shown = Some(Shown {
            look,
            view,
            gathered: None,
            has_stopped,
            is_refined,
            is_for_file: false,
            edges: Edges::Some(Vec::new()),
            known,
            drawn: None,
            drawn_from: None,
            covered,
        });
        Ok(())
    }

    fn insert(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) {
        self.waiting.push(beam, paths, samples);
        if self.waiting.len() >= BATCH {
            self.place_waiting();
            // While samples pour in, the session has no time for `prepare`.
            self.look_into_edges();
        }
    }

    fn insert_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) {
        self.earlier.push(beam, paths, samples);
        if self.earlier.len() >= BATCH {
            self.place_waiting();
        }
    }

    fn remove_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) -> bool {
        self.leaving.push(beam, paths, samples);
        true
    }

    fn insert_unseen(&mut self, _beam: BeamKey) {
        // The scene shows what lies along such a beam.
    }

    fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        let rays: Vec<RaySample> = rays
            .iter()
            .map(|ray| RaySample {
                origin: ray.origin,
                direction: ray.direction,
                distance: ray.distance,
                uncertainty: LIVE_ROUNDING * ray.distance,
                radiance: ray.radiance,
                paths: u32::from(paths),
            })
            .collect();
        let mut placed = Vec::with_capacity(rays.len());
        Placer::new(&self.raycaster, &self.materials).place_rays(&rays, &mut placed);
        self.live.add(&placed);
    }

    fn draw_for_file(&mut self) {
        if let Some(shown) = &mut self.shown {
            (shown.known, shown.is_refined, shown.is_for_file) = (None, true, true);
        }
    }

    fn plan_parts(&mut self, look: &Look) -> Option<PartsPlan> {
        self.place_waiting();
        Some(self.parts().plan(look))
    }

    fn draw_part(
        &mut self,
        plan: &PartsPlan,
        columns: Range<u32>,
        rows: Range<u32>,
    ) -> Option<Picture> {
        self.parts().part(plan, columns, rows)
    }

    fn end_early_by(&mut self, interrupt: Interrupt) {
        self.interrupt = interrupt;
    }

    fn settle(&mut self) {
        if let Some(shown) = self.shown.as_mut().filter(|shown| !shown.awaits_first_after_stop()) {
            (shown.known, shown.is_refined) = (None, true);
        }
    }

    fn prepare(&mut self) -> bool {
        let waits = [&self.waiting, &self.earlier, &self.leaving];
        if waits.iter().any(|waits| waits.len() >= LEAST_BATCH) {
            self.place_waiting();
        }
        let store = &self.store;
        let gathers = |shown: &&mut Shown| shown.look.resolution != Resolution::Moving;
        let Some(shown) = self.shown.as_mut().filter(gathers) else { return false };
        if shown.known.is_some() {
            // Gathering now would delay the first frame.
            return false;
        }
        if shown.gathered.is_none() {
            shown.gathered = Some(Gathered::new(&shown.view, store));
            return shown.look.resolution == Resolution::Full;
        }
        self.look_into_edges()
    }

    fn draw(&mut self, _stage_ended: &mut dyn FnMut(&'static str)) -> Frame {
        let Some((drawn, all)) = self.drawn() else { return Frame::black((1, 1)) };
        let Some(shown) = &self.shown else { return Frame::black((1, 1)) };
        let Look { view, size, resolution } = shown.look;
        let mut frame = Frame::black(resolution.computed(size));
        frame.picture.view = Some(view);
        frame.picture.pixels = drawn.pixels;
        frame.depth = shown.depth();
        if let Some(gathered) = &shown.gathered {
            let all = all.as_ref().unwrap_or(gathered);
            let certainty = drawn.errors.iter().enumerate().map(|(pixel, &error)| {
                let sums = if shown.covered[pixel] { gathered.pixels() } else { all.pixels() };
                Certainty { error, samples: sums[pixel].count }
            });
            frame.certainty = certainty.collect();
        }
        let used = shown.gathered.as_ref().map(Gathered::samples);
        frame.samples_used = used.unwrap_or_else(|| self.store.samples());
        let count = |is: &dyn Fn(usize) -> bool| (0..frame.depth.len()).filter(|&p| is(p)).count();
        frame.uncovered_pixels = count(&|pixel| !shown.covered[pixel]) as u64;
        let unknown = count(&|pixel| drawn.errors[pixel].is_infinite()) as u64;
        // Unknown pixels have the mean of all known light, if there is any.
        let is_empty = self.store.samples() == 0;
        (frame.empty_pixels, frame.guessed_pixels) =
            if is_empty { (unknown, 0) } else { (0, unknown) };
        let is_guessed = |pixel: usize| {
            let own = frame.certainty.get(pixel).map_or(0, |certainty| certainty.samples);
            own < ENOUGH_FOR_GLEAMS && shown.view.is_glossy(&shown.view.seen[pixel])
        };
        frame.gleam_pixels = count(&is_guessed) as u64;
        if resolution == Resolution::Half {
            frame = frame.enlarged(size);
        }
        frame.blank_corners(&view);
        frame
    }

    fn refines(&self) -> bool {
        let refines = |shown: &Shown| {
            shown.drawn.is_some_and(|drawn| drawn != shown.refined(self.denoiser.is_some()))
        };
        self.shown.as_ref().is_some_and(refines)
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
        Some(SurfaceAt { distance, triangle: shown.view.triangle(pixel) })
    }

    fn uncovered(&self) -> Vec<u32> {
        match &self.shown {
            Some(shown) if shown.look.resolution == Resolution::Full => {
                let mut pixels =
                    uncovered_pixels(&shown.covered, &shown.look.view, shown.look.size);
                // The sky and lamps need no samples.
                pixels.retain(|&pixel| shown.view.seen[pixel as usize].is_surface());
                pixels
            }
            _ => Vec::new(),
        }
    }

    fn surface_beams(&self, search: Search) -> Option<BeamSearch> {
        let ends = self.shown.as_ref()?.ends(self.raycaster.scene().origin);
        let sections = Arc::clone(&self.sections);
        (!ends.is_empty()).then(|| -> BeamSearch {
            Box::new(move || beams_ending_on(&sections, &ends, SLACK, search))
        })
    }
}
