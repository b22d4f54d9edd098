//! Frameless rendering as a driver of whole sessions.

use std::sync::Arc;

use holo_display::{Driver, DriverError, Frame, Look, SurfaceAt, WantedBeam};
use holo_picture::View;
use holo_section::{BeamKey, Sample, Section};

use crate::driver::surface_at;
use crate::frameless::Frameless;
use crate::screen::{Screen, radius};

const NAME: &str = "frameless";

/// Shows the newest sample of each pixel, whichever view the sample was for (Bishop, Fuchs,
/// McMillan & Scher Zagier 1994).
///
/// It ignores [`Look::resolution`], because pixels keep their colours from view to view.
pub struct FramelessDriver {
    sections: Arc<[Section]>,
    sky: [f32; 3],
    shown: Option<Shown>,
}

struct Shown {
    frameless: Frameless,
    screen: Screen,
    /// Distance of each pixel's newest own sample, 0 without one.
    depth: Vec<f32>,
}

impl FramelessDriver {
    /// Returns a driver that shows nothing yet. Beams that cannot hit anything show `sky`.
    pub fn new(sections: Arc<[Section]>, sky: [f32; 3]) -> Self {
        Self { sections, sky, shown: None }
    }
}

impl Driver for FramelessDriver {
    fn name(&self) -> &'static str {
        NAME
    }

    fn weigh(
        &mut self,
        look: &Look,
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        self.look(look)?;
        Ok(beams)
    }

    fn look(&mut self, look: &Look) -> Result<(), DriverError> {
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
        let screen = Screen::new(Arc::clone(&self.sections), self.sky, look);
        let depth = vec![0.0; look.size.0 as usize * look.size.1 as usize];
        self.shown = Some(Shown { frameless, screen, depth });
        Ok(())
    }

    fn insert(&mut self, key: BeamKey, _paths: u16, samples: &[Sample]) {
        let Some(Shown { frameless, screen, depth }) = &mut self.shown else { return };
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

    fn insert_unseen(&mut self, key: BeamKey) {
        if let Some(shown) = &mut self.shown {
            shown.screen.insert_unseen(key);
        }
    }

    fn draw(&mut self, _stage_ended: &mut dyn FnMut(&'static str)) -> Frame {
        let Some(Shown { frameless, screen, depth }) = &mut self.shown else {
            return Frame::black((1, 1));
        };
        // A pixel that still shows another view has no known depth.
        let of_view = |(has_colour, &depth): (bool, &f32)| {
            if has_colour && depth == 0.0 { f32::INFINITY } else { depth }
        };
        let depth = frameless.has_colour().zip(&*depth).map(of_view).collect();
        screen.frame(frameless.picture().clone(), depth)
    }

    fn depth(&mut self) -> Vec<f32> {
        self.draw(&mut |_| {}).depth
    }

    fn surface_at(&mut self, column: u32, row: u32) -> Option<SurfaceAt> {
        surface_at(&self.draw(&mut |_| {}), column, row)
    }

    fn viewpoint_radius(&self, view: &View, size: (u32, u32), nearest: f64) -> f64 {
        radius(&self.sections, view, size, nearest)
    }

    fn set_nearest(&mut self, nearest: f64) {
        if let Some(shown) = &mut self.shown {
            shown.screen.set_nearest(nearest);
        }
    }
}
