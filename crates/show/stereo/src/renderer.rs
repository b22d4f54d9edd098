//! A driver of two eyes.

use std::sync::Arc;

use holo_display::{
    Age, BeamSearch, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt, Light,
    LiveSample, PartsRenderer, PixelWeights, RayWishes, Renderer, Search, SelectOptions,
    UsefulBeam, WantedBeam, select_beams,
};
use holo_picture::View;
use holo_section::{BeamKey, RayCoords, Sample, Section};

use crate::StereoEyes;

/// Share of a beam's weight for each eye.
const HALF: f32 = 0.5;

/// Returns a driver that shows what two eyes see, as `driver` draws it.
pub fn stereo_driver(driver: Driver, eyes: StereoEyes, sections: Arc<[Section]>) -> Driver {
    let Driver { mut light, renderer, .. } = driver;
    let second = light.renderer();
    let renderer = StereoRenderer::new([renderer, second], eyes, Arc::clone(&sections));
    Driver {
        keeps_pixels: driver.keeps_pixels || eyes.arrangement.needs_all_pixels(),
        light: Box::new(StereoLight { light, eyes, sections }),
        renderer: Box::new(renderer),
        ..driver
    }
}

/// A driver's light, whose renderers come in pairs.
struct StereoLight {
    light: Box<dyn Light>,
    eyes: StereoEyes,
    sections: Arc<[Section]>,
}

impl Light for StereoLight {
    fn renderer(&mut self) -> Box<dyn Renderer> {
        let pair = [self.light.renderer(), self.light.renderer()];
        Box::new(StereoRenderer::new(pair, self.eyes, Arc::clone(&self.sections)))
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

/// Two renderers of one light.
struct StereoRenderer {
    pair: [Box<dyn Renderer>; 2],
    eyes: StereoEyes,
    sections: Arc<[Section]>,
    /// Size of the picture; `None` before the first view.
    size: Option<(u32, u32)>,
}

impl StereoRenderer {
    fn new(pair: [Box<dyn Renderer>; 2], eyes: StereoEyes, sections: Arc<[Section]>) -> Self {
        StereoRenderer { pair, eyes, sections, size: None }
    }
}

impl Renderer for StereoRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        let requests = self.eyes.requests(look)?;
        for (renderer, request) in self.pair.iter_mut().zip(&requests) {
            renderer.look(request)?;
        }
        self.size = Some(look.size);
        Ok(())
    }

    fn insert_live(&mut self, _paths: u16, _rays: &[LiveSample]) {
        // None are wished for.
    }

    fn settle(&mut self) {
        self.pair.iter_mut().for_each(|renderer| renderer.settle());
    }

    fn draw(
        &mut self,
        phase: FramePhase,
        interrupt: &Interrupt,
        stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame> {
        let size = self.size?;
        let [left, right] = &mut self.pair;
        let left = left.draw(phase, interrupt, stage_ended)?;
        let right = right.draw(phase, interrupt, stage_ended)?;
        Some(self.eyes.arrangement.arrange(size, [&left, &right]))
    }

    fn refines(&self) -> bool {
        self.pair.iter().any(|renderer| renderer.refines())
    }

    fn prepare(&mut self, phase: FramePhase) -> bool {
        let [left, right] = &mut self.pair;
        // One piece of work at a time.
        left.prepare(phase) || right.prepare(phase)
    }

    fn switch(&mut self, part: &str, on: bool) -> bool {
        let [left, right] = &mut self.pair;
        left.switch(part, on) && right.switch(part, on)
    }

    fn parts(&mut self) -> Option<&mut dyn PartsRenderer> {
        None
    }

    fn wishes(&mut self) -> &mut dyn RayWishes {
        self
    }
}

impl RayWishes for StereoRenderer {
    fn weigh(
        &mut self,
        look: &FrameRequest,
        _beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        let mut all = Vec::new();
        for (renderer, request) in self.pair.iter_mut().zip(self.eyes.requests(look)?) {
            let options = SelectOptions::default();
            let beams = select_beams(&self.sections, &request.view, request.size, &options).beams;
            all.extend(renderer.wishes().weigh(&request, beams)?);
        }
        all.sort_by_key(|beam| beam.key);
        let sum = |same: &[WantedBeam]| WantedBeam {
            key: same[0].key,
            weight: same.iter().map(|beam| HALF * beam.weight).sum(),
        };
        Ok(all.chunk_by(|a, b| a.key == b.key).map(sum).collect())
    }

    fn pixel_weights(&mut self) -> Option<PixelWeights> {
        // They would be weights of the pixels of one view.
        None
    }

    fn rays(&mut self, _expected: Option<&View>) -> Option<Vec<(BeamKey, RayCoords)>> {
        let [left, right] = &mut self.pair;
        // The expected view is that of neither eye.
        match (left.wishes().rays(None), right.wishes().rays(None)) {
            (Some(left), Some(right)) => Some([left, right].concat()),
            (one, other) => one.or(other),
        }
    }

    fn viewpoint_radius(&mut self, look: &FrameRequest, nearest: f64) -> f64 {
        let Ok([left, right]) = self.eyes.requests(look) else { return 0.0 };
        let [first, second] = &mut self.pair;
        let own = first.wishes().viewpoint_radius(&left, nearest);
        // The sphere around the middle contains those around both eyes.
        own.max(second.wishes().viewpoint_radius(&right, nearest)) + 0.5 * self.eyes.distance
    }

    fn depths(&mut self) -> Vec<f32> {
        let [left, right] = &mut self.pair;
        [left.wishes().depths(), right.wishes().depths()].concat()
    }

    fn uncovered(&mut self) -> Vec<u32> {
        Vec::new()
    }

    fn surface_beams(&mut self, search: Search) -> Option<BeamSearch> {
        let [left, right] = &mut self.pair;
        let (left, right) =
            (left.wishes().surface_beams(search), right.wishes().surface_beams(search));
        match (left, right) {
            (Some(left), Some(right)) => Some(Box::new(move || joined(left(), right()))),
            (one, other) => one.or(other),
        }
    }
}

/// Returns the beams that are useful for either eye, in the order of their keys, each once.
fn joined(left: Vec<UsefulBeam>, right: Vec<UsefulBeam>) -> Vec<UsefulBeam> {
    let mut all = [left, right].concat();
    all.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
    all.dedup_by_key(|beam| beam.0);
    all
}
