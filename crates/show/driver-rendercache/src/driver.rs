//! The render cache as a driver of whole sessions.
//!
//! The driver requests each ray that the cache wants as the nearest ray that can be stored. The
//! requests also weight the view's beams, for tracers that have time for more.

use std::sync::Arc;

use holo_display::{
    Age, BeamSearch, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt, LiveSample,
    PartsRenderer, RayWishes, Renderer, Search, SkyView, StoringRenderer, ViewLight, WantedBeam,
};
use holo_picture::{View, ViewKind};
use holo_section::{BeamKey, RayCoords, Sample as Stored, Section};

use crate::map::far_depth;
use crate::screen::{CacheScreen, radius};
use crate::{Moment, PointImage, PointImageParams, RayResult};

const NAME: &str = "pointimage";

/// Share of the weight of a view's beams that is divided by requests. The rest is divided by the
/// number of pixels that each beam serves.
const BY_REQUESTS: f32 = 0.75;

/// Number of pixels of the picture for each requested ray.
const PIXELS_PER_REQUEST: usize = 16;

/// Returns the driver `pointimage`. Beams that cannot hit anything show `sky`.
pub fn pointimage_driver(
    sections: Arc<[Section]>,
    sky: impl Into<SkyView>,
    params: PointImageParams,
) -> Driver {
    let sky = sky.into();
    let make = move || PointImageRenderer::new(Arc::clone(&sections), sky.clone(), params.clone());
    Driver { keeps_pixels: true, ..Driver::new(NAME, ViewLight::new(make)) }
}

/// Draws each view of a session from the points of all views so far (Walter, Drettakis & Parker
/// 1999).
struct PointImageRenderer {
    sections: Arc<[Section]>,
    sky: SkyView,
    params: PointImageParams,
    shown: Option<(PointImage, CacheScreen)>,
}

impl PointImageRenderer {
    fn new(sections: Arc<[Section]>, sky: SkyView, params: PointImageParams) -> Self {
        Self { sections, sky, params, shown: None }
    }

    /// Changes the view and requests the rays that it lacks. Returns the weights of its beams.
    fn change_view(
        &mut self,
        look: &FrameRequest,
        beams: &[WantedBeam],
    ) -> Result<Vec<WantedBeam>, DriverError> {
        let before = self.shown.take();
        let earlier = before.as_ref().map(|(_, screen)| screen.view);
        let mut cache = match before.filter(|(_, screen)| screen.serves(look)) {
            Some((cache, _)) => cache,
            None => PointImage::new(look.size, self.params.clone())
                .map_err(|error| DriverError { driver: NAME, reason: error.to_string() })?,
        };
        let predicted = earlier.and_then(|earlier| ahead(&earlier, &look.view));
        let wanted = requests(look.size);
        let moment = Moment { view: look.view, predicted, samples: &[], wanted };
        let weights = cache.frame(&moment).weigh(&self.sections, beams, BY_REQUESTS);
        let screen = CacheScreen::new(Arc::clone(&self.sections), self.sky.clone(), look);
        self.shown = Some((cache, screen));
        Ok(weights)
    }
}

impl StoringRenderer for PointImageRenderer {
    fn insert(&mut self, _age: Age, key: BeamKey, _paths: u16, samples: &[Stored]) {
        let Some((cache, screen)) = &mut self.shown else { return };
        screen.locate(key, samples, |seen| {
            let (column, row) = seen.pixel;
            let tag = if seen.is_own {
                cache.pixel_tag(column, row)
            } else {
                cache.guess_tag(column, row)
            };
            let Some(tag) = tag else { return false };
            // The noise of stored samples is not known.
            let sample = RayResult {
                tag,
                noise: f32::INFINITY,
                ..RayResult::new(seen.place, seen.radiance)
            };
            cache.insert(&[sample]);
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

impl Renderer for PointImageRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        if self.shown.as_ref().is_some_and(|(_, screen)| screen.is_of(look)) {
            return Ok(());
        }
        self.change_view(look, &[]).map(|_| ())
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
        self.change_view(look, &beams)
    }

    fn rays(&mut self) -> Option<Vec<(BeamKey, RayCoords)>> {
        let Some((cache, screen)) = &mut self.shown else { return Some(Vec::new()) };
        let wanted = requests(screen.size);
        let moment = Moment { view: screen.view, predicted: None, samples: &[], wanted };
        Some(cache.frame(&moment).rays(&self.sections))
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

/// Returns the number of rays to request at a time.
fn requests(size: (u32, u32)) -> usize {
    size.0 as usize * size.1 as usize / PIXELS_PER_REQUEST
}

/// Returns the view that follows if the motion from `earlier` to `now` continues. `None` after a
/// turn of 90° or more, and if the type of view has changed.
fn ahead(earlier: &View, now: &View) -> Option<View> {
    let vp = now.vp + (now.vp - earlier.vp);
    let vd = now.vd + (now.vd - earlier.vd);
    let is_same_walk = now.vd.dot(earlier.vd) > 0.0 && now.kind == earlier.kind;
    now.moved(vp, vd).ok().filter(|_| is_same_walk)
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
