//! A driver in use for one view after another, as a session uses it.

#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::expect_used, reason = "tests")]

use holo_display::{
    Age, BeamSearch, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt, Light,
    LiveSample, PixelWeights, Renderer, Search, ViewPhases, WantedBeam,
};
use holo_picture::{Picture, View};
use holo_section::{BeamKey, RayCoords, Sample};
use std::sync::{Arc, Mutex, MutexGuard};

/// A driver, the phases of its view, and the signal that interrupts frames at rest.
pub struct TestViewer {
    pub light: Arc<Mutex<Box<dyn Light>>>,
    pub renderer: Box<dyn Renderer>,
    pub interrupt: Interrupt,
    name: &'static str,
    phases: ViewPhases,
}

impl TestViewer {
    pub fn new(driver: Driver) -> TestViewer {
        let Driver { name, light, renderer, .. } = driver;
        let phases = ViewPhases::after(None, false);
        let light = Arc::new(Mutex::new(light));
        TestViewer { light, renderer, interrupt: Interrupt::default(), name, phases }
    }

    /// Returns a viewer of another view of the same light.
    pub fn beside(&self) -> TestViewer {
        let renderer = self.light().renderer();
        let phases = ViewPhases::after(None, false);
        let light = Arc::clone(&self.light);
        TestViewer { light, renderer, interrupt: Interrupt::default(), name: self.name, phases }
    }

    pub fn light(&self) -> MutexGuard<'_, Box<dyn Light>> {
        self.light.lock().expect("no test panics while it holds the light")
    }

    pub fn name(&self) -> &'static str {
        self.name
    }

    pub fn room(&self) -> u64 {
        self.light().room()
    }

    pub fn switch(&mut self, part: &str, on: bool) -> bool {
        self.renderer.switch(part, on)
    }

    pub fn rays(&mut self, expected: Option<&View>) -> Option<Vec<(BeamKey, RayCoords)>> {
        self.renderer.wishes().rays(expected)
    }

    pub fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        self.phases = ViewPhases::after(Some(&self.phases), look.is_moving);
        self.renderer.look(look)
    }

    pub fn insert(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) {
        self.light().insert(Age::Present, beam, paths, samples);
    }

    pub fn insert_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) {
        self.light().insert(Age::Earlier, beam, paths, samples);
    }

    pub fn remove_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) -> bool {
        self.light().remove_earlier(beam, paths, samples)
    }

    pub fn insert_unseen(&mut self, beam: BeamKey) {
        self.light().insert_unseen(beam);
    }

    pub fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        self.renderer.insert_live(paths, rays);
    }

    pub fn settle(&mut self) {
        self.phases.settle();
        self.renderer.settle();
    }

    pub fn prepare(&mut self) -> bool {
        self.renderer.prepare(self.phases.next(false))
    }

    pub fn refines(&self) -> bool {
        self.renderer.refines()
    }

    /// Draws a frame; `None` without a view, and if it was interrupted.
    pub fn try_draw(&mut self) -> Option<Frame> {
        self.draw_stages().1
    }

    /// Draws as [`try_draw`](Self::try_draw). Also returns the stages that ran.
    pub fn draw_stages(&mut self) -> (Vec<&'static str>, Option<Frame>) {
        let (mut stages, phase) = (Vec::new(), self.phases.next(false));
        let frame = self.renderer.draw(phase, &self.interrupt, &mut |stage| stages.push(stage));
        if frame.is_some() {
            self.phases.note_frame();
        }
        (stages, frame)
    }

    pub fn draw(&mut self) -> Frame {
        self.try_draw().expect("there is a view, and nobody interrupts")
    }

    pub fn draw_for_file(&mut self) -> Frame {
        let frame = self.renderer.draw(FramePhase::File, &self.interrupt, &mut |_| {});
        self.phases.note_frame();
        frame.expect("there is a view, and nothing interrupts a frame for a file")
    }

    /// Draws the left half of a picture; `None` if the driver cannot, or was interrupted.
    pub fn draw_half(&mut self, look: &FrameRequest) -> Option<Picture> {
        let parts = self.renderer.parts()?;
        let plan = parts.plan(look);
        parts.part(&plan, 0..look.size.0 / 2, 0..look.size.1, &self.interrupt)
    }

    pub fn weigh(
        &mut self,
        look: &FrameRequest,
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        self.renderer.wishes().weigh(look, beams)
    }

    pub fn pixel_weights(&mut self) -> Option<PixelWeights> {
        self.renderer.wishes().pixel_weights()
    }

    pub fn depths(&mut self) -> Vec<f32> {
        self.renderer.wishes().depths()
    }

    pub fn uncovered(&mut self) -> Vec<u32> {
        self.renderer.wishes().uncovered()
    }

    pub fn viewpoint_radius(&mut self, look: &FrameRequest, nearest: f64) -> f64 {
        self.renderer.wishes().viewpoint_radius(look, nearest)
    }

    pub fn surface_beams(&mut self, search: Search) -> Option<BeamSearch> {
        self.renderer.wishes().surface_beams(search)
    }
}
