//! Frameless rendering as a driver of whole sessions.

use std::sync::Arc;

use holo_display::{
    Age, BeamSearch, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt, LiveSample,
    PartsRenderer, RayWishes, Renderer, Search, SkyView, StoringRenderer, ViewLight, WantedBeam,
};
use holo_section::{BeamKey, RayCoords, Sample, Section};

use crate::frameless::Frameless;
use crate::screen::{CacheScreen, radius};

const NAME: &str = "frameless";

/// Returns the driver `frameless`. Beams that cannot hit anything show `sky`.
pub fn frameless_driver(sections: Arc<[Section]>, sky: impl Into<SkyView>) -> Driver {
    let sky = sky.into();
    let make = move || {
        let (sections, sky) = (Arc::clone(&sections), sky.clone());
        FramelessRenderer { sections, sky, shown: None }
    };
    Driver { keeps_pixels: true, ..Driver::new(NAME, ViewLight::new(make)) }
}

/// Shows the newest sample of each pixel, whichever view the sample was for (Bishop, Fuchs,
/// McMillan & Scher Zagier 1994).
struct FramelessRenderer {
    sections: Arc<[Section]>,
    sky: SkyView,
    shown: Option<FramelessView>,
}

struct FramelessView {
    frameless: Frameless,
    screen: CacheScreen,
    /// Distance of each pixel's newest own sample, 0 without one.
    depth: Vec<f32>,
}

impl StoringRenderer for FramelessRenderer {
    fn insert(&mut self, _age: Age, key: BeamKey, _paths: u16, samples: &[Sample]) {
        let Some(FramelessView { frameless, screen, depth }) = &mut self.shown else { return };
        let width = screen.size.0;
        screen.locate(key, samples, |seen| {
            let (column, row) = seen.pixel;
            let Some(tag) = frameless.pixel_tag(column, row) else { return false };
            if seen.is_own {
                frameless.insert(tag, seen.radiance);
                depth[(row * width + column) as usize] = seen.distance;
            } else {
                frameless.guess(tag, seen.radiance);
            }
            true
        });
    }

    fn remove_earlier(&mut self, _key: BeamKey, _paths: u16, _samples: &[Sample]) -> bool {
        false
    }

    fn insert_unseen(&mut self, key: BeamKey) {
        if let Some(shown) = &mut self.shown {
            shown.screen.insert_unseen(key);
        }
    }
}

impl Renderer for FramelessRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        let before = self.shown.take();
        let mut frameless = match before.filter(|shown| shown.screen.serves(look)) {
            Some(shown) if shown.screen.is_of(look) => {
                self.shown = Some(shown);
                return Ok(());
            }
            Some(shown) => shown.frameless,
            None => Frameless::new(look.size, look.view, 0)
                .map_err(|error| DriverError { driver: NAME, reason: error.to_string() })?,
        };
        frameless.look(look.view);
        let screen = CacheScreen::new(Arc::clone(&self.sections), self.sky.clone(), look);
        let depth = vec![0.0; look.size.0 as usize * look.size.1 as usize];
        self.shown = Some(FramelessView { frameless, screen, depth });
        Ok(())
    }

    fn insert_live(&mut self, _paths: u16, _rays: &[LiveSample]) {
        // Uncovered pixels are black, and no rays are wished for.
    }

    fn settle(&mut self) {
        // A pixel keeps its colour until its next sample.
    }

    fn draw(
        &mut self,
        _phase: FramePhase,
        _interrupt: &Interrupt,
        _stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame> {
        let FramelessView { frameless, screen, depth } = self.shown.as_mut()?;
        // A pixel that still shows another view has no known depth.
        let of_view = |(has_colour, &depth): (bool, &f32)| {
            if has_colour && depth == 0.0 { f32::INFINITY } else { depth }
        };
        let depth = frameless.has_colour().zip(&*depth).map(of_view).collect();
        Some(screen.frame(frameless.picture().clone(), depth))
    }

    fn refines(&self) -> bool {
        false
    }

    fn prepare(&mut self, _phase: FramePhase) -> bool {
        false
    }

    fn switch(&mut self, _part: &str, _on: bool) -> bool {
        false
    }

    fn parts(&mut self) -> Option<&mut dyn PartsRenderer> {
        None
    }

    fn wishes(&mut self) -> &mut dyn RayWishes {
        self
    }
}

impl RayWishes for FramelessRenderer {
    fn weigh(
        &mut self,
        look: &FrameRequest,
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        self.look(look)?;
        Ok(beams)
    }

    fn rays(&mut self) -> Option<Vec<(BeamKey, RayCoords)>> {
        None
    }

    fn viewpoint_radius(&mut self, look: &FrameRequest, nearest: f64) -> f64 {
        let radius = radius(&self.sections, &look.view, look.size, nearest);
        if let Some(FramelessView { screen, .. }) = &mut self.shown {
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
