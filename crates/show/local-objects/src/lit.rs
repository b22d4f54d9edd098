//! Objects with their light.

use std::sync::Arc;

use crate::darkening::Darkening;
use crate::harmonics::Harmonics;
use crate::lighting::ObjectLighting;
use crate::lights::ProbeLight;
use crate::object::LocalObject;
use crate::probe::LightProbe;
use crate::room::Room;
use glam::{DVec3, Vec3};

/// Relative difference of distances within which a probe shows the surface that a ray meets.
const SAME_SURFACE: f32 = 0.02;

/// An object with its light.
#[derive(Clone)]
pub struct LitObject {
    pub(crate) object: LocalObject,
    pub(crate) lighting: Arc<ObjectLighting>,
    pub(crate) surroundings: Arc<Surroundings>,
}

/// What the object's surroundings look like while it is there.
pub(crate) struct Surroundings {
    pub darkening: Darkening,
    /// The light that is in no light.
    pub rest: Harmonics,
    /// The lights at rest, where the object's shadow may fall on those that do not emit, and the
    /// passes by which it was found.
    lights: Option<(Vec<ProbeLight>, u32)>,
}

impl LitObject {
    /// Lights an object. The probe's centre should be near the object's.
    ///
    /// The object's shadow falls on what the probe shows, such as the floor below, as far as a
    /// person sees while the object moves.
    #[must_use]
    pub fn new(object: LocalObject, lighting: Arc<ObjectLighting>) -> LitObject {
        let darkening = Darkening::roughly(&object, &lighting);
        LitObject::with(object, lighting, darkening, None)
    }

    /// Returns an object with its light. `lights` are those at rest, and the passes by which they
    /// were found.
    pub(crate) fn with(
        object: LocalObject,
        lighting: Arc<ObjectLighting>,
        darkening: Darkening,
        lights: Option<(Vec<ProbeLight>, u32)>,
    ) -> LitObject {
        let rest = darkening.rest(&lighting);
        let surroundings = Arc::new(Surroundings { darkening, rest, lights });
        LitObject { object, lighting, surroundings }
    }

    /// Returns whether this is the same object at the same place, in the same light.
    #[must_use]
    pub fn is_same(&self, other: &LitObject) -> bool {
        self.is_of(&other.object, &other.lighting) && self.passes() == other.passes()
    }

    /// Returns whether this is the object at its place, in this light.
    #[must_use]
    pub fn is_of(&self, object: &LocalObject, lighting: &Arc<ObjectLighting>) -> bool {
        let is_same_model = Arc::ptr_eq(self.object.model(), object.model());
        is_same_model
            && self.object.pose() == object.pose()
            && Arc::ptr_eq(&self.lighting, lighting)
    }

    /// Returns by how many passes [`at_rest`](Self::at_rest) has found its light; 0 if it moves.
    #[must_use]
    pub fn passes(&self) -> u32 {
        self.surroundings.lights.as_ref().map_or(0, |(_, passes)| *passes)
    }

    /// Returns the lights that the object has.
    #[inline]
    pub(crate) fn lights(&self) -> &[ProbeLight] {
        self.surroundings.lights.as_ref().map_or(&self.lighting.lights, |(lights, _)| lights)
    }

    /// Returns a place relative to the probe's centre.
    #[inline]
    pub(crate) fn relative(&self, place: DVec3) -> Vec3 {
        (place - self.lighting.probe.centre()).as_vec3()
    }

    /// Returns the radiance that arrives at a place from a direction, blurred over an angle in
    /// radians. `point` is relative to the probe's centre.
    #[inline]
    pub(crate) fn radiance(&self, point: Vec3, direction: Vec3, blur: f32) -> Vec3 {
        let probe = &self.lighting.probe;
        let seen = probe.cube.direction_seen(point, direction);
        probe.blurred(seen, blur) * self.surroundings.darkening.left(seen)
    }

    /// Returns about the radiance that arrives at a place without the object.
    pub(crate) fn light_without(&self, place: DVec3, direction: Vec3, blur: f32) -> Vec3 {
        let probe = &self.lighting.probe;
        let seen = probe.cube.direction_seen(self.relative(place), direction);
        probe.blurred(seen, blur)
    }

    /// Returns the radiance at a place by what the ray meets in the room, from the first probe that
    /// sees that.
    pub(crate) fn radiance_in_room(
        &self,
        room: &Room,
        origin: DVec3,
        direction: Vec3,
        blur: f32,
    ) -> Vec3 {
        let hit = room.nearest(origin, direction.as_dvec3());
        let distance = hit.map_or(f64::INFINITY, |(_, distance)| distance);
        let place = origin + direction.as_dvec3() * distance;
        let seen = |probe: &LightProbe| {
            let way = (place - probe.centre()).as_vec3();
            let towards = if distance.is_finite() { way.normalize_or_zero() } else { direction };
            let far = if distance.is_finite() { f64::from(way.length()) } else { distance };
            (!room.hides(probe.centre(), towards, far)).then_some(towards)
        };
        let probe = &self.lighting.probe;
        if hit.is_none_or(|(hit, _)| !room.is_mirror(&hit)) {
            if let Some(towards) = seen(probe) {
                return probe.blurred(towards, blur) * self.surroundings.darkening.left(towards);
            }
            for side in &self.lighting.sides {
                if let Some(towards) = seen(side) {
                    return side.blurred(towards, blur);
                }
            }
        }
        self.radiance(self.relative(origin), direction, blur)
    }

    /// Returns the same without the lights, not blurred.
    #[inline]
    pub(crate) fn radiance_of_rest(&self, point: Vec3, direction: Vec3) -> Vec3 {
        self.rest_seen(self.lighting.probe.cube.direction_seen(point, direction))
    }

    /// Returns the radiance without the lights that comes from the first surface of the room along
    /// a ray. `place` is that of the surface; `None` if the ray meets none.
    pub(crate) fn radiance_of_place(
        &self,
        point: Vec3,
        direction: Vec3,
        place: Option<DVec3>,
    ) -> Vec3 {
        let probe = &self.lighting.probe;
        let seen = place.map_or(direction, |place| self.relative(place));
        let texel = probe.cube.grid().texel_of(seen);
        let shown = probe.place(texel).map(Vec3::length);
        let is_shown = match place {
            Some(_) => shown.is_some_and(|far| (far - seen.length()).abs() < SAME_SURFACE * far),
            None => shown.is_none(),
        };
        match is_shown {
            true => self.rest_seen(seen),
            // Something hides it from the probe: what is seen nearby stands for it.
            false => self.radiance_of_rest(point, direction),
        }
    }

    /// Returns the radiance without the lights of what the probe shows in a direction.
    fn rest_seen(&self, direction: Vec3) -> Vec3 {
        let texel = self.lighting.probe.cube.grid().texel_of(direction);
        self.lighting.dim_radiance(texel) * self.surroundings.darkening.left(direction)
    }
}
