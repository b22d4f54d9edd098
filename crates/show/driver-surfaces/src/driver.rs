//! The light of a session, and the views that are drawn from it.
//!
//! Unlike other drivers it stores every sample for the whole session. A frame at rest depends on
//! the set of samples inserted since the session began, in any order. Only the first frame of a
//! view may show light that earlier frames found, also those of other renderers.

use crate::cube_light::LightSources;
use crate::draw::Drawn;
use crate::known::LightMemory;
use crate::light_store::{Follower, Placed, Reflections, Waits};
use crate::parts::PartsSource;
use crate::shown::{Edges, Refined, SurfacesView};
use crate::{Gathered, LightStore, Materials, Placer, RaySample, SurfaceView};
use holo_denoise::Denoiser;
use holo_display::{
    Age, BeamSearch, Certainty, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt,
    Light, LiveSample, PartsPlan, PartsRenderer, PixelWeights, RayWishes, Renderer, Search,
    WantedBeam, beams_ending_on, covered, uncovered_pixels, viewpoint_radius,
};
use holo_picture::{Picture, View};
use holo_raycast::Raycaster;
use holo_section::{BeamKey, RayCoords, Sample, Section};
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// The driver's name, also with stand-ins.
pub(crate) const NAME: &str = "surfaces";

/// Most bytes for samples: 640 MiB, for 33 M samples.
const MOST_BYTES: usize = 5 << 27;

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

/// The same in the first frame after a jump.
const FEW_UNKNOWN: f32 = 0.25;

/// Least side of the filtered squares while the eye moves, pixels. In the cabin at 480 × 360,
/// squares of one pixel delayed a frame by 0.3 s.
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

/// Returns the driver `surfaces`, which stores light on the surfaces of `raycaster`'s scene. A
/// denoiser is used at rest.
pub fn surfaces_driver(
    sections: Arc<[Section]>,
    raycaster: Arc<Raycaster>,
    denoiser: Option<Denoiser>,
) -> Driver {
    let light = SurfaceLight::new(sections, raycaster, denoiser);
    Driver { knows_surfaces: true, ..Driver::new(NAME, light) }
}

/// Light that is stored on the scene's surfaces.
pub struct SurfaceLight(Arc<Mutex<LitScene>>);

/// Draws one view at a time of light that is stored on the scene's surfaces.
pub struct SurfaceRenderer {
    scene: Arc<Mutex<LitScene>>,
    /// Number of its view.
    number: u64,
}

/// The light, and the views of its renderers.
struct LitScene {
    sections: Arc<[Section]>,
    raycaster: Arc<Raycaster>,
    materials: Arc<Materials>,
    denoiser: Option<Denoiser>,
    store: LightStore,
    /// Samples traced for pixels that no section covers. In the best frames, only those pixels show
    /// them.
    live: LightStore,
    /// Light that frames have found.
    known: LightMemory,
    /// The reflection cubes of shiny objects, if the scene has some.
    reflections: Option<Reflections>,
    /// Samples that are not in the store yet.
    waiting: Waits,
    /// The same of samples of the scene before an edit.
    earlier: Waits,
    /// Samples among those that are still in the store and must leave it.
    leaving: Waits,
    /// The views that are shown, by the numbers of their renderers.
    views: BTreeMap<u64, SurfacesView>,
    /// Number of the next renderer.
    next: u64,
}

impl SurfaceLight {
    /// Returns the light of `raycaster`'s scene, without any sample. A denoiser is used at rest.
    pub fn new(
        sections: Arc<[Section]>,
        raycaster: Arc<Raycaster>,
        denoiser: Option<Denoiser>,
    ) -> Self {
        let (low, high) = raycaster.scene().bounds();
        let finest = (FINEST * low.distance(high)).max(f64::from(f32::MIN_POSITIVE)) as f32;
        Self(Arc::new(Mutex::new(LitScene {
            sections,
            materials: Arc::new(Materials::new(raycaster.scene())),
            reflections: Reflections::find(&raycaster),
            raycaster,
            denoiser,
            store: LightStore::new(finest, MOST_BYTES),
            live: LightStore::new(finest, MOST_LIVE_BYTES),
            known: LightMemory::default(),
            waiting: Waits::default(),
            earlier: Waits::default(),
            leaving: Waits::default(),
            views: BTreeMap::new(),
            next: 0,
        })))
    }

    /// Returns a renderer that draws from this light.
    pub fn surface_renderer(&self) -> SurfaceRenderer {
        let mut scene = self.0.lock();
        let number = scene.next;
        scene.next += 1;
        SurfaceRenderer { scene: Arc::clone(&self.0), number }
    }

    /// Takes the denoiser, for another light.
    pub(crate) fn take_denoiser(&mut self) -> Option<Denoiser> {
        self.0.lock().denoiser.take()
    }
}

impl Light for SurfaceLight {
    fn renderer(&mut self) -> Box<dyn Renderer> {
        Box::new(self.surface_renderer())
    }

    fn room(&self) -> u64 {
        self.0.lock().store.most_samples() as u64 / 4 * 3
    }

    fn insert(&mut self, age: Age, beam: BeamKey, paths: u16, samples: &[Sample]) {
        let scene = &mut *self.0.lock();
        // A beam may have millions of samples. To place them takes several times their memory.
        for samples in samples.chunks(BATCH) {
            let waits = match age {
                Age::Present => &mut scene.waiting,
                Age::Earlier => &mut scene.earlier,
            };
            waits.push(beam, paths, samples);
            if waits.len() >= BATCH {
                scene.place_waiting();
                if age == Age::Present {
                    // While samples pour in, the session has no time for `prepare`.
                    let shown = scene.views.values_mut();
                    shown.for_each(|shown| _ = shown.prepare_edges(&scene.store));
                }
            }
        }
    }

    fn remove_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) -> bool {
        self.0.lock().leaving.push(beam, paths, samples);
        true
    }

    fn insert_unseen(&mut self, _beam: BeamKey) {
        // The scene shows what lies along such a beam.
    }
}

impl LitScene {
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
        self.known = LightMemory::default();
        self.reflections.iter_mut().for_each(Reflections::forget);
        self.views.values_mut().for_each(|shown| shown.gathered = None);
    }

    /// Adds placed samples to the store, and to all views.
    fn keep(&mut self, placed: &[Placed]) {
        if self.store.add(placed) {
            self.has_faded();
        }
        for SurfacesView { view, gathered, .. } in self.views.values_mut() {
            gathered.iter_mut().for_each(|gathered| gathered.add(view, placed));
        }
    }

    /// Starts another view of a renderer.
    fn look(&mut self, number: u64, look: &FrameRequest) {
        let size = look.size;
        let (raycaster, materials) = (Arc::clone(&self.raycaster), Arc::clone(&self.materials));
        let reflections = self.reflections.as_ref();
        let eye = (&look.view, size);
        let view =
            SurfaceView::with_reflections(raycaster, materials, eye, reflections, look.is_moving);
        if let Some(reflections) = &mut self.reflections {
            reflections.show(&view.objects);
        }
        let covered = covered(&self.sections, &look.view, size);
        self.store.begin_round();
        self.live.begin_round();
        let has_stopped = self.views.get(&number).is_some_and(|shown| shown.look.is_moving);
        let lit = (&self.store, &self.known, self.reflections.as_ref());
        let known = match look.is_moving {
            true => view.known(lit, LEAST_STEP, MOST_UNKNOWN),
            false if has_stopped => view.known(lit, FIRST_STEP, MOST_UNKNOWN),
            // The best picture of a small view is soon there.
            false if look.is_small() => None,
            false => view.known(lit, FIRST_STEP, FEW_UNKNOWN),
        };
        let shown = SurfacesView {
            look: *look,
            view,
            gathered: None,
            edges: Edges::Some(Vec::new()),
            known,
            drawn: None,
            drawn_from: None,
            covered,
            weights: None,
        };
        self.views.insert(number, shown);
    }

    /// Draws a view. If there are live rays, also returns the sums that include them, from which
    /// pixels outside all sections are drawn.
    ///
    /// While the eye moves and in the first frame, the view shows light that earlier frames found,
    /// if enough of it is known. `None` without a view, or if the frame was interrupted.
    fn drawn(
        &mut self,
        number: u64,
        phase: FramePhase,
        interrupt: &Interrupt,
    ) -> Option<(Drawn, Option<Gathered>)> {
        if let Some(drawn) = self.drawn_from_known(number, phase) {
            return Some((drawn, None));
        }
        self.place_waiting();
        self.drawn_from_samples(number, phase, interrupt)
    }

    /// Draws a view from known light, if it is to be shown now.
    fn drawn_from_known(&mut self, number: u64, phase: FramePhase) -> Option<Drawn> {
        let shown = self.views.get_mut(&number)?;
        if matches!(phase, FramePhase::Rest | FramePhase::File) {
            shown.known = None;
        }
        let drawn = shown.view.draw_known(&self.store, shown.known.as_ref()?);
        if phase == FramePhase::First {
            (shown.known, shown.drawn) = (None, Some(Refined::KNOWN));
        }
        Some(drawn)
    }

    /// Draws a view from all samples in the store. Returns what [`drawn`](Self::drawn) does.
    fn drawn_from_samples(
        &mut self,
        number: u64,
        phase: FramePhase,
        interrupt: &Interrupt,
    ) -> Option<(Drawn, Option<Gathered>)> {
        let shown = self.views.get_mut(&number)?;
        if shown.look.is_small() {
            while shown.look_into_edges(&self.store) {}
        }
        let samples = self.store.samples() + self.live.samples();
        let is_best = shown.draws_best(samples, phase);
        let is_soon =
            !shown.look.is_small() && matches!(phase, FramePhase::First | FramePhase::Moving);
        let mut refined = shown.refined(self.denoiser.is_some(), is_soon);
        let never = Interrupt::default();
        let can_end_early = phase == FramePhase::Rest && shown.drawn.is_some();
        let interrupt = if can_end_early { interrupt } else { &never };
        let (view, store) = (&shown.view, &self.store);
        let gathered = shown.gathered.get_or_insert_with(|| Gathered::new(view, store));
        let mut denoiser = self.denoiser.as_mut().filter(|_| refined.is_denoised);
        let least = match phase {
            FramePhase::Moving => LEAST_STEP,
            FramePhase::First if is_soon => FIRST_STEP,
            FramePhase::First | FramePhase::Rest | FramePhase::File => 1,
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
        (shown.drawn, shown.drawn_from) = (Some(refined), Some(samples));
        Some((drawn, all))
    }

    fn draw(&mut self, number: u64, phase: FramePhase, interrupt: &Interrupt) -> Option<Frame> {
        let (drawn, all) = self.drawn(number, phase, interrupt)?;
        let shown = self.views.get(&number)?;
        let FrameRequest { view, size, .. } = shown.look;
        let mut frame = Frame::black(size);
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
        if phase == FramePhase::Rest
            && let Some(shown) = self.views.get_mut(&number)
        {
            shown.weigh(&frame.picture.pixels, &frame.certainty);
        }
        frame.blank_corners(&view);
        Some(frame)
    }

    /// Does a piece of work for the next frame of a view. Returns true if more is left.
    fn prepare(&mut self, number: u64, phase: FramePhase) -> bool {
        let waits = [&self.waiting, &self.earlier, &self.leaving];
        if waits.iter().any(|waits| waits.len() >= LEAST_BATCH) {
            self.place_waiting();
        }
        if matches!(phase, FramePhase::Moving) {
            return self.fill_cubes();
        }
        let is_left = self.prepare_view(number, phase);
        is_left || self.fill_cubes()
    }

    /// Fills some texels of the reflection cubes of objects that views show. Returns true if more
    /// are left.
    fn fill_cubes(&mut self) -> bool {
        let Some(reflections) = &mut self.reflections else { return false };
        let follower = Follower::new(&self.raycaster, &self.materials);
        let sources = LightSources { follower, store: &self.store, known: &self.known };
        reflections.fill(&self.raycaster, self.store.samples(), |ray, width, own| {
            sources.along(ray, width, own)
        })
    }

    /// Does a piece of work for the next frame of a view at rest. Returns true if more is left.
    fn prepare_view(&mut self, number: u64, phase: FramePhase) -> bool {
        let store = &self.store;
        let gathers = |shown: &&mut SurfacesView| !shown.look.is_moving;
        let Some(shown) = self.views.get_mut(&number).filter(gathers) else { return false };
        if phase == FramePhase::Rest {
            shown.known = None;
        }
        if shown.known.is_some() {
            // Gathering now would delay the first frame.
            return false;
        }
        if shown.gathered.is_none() {
            shown.gathered = Some(Gathered::new(&shown.view, store));
            return true;
        }
        shown.prepare_edges(store)
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

    fn parts<'a>(&'a mut self, interrupt: &'a Interrupt) -> PartsSource<'a> {
        PartsSource {
            sections: &self.sections,
            raycaster: &self.raycaster,
            materials: &self.materials,
            store: &self.store,
            live: &self.live,
            denoiser: self.denoiser.as_mut(),
            interrupt,
        }
    }
}

impl Drop for SurfaceRenderer {
    fn drop(&mut self) {
        self.scene.lock().views.remove(&self.number);
    }
}

impl Renderer for SurfaceRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        self.scene.lock().look(self.number, look);
        Ok(())
    }

    fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        self.scene.lock().insert_live(paths, rays);
    }

    fn settle(&mut self) {
        // The phases of frames tell the rest.
    }

    fn draw(
        &mut self,
        phase: FramePhase,
        interrupt: &Interrupt,
        _stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame> {
        self.scene.lock().draw(self.number, phase, interrupt)
    }

    fn refines(&self) -> bool {
        let scene = self.scene.lock();
        let has_denoiser = scene.denoiser.is_some();
        let refines = |shown: &SurfacesView| {
            shown.drawn.is_some_and(|drawn| drawn != shown.refined(has_denoiser, false))
        };
        scene.views.get(&self.number).is_some_and(refines)
    }

    fn prepare(&mut self, phase: FramePhase) -> bool {
        self.scene.lock().prepare(self.number, phase)
    }

    fn switch(&mut self, _part: &str, _on: bool) -> bool {
        false
    }

    fn parts(&mut self) -> Option<&mut dyn PartsRenderer> {
        Some(self)
    }

    fn wishes(&mut self) -> &mut dyn RayWishes {
        self
    }
}

impl PartsRenderer for SurfaceRenderer {
    fn plan(&mut self, look: &FrameRequest) -> PartsPlan {
        let scene = &mut *self.scene.lock();
        scene.place_waiting();
        scene.parts(&Interrupt::default()).plan(look)
    }

    fn part(
        &mut self,
        plan: &PartsPlan,
        columns: Range<u32>,
        rows: Range<u32>,
        interrupt: &Interrupt,
    ) -> Option<Picture> {
        self.scene.lock().parts(interrupt).part(plan, columns, rows)
    }
}

impl RayWishes for SurfaceRenderer {
    fn weigh(
        &mut self,
        _look: &FrameRequest,
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        Ok(beams)
    }

    fn pixel_weights(&mut self) -> Option<PixelWeights> {
        self.scene.lock().views.get(&self.number)?.weights.clone()
    }

    fn rays(&mut self, _expected: Option<&View>) -> Option<Vec<(BeamKey, RayCoords)>> {
        None
    }

    fn viewpoint_radius(&mut self, look: &FrameRequest, nearest: f64) -> f64 {
        viewpoint_radius(&look.view, look.size, nearest, 1.0)
    }

    fn depths(&mut self) -> Vec<f32> {
        self.scene.lock().views.get(&self.number).map_or_else(Vec::new, SurfacesView::depth)
    }

    fn uncovered(&mut self) -> Vec<u32> {
        match self.scene.lock().views.get(&self.number) {
            Some(shown) if !shown.look.is_moving => {
                let mut pixels =
                    uncovered_pixels(&shown.covered, &shown.look.view, shown.look.size);
                // The sky and lamps need no samples.
                pixels.retain(|&pixel| shown.view.seen[pixel as usize].is_surface());
                pixels
            }
            _ => Vec::new(),
        }
    }

    fn surface_beams(&mut self, search: Search) -> Option<BeamSearch> {
        let scene = self.scene.lock();
        let ends = scene.views.get(&self.number)?.ends(scene.raycaster.scene().origin);
        let sections = Arc::clone(&scene.sections);
        (!ends.is_empty()).then(|| -> BeamSearch {
            Box::new(move || beams_ending_on(&sections, &ends, SLACK, search))
        })
    }
}
