//! Objects with their light.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::darkening::taken_roughly;
use crate::environment::Environment;
use crate::harmonics::Harmonics;
use crate::lighting::{ObjectLighting, harmonics};
use crate::object::LocalObject;

/// A distance from the object's centre, in radii, beyond which it is too far from what a probe
/// shows to darken it.
const NEAR: f32 = 6.0;

/// An object with its light.
#[derive(Clone)]
pub struct LitObject {
    pub(crate) object: LocalObject,
    pub(crate) lighting: Arc<ObjectLighting>,
    /// What the object's surroundings look like while it is there.
    pub(crate) surroundings: Arc<Surroundings>,
}

/// What a probe shows while an object takes some of its light.
pub(crate) struct Surroundings {
    environment: Environment,
    /// The texels that are in no light.
    pub rest: Harmonics,
}

impl LitObject {
    /// Lights an object. The probe's centre should be near the object's.
    ///
    /// The object's shadow falls on what the probe shows, such as the floor below.
    #[must_use]
    pub fn new(object: LocalObject, lighting: Arc<ObjectLighting>) -> LitObject {
        let probe = &lighting.probe;
        let mut radiance = probe.radiance.clone();
        let centre = (object.centre() - probe.centre()).as_vec3();
        let reach = NEAR * object.radius() as f32;
        radiance.par_iter_mut().enumerate().for_each(|(texel, radiance)| {
            let place = probe.place(texel).filter(|_| !lighting.is_bright[texel]);
            if let Some(place) = place.filter(|place| place.distance(centre) < reach) {
                let normal = probe.normal(texel);
                *radiance *= Vec3::ONE - taken_roughly(&object, &lighting, place, normal);
            }
        });
        let rest = harmonics(probe, &lighting.is_bright, |texel| radiance[texel]);
        let environment = Environment::new(probe.cube, radiance);
        let surroundings = Arc::new(Surroundings { environment, rest });
        LitObject { object, lighting, surroundings }
    }

    /// Returns whether this is the same object at the same place, in the same light.
    #[must_use]
    pub fn is_same(&self, other: &LitObject) -> bool {
        self.is_of(&other.object, &other.lighting)
    }

    /// Returns whether this is the object at its place, in this light.
    #[must_use]
    pub fn is_of(&self, object: &LocalObject, lighting: &Arc<ObjectLighting>) -> bool {
        let is_same_model = Arc::ptr_eq(self.object.model(), object.model());
        is_same_model
            && self.object.pose() == object.pose()
            && Arc::ptr_eq(&self.lighting, lighting)
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
        let seen = self.lighting.probe.direction_seen(point, direction);
        self.surroundings.environment.radiance(seen, blur)
    }

    /// Returns the same without the lights.
    #[inline]
    pub(crate) fn radiance_of_rest(&self, point: Vec3, direction: Vec3) -> Vec3 {
        let probe = &self.lighting.probe;
        let texel = probe.cube.texel(probe.direction_seen(point, direction));
        if self.lighting.is_bright[texel] {
            return Vec3::ZERO;
        }
        self.surroundings.environment.texel(texel)
    }
}
