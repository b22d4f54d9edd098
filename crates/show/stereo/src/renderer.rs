//! A driver of several views.

use std::sync::Arc;

use holo_display::{
    Age, BeamSearch, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt, Light,
    LiveSample, PartsRenderer, PixelWeights, RayWishes, Renderer, Search, SelectOptions,
    UsefulBeam, WantedBeam, select_beams,
};
use holo_picture::View;
use holo_section::{BeamKey, RayCoords, Sample, Section};

use crate::{StereoEyes, Wall};

/// Returns a driver that shows what two eyes see, as `driver` draws it.
pub fn stereo_driver(driver: Driver, eyes: StereoEyes, sections: Arc<[Section]>) -> Driver {
    let needs_all_pixels = eyes.arrangement.needs_all_pixels();
    let driver = several_views(driver, SeveralViews::Eyes(eyes), sections);
    Driver { keeps_pixels: driver.keeps_pixels || needs_all_pixels, ..driver }
}

/// Returns a driver that shows what an eye sees through the screens of a wall, as `driver` draws
/// it.
pub fn wall_driver(driver: Driver, wall: Wall, sections: Arc<[Section]>) -> Driver {
    several_views(driver, SeveralViews::Wall(wall), sections)
}

fn several_views(driver: Driver, views: SeveralViews, sections: Arc<[Section]>) -> Driver {
    let Driver { mut light, renderer, .. } = driver;
    let mut renderers = vec![renderer];
    renderers.extend((1..views.count()).map(|_| light.renderer()));
    let renderer = ViewsRenderer::new(renderers, views.clone(), Arc::clone(&sections));
    Driver {
        light: Box::new(SharedLight { light, views, sections }),
        renderer: Box::new(renderer),
        ..driver
    }
}

/// The views that a picture shows, and where it shows them.
#[derive(Clone)]
enum SeveralViews {
    /// Those of two eyes.
    Eyes(StereoEyes),
    /// Those through the screens of a wall.
    Wall(Wall),
}

impl SeveralViews {
    fn count(&self) -> usize {
        match self {
            Self::Eyes(_) => 2,
            Self::Wall(wall) => wall.count(),
        }
    }

    fn requests(&self, look: &FrameRequest) -> Result<Vec<FrameRequest>, DriverError> {
        match self {
            Self::Eyes(eyes) => eyes.requests(look).map(Vec::from),
            Self::Wall(wall) => wall.requests(look),
        }
    }

    fn arrange(&self, size: (u32, u32), frames: &[Frame]) -> Frame {
        match (self, frames) {
            (Self::Eyes(eyes), [left, right]) => eyes.arrangement.arrange(size, [left, right]),
            (Self::Eyes(_), _) => Frame::black(size),
            (Self::Wall(wall), _) => wall.arrange(size, frames),
        }
    }

    /// Returns the greatest distance of an eye from that of the request, scene units.
    fn reach(&self) -> f64 {
        match self {
            Self::Eyes(eyes) => 0.5 * eyes.distance,
            Self::Wall(_) => 0.0,
        }
    }
}

/// A driver's light, whose renderers come in groups, one for each view.
struct SharedLight {
    light: Box<dyn Light>,
    views: SeveralViews,
    sections: Arc<[Section]>,
}

impl Light for SharedLight {
    fn renderer(&mut self) -> Box<dyn Renderer> {
        let renderers = (0..self.views.count()).map(|_| self.light.renderer()).collect();
        Box::new(ViewsRenderer::new(renderers, self.views.clone(), Arc::clone(&self.sections)))
    }

    fn room(&self) -> u64 {
        self.light.room()
    }

    fn insert(&mut self, age: Age, beam: BeamKey, paths: u16, samples: &[Sample]) {
        self.light.insert(age, beam, paths, samples);
    }

    fn remove_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) -> bool {
        self.light.remove_earlier(beam, paths, samples)
    }

    fn insert_unseen(&mut self, beam: BeamKey) {
        self.light.insert_unseen(beam);
    }
}

/// Renderers of one light.
struct ViewsRenderer {
    renderers: Vec<Box<dyn Renderer>>,
    views: SeveralViews,
    sections: Arc<[Section]>,
    /// Size of the picture; `None` before the first view.
    size: Option<(u32, u32)>,
}

impl ViewsRenderer {
    fn new(
        renderers: Vec<Box<dyn Renderer>>,
        views: SeveralViews,
        sections: Arc<[Section]>,
    ) -> Self {
        ViewsRenderer { renderers, views, sections, size: None }
    }
}

impl Renderer for ViewsRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        let requests = self.views.requests(look)?;
        for (renderer, request) in self.renderers.iter_mut().zip(&requests) {
            renderer.look(request)?;
        }
        self.size = Some(look.size);
        Ok(())
    }

    fn insert_live(&mut self, _paths: u16, _rays: &[LiveSample]) {
        // None are wished for.
    }

    fn settle(&mut self) {
        self.renderers.iter_mut().for_each(|renderer| renderer.settle());
    }

    fn draw(
        &mut self,
        phase: FramePhase,
        interrupt: &Interrupt,
        stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame> {
        let size = self.size?;
        let draw = |renderer: &mut Box<dyn Renderer>| renderer.draw(phase, interrupt, stage_ended);
        let frames: Option<Vec<Frame>> = self.renderers.iter_mut().map(draw).collect();
        Some(self.views.arrange(size, &frames?))
    }

    fn refines(&self) -> bool {
        self.renderers.iter().any(|renderer| renderer.refines())
    }

    fn prepare(&mut self, phase: FramePhase) -> bool {
        // One piece of work at a time.
        self.renderers.iter_mut().any(|renderer| renderer.prepare(phase))
    }

    fn switch(&mut self, part: &str, on: bool) -> bool {
        self.renderers.iter_mut().all(|renderer| renderer.switch(part, on))
    }

    fn parts(&mut self) -> Option<&mut dyn PartsRenderer> {
        None
    }

    fn wishes(&mut self) -> &mut dyn RayWishes {
        self
    }
}

impl RayWishes for ViewsRenderer {
    fn weigh(
        &mut self,
        look: &FrameRequest,
        _beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        let mut all = Vec::new();
        for (renderer, request) in self.renderers.iter_mut().zip(self.views.requests(look)?) {
            let options = SelectOptions::default();
            let beams = select_beams(&self.sections, &request.view, request.size, &options).beams;
            all.extend(renderer.wishes().weigh(&request, beams)?);
        }
        all.sort_by_key(|beam| beam.key);
        let share = 1.0 / self.renderers.len().max(1) as f32;
        let sum = |same: &[WantedBeam]| WantedBeam {
            key: same[0].key,
            weight: same.iter().map(|beam| share * beam.weight).sum(),
        };
        Ok(all.chunk_by(|a, b| a.key == b.key).map(sum).collect())
    }

    fn pixel_weights(&mut self) -> Option<PixelWeights> {
        // They would be weights of the pixels of one view.
        None
    }

    fn rays(&mut self, _expected: Option<&View>) -> Option<Vec<(BeamKey, RayCoords)>> {
        // The expected view is none of these.
        let rays = self.renderers.iter_mut().filter_map(|renderer| renderer.wishes().rays(None));
        rays.reduce(|a, b| [a, b].concat())
    }

    fn viewpoint_radius(&mut self, look: &FrameRequest, nearest: f64) -> f64 {
        let Ok(requests) = self.views.requests(look) else { return 0.0 };
        let radii = self
            .renderers
            .iter_mut()
            .zip(&requests)
            .map(|(renderer, request)| renderer.wishes().viewpoint_radius(request, nearest));
        // The sphere around the request's eye contains those around all eyes.
        radii.fold(0.0, f64::max) + self.views.reach()
    }

    fn depths(&mut self) -> Vec<f32> {
        self.renderers.iter_mut().flat_map(|renderer| renderer.wishes().depths()).collect()
    }

    fn uncovered(&mut self) -> Vec<u32> {
        Vec::new()
    }

    fn surface_beams(&mut self, search: Search) -> Option<BeamSearch> {
        let searches = self
            .renderers
            .iter_mut()
            .filter_map(|renderer| renderer.wishes().surface_beams(search))
            .collect::<Vec<BeamSearch>>();
        if searches.is_empty() {
            return None;
        }
        Some(Box::new(move || joined(searches.into_iter().flat_map(|search| search()).collect())))
    }
}

/// Returns the beams that are useful for any view, in the order of their keys, each once.
fn joined(mut all: Vec<UsefulBeam>) -> Vec<UsefulBeam> {
    all.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
    all.dedup_by_key(|beam| beam.0);
    all
}
