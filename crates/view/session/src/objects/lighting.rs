//! The light around local objects, by place.
//!
//! The driver draws six small views from the middle of an object. Drivers that store light draw
//! them at once. For others, a probe waits until the stored samples of its views have arrived.

use std::sync::Arc;

use glam::DVec3;
use holo_display::{Frame, FramePhase, FrameRequest, Interrupt, Renderer};
use holo_local_objects::{
    LIGHTS, LightProbe, LocalObject, ObjectLighting, ProbeError, Room, probe_views, side_places,
};

use crate::Session;

/// Side of a probe's faces for objects that only scatter light, and for those that reflect it as
/// mirrors do, pixels.
const SIDE: u32 = 64;
const SHINY_SIDE: u32 = 256;

/// Most further probes for what the mirrors of an object show and its middle does not see, and the
/// side of their faces, pixels: three of them cost three quarters of the probe of the middle.
const MOST_SIDES: usize = 3;
const SIDE_OF_SIDES: u32 = 128;

/// Most places whose light is stored.
const MOST_PLACES: usize = 16;

/// Share of its radius by which an object may move before its light is that of another place.
const SAME_PLACE: f64 = 0.25;

/// Growth of the samples after which the light of a place is found again, while nobody waits for a
/// file.
const GROWTH: f64 = 1.25;

/// The light of places.
#[derive(Default)]
pub(super) struct Lightings {
    places: Vec<LitPlace>,
    /// Probes whose samples are under way.
    waiting: Vec<WaitingProbe>,
    /// Samples that have arrived.
    samples: u64,
}

struct LitPlace {
    centre: DVec3,
    side: u32,
    lighting: Arc<ObjectLighting>,
    /// Samples that had arrived when it was found.
    samples: u64,
    /// True if the driver has changed since.
    is_old: bool,
}

struct WaitingProbe {
    centre: DVec3,
    side: u32,
    renderers: Vec<Box<dyn Renderer>>,
}

impl Lightings {
    pub(super) fn note_samples(&mut self, count: u64) {
        self.samples += count;
    }

    pub(super) fn note_driver(&mut self) {
        self.waiting.clear();
        self.places.iter_mut().for_each(|place| place.is_old = true);
    }

    fn nearest(&self, object: &LocalObject) -> Option<&LitPlace> {
        let apart = |place: &&LitPlace| place.centre.distance(object.centre());
        self.places.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))
    }

    fn put(&mut self, place: LitPlace, radius: f64) {
        let is_same = |other: &LitPlace| {
            other.side == place.side && is_same_place(other.centre, place.centre, radius)
        };
        self.places.retain(|other| !is_same(other));
        if self.places.len() >= MOST_PLACES {
            self.places.remove(0);
        }
        self.places.push(place);
    }
}

fn is_same_place(a: DVec3, b: DVec3, radius: f64) -> bool {
    a.distance(b) <= SAME_PLACE * radius
}

/// Returns the side of the probe of an object.
fn side(object: &LocalObject) -> u32 {
    if object.is_shiny() { SHINY_SIDE } else { SIDE }
}

/// Returns what is to be shown to a driver for a probe.
fn looks(centre: DVec3, side: u32) -> Option<[FrameRequest; 6]> {
    let look = |view| FrameRequest { view, size: (side, side), is_moving: false };
    probe_views(centre).map(|views| views.map(look))
}

impl Session {
    /// Returns the light around an object; `None` if none is known.
    pub(super) fn lighting(
        &mut self,
        object: &LocalObject,
        is_quick: bool,
        is_file: bool,
        room: Option<&Room>,
    ) -> Option<Arc<ObjectLighting>> {
        let lightings = &self.objects.lightings;
        let samples = lightings.samples;
        let known = lightings.nearest(object);
        let is_here = |place: &&LitPlace| {
            let grown = match is_file {
                true => samples != place.samples,
                false => samples as f64 > GROWTH * place.samples as f64,
            };
            !grown
                && !place.is_old
                && place.side == side(object)
                && is_same_place(place.centre, object.centre(), object.radius())
        };
        if let Some(place) = known.filter(|place| is_quick || is_here(place)) {
            return Some(Arc::clone(&place.lighting));
        }
        let found = self.probe(object, is_file);
        if let Some(Ok(probe)) = found {
            let lighting = ObjectLighting::new(probe, LIGHTS, room);
            let lighting = Arc::new(lighting.with_sides(self.sides(object, room)));
            let place = LitPlace {
                centre: object.centre(),
                side: side(object),
                lighting: Arc::clone(&lighting),
                samples,
                is_old: false,
            };
            self.objects.lightings.put(place, object.radius());
            return Some(lighting);
        }
        self.objects.lightings.nearest(object).map(|place| Arc::clone(&place.lighting))
    }

    /// Returns the light at places that see what the object's mirrors show and its middle does not,
    /// if the driver knows it at once.
    fn sides(&mut self, object: &LocalObject, room: Option<&Room>) -> Vec<LightProbe> {
        let room = room.filter(|_| object.is_shiny() && self.keeps_samples());
        let places = room.map_or_else(Vec::new, |room| side_places(object, room, MOST_SIDES));
        places
            .into_iter()
            .filter_map(|place| self.probe_of_store(place, SIDE_OF_SIDES)?.ok())
            .collect()
    }

    /// Returns the light at a place that the driver's one store has. `None` if the place is not
    /// possible.
    fn probe_of_store(
        &mut self,
        centre: DVec3,
        side: u32,
    ) -> Option<Result<LightProbe, ProbeError>> {
        let looks = looks(centre, side)?;
        let mut renderer = self.driver.light.renderer();
        let frames = looks.iter().map(|look| frame(renderer.as_mut(), look));
        let frames: Vec<Frame> = frames.collect::<Option<_>>()?;
        Some(probe_of(centre, frames))
    }

    /// Returns the light that the driver shows around an object. `None` if its samples are under
    /// way.
    fn probe(
        &mut self,
        object: &LocalObject,
        is_file: bool,
    ) -> Option<Result<LightProbe, ProbeError>> {
        let (centre, side) = (object.centre(), side(object));
        if self.keeps_samples() {
            // What is not there yet makes a later probe better.
            return self.probe_of_store(centre, side);
        }
        let looks = looks(centre, side)?;
        // Without a view, nothing can be requested.
        self.current.as_ref()?;
        let is_for = |probe: &WaitingProbe| {
            probe.side == side && is_same_place(probe.centre, centre, object.radius())
        };
        if !self.objects.lightings.waiting.iter().any(is_for) {
            let mut renderers = Vec::with_capacity(looks.len());
            for look in &looks {
                let mut renderer = self.driver.light.renderer();
                renderer.look(look).ok()?;
                renderers.push(renderer);
            }
            self.objects.lightings.waiting.push(WaitingProbe { centre, side, renderers });
            // A lost server is noticed by whoever waits for it.
            _ = self.ask_beside(&looks);
        }
        if !self.has_stored_beside() && !is_file {
            return None;
        }
        let waiting = &mut self.objects.lightings.waiting;
        let at = waiting.iter().position(is_for)?;
        let WaitingProbe { centre, renderers, .. } = waiting.remove(at);
        let frames = renderers.into_iter().map(|mut renderer| {
            renderer.settle();
            renderer.draw(FramePhase::File, &Interrupt::default(), &mut |_| {})
        });
        let frames: Vec<Frame> = frames.collect::<Option<_>>()?;
        Some(probe_of(centre, frames))
    }

    /// Returns whether the samples of a probe have arrived.
    pub(super) fn has_probe(&self) -> bool {
        !self.objects.lightings.waiting.is_empty() && self.has_stored_beside()
    }

    /// Requests the samples of probes that are not here, before everything is awaited.
    pub(crate) fn prepare_lightings(&mut self) {
        if !self.objects.is_empty() && !self.keeps_samples() && self.current.is_some() {
            let room = self.room();
            self.lit_objects(false, false, 0, room.as_ref());
        }
    }
}

fn frame(renderer: &mut dyn Renderer, look: &FrameRequest) -> Option<Frame> {
    renderer.look(look).ok()?;
    renderer.draw(FramePhase::File, &Interrupt::default(), &mut |_| {})
}

fn probe_of(centre: DVec3, frames: Vec<Frame>) -> Result<LightProbe, ProbeError> {
    let frames: [Frame; 6] = frames.try_into().map_err(|_| ProbeError::Frames)?;
    LightProbe::new(centre, &frames)
}
