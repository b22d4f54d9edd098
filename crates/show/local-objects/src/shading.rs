//! What a ray sees of the objects.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{DVec3, Vec3};
use holo_optics::{FACETS, dielectric, facets, pane, reflect, refract};

use crate::lights::{LightPoint, ProbeLight};
use crate::lit::LitObject;
use crate::numbers::{PassNumbers, cosine_direction};
use crate::object::ObjectHit;
use crate::room::{Room, TOTAL};
use crate::sheen::GlossRay;
use crate::surface::{Finish, Gloss, MIRROR, ObjectSurface};

/// Most surfaces that a ray follows through glass and mirrors.
const MOST_SURFACES: usize = 12;

/// Rays by which a pass estimates the rest of the light at a point.
const REST_RAYS: usize = 2;

/// Least share of light for which a ray is followed on.
const LEAST_WEIGHT: f32 = 0.004;

/// Widest angle, radians, over which light that is looked up comes from about one place of the
/// room.
const SHARP: f32 = 0.05;

/// How exactly light is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LightDetail {
    /// Without noise: lights are points, and the rest is smooth and hidden by nothing.
    Quick,
    /// Each pass is an estimate.
    Exact,
}

/// What a ray sees of the objects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeenObject {
    /// Distance of the first surface.
    pub distance: f64,
    /// Radiance towards the eye.
    pub radiance: Vec3,
    /// Share of the light behind that passes straight.
    pub through: Vec3,
    /// The number of the object that is met first.
    pub object: usize,
}

/// The objects, and the room around them.
#[derive(Clone, Copy)]
pub(crate) struct Shader<'a> {
    pub objects: &'a [LitObject],
    pub room: Option<&'a Room>,
    pub detail: LightDetail,
}

/// A ray that may leave an object's surface.
#[derive(Clone, Copy)]
struct ObjectRay {
    origin: DVec3,
    direction: Vec3,
    /// The number of the object, and its surface.
    from: Option<(usize, ObjectSurface)>,
}

impl Shader<'_> {
    /// Returns what a ray sees; `None` if it meets no object. Its width is `width` for each unit of
    /// distance, plus `base`.
    pub(crate) fn seen(
        &self,
        origin: DVec3,
        direction: DVec3,
        (base, width): (f32, f32),
        numbers: &mut PassNumbers,
    ) -> Option<SeenObject> {
        let mut ray = ObjectRay { origin, direction: direction.as_vec3(), from: None };
        let (mut radiance, mut weight) = (Vec3::ZERO, Vec3::ONE);
        let mut first: Option<(f64, usize)> = None;
        // A ray is straight while it has its first direction. `last` is the object that it met last.
        let (mut is_straight, mut last) = (true, None);
        for _ in 0..MOST_SURFACES {
            let Some((number, hit)) = self.nearest(&ray) else {
                let (distance, object) = first?;
                if is_straight {
                    return Some(SeenObject { distance, radiance, through: weight, object });
                }
                let lit: &LitObject = &self.objects[last.unwrap_or(0)];
                radiance += weight * self.around(lit, ray.origin, ray.direction, 0.0);
                return Some(SeenObject { distance, radiance, through: Vec3::ZERO, object });
            };
            let lit = &self.objects[number];
            let (distance, object) = *first.get_or_insert((hit.distance, number));
            last = Some(number);
            let width = base + width * hit.distance as f32;
            let surface = lit.object.surface(ray.origin, ray.direction, &hit, width);
            let eye = -ray.direction;
            let finish = surface.finish(lit.object.raycaster().scene(), eye);
            radiance += weight * finish.emission;
            let cosine = surface.normal.dot(eye).clamp(0.0, 1.0);
            let next = match finish.gloss {
                Gloss::Pane { ior, colour } => {
                    let share = pane(cosine, ior);
                    let mirrored = reflect(eye, surface.normal);
                    radiance += weight * share * self.reflected(number, &surface, mirrored, 0.0);
                    weight *= colour * (1.0 - share);
                    ray.direction
                }
                Gloss::Solid { ior, colour } => {
                    is_straight = false;
                    let enters = surface.front.dot(eye) >= 0.0;
                    let eta = if enters { ior } else { 1.0 / ior };
                    let (share, beyond) = dielectric(cosine, eta);
                    let mirrored = reflect(eye, surface.normal);
                    if share > TOTAL {
                        mirrored
                    } else {
                        if enters {
                            let seen = self.reflected(number, &surface, mirrored, 0.0);
                            radiance += weight * share * seen;
                        }
                        weight *= colour * (1.0 - share);
                        refract(eye, surface.normal, beyond, eta)
                    }
                }
                Gloss::Metal { ks, alpha } if alpha < MIRROR => {
                    is_straight = false;
                    weight *= ks;
                    reflect(eye, surface.normal)
                }
                _ => {
                    let from = (number, &surface);
                    radiance += weight * self.scattered(from, &finish, eye, numbers);
                    return Some(SeenObject { distance, radiance, through: Vec3::ZERO, object });
                }
            };
            if weight.max_element() < LEAST_WEIGHT {
                break;
            }
            let from = Some((number, surface));
            ray = ObjectRay { origin: surface.place, direction: next, from };
        }
        first.map(|(distance, object)| SeenObject {
            distance,
            radiance,
            through: Vec3::ZERO,
            object,
        })
    }

    /// Returns the object that a ray meets first, and where.
    fn nearest(&self, ray: &ObjectRay) -> Option<(usize, ObjectHit)> {
        let of = |(number, lit): (usize, &LitObject)| {
            let hit = match &ray.from {
                Some((own, surface)) if *own == number => {
                    lit.object.nearest_from(surface, ray.direction)
                }
                _ => lit.object.nearest(ray.origin, ray.direction.as_dvec3()),
            };
            hit.map(|hit| (number, hit))
        };
        let hits = self.objects.iter().enumerate().filter_map(of);
        hits.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))
    }

    /// Returns whether an object lies between a surface of one and a point at this distance.
    fn is_hidden(&self, (own, from): (usize, &ObjectSurface), towards: Vec3, far: f64) -> bool {
        self.objects.iter().enumerate().any(|(number, lit)| {
            if number == own {
                lit.object.hides_from(from, towards, far)
            } else {
                lit.object.hides(from.place, towards.as_dvec3(), far)
            }
        })
    }

    /// Returns the radiance of an object's surroundings along a ray that leaves it. Quick frames
    /// look it up by the probe's distances, exact ones by what the ray meets in the room.
    fn around(&self, lit: &LitObject, origin: DVec3, direction: Vec3, blur: f32) -> Vec3 {
        let is_exact = self.detail == LightDetail::Exact;
        match self.room.filter(|_| is_exact && blur <= SHARP) {
            Some(room) => lit.radiance_in_room(room, origin, direction, blur),
            None => lit.radiance(lit.relative(origin), direction, blur),
        }
    }

    /// Returns the radiance that a surface reflects from a direction: of the surroundings, or
    /// roughly of the objects.
    fn reflected(&self, own: usize, from: &ObjectSurface, towards: Vec3, blur: f32) -> Vec3 {
        let lit = &self.objects[own];
        let ray = ObjectRay { origin: from.place, direction: towards, from: Some((own, *from)) };
        match self.nearest(&ray) {
            Some((number, hit)) => self.rough_light(number, &ray, &hit),
            None => self.around(lit, from.place, towards, blur),
        }
    }

    /// Returns about the radiance of an object that another surface shows.
    fn rough_light(&self, number: usize, ray: &ObjectRay, hit: &ObjectHit) -> Vec3 {
        let lit = &self.objects[number];
        let surface = lit.object.surface(ray.origin, ray.direction, hit, 0.0);
        let finish = surface.finish(lit.object.raycaster().scene(), -ray.direction);
        let colour = match finish.gloss {
            Gloss::Matt | Gloss::Coat { .. } => finish.diffuse,
            Gloss::Metal { ks, .. } => ks,
            Gloss::Pane { colour, .. } | Gloss::Solid { colour, .. } => colour,
        };
        let from = (number, &surface);
        let lights = lit.lights().iter();
        let lights: Vec3 = lights.map(|light| self.direct(from, light, &light.middle)).sum();
        let rest = lit.surroundings.rest.irradiance(surface.normal);
        finish.emission + colour * (lights + rest) * FRAC_1_PI
    }

    /// Returns the irradiance of a surface by one point of a light.
    fn direct(
        &self,
        (own, from): (usize, &ObjectSurface),
        light: &ProbeLight,
        point: &LightPoint,
    ) -> Vec3 {
        let arriving = point.arriving(self.objects[own].relative(from.place));
        let cosine = from.normal.dot(arriving.direction);
        if cosine <= 0.0 || self.is_hidden((own, from), arriving.direction, arriving.distance) {
            return Vec3::ZERO;
        }
        // The probe sees its own lights, so only exact frames ask whether a point does too.
        let asks = light.is_unseen || self.detail == LightDetail::Exact;
        if let Some(room) = self.room.filter(|_| asks)
            && room.hides(from.place, arriving.direction, arriving.distance)
        {
            return Vec3::ZERO;
        }
        arriving.irradiance * cosine
    }

    /// Returns the irradiance of a surface by the light that is in no light.
    fn rest(&self, (own, from): (usize, &ObjectSurface), numbers: &mut PassNumbers) -> Vec3 {
        let lit = &self.objects[own];
        let smooth = &lit.surroundings.rest;
        if self.detail == LightDetail::Quick {
            return smooth.irradiance(from.normal);
        }
        let point = lit.relative(from.place);
        let mut sum = Vec3::ZERO;
        for _ in 0..REST_RAYS {
            let towards = cosine_direction(from.normal, numbers.two());
            let ray =
                ObjectRay { origin: from.place, direction: towards, from: Some((own, *from)) };
            let seen = match self.nearest(&ray) {
                Some((number, hit)) => self.rough_light(number, &ray, &hit),
                None => match self.room {
                    Some(room) => {
                        let direction = towards.as_dvec3();
                        let hit = room.nearest(from.place, direction);
                        let place = hit.map(|(_, distance)| from.place + direction * distance);
                        lit.radiance_of_place(point, towards, place)
                    }
                    None => lit.radiance_of_rest(point, towards),
                },
            };
            // The smooth light has a known irradiance, so only the difference has noise.
            sum += seen - smooth.radiance(towards);
        }
        let rest = smooth.irradiance_unbounded(from.normal);
        rest + sum * (PI / REST_RAYS as f32)
    }

    /// Returns the radiance that a surface scatters towards the eye.
    fn scattered(
        &self,
        (own, surface): (usize, &ObjectSurface),
        finish: &Finish,
        eye: Vec3,
        numbers: &mut PassNumbers,
    ) -> Vec3 {
        let from = (own, surface);
        let mut radiance = Vec3::ZERO;
        let cosine = surface.normal.dot(eye).clamp(0.0, 1.0);
        let mut diffuse = finish.diffuse;
        match finish.gloss {
            Gloss::Coat { ks, ior, alpha } => {
                let (share, _) = dielectric(cosine, ior);
                diffuse *= Vec3::ONE - ks * share;
                radiance += ks * self.glossy(from, eye, alpha, Some(ior), numbers);
            }
            Gloss::Metal { ks, alpha } => {
                radiance += ks * self.glossy(from, eye, alpha, None, numbers);
            }
            Gloss::Matt | Gloss::Pane { .. } | Gloss::Solid { .. } => {}
        }
        if diffuse == Vec3::ZERO {
            return radiance;
        }
        let lights = self.objects[own].lights();
        let mut irradiance = self.rest(from, numbers);
        for light in lights {
            let point = match self.detail {
                LightDetail::Quick => light.middle,
                LightDetail::Exact => light.sample(numbers.one()),
            };
            irradiance += self.direct(from, light, &point);
        }
        radiance + diffuse * irradiance * FRAC_1_PI
    }

    /// Returns the radiance that a rough mirror reflects towards the eye, by Fresnel's law for an
    /// index of refraction, or all of it.
    fn glossy(
        &self,
        (own, surface): (usize, &ObjectSurface),
        eye: Vec3,
        alpha: f32,
        ior: Option<f32>,
        numbers: &mut PassNumbers,
    ) -> Vec3 {
        let normal = surface.normal;
        let share = |cosine: f32| ior.map_or(1.0, |ior| dielectric(cosine, ior).0);
        if alpha < MIRROR {
            let mirrored = reflect(eye, normal);
            let cosine = normal.dot(eye).clamp(0.0, 1.0);
            return share(cosine) * self.reflected(own, surface, mirrored, 0.0);
        }
        if self.detail == LightDetail::Quick {
            let light = facets(normal, eye, alpha).map(|facet| {
                let seen = self.reflected(own, surface, facet.towards, facet.width);
                facet.share * share(facet.cosine.clamp(0.0, 1.0)) * seen
            });
            return light.sum::<Vec3>() / FACETS as f32;
        }
        let Some(ray) = GlossRay::sampled(normal, eye, alpha, numbers.two()) else {
            return Vec3::ZERO;
        };
        // The blur of a texel replaces the noise of very small lights.
        let blur = 0.25 * alpha;
        share(ray.cosine) * ray.masked * self.reflected(own, surface, ray.towards, blur)
    }
}
