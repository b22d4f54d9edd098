//! The share of light that an object takes from the surfaces around it.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{DVec3, Vec3};

use crate::darkening::{hidden_part, portion};
use crate::lights::{LightPoint, ProbeLight};
use crate::lit::LitObject;
use crate::numbers::{PassNumbers, cosine_direction, in_cone};
use crate::room::{Room, RoomSurface};
use crate::shading::LightDetail;

/// A distance from an object's centre, in radii, beyond which it takes too little of the light from
/// all sides to be seen: at most 1/64 of a facing surface's.
const NEAR: f64 = 8.0;

/// The same for frames that are drawn at once: a few percent.
const NEAR_QUICK: f64 = 2.5;

/// Greatest share that a pass may estimate: few do, and noise of more would be seen.
const MOST_SHARE: f32 = 4.0;

/// Least reflectance for which a surface's light follows from its radiance.
const LEAST_REFLECTANCE: f32 = 0.01;

/// A surface that may lie in an object's shadow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shadowed<'a> {
    /// In the scene.
    pub place: DVec3,
    /// Unit normal on the side that is seen.
    pub normal: Vec3,
    /// The surface of the room and its radiance, if the room's model is known.
    pub known: Option<(&'a Room, &'a RoomSurface, Vec3)>,
}

/// Returns whether an object may take light from within `margin` of a place.
pub(crate) fn may_shadow(lit: &LitObject, place: DVec3, margin: f64, detail: LightDetail) -> bool {
    let (centre, radius) = (lit.object.centre(), lit.object.radius() + margin);
    let near = if detail == LightDetail::Quick { NEAR_QUICK } else { NEAR };
    if place.distance_squared(centre) < (near * radius).powi(2) {
        return true;
    }
    let (point, centre) = (lit.relative(place), lit.relative(centre));
    lit.lighting.lights.iter().any(|light| passes(light, point, centre, radius as f32))
}

/// Returns whether light on its way to a point may pass a sphere.
fn passes(light: &ProbeLight, point: Vec3, centre: Vec3, radius: f32) -> bool {
    let to_centre = centre - point;
    let (along, way, reach) = match light.middle.place {
        Some(place) => {
            let way = place - point;
            let square = way.length_squared().max(f32::MIN_POSITIVE);
            let share = (to_centre.dot(way) / square).clamp(0.0, 1.0);
            (share, way * share, radius + share * light.spread)
        }
        None => {
            let along = to_centre.dot(light.middle.direction).max(0.0);
            let way = light.middle.direction * along;
            (along, way, radius + along * light.spread)
        }
    };
    along > 0.0 && to_centre.distance_squared(way) < reach * reach
}

impl Shadowed<'_> {
    /// Returns the share of light that an object takes from the surface, by channel. It may be an
    /// estimate, whose mean over all passes is the share: below 0 where the object sends more light
    /// than it hides.
    pub(crate) fn share(
        &self,
        lit: &LitObject,
        detail: LightDetail,
        numbers: &mut PassNumbers,
    ) -> Vec3 {
        let (hidden, all) = self.hidden_and_all(lit, detail, numbers);
        let most =
            if detail == LightDetail::Exact && self.known.is_some() { MOST_SHARE } else { 1.0 };
        let least = if detail == LightDetail::Exact { -MOST_SHARE } else { 0.0 };
        portion(hidden, all).clamp(Vec3::splat(least), Vec3::splat(most))
    }

    /// Returns the irradiance that an object takes from the surface, and all that the surface has
    /// without the object. Both may be estimates.
    pub(crate) fn hidden_and_all(
        &self,
        lit: &LitObject,
        detail: LightDetail,
        numbers: &mut PassNumbers,
    ) -> (Vec3, Vec3) {
        let point = lit.relative(self.place);
        let (centre, radius) = (lit.relative(lit.object.centre()), lit.object.radius() as f32);
        let mut hidden = match detail {
            LightDetail::Quick => {
                let rest = lit.lighting.rest.irradiance(self.normal);
                rest * hidden_part(&lit.object, centre - point, self.normal)
            }
            LightDetail::Exact => self.hidden_rest(lit, numbers) + self.dimmed(lit, numbers),
        };
        let mut all = lit.lighting.rest.irradiance(self.normal);
        for light in &lit.lighting.lights {
            if self.known.is_some() && !passes(light, point, centre, radius) {
                continue;
            }
            let of = match detail {
                LightDetail::Quick => light.middle,
                LightDetail::Exact => light.sample(numbers.one()),
            };
            let (irradiance, is_hidden) = self.direct(lit, light, &of);
            all += irradiance;
            if is_hidden {
                hidden += irradiance;
            }
        }
        if let Some((_, surface, radiance)) = self.known {
            // What the surface shows says how much light it has.
            let reflectance = surface.reflectance.max(Vec3::splat(LEAST_REFLECTANCE));
            all = PI * radiance / reflectance;
        }
        (hidden, all)
    }

    /// Returns the irradiance by one point of a light, and whether the object hides it.
    fn direct(&self, lit: &LitObject, light: &ProbeLight, of: &LightPoint) -> (Vec3, bool) {
        let arriving = of.arriving(lit.relative(self.place));
        let cosine = self.normal.dot(arriving.direction);
        if cosine <= 0.0 {
            return (Vec3::ZERO, false);
        }
        let irradiance = arriving.irradiance * cosine;
        let towards = arriving.direction.as_dvec3();
        if !lit.object.hides(self.place, towards, arriving.distance) {
            // Only whoever does not know the room sums all light up, and takes it for free.
            return (irradiance, false);
        }
        match self.known {
            Some((room, surface, _))
                if room.hides_from(surface, arriving.direction, arriving.distance) =>
            {
                (Vec3::ZERO, false)
            }
            _ => (irradiance, !light.is_unseen || self.known.is_some()),
        }
    }

    /// Estimates the irradiance that comes from the object instead of what it hides, with the
    /// opposite sign, without the lights.
    fn hidden_rest(&self, lit: &LitObject, numbers: &mut PassNumbers) -> Vec3 {
        let to_centre = lit.object.centre() - self.place;
        let (distance, radius) = (to_centre.length(), lit.object.radius());
        let pair = numbers.two();
        if distance > NEAR * radius {
            return Vec3::ZERO;
        }
        let (towards, weight) = if distance > 1.05 * radius {
            let sine = (radius / distance) as f32;
            let least = (1.0 - sine * sine).max(0.0).sqrt();
            let axis = (to_centre / distance).as_vec3();
            let towards = in_cone(axis, least, pair);
            (towards, 2.0 * PI * (1.0 - least) * self.normal.dot(towards))
        } else {
            (cosine_direction(self.normal, pair), PI)
        };
        if weight <= 0.0 {
            return Vec3::ZERO;
        }
        let Some(hit) = lit.object.nearest(self.place, towards.as_dvec3()) else {
            return Vec3::ZERO;
        };
        let surface = lit.object.surface(self.place, towards, &hit, 0.0);
        let finish = surface.finish(lit.object.raycaster().scene(), -towards);
        let point = lit.relative(surface.place);
        let mut light = lit.surroundings.rest.irradiance(surface.normal);
        for arriving in lit.lights().iter().map(|light| light.middle.arriving(point)) {
            let cosine = surface.normal.dot(arriving.direction);
            if cosine > 0.0
                && !lit.object.hides_from(&surface, arriving.direction, arriving.distance)
            {
                light += arriving.irradiance * cosine;
            }
        }
        let instead = finish.diffuse * light * FRAC_1_PI;
        let cube = &lit.lighting.probe.cube;
        let seen = cube.direction_seen(lit.relative(self.place), towards);
        (lit.lighting.dim_radiance(cube.grid().texel_of(seen)) - instead) * weight
    }

    /// Estimates the irradiance that surfaces around the object send less because of its shadow on
    /// them.
    fn dimmed(&self, lit: &LitObject, numbers: &mut PassNumbers) -> Vec3 {
        let towards = cosine_direction(self.normal, numbers.two());
        let probe = &lit.lighting.probe;
        let seen = probe.cube.direction_seen(lit.relative(self.place), towards);
        let taken = Vec3::ONE - lit.surroundings.darkening.left(seen);
        if taken == Vec3::ZERO || lit.object.nearest(self.place, towards.as_dvec3()).is_some() {
            return Vec3::ZERO;
        }
        probe.radiance(probe.cube.grid().texel_of(seen)) * taken * PI
    }
}
