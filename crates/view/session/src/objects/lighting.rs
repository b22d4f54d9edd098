//! The light around local objects, by place.
//!
//! The driver draws six small views from the middle of an object. Drivers that store light draw
//! them at once. For others, a probe waits until the stored samples of its views have arrived.

use std::sync::Arc;

use anyhow::Result;
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
    /// Whether all samples that were requested for the waiting probes are here.
    is_settled: bool,
}

struct LitPlace {
    centre: DVec3,
    side: u32,
    /// `None` if the driver shows no light there.
    lighting: Option<Arc<ObjectLighting>>,
    /// Samples that had arrived when it was found.
    samples: u64,
    /// True if the driver has changed since.
    is_old: bool,
}

struct WaitingProbe {
    centre: DVec3,
    side: u32,
    renderers: Vec<Box<dyn Renderer>>,
    /// The number of the first request of the view with which its samples were requested.
    view: u32,
}

impl WaitingProbe {
    fn is_of(&self, object: &LocalObject) -> bool {
        self.side == side(object) && is_same_place(self.centre, object.centre(), object.radius())
    }
}

impl Lightings {
    pub(super) fn note_samples(&mut self, count: u64) {
        self.samples += count;
    }

    pub(super) fn note_driver(&mut self) {
        self.waiting.clear();
        self.places.iter_mut().for_each(|place| place.is_old = true);
    }

    /// Notes that all samples that were requested have arrived.
    pub(super) fn note_settled(&mut self) {
        self.is_settled = true;
    }

    /// Returns an object's place, if its light was looked for there. `is_file` refuses light of
    /// fewer samples than there are.
    fn here(&self, object: &LocalObject, is_file: bool) -> Option<&LitPlace> {
        self.places.iter().find(|place| {
            let has_grown = match is_file {
                true => self.samples != place.samples,
                false => self.samples as f64 > GROWTH * place.samples as f64,
            };
            !has_grown
                && !place.is_old
                && place.side == side(object)
                && is_same_place(place.centre, object.centre(), object.radius())
        })
    }

    /// Returns the light of the nearest place.
    fn nearest(&self, object: &LocalObject) -> Option<Arc<ObjectLighting>> {
        let apart = |place: &&LitPlace| place.centre.distance(object.centre());
        let lit = self.places.iter().filter(|place| place.lighting.is_some());
        lit.min_by(|a, b| apart(a).total_cmp(&apart(b)))?.lighting.clone()
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
        let known = if is_quick { lightings.nearest(object) } else { None };
        let here = || lightings.here(object, is_file)?.lighting.clone();
        if let Some(lighting) = known.or_else(here) {
            return Some(lighting);
        }
        if lightings.here(object, is_file).is_none()
            && let Some(found) = self.probe(object)
        {
            let lighting = found.ok().map(|probe| {
                let lighting = ObjectLighting::new(probe, LIGHTS, room);
                Arc::new(lighting.with_sides(self.sides(object, room)))
            });
            let place = LitPlace {
                centre: object.centre(),
                side: side(object),
                lighting,
                samples,
                is_old: false,
            };
            self.objects.lightings.put(place, object.radius());
        }
        self.objects.lightings.nearest(object)
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
    fn probe(&mut self, object: &LocalObject) -> Option<Result<LightProbe, ProbeError>> {
        if self.keeps_samples() {
            // What is not there yet makes a later probe better.
            return self.probe_of_store(object.centre(), side(object));
        }
        let mut waiting = self.objects.lightings.waiting.iter();
        let at = waiting.position(|probe| probe.is_of(object))?;
        if !self.is_ready(&self.objects.lightings.waiting[at]) {
            return None;
        }
        let WaitingProbe { centre, renderers, .. } = self.objects.lightings.waiting.remove(at);
        let frames = renderers.into_iter().map(|mut renderer| {
            renderer.settle();
            renderer.draw(FramePhase::File, &Interrupt::default(), &mut |_| {})
        });
        let frames: Vec<Frame> = frames.collect::<Option<_>>()?;
        Some(probe_of(centre, frames))
    }

    /// Returns whether the samples of a probe have arrived. While the eye moves, those that are here
    /// have to do.
    fn is_ready(&self, probe: &WaitingProbe) -> bool {
        let view = self.current.as_ref().map(|current| current.first_request);
        let is_of_view = view == Some(probe.view) || self.is_moving();
        self.objects.lightings.is_settled || is_of_view && self.has_stored_beside()
    }

    /// Returns whether the samples of a probe have arrived.
    pub(super) fn has_probe(&self) -> bool {
        self.objects.lightings.waiting.iter().any(|probe| self.is_ready(probe))
    }

    /// Returns whether samples around an object are under way.
    pub(super) fn awaits_light(&self) -> bool {
        let lightings = &self.objects.lightings;
        let is_awaited = |object: &LocalObject| {
            let mut waiting = lightings.waiting.iter();
            match waiting.find(|probe| probe.is_of(object)) {
                Some(probe) => !self.is_ready(probe),
                None => lightings.here(object, false).is_none(),
            }
        };
        let draws_one_view = !self.keeps_samples() && self.current.is_some();
        draws_one_view && self.carried().iter().any(is_awaited)
    }

    /// Requests the samples around objects, for a driver that has no store of all light. A view that
    /// follows cancels the requests of the view before; they are made again once the eye rests.
    ///
    /// # Errors
    /// If the server is lost.
    pub(crate) fn ask_for_lights(&mut self) -> Result<()> {
        if self.objects.is_empty() || self.keeps_samples() {
            return Ok(());
        }
        let Some(view) = self.current.as_ref().map(|current| current.first_request) else {
            return Ok(());
        };
        let (objects, is_moving) = (self.carried(), self.is_moving());
        let lightings = &mut self.objects.lightings;
        lightings.waiting.retain(|probe| objects.iter().any(|object| probe.is_of(object)));
        let mut wanted = Vec::new();
        for object in objects {
            let Some(looks) = looks(object.centre(), side(&object)) else { continue };
            let lightings = &mut self.objects.lightings;
            if let Some(probe) = lightings.waiting.iter_mut().find(|probe| probe.is_of(&object)) {
                if probe.view != view && !is_moving {
                    probe.view = view;
                    wanted.extend(looks);
                }
                continue;
            }
            // The hand that moves an object has the light of the nearest place.
            let is_needed = lightings.here(&object, false).is_none()
                && (self.objects.settles() || self.objects.lightings.nearest(&object).is_none());
            if !is_needed {
                continue;
            }
            let mut renderers = Vec::with_capacity(looks.len());
            for look in &looks {
                let mut renderer = self.driver.light.renderer();
                if renderer.look(look).is_ok() {
                    renderers.push(renderer);
                }
            }
            let (centre, side) = (object.centre(), side(&object));
            self.objects.lightings.waiting.push(WaitingProbe { centre, side, renderers, view });
            wanted.extend(looks);
        }
        if wanted.is_empty() {
            return Ok(());
        }
        self.objects.lightings.is_settled = false;
        self.ask_beside(&wanted)
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
