//! Following light until it ends in the cache.

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, spawn};
use std::f32::consts::FRAC_1_PI;

use super::Cached;
use crate::bsdf::Scatter;
use crate::direct::{self, Left, Vertex};
use crate::geometry::Frame;
use crate::medium::{Crossing, Inside, TOUCH};
use crate::path::{Direct, MAX_DEPTH, PathEngine, ROULETTE_CEILING};
use crate::sampler::{Purpose, Sampler};

/// For whom light is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// A sample that someone looks at.
    Eye,
    /// A record.
    Record,
}

/// How light that is met straight away counts.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Arrived {
    /// Nothing else finds it.
    Alone,
    /// Light samples find it too.
    Weighed(Left),
    /// Light samples have counted it.
    Excluded,
}

/// Where to go on from.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub hit: Option<Hit>,
    pub direction: Vec3,
    pub inside: Inside,
    pub arrived: Arrived,
}

impl Cached {
    pub(super) fn walk(
        &self,
        engine: &PathEngine,
        raycaster: &Raycaster,
        role: Role,
        step: Step,
        first: u32,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let scene = raycaster.scene();
        // Records hold all light but what comes straight: of no use where only some more of it may be counted.
        let limited = engine.bounces != u32::MAX;
        let mut radiance = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        let mut eta2 = 1.0;
        let mut scatterings = u32::from(role != Role::Eye);
        let Step { mut hit, mut direction, mut inside, mut arrived } = step;
        for depth in first..MAX_DEPTH {
            let Some(found) = hit else {
                radiance += throughput * engine.sky * arrived.weight(|left| left.sky_density());
                break;
            };
            let point = raycaster.surface(found.triangle, found.u, found.v);
            let material = scene.material_ids[found.triangle as usize];
            let surface = &engine.surfaces[material as usize];
            let crossing =
                engine.nesting.as_ref().and_then(|n| n.cross(raycaster, &point, material, direction, &inside));
            let (scatter, beyond) = match &crossing {
                None => (&surface.scatter, None),
                Some(Crossing::Boundary { scatter, beyond }) => (scatter, Some(beyond)),
                Some(Crossing::Opaque(touching)) => {
                    hit = Some(Hit { t: found.t, ..*touching });
                    continue;
                }
            };
            let cosine = -direction.dot(point.normal);
            let front = cosine > 0.0;
            if surface.emits && (front || surface.two_sided) {
                let weight =
                    arrived.weight(|left| left.emitter_density(&engine.lights, raycaster, &found, cosine.abs()));
                radiance += throughput * surface.emission * weight;
            }
            let frame = Frame::new(if front { point.normal } else { -point.normal });
            let wo = frame.to_local(-direction);
            if wo.z <= 0.0 {
                break;
            }
            let mut lighting = None;
            if !scatter.is_delta() {
                if matches!(scatter, Scatter::Black) || scatterings > engine.bounces {
                    break;
                }
                scatterings += 1;
                let indirect = if let Scatter::Diffuse(kd) = scatter {
                    let light = if scatterings > engine.bounces {
                        Some(Vec3::ZERO)
                    } else if limited && scatterings > 1 {
                        None
                    } else if role == Role::Eye {
                        Some(self.irradiance(engine, raycaster, &point, frame.n, &inside))
                    } else {
                        self.known(raycaster, &point, frame.n, super::RECORDS_REACH).map(|found| found.irradiance)
                    };
                    light.map(|light| *kd * light * FRAC_1_PI)
                } else {
                    None
                };
                let way = if indirect.is_some() { Direct::Lights } else { Direct::Both };
                if engine.lights.any() {
                    let count = if role == Role::Eye && indirect.is_some() {
                        engine.light_samples.max(super::LIGHT_SAMPLES)
                    } else {
                        1
                    };
                    let seen = direct::seen(&engine.lights, scatter, &point, frame.n);
                    let surfaces = &engine.surfaces;
                    let vertex = Vertex { raycaster, surfaces, scatter, point: &point, frame: &frame, wo, front };
                    sampler.turn(depth, Purpose::Light);
                    radiance += throughput * vertex.lit(&engine.lights, &seen, engine.sky, count, way, sampler);
                    lighting = Some((seen, count));
                }
                if let Some(indirect) = indirect {
                    radiance += throughput * indirect;
                    break;
                }
            }
            sampler.turn(depth, Purpose::Scatter);
            let Some(sampled) = scatter.sample(wo, front, sampler) else { break };
            if let Some(beyond) = beyond.filter(|_| sampled.wi.z < 0.0) {
                inside = *beyond;
            }
            throughput *= sampled.weight;
            eta2 *= sampled.eta2;
            if scatterings >= 3 || depth >= 5 {
                let survival = (throughput.max_element() * eta2).min(ROULETTE_CEILING);
                sampler.turn(depth, Purpose::Roulette);
                if sampler.one() >= survival {
                    break;
                }
                throughput /= survival;
            }
            if throughput == Vec3::ZERO {
                break;
            }
            arrived = match sampled.pdf.zip(lighting) {
                Some((pdf, (seen, count))) => Arrived::Weighed(Left::new(pdf, seen, scatter, sampled.wi, count)),
                None => Arrived::Alone,
            };
            direction = frame.to_world(sampled.wi);
            let error = if crossing.is_some() { point.error * TOUCH } else { point.error };
            let ray = Ray::new(spawn(point.point, error, point.normal, direction), direction);
            hit = raycaster.nearest_from(&ray, found.triangle);
        }
        radiance
    }
}

impl Arrived {
    fn weight(&self, density: impl FnOnce(&Left) -> f32) -> f32 {
        match self {
            Self::Alone => 1.0,
            Self::Weighed(left) => Direct::Both.material_weight(left.pdf, density(left)),
            Self::Excluded => 0.0,
        }
    }
}
