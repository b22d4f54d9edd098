//! The driver of scenes with stand-ins: simpler geometry and portals that replace the scene in
//! views of some sections (Larson & Simmons 1999, §2.4.4).
//!
//! Light is stored on the geometry that was cast when its samples came. Each view therefore begins
//! without light.

use crate::driver::NAME;
use crate::portals::{PortalPixels, looking_beyond};
use crate::{SurfaceLight, SurfaceRenderer};
use holo_denoise::Denoiser;
use holo_display::{
    Age, BeamSearch, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt, Light,
    LiveSample, PartsRenderer, PixelWeights, RayWishes, Renderer, Search, StoringRenderer,
    ViewLight, WantedBeam, section_of,
};
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_section::{BeamKey, RayCoords, Sample, Section};
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Makes a driver that needs no scene. It draws pixels that look through portals.
pub type MakeDriver = Arc<dyn Fn() -> Driver + Send + Sync>;

/// The stand-in of one section.
#[derive(Clone, Debug, Default)]
pub struct StandIn {
    /// Simpler geometry that replaces the scene.
    pub geometry: Option<Arc<Raycaster>>,
    /// Invisible surfaces beyond which the geometry is incomplete.
    pub portals: Option<Arc<Raycaster>>,
}

/// Stand-ins by section number.
#[derive(Clone, Debug, Default)]
pub struct StandIns(pub BTreeMap<u16, StandIn>);

impl StandIns {
    /// Returns the stand-in of the section that a view looks out of or into.
    fn of(&self, sections: &[Section], view: &View) -> StandIn {
        let stand_in = section_of(sections, view).and_then(|section| self.0.get(&section));
        stand_in.cloned().unwrap_or_default()
    }
}

/// Returns the driver `surfaces` of a scene with stand-ins. It casts `scene` in views without one.
/// The first of its renderers uses the denoiser.
pub fn stand_ins_driver(
    sections: Arc<[Section]>,
    scene: Arc<Raycaster>,
    stand_ins: StandIns,
    denoiser: Option<Denoiser>,
    make_beyond: MakeDriver,
) -> Driver {
    let denoiser = Mutex::new(denoiser);
    let make = move || {
        let denoiser = denoiser.lock().take();
        let light = SurfaceLight::new(Arc::clone(&sections), Arc::clone(&scene), denoiser);
        StandInsRenderer {
            sections: Arc::clone(&sections),
            scene: Arc::clone(&scene),
            stand_ins: stand_ins.clone(),
            make_beyond: Arc::clone(&make_beyond),
            renderer: light.surface_renderer(),
            light,
            beyond: None,
        }
    };
    Driver { knows_surfaces: true, ..Driver::new(NAME, ViewLight::new(make)) }
}

/// Draws light that is stored on stand-ins while one view is shown.
struct StandInsRenderer {
    sections: Arc<[Section]>,
    scene: Arc<Raycaster>,
    stand_ins: StandIns,
    make_beyond: MakeDriver,
    /// The light on the geometry that is cast for the view.
    light: SurfaceLight,
    renderer: SurfaceRenderer,
    beyond: Option<PortalPixels>,
}

impl StandInsRenderer {
    /// Casts other geometry. All samples are forgotten.
    fn change_geometry(&mut self, geometry: Arc<Raycaster>) {
        let denoiser = self.light.take_denoiser();
        self.light = SurfaceLight::new(Arc::clone(&self.sections), geometry, denoiser);
        self.renderer = self.light.surface_renderer();
    }
}

impl StoringRenderer for StandInsRenderer {
    fn insert(&mut self, age: Age, beam: BeamKey, paths: u16, samples: &[Sample]) {
        self.light.insert(age, beam, paths, samples);
        if let Some(PortalPixels { driver, .. }) = &mut self.beyond {
            driver.light.insert(age, beam, paths, samples);
        }
    }

    fn remove_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) -> bool {
        let remove =
            |beyond: &mut PortalPixels| beyond.driver.light.remove_earlier(beam, paths, samples);
        let is_gone = self.beyond.as_mut().is_none_or(remove);
        self.light.remove_earlier(beam, paths, samples) && is_gone
    }

    fn insert_unseen(&mut self, beam: BeamKey) {
        // The geometry shows what lies along such a beam, except beyond portals.
        if let Some(PortalPixels { driver, .. }) = &mut self.beyond {
            driver.light.insert_unseen(beam);
        }
    }
}

impl Renderer for StandInsRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        let StandIn { geometry, portals } = self.stand_ins.of(&self.sections, &look.view);
        let geometry = geometry.unwrap_or_else(|| Arc::clone(&self.scene));
        self.change_geometry(Arc::clone(&geometry));
        self.beyond = None;
        if let Some(portals) = portals {
            let pixels = looking_beyond(&geometry, &portals, &look.view, look.size);
            let mut driver = (self.make_beyond)();
            driver.renderer.look(look)?;
            self.beyond = pixels.contains(&true).then_some(PortalPixels { driver, pixels });
        }
        self.renderer.look(look)
    }

    fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        self.renderer.insert_live(paths, rays);
        if let Some(PortalPixels { driver, .. }) = &mut self.beyond {
            driver.renderer.insert_live(paths, rays);
        }
    }

    fn settle(&mut self) {
        self.renderer.settle();
        if let Some(PortalPixels { driver, .. }) = &mut self.beyond {
            driver.renderer.settle();
        }
    }

    fn draw(
        &mut self,
        phase: FramePhase,
        interrupt: &Interrupt,
        stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame> {
        let mut frame = self.renderer.draw(phase, interrupt, stage_ended)?;
        if let Some(beyond) = &mut self.beyond {
            beyond.paint(&mut frame, phase, interrupt)?;
        }
        Some(frame)
    }

    fn refines(&self) -> bool {
        let beyond = self.beyond.as_ref();
        self.renderer.refines() || beyond.is_some_and(|beyond| beyond.driver.renderer.refines())
    }

    fn prepare(&mut self, phase: FramePhase) -> bool {
        let beyond = self.beyond.as_mut();
        let prepares = |beyond: &mut PortalPixels| beyond.driver.renderer.prepare(phase);
        self.renderer.prepare(phase) || beyond.is_some_and(prepares)
    }

    fn switch(&mut self, part: &str, on: bool) -> bool {
        self.renderer.switch(part, on)
    }

    fn parts(&mut self) -> Option<&mut dyn PartsRenderer> {
        // A part beyond a portal has no samples of its own.
        None
    }

    fn wishes(&mut self) -> &mut dyn RayWishes {
        self
    }
}

impl RayWishes for StandInsRenderer {
    fn weigh(
        &mut self,
        look: &FrameRequest,
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        self.renderer.weigh(look, beams)
    }

    fn pixel_weights(&mut self) -> Option<PixelWeights> {
        self.renderer.pixel_weights()
    }

    fn rays(&mut self, expected: Option<&View>) -> Option<Vec<(BeamKey, RayCoords)>> {
        self.renderer.rays(expected)
    }

    fn viewpoint_radius(&mut self, look: &FrameRequest, nearest: f64) -> f64 {
        self.renderer.viewpoint_radius(look, nearest)
    }

    fn depths(&mut self) -> Vec<f32> {
        self.renderer.depths()
    }

    fn uncovered(&mut self) -> Vec<u32> {
        let mut pixels = self.renderer.uncovered();
        if let Some(PortalPixels { driver, pixels: of_portals }) = &mut self.beyond {
            let is_beyond = |pixel: &u32| of_portals[*pixel as usize];
            pixels.extend(driver.renderer.wishes().uncovered().into_iter().filter(is_beyond));
            pixels.sort_unstable();
        }
        pixels
    }

    fn surface_beams(&mut self, search: Search) -> Option<BeamSearch> {
        self.renderer.surface_beams(search)
    }
}
