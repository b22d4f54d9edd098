//! The render cache as a driver of whole sessions.
//!
//! The driver requests each ray that the cache wants as the nearest ray that can be stored, and
//! remembers what it is for (`awaited`). So a sample of an earlier request is used as the cache
//! meant it. The requests also weight the view's beams, for tracers that have time for more.
//!
//! Samples of the scene before an edit fill gaps and never change a point of the present scene.
//! Those on objects that have moved since are moved too.

use std::sync::Arc;

use holo_display::{
    Age, BeamSearch, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt, LiveSample,
    ObjectMotion, PartsRenderer, PixelWeights, RayWishes, Renderer, Search, SkyView,
    StoringRenderer, ViewLight, WantedBeam, mix, moved_along,
};
use holo_picture::{View, ViewKind};
use holo_section::{BeamKey, RayCoords, Sample as Stored, Section};

use crate::awaited::AwaitedRays;
use crate::map::far_depth;
use crate::memory::LeftPoints;
use crate::path_noise::PathNoise;
use crate::screen::{CacheScreen, ProjectedSample, StoredRay, pixel_of, radius, sees_alike};
use crate::{Moment, Place, PointImage, PointImageParams, PointMemory, RayResult, Tag};

const NAME: &str = "pointimage";

/// Share of the weight of a view's beams that is divided by requests. The rest is divided by the
/// number of pixels that each beam serves.
const BY_REQUESTS: f32 = 0.75;

/// One pixel in this many is requested when beams are weighted.
const PIXELS_PER_REQUEST: usize = 16;

/// Returns the driver `pointimage`. Beams that cannot hit anything show `sky`.
pub fn pointimage_driver(
    sections: Arc<[Section]>,
    sky: impl Into<SkyView>,
    params: PointImageParams,
) -> Driver {
    pointimage_driver_with_memory(sections, sky, params, PointMemory::default())
}

/// Returns the driver `pointimage`, which leaves its points to the next one with this memory, and
/// goes on with those of the one before.
pub fn pointimage_driver_with_memory(
    sections: Arc<[Section]>,
    sky: impl Into<SkyView>,
    params: PointImageParams,
    memory: PointMemory,
) -> Driver {
    let sky = sky.into();
    let parts = params.stages.parts();
    let make = move || {
        let (sections, sky) = (Arc::clone(&sections), sky.clone());
        PointImageRenderer::new(sections, sky, params.clone(), memory.clone())
    };
    Driver { takes_late: true, parts, ..Driver::new(NAME, ViewLight::new(make)) }
}

/// Draws each view of a session from the points of all views so far (Walter, Drettakis & Parker
/// 1999).
struct PointImageRenderer {
    sections: Arc<[Section]>,
    sky: SkyView,
    params: PointImageParams,
    shown: Option<(PointImage, CacheScreen)>,
    /// Requested rays that have not arrived.
    awaited: AwaitedRays<Tag>,
    noise: PathNoise,
    /// The view that is expected when the rays of the last request arrive.
    expected: Option<View>,
    memory: PointMemory,
    /// How objects have moved since the samples of earlier scenes, and the number of motions that
    /// the points have followed.
    motions: (Vec<ObjectMotion>, usize),
}

impl Drop for PointImageRenderer {
    fn drop(&mut self) {
        if let Some((cache, screen)) = self.shown.take() {
            let (view, followed) = (screen.view, self.motions.1);
            self.memory.leave(LeftPoints { cache, view, followed });
        }
    }
}

impl PointImageRenderer {
    fn new(
        sections: Arc<[Section]>,
        sky: SkyView,
        params: PointImageParams,
        memory: PointMemory,
    ) -> Self {
        let (awaited, noise) = (AwaitedRays::default(), PathNoise::default());
        let motions = memory.motions();
        Self { sections, sky, params, shown: None, awaited, noise, expected: None, memory, motions }
    }

    /// Changes the view. Points stay if they mean the same in both views.
    fn change_view(&mut self, look: &FrameRequest, is_requested: bool) -> Result<(), DriverError> {
        let error =
            |error: crate::PointImageError| DriverError { driver: NAME, reason: error.to_string() };
        let before = self.shown.take().filter(|(_, screen)| screen.serves(look));
        let (cache, screen) = match before {
            Some((mut cache, screen)) => {
                cache.resize(look.size).map_err(error)?;
                (cache, screen.next(look, is_requested))
            }
            None => {
                self.awaited.clear();
                let screen = CacheScreen::new(Arc::clone(&self.sections), self.sky.clone(), look);
                (self.first_points(look).map_err(error)?, screen)
            }
        };
        let (cache, _) = self.shown.insert((cache, screen));
        // Samples that arrive before the first frame belong to this view.
        cache.aim(&look.view);
        Ok(())
    }

    /// Returns the points of the driver before this one, if they were left and mean the same in
    /// this view. Otherwise no points.
    fn first_points(&mut self, look: &FrameRequest) -> Result<PointImage, crate::PointImageError> {
        let left = self.memory.take().filter(|left| sees_alike(&left.view, &look.view));
        let Some(LeftPoints { mut cache, followed, .. }) = left else {
            return PointImage::new(look.size, self.params.clone());
        };
        self.motions.1 = followed;
        cache.set_stages(self.params.stages);
        cache.resize(look.size)?;
        Ok(cache)
    }

    /// Inserts samples of the scene before an edit.
    fn insert_earlier(&mut self, key: BeamKey, samples: &[Stored]) {
        let Some((cache, screen)) = &mut self.shown else { return };
        let (motions, view, size) = (&self.motions.0, screen.view, screen.size);
        screen.locate(key, samples, |ray, seen| {
            let found = match ray.place() {
                Place::At(place) if !motions.is_empty() => {
                    let now = moved_along(motions, place);
                    now.and_then(|now| Some((pixel_of(&view, size, now)?, Place::At(now))))
                }
                _ => seen.map(|seen| (seen.pixel, seen.place)),
            };
            let Some(((column, row), place)) = found else { return false };
            let Some(tag) = cache.guess_tag(column, row) else { return false };
            let sample = RayResult::new(place, ray.radiance);
            cache.insert(&[RayResult { tag, noise: f32::INFINITY, ..sample }]);
            true
        });
    }
}

impl StoringRenderer for PointImageRenderer {
    fn insert(&mut self, age: Age, key: BeamKey, paths: u16, samples: &[Stored]) {
        if age == Age::Earlier {
            return self.insert_earlier(key, samples);
        }
        let Some((cache, screen)) = &mut self.shown else { return };
        let (awaited, noise) = (&mut self.awaited, &mut self.noise);
        let paths = f32::from(paths);
        screen.locate(key, samples, |ray, seen| {
            let requested = awaited.remove(key, ray.coords);
            let Some(sample) = result(cache, requested, ray, seen.as_ref()) else { return false };
            if let Some(ProjectedSample { pixel: (column, row), place, .. }) = seen
                && let Some((known, count)) = cache.known_at(column, row, place)
            {
                noise.compare((sample.radiance, paths), (known, count as f32 * paths));
            }
            cache.insert(&[RayResult { noise: noise.of(sample.radiance, paths), ..sample }]);
            true
        });
    }

    fn remove_earlier(&mut self, _key: BeamKey, _paths: u16, _samples: &[Stored]) -> bool {
        // Points do not know their samples.
        false
    }

    fn insert_unseen(&mut self, key: BeamKey) {
        if let Some((_, screen)) = &mut self.shown {
            screen.insert_unseen(key);
        }
    }
}

/// Returns a stored sample as the cache takes it, without its noise. `None` if nothing in the view
/// is known by it.
///
/// A sample that the cache requested for another view, or through a point, has the tag of its
/// request, wherever it lies. Others count by their pixel in the present view: a ray that was
/// snapped to the lattice may pass through a neighbour of its pixel.
fn result(
    cache: &PointImage,
    requested: Option<Tag>,
    ray: &StoredRay,
    seen: Option<&ProjectedSample>,
) -> Option<RayResult> {
    if let Some(tag) = requested.filter(|tag| cache.is_for_itself(*tag)) {
        return Some(RayResult { tag, ..RayResult::new(ray.place(), ray.radiance) });
    }
    let seen = seen?;
    let (column, row) = seen.pixel;
    let tag = if seen.is_own { cache.pixel_tag(column, row) } else { cache.guess_tag(column, row) };
    Some(RayResult { tag: tag?, ..RayResult::new(seen.place, seen.radiance) })
}

impl Renderer for PointImageRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        if self.shown.as_ref().is_some_and(|(_, screen)| screen.is_of(look)) {
            return Ok(());
        }
        self.change_view(look, false)
    }

    fn insert_live(&mut self, _paths: u16, _rays: &[LiveSample]) {
        // Uncovered pixels are black, and no rays are wished for.
    }

    fn settle(&mut self) {
        // Points of earlier views stay until others take their places.
    }

    fn draw(
        &mut self,
        _phase: FramePhase,
        _interrupt: &Interrupt,
        stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame> {
        let (cache, screen) = self.shown.as_mut()?;
        let moment = Moment { view: screen.view, predicted: None, samples: &[], wanted: 0 };
        let frame = cache.frame_watched(&moment, &mut |stage| stage_ended(stage.name()));
        let depth = distances(&screen.view, screen.size, frame.depth());
        Some(screen.frame(frame.picture(), depth))
    }

    fn refines(&self) -> bool {
        false
    }

    fn prepare(&mut self, _phase: FramePhase) -> bool {
        false
    }

    fn switch(&mut self, part: &str, on: bool) -> bool {
        let known = self.params.stages.switch(part, on);
        if let Some((cache, _)) = &mut self.shown {
            cache.set_stages(self.params.stages);
        }
        known
    }

    fn parts(&mut self) -> Option<&mut dyn PartsRenderer> {
        None
    }

    fn wishes(&mut self) -> &mut dyn RayWishes {
        self
    }
}

impl RayWishes for PointImageRenderer {
    fn weigh(
        &mut self,
        look: &FrameRequest,
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        self.change_view(look, true)?;
        let Some((cache, screen)) = &mut self.shown else { return Ok(beams) };
        // The view that was expected before is about as far ahead of the present one.
        let predicted = self.expected.filter(|_| look.is_moving);
        let wanted = pixels(look.size) / PIXELS_PER_REQUEST;
        let moment = Moment { view: screen.view, predicted, samples: &[], wanted };
        Ok(cache.frame(&moment).weigh(&self.sections, &beams, BY_REQUESTS))
    }

    fn pixel_weights(&mut self) -> Option<PixelWeights> {
        None
    }

    fn rays(&mut self, expected: Option<&View>) -> Option<Vec<(BeamKey, RayCoords)>> {
        let Some((cache, screen)) = &mut self.shown else { return Some(Vec::new()) };
        self.expected = expected.copied();
        let wanted = self.awaited.wanted(pixels(screen.size));
        let moment = Moment { view: screen.view, predicted: self.expected, samples: &[], wanted };
        let mut rays = cache.frame(&moment).rays(&self.sections);
        // A server that cannot trace all of them leaves out those at the end. These must be neither
        // all of the picture's bottom nor all of the present view.
        shuffle(&mut rays, self.params.seed);
        for &(tag, key, coords) in &rays {
            self.awaited.insert(key, coords, tag);
        }
        Some(rays.into_iter().map(|(_, key, coords)| (key, coords)).collect())
    }

    fn viewpoint_radius(&mut self, look: &FrameRequest, nearest: f64) -> f64 {
        let radius = radius(&self.sections, &look.view, look.size, nearest);
        if let Some((_, screen)) = &mut self.shown {
            screen.set_radius(look, radius);
        }
        radius
    }

    fn depths(&mut self) -> Vec<f32> {
        let frame = self.draw(FramePhase::Rest, &Interrupt::default(), &mut |_| {});
        frame.map_or_else(Vec::new, |frame| frame.depth)
    }

    fn uncovered(&mut self) -> Vec<u32> {
        Vec::new()
    }

    fn surface_beams(&mut self, _search: Search) -> Option<BeamSearch> {
        // Other beams' samples would only be guesses.
        None
    }
}

fn pixels(size: (u32, u32)) -> usize {
    size.0 as usize * size.1 as usize
}

/// Puts a list into a random order, the same for the same seed.
fn shuffle<T>(list: &mut [T], seed: u32) {
    for last in (1..list.len()).rev() {
        let other = (u64::from(mix(seed, last as u32)) * (last as u64 + 1)) >> 32;
        list.swap(last, other as usize);
    }
}

/// Converts depths as in [`crate::CacheFrame::depth`] to distances along the rays of pixels, scene
/// units.
fn distances(view: &View, size: (u32, u32), depth: impl Iterator<Item = f32>) -> Vec<f32> {
    let far = far_depth(view);
    let distance = |(pixel, depth): (u32, f32)| {
        if f64::from(depth) >= far {
            return f32::INFINITY;
        }
        if view.kind != ViewKind::Perspective {
            return depth;
        }
        let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
        let (_, direction) = view.ray(x, y);
        (f64::from(depth) / direction.dot(view.vd)) as f32
    };
    (0..).zip(depth).map(distance).collect()
}
