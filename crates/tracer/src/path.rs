//! The path engine: unbiased paths from the eye, with direct light by sampling both lights and materials.
//!
//! Always true:
//! - The mean over seeds is the solution of the rendering equation for the settings' `bounces`, up to f32 rounding.
//! - Light is combined by the power heuristic (Veach 1997, §9.2.4) where both ways can find it, and counted in full where
//!   only the material can: after mirrors and smooth glass, and at the first surface.
//! - Shadow rays are blocked by glass: light through it is found by the material alone.
//! - From the sixth scattering on, paths end by roulette with their throughput, at least with probability 0.05 each, so
//!   chains of perfect mirrors end too. The hard limit of [`MAX_DEPTH`] is beyond 0.95^1000, about 5e-23 of the paths.

use glam::{DVec3, Vec3};
use holo_raycast::{Hit, NO_TRIANGLE, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::{Bsdf, Scene};

use crate::bsdf::{Scatter, Tables};
use crate::geometry::{Frame, cosine_hemisphere, cosine_pdf};
use crate::lights::Lights;
use crate::medium::{Crossing, Inside, Nesting, TOUCH};
use crate::sampler::Sampler;

/// Scatterings before roulette begins.
const ROULETTE_DEPTH: u32 = 5;
/// Chance of going on that roulette never exceeds.
const ROULETTE_CEILING: f32 = 0.95;
/// Scatterings of a path at most.
const MAX_DEPTH: u32 = 1024;

/// How direct light is found. Both are unbiased alone where no material is a delta; tests compare them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direct {
    Both,
    #[cfg_attr(not(test), allow(dead_code, reason = "only for comparison"))]
    Lights,
    #[cfg_attr(not(test), allow(dead_code, reason = "only for comparison"))]
    Materials,
}

/// What the engine needs of a material.
#[derive(Clone, Debug)]
struct Surface {
    scatter: Scatter,
    emission: Vec3,
    emits: bool,
    two_sided: bool,
}

/// The path engine of one scene.
#[derive(Debug)]
pub(crate) struct PathEngine {
    surfaces: Vec<Surface>,
    lights: Lights,
    nesting: Option<Nesting>,
    sky: Vec3,
    bounces: u32,
    direct: Direct,
}

/// A first hit, shared by all paths of a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    pub hit: Option<Hit>,
    pub direction: Vec3,
    /// What the eye is inside of.
    pub inside: Inside,
}

/// The scattering that a ray left from, for weighing the light that it finds.
#[derive(Clone, Copy)]
struct Left {
    /// `None` if light sampling could not have found the same light.
    pdf: Option<f32>,
    /// Density with which the sky's own sampling would have made the direction.
    sky_pdf: f32,
}

impl PathEngine {
    pub(crate) fn new(scene: &Scene, bounces: Option<u32>, direct: Direct) -> Self {
        let mut used = vec![false; scene.materials.len()];
        scene.material_ids.iter().for_each(|&m| used[m as usize] = true);
        let mut tables = Tables::default();
        let surfaces = scene
            .materials
            .iter()
            .zip(used)
            .map(|(m, used)| Surface {
                scatter: match m.bsdf {
                    // Solids scatter by what is on both sides: `nesting`.
                    Bsdf::Dielectric { .. } => Scatter::Black,
                    _ if !used => Scatter::Black,
                    bsdf => Scatter::new(&bsdf, &mut tables),
                },
                emission: m.emission.into(),
                emits: m.emits(),
                two_sided: m.two_sided_emission,
            })
            .collect();
        Self {
            surfaces,
            lights: Lights::new(scene),
            nesting: Nesting::new(scene),
            sky: scene.sky.into(),
            bounces: bounces.unwrap_or(u32::MAX),
            direct,
        }
    }

    /// What an eye is inside of (world coordinates).
    pub(crate) fn inside(&self, raycaster: &Raycaster, eye: DVec3) -> Inside {
        self.nesting.as_ref().map_or_else(Inside::default, |nesting| nesting.at(raycaster, eye))
    }

    /// Radiance from infinity.
    pub(crate) fn sky(&self) -> Vec3 {
        self.sky
    }

    /// One estimate of the radiance that arrives against `start.direction`.
    pub(crate) fn radiance(&self, raycaster: &Raycaster, start: Start, sampler: &mut Sampler) -> Vec3 {
        let scene = raycaster.scene();
        let mut radiance = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        let mut eta2 = 1.0;
        let mut scatterings = 0;
        let mut left = Left { pdf: None, sky_pdf: 0.0 };
        let Start { mut hit, mut direction, mut inside } = start;
        for depth in 0..MAX_DEPTH {
            let Some(found) = hit else {
                radiance += throughput * self.sky * self.weight(left.pdf, left.sky_pdf);
                break;
            };
            let point = raycaster.surface(found.triangle, found.u, found.v);
            let material = scene.material_ids[found.triangle as usize];
            let surface = &self.surfaces[material as usize];
            let crossing = self.nesting.as_ref().and_then(|n| n.cross(raycaster, &point, material, direction, &inside));
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
                let light_pdf = self.lights.density(material) * found.t * found.t / cosine.abs();
                radiance += throughput * surface.emission * self.weight(left.pdf, light_pdf);
            }
            let frame = Frame::new(if front { point.normal } else { -point.normal });
            let wo = frame.to_local(-direction);
            if wo.z <= 0.0 {
                break;
            }
            if !scatter.is_delta() {
                if matches!(scatter, Scatter::Black) || scatterings > self.bounces {
                    break;
                }
                scatterings += 1;
                if self.direct != Direct::Materials {
                    radiance += throughput * self.lit(raycaster, scatter, &point, &frame, wo, front, sampler);
                }
            }
            let Some(sampled) = scatter.sample(wo, front, sampler) else { break };
            if let Some(beyond) = beyond.filter(|_| sampled.wi.z < 0.0) {
                inside = *beyond;
            }
            throughput *= sampled.weight;
            eta2 *= sampled.eta2;
            if depth >= ROULETTE_DEPTH {
                // Radiance is greater inside glass: without eta2, paths would be ended for having gone in.
                let survival = (throughput.max_element() * eta2).min(ROULETTE_CEILING);
                if sampler.one() >= survival {
                    break;
                }
                throughput /= survival;
            }
            if throughput == Vec3::ZERO {
                break;
            }
            left = Left {
                pdf: sampled.pdf,
                sky_pdf: if sampled.pdf.is_some() { self.sky_pdf(scatter, sampled.wi) } else { 0.0 },
            };
            direction = frame.to_world(sampled.wi);
            // What touches a boundary was crossed with it.
            let error = if crossing.is_some() { point.error * TOUCH } else { point.error };
            let ray = Ray::new(spawn(point.point, error, point.normal, direction), direction);
            hit = raycaster.nearest_from(&ray, found.triangle);
        }
        radiance
    }

    /// Weight of light found by the material, given both densities per solid angle.
    #[inline]
    fn weight(&self, pdf: Option<f32>, light_pdf: f32) -> f32 {
        match (pdf, self.direct) {
            (None, _) | (_, Direct::Materials) => 1.0,
            (Some(_), Direct::Lights) => 0.0,
            (Some(pdf), Direct::Both) => power_heuristic(pdf, light_pdf),
        }
    }

    /// Density with which [`lit`](Self::lit) aims at the sky in direction `wi`.
    #[inline]
    fn sky_pdf(&self, scatter: &Scatter, wi: Vec3) -> f32 {
        let sides = if scatter.transmits() { 0.5 * cosine_pdf(wi.z.abs()) } else { cosine_pdf(wi.z) };
        self.lights.sky * sides
    }

    /// Direct light by one sample of the lights or of the sky.
    #[allow(clippy::too_many_arguments, reason = "the parts of one vertex")]
    #[inline]
    fn lit(
        &self,
        raycaster: &Raycaster,
        scatter: &Scatter,
        point: &SurfacePoint,
        frame: &Frame,
        wo: Vec3,
        front: bool,
        sampler: &mut Sampler,
    ) -> Vec3 {
        if !self.lights.any() {
            return Vec3::ZERO;
        }
        if self.lights.sky > 0.0 && sampler.one() < self.lights.sky {
            let mut wi = cosine_hemisphere(sampler.two());
            if scatter.transmits() && sampler.one() < 0.5 {
                wi.z = -wi.z;
            }
            let (value, pdf) = scatter.evaluate(wo, wi, front);
            let light_pdf = self.sky_pdf(scatter, wi);
            if value == Vec3::ZERO || light_pdf <= 0.0 {
                return Vec3::ZERO;
            }
            let direction = frame.to_world(wi);
            let ray = Ray::new(spawn(point.point, point.error, point.normal, direction), direction);
            if raycaster.occluded_from(&ray, point.triangle) {
                return Vec3::ZERO;
            }
            return value * self.sky * (self.light_weight(light_pdf, pdf) / light_pdf);
        }
        let light = self.lights.point(raycaster, sampler);
        let material = raycaster.scene().material_ids[light.triangle as usize];
        let emitter = &self.surfaces[material as usize];
        let towards = light.point - point.point;
        let distance2 = towards.length_squared();
        if distance2 == 0.0 || light.triangle == point.triangle {
            return Vec3::ZERO;
        }
        let direction = towards / distance2.sqrt();
        let cosine = -direction.dot(light.normal);
        if !(cosine > 0.0 || emitter.two_sided && cosine < 0.0) {
            return Vec3::ZERO;
        }
        let (value, pdf) = scatter.evaluate(wo, frame.to_local(direction), front);
        if value == Vec3::ZERO || raycaster.blocked(point, &light) {
            return Vec3::ZERO;
        }
        let light_pdf = self.lights.density(material) * distance2 / cosine.abs();
        value * emitter.emission * (self.light_weight(light_pdf, pdf) / light_pdf)
    }

    #[inline]
    fn light_weight(&self, light_pdf: f32, pdf: f32) -> f32 {
        if self.direct == Direct::Lights { 1.0 } else { power_heuristic(light_pdf, pdf) }
    }
}

/// Veach's power heuristic with exponent 2, safe for densities whose squares overflow.
#[inline]
fn power_heuristic(chosen: f32, other: f32) -> f32 {
    let ratio = other / chosen;
    1.0 / (1.0 + ratio * ratio)
}

/// The first hit of a world ray, and its distance.
pub(crate) fn first_hit(raycaster: &Raycaster, origin: DVec3, direction: DVec3) -> (Option<Hit>, f64) {
    let Some((ray, _)) = raycaster.localize(origin, direction) else {
        return (None, f64::INFINITY);
    };
    let Some(hit) = raycaster.nearest_from(&ray, NO_TRIANGLE) else {
        return (None, f64::INFINITY);
    };
    // From the surface point and not from t: an eye far away leaves t's f32 nothing.
    let (point, _) = raycaster.surface_point(&hit);
    let offset = (raycaster.scene().origin - origin) + point.as_dvec3();
    (Some(hit), offset.dot(direction).max(0.0))
}
