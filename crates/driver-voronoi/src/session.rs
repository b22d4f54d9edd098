//! The driver of a whole session: a [`Voronoi`] for each view, another driver for what lies beyond
//! portals, and a copy for pixels that no section covers.

use super::{StandIns, Voronoi};
use holo_display::{
    BeamSearch, Driver, DriverError, Frame, LiveSample, Look, Resolution, Search, SurfaceAt,
};
use holo_light::Store;
use holo_raycast::Raycaster;
use holo_section::{BeamKey, Sample, Section};
use std::sync::Arc;

/// Makes a driver that needs no scene: it draws what lies beyond portals.
pub type MakeDriver = Arc<dyn Fn() -> Box<dyn Driver> + Send + Sync>;

/// The geometry-guided driver for all views of a session.
pub struct VoronoiDriver {
    sections: Arc<[Section]>,
    raycaster: Arc<Raycaster>,
    /// Indirect light on the scene's own surfaces.
    records: Arc<Store>,
    stand_ins: StandIns,
    make_beyond: MakeDriver,
    shown: Option<Shown>,
}

/// One view, and what draws it.
struct Shown {
    look: Look,
    covered: Voronoi,
    /// A copy that also has live rays, once some have come.
    live: Option<Box<Live>>,
    beyond: Option<Beyond>,
}

/// What draws the pixels that no section covers.
struct Live {
    driver: Voronoi,
    pixels: Vec<u32>,
}

/// What draws the pixels that look through portals.
struct Beyond {
    driver: Box<dyn Driver>,
    /// By pixel of the picture, whether it looks through a portal.
    pixels: Vec<bool>,
}

impl VoronoiDriver {
    /// Returns a driver that casts `raycaster`'s scene. `records` may grow while it draws.
    pub fn new(
        sections: Arc<[Section]>,
        raycaster: Arc<Raycaster>,
        records: Arc<Store>,
        stand_ins: StandIns,
        make_beyond: MakeDriver,
    ) -> Self {
        Self { sections, raycaster, records, stand_ins, make_beyond, shown: None }
    }
}

impl Driver for VoronoiDriver {
    fn name(&self) -> &'static str {
        "voronoi"
    }

    fn look(&mut self, look: &Look) -> Result<(), DriverError> {
        let stand_in = self.stand_ins.of(&self.sections, &look.view);
        // Records lie on the scene's own surfaces.
        let records = stand_in.geometry.is_none().then(|| Arc::clone(&self.records));
        let raycaster = stand_in.geometry.unwrap_or_else(|| Arc::clone(&self.raycaster));
        let driver = Voronoi::at_resolution(
            Arc::clone(&self.sections),
            raycaster,
            stand_in.portals,
            look.view,
            look.size,
            look.resolution,
        );
        let covered = match records {
            Some(records) => driver.with_records(records),
            None => driver,
        };
        let pixels = covered.beyond_portals();
        let beyond = if pixels.is_empty() {
            None
        } else {
            let mut driver = (self.make_beyond)();
            driver.look(look)?;
            Some(Beyond { driver, pixels })
        };
        self.shown = Some(Shown { look: *look, covered, live: None, beyond });
        Ok(())
    }

    fn insert(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) {
        let Some(shown) = &mut self.shown else { return };
        shown.covered.insert(beam, paths, samples);
        if let Some(live) = &mut shown.live {
            live.driver.insert(beam, paths, samples);
        }
        if let Some(beyond) = &mut shown.beyond {
            beyond.driver.insert(beam, paths, samples);
        }
    }

    fn insert_unseen(&mut self, beam: BeamKey) {
        // The scene tells what such a beam shows, except beyond portals.
        if let Some(beyond) = self.shown.as_mut().and_then(|shown| shown.beyond.as_mut()) {
            beyond.driver.insert_unseen(beam);
        }
    }

    fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        let Some(shown) = &mut self.shown else { return };
        let covered = &shown.covered;
        let live = shown.live.get_or_insert_with(|| {
            Box::new(Live { driver: covered.copied(), pixels: covered.uncovered() })
        });
        live.driver.insert_live(paths, rays);
        if let Some(beyond) = &mut shown.beyond {
            beyond.driver.insert_live(paths, rays);
        }
    }

    fn draw(&mut self, _stage_ended: &mut dyn FnMut(&'static str)) -> Frame {
        let Some(shown) = &mut self.shown else { return Frame::black((1, 1)) };
        let mut frame = shown.covered.draw();
        if let Some(live) = &shown.live {
            let drawn = live.driver.draw();
            for pixel in live.pixels.iter().map(|&pixel| pixel as usize) {
                frame.picture.pixels[pixel] = drawn.picture.pixels[pixel];
                frame.depth[pixel] = drawn.depth[pixel];
            }
        }
        if let Some(beyond) = &mut shown.beyond {
            beyond.paint(&mut frame);
        }
        frame
    }

    fn depth(&mut self) -> Vec<f32> {
        self.shown.as_ref().map_or_else(Vec::new, |shown| shown.covered.depth())
    }

    fn knows_depth(&self) -> bool {
        true
    }

    fn surface_at(&mut self, column: u32, row: u32) -> Option<SurfaceAt> {
        let shown = self.shown.as_mut()?;
        if column >= shown.look.size.0 || row >= shown.look.size.1 {
            return None;
        }
        let pixel = row as usize * shown.look.size.0 as usize + column as usize;
        if let Some(beyond) = &mut shown.beyond
            && beyond.pixels.get(pixel) == Some(&true)
        {
            return beyond.driver.surface_at(column, row);
        }
        let hit = shown.covered.hit_at(column, row);
        Some(SurfaceAt {
            distance: hit.map_or(f32::INFINITY, |(distance, _)| distance),
            triangle: hit.map(|(_, triangle)| triangle),
        })
    }

    fn uncovered(&self) -> Vec<u32> {
        match &self.shown {
            Some(shown) if shown.look.resolution == Resolution::Full => shown.covered.uncovered(),
            _ => Vec::new(),
        }
    }

    fn surface_beams(&self, search: Search) -> Option<BeamSearch> {
        self.shown.as_ref()?.covered.surface_beams(search)
    }
}

impl Beyond {
    /// Draws the pixels that look through portals.
    fn paint(&mut self, frame: &mut Frame) {
        let drawn = self.driver.draw(&mut |_| {});
        let colours = frame.picture.pixels.iter_mut().zip(&drawn.picture.pixels);
        let depths = frame.depth.iter_mut().zip(&drawn.depth);
        let all = colours.zip(depths).zip(&self.pixels);
        for (((to, from), (depth, its)), _) in all.filter(|(_, beyond)| **beyond) {
            (*to, *depth) = (*from, *its);
            frame.empty_pixels += u64::from(*its == 0.0);
        }
    }
}
