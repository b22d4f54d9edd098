//! Finds the light around local objects, from what the driver has stored.

use std::{sync::Arc, time::Instant};

use anyhow::Result;
use holo_display::{Frame, FramePhase, Interrupt};
use holo_local_objects::{LIGHTS, LightProbe, LocalObject, ObjectLighting, ProbeError, Room};

use super::{
    FoundLight, LitPlace, PASSED_SIDE, UnfinishedProbe, WaitingProbe, looks, probe_of, side,
};
use crate::Session;

impl Session {
    /// Returns the light around an object; `None` if none is known.
    pub(crate) fn lighting(
        &mut self,
        object: &LocalObject,
        is_quick: bool,
        is_file: bool,
        room: Option<&Room>,
    ) -> Option<Arc<ObjectLighting>> {
        if is_quick && self.keeps_samples() && self.objects.lightings.may_pass() {
            self.light_of_passed(object, room);
            self.objects.lightings.passed_at = Some(Instant::now());
        }
        let lightings = &self.objects.lightings;
        let samples = lightings.samples;
        let known = if is_quick { lightings.nearest(object) } else { None };
        let here = || lightings.here(object, is_file)?.lighting.clone();
        if let Some(lighting) = known.or_else(here) {
            return Some(lighting);
        }
        if lightings.here(object, is_file).is_none() {
            let found = match self.keeps_samples() {
                true => self.light_of_store(object, is_quick, is_file, room),
                false => self.probe(object).map(|found| {
                    let lighting = found.ok().map(|probe| ObjectLighting::new(probe, LIGHTS, room));
                    FoundLight { lighting, side: side(object), samples, is_whole: true }
                }),
            };
            if let Some(FoundLight { lighting, side, samples, is_whole }) = found {
                let place = LitPlace {
                    centre: object.centre(),
                    side,
                    lighting: lighting.map(Arc::new),
                    samples,
                    is_old: !is_whole,
                };
                self.objects.lightings.put(place, object.radius());
            }
        }
        self.objects.lightings.nearest(object)
    }

    /// Finds the light of a place that a moving object passes, in the store of a driver. Each call
    /// draws a single face.
    pub(super) fn light_of_passed(&mut self, object: &LocalObject, room: Option<&Room>) {
        let lightings = &mut self.objects.lightings;
        let mut probe = match lightings.passed.take() {
            Some(probe) => probe,
            None if !lightings.passes(object) => return,
            None => {
                let (renderer, samples) = (self.driver.light.renderer(), lightings.samples);
                UnfinishedProbe::new(object.centre(), PASSED_SIDE, renderer, samples)
            }
        };
        let advanced = probe.advance(object, None);
        let lightings = &mut self.objects.lightings;
        match (advanced, probe.middle.take()) {
            (Ok(_), None) => lightings.passed = Some(probe),
            (Ok(_), Some(middle)) => {
                let lighting = Some(Arc::new(ObjectLighting::new(middle, LIGHTS, room)));
                let UnfinishedProbe { centre, side, samples, .. } = probe;
                // An object that rests there has better light.
                let place = LitPlace { centre, side, lighting, samples, is_old: true };
                lightings.put(place, object.radius());
            }
            (Err(_), _) => {}
        }
    }

    /// Finds the light around an object in the store of a driver. `None` if an input has
    /// interrupted it; a later call continues. A quick frame draws a single face. If no light is
    /// known yet, that of the object's middle comes first, by few pixels.
    pub(super) fn light_of_store(
        &mut self,
        object: &LocalObject,
        is_quick: bool,
        is_file: bool,
        room: Option<&Room>,
    ) -> Option<FoundLight> {
        let interrupt = self.interrupt.clone();
        let waits = |faces: usize| match (is_file, is_quick) {
            (true, _) => false,
            (_, true) => faces > 0,
            _ => interrupt.is_set(),
        };
        let lightings = &self.objects.lightings;
        if !is_file && lightings.unfinished.as_ref().is_some_and(|probe| !probe.is_of(object)) {
            // One after the other.
            return None;
        }
        let samples = self.objects.lightings.samples;
        let begun = self.objects.lightings.unfinished.take();
        let is_first = !is_file && self.objects.lightings.nearest(object).is_none();
        let side = if is_first { PASSED_SIDE } else { side(object) };
        let mut probe = match begun.filter(|probe| probe.is_of(object) && !is_file) {
            Some(probe) => probe,
            None => {
                let renderer = self.driver.light.renderer();
                UnfinishedProbe::new(object.centre(), side, renderer, samples)
            }
        };
        let mut faces = 0;
        let is_known = loop {
            if let Some(middle) = probe.middle.take_if(|_| is_first) {
                let lighting = Some(ObjectLighting::new(middle, LIGHTS, room));
                let is_whole = !object.is_shiny();
                return Some(FoundLight { lighting, side, samples, is_whole });
            }
            if waits(faces) {
                self.objects.lightings.unfinished = Some(probe);
                return None;
            }
            match probe.advance(object, room) {
                Ok(false) => faces += 1,
                Ok(true) => break true,
                Err(_) => break false,
            }
        };
        let UnfinishedProbe { middle, sides, samples, .. } = probe;
        let middle = middle.filter(|_| is_known);
        let lighting = middle.map(|middle| ObjectLighting::new(middle, LIGHTS, room));
        let lighting = lighting.map(|lighting| lighting.with_sides(sides));
        Some(FoundLight { lighting, side, samples, is_whole: true })
    }

    /// Returns the light around an object by a driver that draws one view. `None` if its samples
    /// are under way.
    fn probe(&mut self, object: &LocalObject) -> Option<Result<LightProbe, ProbeError>> {
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

    /// Returns whether the samples of a probe have arrived. While the eye moves, those that are
    /// here have to do.
    fn is_ready(&self, probe: &WaitingProbe) -> bool {
        let view = self.current.as_ref().map(|current| current.first_request);
        let is_of_view = view == Some(probe.view) || self.is_moving();
        self.objects.lightings.is_settled || is_of_view && self.has_stored_beside()
    }

    /// Returns whether the samples of a probe have arrived.
    pub(crate) fn has_probe(&self) -> bool {
        self.objects.lightings.waiting.iter().any(|probe| self.is_ready(probe))
    }

    /// Returns whether samples around an object are under way.
    pub(crate) fn awaits_light(&self) -> bool {
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

    /// Requests the samples around objects, for a driver that has no store of all light. A view
    /// that follows cancels the requests of the view before; they are made again once the eye
    /// rests.
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
