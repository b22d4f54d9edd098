//! Objects with their light.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_reflection_cube::{CubeAnswer, ReflectionCube};
use rayon::prelude::*;

use crate::darkening::taken_roughly;
use crate::harmonics::Harmonics;
use crate::lighting::{ObjectLighting, harmonics};
use crate::object::LocalObject;
use crate::probe::radiance;

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
    cube: ReflectionCube,
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
        let centre = (object.centre() - probe.centre()).as_vec3();
        let reach = NEAR * object.radius() as f32;
        let darkened = |texel: usize| {
            let place = probe.place(texel).filter(|_| !lighting.is_bright[texel])?;
            (place.distance(centre) < reach).then(|| {
                let taken = taken_roughly(&object, &lighting, place, probe.normal(texel));
                (texel, probe.radiance(texel) * (Vec3::ONE - taken))
            })
        };
        let darkened: Vec<_> = (0..probe.cube.len()).into_par_iter().filter_map(darkened).collect();
        let mut cube = probe.cube.clone();
        for (texel, radiance) in darkened {
            cube.set_radiance(texel, radiance.to_array());
        }
        cube.refresh_levels();
        let rest = harmonics(&cube, &lighting.is_bright);
        let surroundings = Arc::new(Surroundings { cube, rest });
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
        match self.surroundings.cube.look_up(point, direction, blur..=blur) {
            CubeAnswer::Light(light) => light.radiance.into(),
            // All texels are valid.
            CubeAnswer::Unknown | CubeAnswer::MustTrace => Vec3::ZERO,
        }
    }

    /// Returns the same without the lights.
    #[inline]
    pub(crate) fn radiance_of_rest(&self, point: Vec3, direction: Vec3) -> Vec3 {
        let texel = self.surroundings.cube.texel_seen(point, direction);
        if self.lighting.is_bright[texel] {
            return Vec3::ZERO;
        }
        radiance(&self.surroundings.cube, texel)
    }
}
