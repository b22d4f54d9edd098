//! Sunlight that mirrors and glass throw onto diffuse surfaces, for the engine `cached`.
//!
//! The rays of a record would meet the image of a sun too rarely, and interpolation would blur the
//! edges of its light. So records leave out such sunlight, and each sample estimates it by one ray
//! that is aimed at the caustics' photons.
//!
//! Invariant: a record leaves out exactly the light that [`PathEngine::sun_caustic`] estimates:
//! that of suns over one or more mirrors and glass surfaces. Light straight through panes is found
//! by samples of the suns. Where no photons are near, there is no such light. A scene without suns
//! pays nothing.

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};

use crate::bsdf::Scatter;
use crate::engine::PathEngine;
use crate::geometry::{Frame, cosine_hemisphere, cosine_pdf};
use crate::medium::{Crossing, Inside, TOUCH};
use crate::policy::ShadingPoint;
use crate::sampler::{Purpose, Sampler};
use crate::shading::{self, Look};

/// Share of the rays that are aimed.
const AIMED: f32 = 0.9;
/// Most mirrors and glass surfaces of a ray.
const DEPTH: u32 = 32;

impl PathEngine {
    /// Returns an estimate of the irradiance at a diffuse surface by sunlight that comes over
    /// mirrors and glass.
    pub(crate) fn sun_caustic(&self, at: &ShadingPoint, sampler: &mut Sampler) -> Vec3 {
        let ShadingPoint { raycaster, point, lit, inside, .. } = *at;
        let Some(caustics) = self.caustics.as_ref().filter(|_| self.suns.any()) else {
            return Vec3::ZERO;
        };
        let Some(vertex) = caustics.seen_from(point.point, lit) else { return Vec3::ZERO };
        sampler.turn(at.depth, Purpose::Caustic);
        let (first, second) = sampler.pairs(1).at(0);
        let aimed = f64::from(AIMED);
        let direction = if first < aimed {
            vertex.choose(first / aimed, second)
        } else {
            let first = ((first - aimed) / (1.0 - aimed)) as f32;
            Some(Frame::new(lit).to_world(cosine_hemisphere([first, second])))
        };
        let Some(direction) = direction else { return Vec3::ZERO };
        let cosine = direction.dot(lit);
        if cosine <= 0.0 || !shading::is_above(point.normal, lit, direction) {
            return Vec3::ZERO;
        }
        let ray = Ray::new(spawn(point.point, point.error, point.normal, direction), direction);
        let Some(hit) = raycaster.nearest_from(&ray, point.triangle) else { return Vec3::ZERO };
        let light = self.sun_over_mirrors(raycaster, (hit, direction), inside, sampler, at.depth);
        let density = AIMED * vertex.density(direction, &hit) + (1.0 - AIMED) * cosine_pdf(cosine);
        let irradiance = light * cosine / density;
        if irradiance.is_finite() { irradiance } else { Vec3::ZERO }
    }

    /// Returns an estimate of sunlight along a ray that hits a mirror or glass.
    fn sun_over_mirrors(
        &self,
        raycaster: &Raycaster,
        (mut hit, mut direction): (Hit, Vec3),
        inside: &Inside,
        sampler: &mut Sampler,
        depth: u32,
    ) -> Vec3 {
        let (mut throughput, mut inside, mut is_straight) = (Vec3::ONE, *inside, true);
        for number in 1..=DEPTH {
            let point = raycaster.surface(hit.triangle, hit.u, hit.v);
            let material = raycaster.scene().material_id(hit.triangle);
            let surface = &self.surfaces[material as usize];
            let nesting = self.nesting.as_ref();
            let crossing =
                nesting.and_then(|n| n.cross(raycaster, &point, material, direction, &inside));
            let textured;
            let (scatter, beyond) = match &crossing {
                Some(Crossing::Boundary { scatter, beyond }) => (scatter, Some(*beyond)),
                Some(Crossing::Opaque(_)) => return Vec3::ZERO,
                None if self.is_shaded => {
                    textured = self.textured(raycaster, &hit, surface, 0.0);
                    (textured.as_ref().unwrap_or(&surface.scatter), None)
                }
                None => (&surface.scatter, None),
            };
            if !scatter.is_delta() {
                return Vec3::ZERO;
            }
            let front = direction.dot(point.normal) < 0.0;
            let facing = if front { point.normal } else { -point.normal };
            let look = Look { towards_eye: -direction, width: 0.0 };
            let normal = match self.is_shaded {
                true => shading::normals(raycaster, &hit, scatter, facing, &look).1,
                false => facing,
            };
            let frame = Frame::new(normal);
            let wo = frame.to_local(-direction);
            sampler.turn(depth + number, Purpose::Caustic);
            let Some(sampled) = (wo.z > 0.0).then(|| scatter.sample(wo, front, sampler)).flatten()
            else {
                return Vec3::ZERO;
            };
            let next = frame.to_world(sampled.wi);
            let passed = shading::terminator(&frame, point.normal, next, sampled.wi.z, false);
            throughput *= sampled.weight * passed;
            if throughput == Vec3::ZERO {
                return Vec3::ZERO;
            }
            is_straight &= matches!(scatter, Scatter::Pane { .. }) && sampled.wi.z < 0.0;
            if let Some(beyond) = beyond.filter(|_| sampled.wi.z < 0.0) {
                inside = beyond;
            }
            direction = next;
            let error = if crossing.is_some() { point.error * TOUCH } else { point.error };
            let SurfacePoint { point: from, normal: geometric, triangle, .. } = point;
            let ray = Ray::new(spawn(from, error, geometric, direction), direction);
            match raycaster.nearest_from(&ray, triangle) {
                Some(next) => hit = next,
                None if is_straight => return Vec3::ZERO,
                None => return throughput * self.suns.along(direction, |_| 1.0),
            }
        }
        Vec3::ZERO
    }
}
