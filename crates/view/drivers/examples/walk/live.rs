//! A driver of a session, fed as a session and a server feed it: views and wishes go in and out by
//! its traits, requests are rays that can be stored, and samples have ten bytes, state no noise and
//! arrive a frame later.

use crate::drivers::{Answer, Making, Wanted};
use crate::path::RATE;
use holo_display::{
    Age, Driver, DriverError, FramePhase, FrameRequest, Interrupt, SelectOptions, select_beams,
};
use holo_picture::{Picture, View};
use holo_section::{BeamKey, RayCoords, Sample, Section};
use holo_session::EyeVelocity;
use std::sync::Arc;
use std::time::Duration;

/// Frames between two requests of beams, as in a session whose eye moves.
const FRAMES_PER_REQUEST: u32 = 5;

/// Assumed distance of the nearest surface, scene units.
const NEAREST: f64 = 1.0;

/// The ray of a stored sample.
pub struct StoredRay {
    key: BeamKey,
    coords: RayCoords,
    /// Distance from the ray's beginning in the section to the traced origin.
    ahead: f64,
}

/// A driver in use.
pub struct Live {
    driver: Driver,
    sections: Arc<[Section]>,
    size: (u32, u32),
    paths: u16,
    /// The view before, and samples that have not arrived.
    before: Option<View>,
    under_way: Vec<(BeamKey, Sample)>,
    frames: u32,
}

impl Live {
    pub fn new(driver: Driver, making: &Making) -> Self {
        let (sections, size) = (Arc::clone(making.sections), making.size);
        let (before, under_way, paths) = (None, Vec::new(), making.paths);
        Self { driver, sections, size, paths, before, under_way, frames: 0 }
    }

    /// Shows a view, lets the samples of the last request arrive, and returns the rays that the
    /// driver wants most, and the picture if `shown`.
    pub fn frame(
        &mut self,
        view: View,
        wanted: usize,
        shown: bool,
    ) -> Result<(Vec<Wanted>, Option<Picture>), DriverError> {
        let before = self.before.replace(view);
        let look = FrameRequest { view, size: self.size, is_moving: before != Some(view) };
        if self.frames.is_multiple_of(FRAMES_PER_REQUEST) {
            let options = SelectOptions::default();
            let beams = select_beams(&self.sections, &view, self.size, &options).beams;
            let wishes = self.driver.renderer.wishes();
            wishes.weigh(&look, beams)?;
            wishes.viewpoint_radius(&look, NEAREST);
        }
        self.driver.renderer.look(&look)?;
        for (key, sample) in self.under_way.drain(..) {
            self.driver.light.insert(Age::Present, key, self.paths, &[sample]);
        }
        let drawn =
            self.driver.renderer.draw(FramePhase::Moving, &Interrupt::default(), &mut |_| {});
        let picture = drawn.filter(|_| shown).map(|frame| frame.picture);
        let place = |view: View| [view.vp, view.vd];
        let velocity = before.map_or(EyeVelocity::default(), |before| {
            EyeVelocity::between(place(before), place(view), 1.0 / RATE)
        });
        let expected = velocity.ahead(&view, Duration::from_secs_f64(1.0 / RATE));
        let rays = self.driver.renderer.wishes().rays(expected.as_ref()).unwrap_or_default();
        self.frames += 1;
        let traced = |(key, coords)| self.traced(key, coords, &view);
        Ok((rays.into_iter().take(wanted).filter_map(traced).collect(), picture))
    }

    /// Returns the ray of a request. In a section around the eye, it begins at the point nearest to
    /// the eye.
    fn traced(&self, key: BeamKey, coords: RayCoords, view: &View) -> Option<Wanted> {
        let section = self.sections.get(usize::from(key.section))?;
        let ray = section.ray(section.cells(key.beam)?, coords);
        let is_around = section.contains(view.vp);
        let ahead =
            if is_around { (view.vp - ray.origin).dot(ray.direction).max(0.0) } else { 0.0 };
        let origin = ray.origin + ray.direction * ahead;
        Some(Wanted::requested(origin, ray.direction, StoredRay { key, coords, ahead }))
    }

    /// Takes the answer to a ray. It arrives with the next frame.
    pub fn take(&mut self, ray: &StoredRay, answer: &Answer, dither: u32) {
        let Some(section) = self.sections.get(usize::from(ray.key.section)) else { return };
        let (distance, diagonal) = (answer.distance + ray.ahead, section.diagonal());
        let sample = Sample::encode(ray.coords, answer.radiance, distance, diagonal, dither);
        self.under_way.push((ray.key, sample));
    }
}
