//! Frameless rendering as a driver of whole sessions.
//!
//! The driver requests its pixels in their random order, each as the nearest ray that can be
//! stored.

use std::sync::Arc;

use holo_display::{
    Age, BeamSearch, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt, LiveSample,
    PartsRenderer, PixelWeights, RayWishes, Renderer, Search, SkyView, StoringRenderer, ViewLight,
    WantedBeam, best_beam,
};
use holo_picture::{PictureError, View};
use holo_section::{BeamKey, RayCoords, Sample, Section};

use crate::awaited::AwaitedRays;
use crate::frameless::{Frameless, PixelTag};
use crate::screen::{CacheScreen, radius};

const NAME: &str = "frameless";

/// Returns the driver `frameless`. Beams that cannot hit anything show `sky`.
pub fn frameless_driver(sections: Arc<[Section]>, sky: impl Into<SkyView>) -> Driver {
    let sky = sky.into();
    let make = move || FramelessRenderer {
        sections: Arc::clone(&sections),
        sky: sky.clone(),
        shown: None,
        awaited: AwaitedRays::default(),
    };
    Driver { keeps_pixels: true, takes_late: true, ..Driver::new(NAME, ViewLight::new(make)) }
}

/// Shows the newest sample of each pixel, whichever view the sample was for (Bishop, Fuchs,
/// McMillan & Scher Zagier 1994).
struct FramelessRenderer {
    sections: Arc<[Section]>,
    sky: SkyView,
    shown: Option<FramelessView>,
    /// Requested rays that have not arrived.
    awaited: AwaitedRays<PixelTag>,
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
        let (awaited, width) = (&mut self.awaited, screen.size.0);
        screen.locate(key, samples, |ray, seen| {
            let requested = awaited.remove(key, ray.coords);
            if let Some(tag) = requested.filter(|tag| !frameless.is_current(*tag)) {
                // Its pixel shows an earlier view until its next ray.
                frameless.insert(tag, ray.radiance);
                return true;
            }
            let Some(seen) = seen else { return false };
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

impl FramelessRenderer {
    /// Changes the view. Pixels stay if they mean the same in both views.
    fn change_view(&mut self, look: &FrameRequest, is_requested: bool) -> Result<(), DriverError> {
        let error = |error: PictureError| DriverError { driver: NAME, reason: error.to_string() };
        let before = self.shown.take().filter(|shown| shown.screen.serves(look));
        let (mut frameless, screen) = match before {
            Some(shown) => (shown.frameless, shown.screen.next(look, is_requested)),
            None => {
                self.awaited.clear();
                let screen = CacheScreen::new(Arc::clone(&self.sections), self.sky.clone(), look);
                (Frameless::new(look.size, look.view, 0).map_err(error)?, screen)
            }
        };
        frameless.resize(look.size).map_err(error)?;
        frameless.look(look.view);
        let depth = vec![0.0; look.size.0 as usize * look.size.1 as usize];
        self.shown = Some(FramelessView { frameless, screen, depth });
        Ok(())
    }
}

impl Renderer for FramelessRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        if self.shown.as_ref().is_some_and(|shown| shown.screen.is_of(look)) {
            return Ok(());
        }
        self.change_view(look, false)
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
        if !self.shown.as_ref().is_some_and(|shown| shown.screen.is_of(look)) {
            self.change_view(look, true)?;
        }
        Ok(beams)
    }

    fn pixel_weights(&mut self) -> Option<PixelWeights> {
        None
    }

    fn rays(&mut self, _expected: Option<&View>) -> Option<Vec<(BeamKey, RayCoords)>> {
        let Some(FramelessView { frameless, screen, .. }) = &mut self.shown else {
            return Some(Vec::new());
        };
        let wanted = self.awaited.wanted(screen.size.0 as usize * screen.size.1 as usize);
        let mut rays = Vec::with_capacity(wanted);
        for (tag, origin, direction) in frameless.requests(wanted) {
            let Some(key) = best_beam(&self.sections, origin, direction) else { continue };
            let section = self.sections.get(usize::from(key.section));
            let Some(hit) = section.and_then(|section| section.line(origin, direction)) else {
                continue;
            };
            self.awaited.insert(key, hit.coords, tag);
            rays.push((key, hit.coords));
        }
        Some(rays)
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
