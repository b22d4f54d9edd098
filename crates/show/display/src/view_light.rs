//! The light of drivers whose renderers store the samples of their views themselves.

use std::sync::{Arc, Weak};

use holo_picture::View;
use holo_section::{BeamKey, RayCoords, Sample};
use parking_lot::Mutex;

use crate::{
    Age, BeamSearch, DriverError, Frame, FramePhase, FrameRequest, Interrupt, Light, LiveSample,
    PartsRenderer, PixelWeights, RayWishes, Renderer, Search, WantedBeam,
};

/// A renderer that stores the samples of its view itself. Its methods are those of [`Light`].
pub trait StoringRenderer: Renderer + RayWishes + 'static {
    /// Inserts samples of one beam.
    fn insert(&mut self, age: Age, beam: BeamKey, paths: u16, samples: &[Sample]);

    /// Takes earlier samples out again. Returns whether it can.
    fn remove_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) -> bool;

    /// Marks a beam as unseen.
    fn insert_unseen(&mut self, beam: BeamKey);
}

/// Passes samples to all its renderers, and stores none.
pub struct ViewLight<R> {
    make: Box<dyn Fn() -> R + Send>,
    renderers: Vec<Weak<Mutex<R>>>,
}

/// A renderer that shares its samples' way with a [`ViewLight`].
struct SharedRenderer<R>(Arc<Mutex<R>>);

impl<R: StoringRenderer> ViewLight<R> {
    /// Returns a light whose renderers `make` makes.
    pub fn new(make: impl Fn() -> R + Send + 'static) -> ViewLight<R> {
        ViewLight { make: Box::new(make), renderers: Vec::new() }
    }

    /// Calls `pass` with each renderer. Returns whether it was true for all of them.
    fn all(&mut self, mut pass: impl FnMut(&mut R) -> bool) -> bool {
        let mut all = true;
        self.renderers.retain(|renderer| {
            let Some(renderer) = renderer.upgrade() else { return false };
            all &= pass(&mut renderer.lock());
            true
        });
        all
    }
}

impl<R: StoringRenderer> Light for ViewLight<R> {
    fn renderer(&mut self) -> Box<dyn Renderer> {
        let renderer = Arc::new(Mutex::new((self.make)()));
        self.renderers.push(Arc::downgrade(&renderer));
        Box::new(SharedRenderer(renderer))
    }

    fn room(&self) -> u64 {
        0
    }

    fn insert(&mut self, age: Age, beam: BeamKey, paths: u16, samples: &[Sample]) {
        self.all(|renderer| {
            renderer.insert(age, beam, paths, samples);
            true
        });
    }

    fn remove_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) -> bool {
        self.all(|renderer| renderer.remove_earlier(beam, paths, samples))
    }

    fn insert_unseen(&mut self, beam: BeamKey) {
        self.all(|renderer| {
            renderer.insert_unseen(beam);
            true
        });
    }
}

impl<R: StoringRenderer> Renderer for SharedRenderer<R> {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        self.0.lock().look(look)
    }

    fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        self.0.lock().insert_live(paths, rays);
    }

    fn settle(&mut self) {
        self.0.lock().settle();
    }

    fn draw(
        &mut self,
        phase: FramePhase,
        interrupt: &Interrupt,
        stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame> {
        self.0.lock().draw(phase, interrupt, stage_ended)
    }

    fn refines(&self) -> bool {
        self.0.lock().refines()
    }

    fn prepare(&mut self, phase: FramePhase) -> bool {
        self.0.lock().prepare(phase)
    }

    fn switch(&mut self, part: &str, on: bool) -> bool {
        self.0.lock().switch(part, on)
    }

    fn parts(&mut self) -> Option<&mut dyn PartsRenderer> {
        // Parts are drawn from light that outlives a view.
        None
    }

    fn wishes(&mut self) -> &mut dyn RayWishes {
        self
    }
}

impl<R: StoringRenderer> RayWishes for SharedRenderer<R> {
    fn weigh(
        &mut self,
        look: &FrameRequest,
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        self.0.lock().weigh(look, beams)
    }

    fn pixel_weights(&mut self) -> Option<PixelWeights> {
        self.0.lock().pixel_weights()
    }

    fn rays(&mut self, expected: Option<&View>) -> Option<Vec<(BeamKey, RayCoords)>> {
        self.0.lock().rays(expected)
    }

    fn viewpoint_radius(&mut self, look: &FrameRequest, nearest: f64) -> f64 {
        self.0.lock().viewpoint_radius(look, nearest)
    }

    fn depths(&mut self) -> Vec<f32> {
        self.0.lock().depths()
    }

    fn uncovered(&mut self) -> Vec<u32> {
        self.0.lock().uncovered()
    }

    fn surface_beams(&mut self, search: Search) -> Option<BeamSearch> {
        self.0.lock().surface_beams(search)
    }
}
