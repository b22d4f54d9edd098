//! The driver of scenes with stand-ins: simpler geometry and portals that replace the scene in
//! views of some sections (Larson & Simmons 1999, §2.4.4).
//!
//! Light is stored on the geometry that was cast when its samples came. Each view therefore begins
//! without light.

use crate::SurfacesDriver;
use crate::portals::{Beyond, looking_beyond};
use holo_denoise::Denoiser;
use holo_display::{
    BeamSearch, Driver, DriverError, Frame, Interrupt, LiveSample, Look, Search, SurfaceAt,
    section_of,
};
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_section::{BeamKey, Sample, Section};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Makes a driver that needs no scene. It draws pixels that look through portals.
pub type MakeDriver = Box<dyn Fn() -> Box<dyn Driver> + Send>;

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

/// Draws light that is stored on stand-ins while one view is shown.
pub struct StandInsDriver {
    sections: Arc<[Section]>,
    scene: Arc<Raycaster>,
    stand_ins: StandIns,
    make_beyond: MakeDriver,
    driver: SurfacesDriver,
    beyond: Option<Beyond>,
    /// Width of the current picture, pixels.
    width: u32,
}

impl StandInsDriver {
    /// Returns a driver that casts `scene` in views without a stand-in.
    pub fn new(
        sections: Arc<[Section]>,
        scene: Arc<Raycaster>,
        stand_ins: StandIns,
        denoiser: Option<Denoiser>,
        make_beyond: MakeDriver,
    ) -> Self {
        let driver = SurfacesDriver::new(Arc::clone(&sections), Arc::clone(&scene), denoiser);
        Self { sections, scene, stand_ins, make_beyond, driver, beyond: None, width: 1 }
    }
}

impl Driver for StandInsDriver {
    fn name(&self) -> &'static str {
        self.driver.name()
    }

    fn look(&mut self, look: &Look) -> Result<(), DriverError> {
        let StandIn { geometry, portals } = self.stand_ins.of(&self.sections, &look.view);
        let geometry = geometry.unwrap_or_else(|| Arc::clone(&self.scene));
        self.driver.change_scene(Arc::clone(&geometry));
        self.width = look.size.0;
        self.beyond = None;
        if let Some(portals) = portals {
            let pixels = looking_beyond(&geometry, &portals, &look.view, look.size);
            let mut driver = (self.make_beyond)();
            driver.look(look)?;
            self.beyond = pixels.contains(&true).then_some(Beyond { driver, pixels });
        }
        self.driver.look(look)
    }

    fn insert(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) {
        self.driver.insert(beam, paths, samples);
        if let Some(Beyond { driver, .. }) = &mut self.beyond {
            driver.insert(beam, paths, samples);
        }
    }

    fn insert_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) {
        self.driver.insert_earlier(beam, paths, samples);
        if let Some(Beyond { driver, .. }) = &mut self.beyond {
            driver.insert_earlier(beam, paths, samples);
        }
    }

    fn remove_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) -> bool {
        let beyond = self.beyond.as_mut();
        let is_gone =
            beyond.is_none_or(|beyond| beyond.driver.remove_earlier(beam, paths, samples));
        self.driver.remove_earlier(beam, paths, samples) && is_gone
    }

    fn insert_unseen(&mut self, beam: BeamKey) {
        // The geometry shows what lies along such a beam, except beyond portals.
        if let Some(Beyond { driver, .. }) = &mut self.beyond {
            driver.insert_unseen(beam);
        }
    }

    fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        self.driver.insert_live(paths, rays);
        if let Some(Beyond { driver, .. }) = &mut self.beyond {
            driver.insert_live(paths, rays);
        }
    }

    fn draw_for_file(&mut self) {
        self.driver.draw_for_file();
    }

    fn end_early_by(&mut self, interrupt: Interrupt) {
        self.driver.end_early_by(interrupt);
    }

    fn settle(&mut self) {
        self.driver.settle();
    }

    fn prepare(&mut self) -> bool {
        self.driver.prepare()
    }

    fn draw(&mut self, stage_ended: &mut dyn FnMut(&'static str)) -> Frame {
        let mut frame = self.driver.draw(stage_ended);
        // An interrupted frame has nothing in it.
        let is_whole = frame.depth.len() > 1;
        if let Some(beyond) = self.beyond.as_mut().filter(|_| is_whole) {
            beyond.paint(&mut frame);
        }
        frame
    }

    fn refines(&self) -> bool {
        self.driver.refines()
    }

    fn depth(&mut self) -> Vec<f32> {
        self.driver.depth()
    }

    fn knows_depth(&self) -> bool {
        true
    }

    fn surface_at(&mut self, column: u32, row: u32) -> Option<SurfaceAt> {
        let pixel = row as usize * self.width as usize + column as usize;
        match &mut self.beyond {
            Some(Beyond { driver, pixels }) if pixels.get(pixel) == Some(&true) => {
                driver.surface_at(column, row)
            }
            _ => self.driver.surface_at(column, row),
        }
    }

    fn uncovered(&self) -> Vec<u32> {
        let mut pixels = self.driver.uncovered();
        if let Some(beyond) = &self.beyond {
            let is_beyond = |pixel: &u32| beyond.pixels[*pixel as usize];
            pixels.extend(beyond.driver.uncovered().into_iter().filter(is_beyond));
            pixels.sort_unstable();
        }
        pixels
    }

    fn surface_beams(&self, search: Search) -> Option<BeamSearch> {
        self.driver.surface_beams(search)
    }
}
