//! The path engine: unbiased paths from the eye, with direct light by sampling both lights and materials.
//!
//! Always true:
//! - The mean over seeds is the solution of the rendering equation for the settings' `bounces`, up to f32 rounding.
//! - Light is combined by the power heuristic (Veach 1997, §9.2.4) where both ways can find it, and counted in full where
//!   only the material can: after mirrors and smooth glass, and at the first surface.
//! - Shadow rays are blocked by glass: light through it is found by the material alone.
//! - From the third scattering or the sixth surface on, paths end by roulette with their throughput, at least with probability 0.05 each, so
//!   chains of perfect mirrors end too. The hard limit of [`MAX_DEPTH`] is beyond 0.95^1000, about 5e-23 of the paths.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::{Hit, NO_TRIANGLE, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::{Bsdf, Scene};

use crate::bsdf::{Scatter, Tables};
use crate::direct::{self, Left, Vertex};
use crate::geometry::Frame;
use crate::lights::Lights;
use crate::medium::{Crossing, Inside, Nesting, TOUCH};
use crate::sampler::{Purpose, Sampler};
use crate::secondary::{Choice, Secondary};

/// At which scattering by surfaces other than mirrors and glass roulette begins. Error squared times time with 2, 3, 4, 6: Cornell box
/// 0.072, 0.069, 0.064, 0.064; cabin's living room 0.080, 0.081, 0.088, 0.121; its bedroom 0.14, 0.28, 0.35, 0.48, where 2 is luck with few
/// bright pixels.
const ROULETTE_SCATTERINGS: u32 = 3;
/// Surfaces before roulette begins for all paths: mirrors and glass take little.
const ROULETTE_DEPTH: u32 = 5;
/// Chance of going on that roulette never exceeds.
const ROULETTE_CEILING: f32 = 0.95;
/// Scatterings of a path at most.
const MAX_DEPTH: u32 = 1024;

/// How direct light is found. Each is unbiased alone where no material is a delta; tests compare them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direct {
    Both,
    Lights,
    #[cfg_attr(not(test), allow(dead_code, reason = "only for comparison"))]
    Materials,
}

/// What the engine needs of a material.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    pub scatter: Scatter,
    pub emission: Vec3,
    pub emits: bool,
    pub two_sided: bool,
}

/// The path engine of one scene.
#[derive(Debug)]
pub(crate) struct PathEngine {
    pub surfaces: Vec<Surface>,
    pub lights: Lights,
    pub secondary: Option<Secondary>,
    pub nesting: Option<Nesting>,
    pub sky: Vec3,
    pub bounces: u32,
    direct: Direct,
    /// Samples of the lights at the first surface that is not a mirror or glass.
    pub light_samples: u32,
}

/// Where a path goes on from: a first hit, shared by all paths of a sample, or a ray that leaves a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    pub hit: Option<Hit>,
    pub direction: Vec3,
    /// What the ray is inside of.
    pub inside: Inside,
    pub arrived: Arrived,
    /// Surfaces that the path has left, all of them wide.
    pub depth: u32,
}

impl Start {
    /// An eye's ray.
    pub(crate) fn eye(hit: Option<Hit>, direction: Vec3, inside: Inside) -> Self {
        Self { hit, direction, inside, arrived: Arrived::Alone, depth: 0 }
    }
}

/// How light counts that a ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Arrived {
    /// Nothing else finds it.
    Alone,
    /// Light samples could have found it too.
    Weighed(Left),
    /// It is counted elsewhere.
    Excluded,
}

impl Arrived {
    #[inline]
    fn weight(&self, direct: Direct, density: impl FnOnce(&Left) -> f32) -> f32 {
        match self {
            Self::Alone => 1.0,
            Self::Weighed(left) => direct.material_weight(left.pdf, density(left)),
            Self::Excluded => 0.0,
        }
    }
}

/// A vertex at which a path may end.
pub(crate) struct Met<'a> {
    pub raycaster: &'a Raycaster,
    pub point: &'a SurfacePoint,
    /// On the side that the path has come to.
    pub normal: Vec3,
    pub scatter: &'a Scatter,
    pub inside: &'a Inside,
    /// Surfaces so far that are neither mirrors nor glass, this one included.
    pub scatterings: u32,
}

/// What ends paths before light does.
pub(crate) trait Ending {
    /// Radiance that a vertex sends on of light that came by other surfaces, where that is known.
    fn indirect(&self, met: &Met) -> Option<Vec3>;

    /// Samples of the lights at a vertex, and whether the path ends there.
    fn light_samples(&self, engine: &PathEngine, scatterings: u32, ends: bool) -> u32;
}

/// Paths that only light, roulette or absorption end.
pub(crate) struct Never;

impl Ending for Never {
    #[inline]
    fn indirect(&self, _: &Met) -> Option<Vec3> {
        None
    }

    #[inline]
    fn light_samples(&self, engine: &PathEngine, scatterings: u32, _: bool) -> u32 {
        if scatterings == 1 { engine.light_samples } else { 1 }
    }
}

impl PathEngine {
    pub(crate) fn new(raycaster: &Arc<Raycaster>, bounces: Option<u32>, direct: Direct, light_samples: u32) -> Self {
        let scene: &Scene = raycaster.scene();
        let mut used = vec![false; scene.materials.len()];
        scene.material_ids.iter().for_each(|&m| used[m as usize] = true);
        let mut tables = Tables::default();
        let surfaces: Vec<Surface> = scene
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
        let lights = Lights::new(scene).with_cells(raycaster);
        Self {
            secondary: Secondary::find(raycaster, &surfaces, &lights),
            surfaces,
            lights,
            nesting: Nesting::new(scene),
            sky: scene.sky.into(),
            bounces: bounces.unwrap_or(u32::MAX),
            direct,
            light_samples,
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
    #[inline]
    pub(crate) fn radiance(&self, raycaster: &Raycaster, start: Start, sampler: &mut Sampler) -> Vec3 {
        self.follow(raycaster, start, &Never, sampler)
    }

    /// The same, by paths that may end before.
    pub(crate) fn follow(
        &self,
        raycaster: &Raycaster,
        start: Start,
        ending: &impl Ending,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let scene = raycaster.scene();
        let mut radiance = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        let mut eta2 = 1.0;
        // By how much aimed samples have lowered the throughput.
        let mut aimed_by = 1.0;
        let Start { mut hit, mut direction, mut inside, mut arrived, depth: first } = start;
        let mut scatterings = first;
        for depth in first..MAX_DEPTH {
            let Some(found) = hit else {
                let weight = arrived.weight(self.direct, Left::sky_density);
                radiance += throughput * self.sky * weight;
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
                let weight = arrived
                    .weight(self.direct, |left| left.emitter_density(&self.lights, raycaster, &found, cosine.abs()));
                radiance += throughput * surface.emission * weight;
            }
            let frame = Frame::new(if front { point.normal } else { -point.normal });
            let wo = frame.to_local(-direction);
            if wo.z <= 0.0 {
                break;
            }
            let mut lighting = None;
            if !scatter.is_delta() {
                if matches!(scatter, Scatter::Black) || scatterings > self.bounces {
                    break;
                }
                scatterings += 1;
                let normal = frame.n;
                let met = Met { raycaster, point: &point, normal, scatter, inside: &inside, scatterings };
                let indirect = ending.indirect(&met);
                let direct = if indirect.is_some() { Direct::Lights } else { self.direct };
                if direct != Direct::Materials && self.lights.any() {
                    let count = ending.light_samples(self, scatterings, indirect.is_some());
                    let seen = direct::seen(&self.lights, scatter, &point, frame.n);
                    let surfaces = &self.surfaces;
                    let vertex = Vertex { raycaster, surfaces, scatter, point: &point, frame: &frame, wo, front };
                    sampler.turn(depth, Purpose::Light);
                    radiance += throughput * vertex.lit(&self.lights, &seen, self.sky, count, direct, sampler);
                    lighting = Some((seen, count));
                }
                if let Some(indirect) = indirect {
                    radiance += throughput * indirect;
                    break;
                }
            }
            let sources = self.secondary.as_ref().filter(|_| scatter.is_wide());
            let aimed = sources.and_then(|sources| sources.aimed(&point, frame.n));
            let choice = aimed.as_ref().map_or(Choice::Material, |aimed| {
                sampler.turn(depth, Purpose::Aim);
                aimed.choose(raycaster, sampler)
            });
            let sampled = match &choice {
                Choice::Material => {
                    sampler.turn(depth, Purpose::Scatter);
                    scatter.sample(wo, front, sampler)
                }
                Choice::Source(target) if target.triangle != found.triangle => {
                    let direction = (target.point - point.point).normalize_or_zero();
                    scatter.towards(wo, frame.to_local(direction), front)
                }
                Choice::Source(_) | Choice::Nothing => None,
            };
            let Some(sampled) = sampled else { break };
            if let Some(beyond) = beyond.filter(|_| sampled.wi.z < 0.0) {
                inside = *beyond;
            }
            throughput *= sampled.weight;
            eta2 *= sampled.eta2;
            if scatterings >= ROULETTE_SCATTERINGS || depth >= ROULETTE_DEPTH {
                // Radiance is greater inside glass: without eta2, paths would be ended for having gone in. What samples are aimed at is
                // brighter too: the few that roulette left would be as bright as if none had been aimed.
                let survival = (throughput.max_element() * eta2 * aimed_by).min(ROULETTE_CEILING);
                sampler.turn(depth, Purpose::Roulette);
                if sampler.one() >= survival {
                    break;
                }
                throughput /= survival;
            }
            if throughput == Vec3::ZERO {
                break;
            }
            // Light sampling could not have found what a mirror shows.
            arrived = match sampled.pdf.zip(lighting) {
                Some((pdf, (seen, count))) => Arrived::Weighed(Left::new(pdf, seen, scatter, sampled.wi, count)),
                None => Arrived::Alone,
            };
            direction = frame.to_world(sampled.wi);
            // What touches a boundary was crossed with it.
            let error = if crossing.is_some() { point.error * TOUCH } else { point.error };
            let ray = Ray::new(spawn(point.point, error, point.normal, direction), direction);
            hit = raycaster.nearest_from(&ray, found.triangle);
            if let (Some(aimed), Some(pdf)) = (&aimed, sampled.pdf) {
                let Some(found) = aimed.weight(raycaster, pdf, &choice, hit.as_ref()) else { break };
                throughput *= found.weight;
                if found.on_source {
                    aimed_by /= found.weight;
                }
            }
        }
        radiance
    }
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
