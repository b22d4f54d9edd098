//! The path engine: unbiased paths from the eye, with direct light by sampling both lights and materials.
//!
//! Always true:
//! - The mean over seeds is the solution of the rendering equation for the settings' `bounces`, up to f32 rounding.
//! - Light is combined by the power heuristic (Veach 1997, §9.2.4) where both ways can find it, and counted in full where
//!   only the material can: after mirrors and smooth glass, and at the first surface.
//! - Shadow rays go straight on through panes, towards lamps, as paths do. They are blocked by other glass, and by panes before the sky:
//!   light through those is found by the material alone. (Windows are found better so than by aiming at the whole sky.)
//! - From the second scattering or the sixth surface on, paths end by roulette with twice their throughput, at least with probability 0.05
//!   each, so chains of perfect mirrors end too. The hard limit of [`MAX_DEPTH`] is beyond 0.95^1000, about 5e-23 of the paths.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::{Hit, NO_TRIANGLE, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::{Bsdf, Scene};

use crate::bsdf::{Sampled, Scatter, Tables};
use crate::direct::{self, Left, Lit, Vertex};
use crate::ending::{Ending, Met, Never};
use crate::geometry::Frame;
use crate::images::{Aims, Shown};
use crate::lights::Lights;
use crate::medium::{Crossing, Inside, Nesting, TOUCH};
use crate::panes::Panes;
use crate::sampler::{Purpose, Sampler};
use crate::secondary::{Aimed, Choice, Secondary};

/// At which scattering by surfaces other than mirrors and glass roulette begins.
const ROULETTE_SCATTERINGS: u32 = 2;
/// Times their throughput that paths survive with: what they may still find is worth more than the shorter way to another sample. Error
/// squared times time from the second scattering on with 1, 1.5, 2, 2.5 (and from the third with 1, from the sixth): Cornell box 0.046, 0.036,
/// 0.035, 0.033 (0.042, 0.040); cabin's living room with 1.5, 2: 0.131, 0.116 (0.146); its bedroom 0.38, 0.37 (0.40).
const ROULETTE_FACTOR: f32 = 2.0;
/// Surfaces before roulette begins for all paths: mirrors and glass take little.
const ROULETTE_DEPTH: u32 = 5;
/// Chance of going on that roulette never exceeds.
const ROULETTE_CEILING: f32 = 0.95;
/// Scatterings of a path at most.
pub(crate) const MAX_DEPTH: u32 = 1024;

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
    pub panes: Arc<Panes>,
    pub secondary: Option<Secondary>,
    pub nesting: Option<Nesting>,
    pub sky: Vec3,
    pub bounces: u32,
    direct: Direct,
    /// Samples of the lights at the first surface that is not a mirror or glass.
    pub light_samples: u32,
    /// Ways on from there: a path is a tree with one fork. What came before is shared by all of them.
    pub branches: u32,
}

/// Where a path goes on from: a first hit, shared by all paths of a sample, or a ray that leaves a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start<'a> {
    pub hit: Option<Hit>,
    pub direction: Vec3,
    /// What the ray is inside of.
    pub inside: Inside,
    pub arrived: Arrived,
    /// If images of lamps were aimed at from where the ray begins.
    pub aims: Option<Aims<'a>>,
    /// Surfaces that the path has left, all of them wide.
    pub depth: u32,
}

impl Start<'_> {
    /// An eye's ray.
    pub(crate) fn eye(hit: Option<Hit>, direction: Vec3, inside: Inside) -> Self {
        Self { hit, direction, inside, arrived: Arrived::Alone, aims: None, depth: 0 }
    }
}

/// A path on its way.
#[derive(Clone, Copy)]
struct Path<'a> {
    hit: Option<Hit>,
    direction: Vec3,
    inside: Inside,
    arrived: Arrived,
    /// Whether it has gone through panes or by a mirror of images since then.
    through: bool,
    /// How it left, if images of lamps were aimed at from there, and the mirror that it has met since.
    aims: Option<Aims<'a>>,
    shown: Option<Shown<'a>>,
    /// Surfaces left so far, and those of them that are neither mirrors nor glass.
    depth: u32,
    scatterings: u32,
    /// Of smooth surfaces, at how many the path has gone both ways.
    forks: u32,
    throughput: Vec3,
    eta2: f32,
    /// By how much aimed samples have lowered the throughput.
    aimed_by: f32,
}

/// A vertex that a path goes on from.
struct Leaving<'a> {
    point: &'a SurfacePoint,
    /// Of where rays start: what touches a boundary was crossed with it.
    error: Vec3,
    frame: Frame,
    wo: Vec3,
    front: bool,
    scatter: &'a Scatter,
    beyond: Option<&'a Inside>,
    aimed: Option<Aimed<'a>>,
    /// Lights as light samples saw them, and how many there were.
    lighting: Option<Lit>,
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

impl PathEngine {
    pub(crate) fn new(
        raycaster: &Arc<Raycaster>,
        bounces: Option<u32>,
        direct: Direct,
        light_samples: u32,
    ) -> Self {
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
        let panes = Arc::new(Panes::new(scene));
        let lights = Lights::new(scene).with_cells(raycaster, &panes);
        Self {
            secondary: Secondary::find(raycaster, &surfaces, &lights),
            surfaces,
            lights,
            panes,
            nesting: Nesting::new(scene),
            sky: scene.sky.into(),
            bounces: bounces.unwrap_or(u32::MAX),
            direct,
            light_samples,
            branches: 1,
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
    pub(crate) fn radiance(
        &self,
        raycaster: &Raycaster,
        start: Start,
        sampler: &mut Sampler,
    ) -> Vec3 {
        self.follow(raycaster, start, &Never, sampler)
    }

    /// The same, by paths that may end before.
    pub(crate) fn follow<'a>(
        &self,
        raycaster: &Raycaster,
        start: Start<'a>,
        ending: &'a impl Ending,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let Start { hit, direction, inside, arrived, aims, depth } = start;
        let scatterings = depth;
        let path = Path {
            hit,
            direction,
            inside,
            arrived,
            through: false,
            aims,
            shown: None,
            depth,
            scatterings,
            forks: 0,
            throughput: Vec3::ONE,
            eta2: 1.0,
            aimed_by: 1.0,
        };
        self.go_on(raycaster, path, ending, sampler)
    }

    /// Radiance that the rest of a path brings.
    fn go_on<'a>(
        &self,
        raycaster: &Raycaster,
        mut path: Path<'a>,
        ending: &'a impl Ending,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let scene = raycaster.scene();
        let mut radiance = Vec3::ZERO;
        while path.depth < MAX_DEPTH {
            let Path { direction, throughput, depth, .. } = path;
            let Some(found) = path.hit else {
                let weight = if path.through {
                    1.0
                } else {
                    path.arrived.weight(self.direct, Left::sky_density)
                };
                radiance += throughput * self.sky * weight;
                break;
            };
            let point = raycaster.surface(found.triangle, found.u, found.v);
            let material = scene.material_ids[found.triangle as usize];
            let surface = &self.surfaces[material as usize];
            let crossing = self
                .nesting
                .as_ref()
                .and_then(|n| n.cross(raycaster, &point, material, direction, &path.inside));
            let (scatter, beyond) = match &crossing {
                None => (&surface.scatter, None),
                Some(Crossing::Boundary { scatter, beyond }) => (scatter, Some(beyond)),
                Some(Crossing::Opaque(touching)) => {
                    path.hit = Some(Hit { t: found.t, ..*touching });
                    path.depth += 1;
                    continue;
                }
            };
            let cosine = -direction.dot(point.normal);
            let front = cosine > 0.0;
            if surface.emits && (front || surface.two_sided) {
                let cosine = cosine.abs();
                let weight = match &path.shown {
                    Some(shown) => shown.weight(&found, cosine),
                    None => path.arrived.weight(self.direct, |left| {
                        left.emitter_density(&self.lights, raycaster, &found, cosine)
                    }),
                };
                let light = throughput * surface.emission * weight;
                let is_alone = matches!(path.arrived, Arrived::Alone)
                    && path.shown.is_none()
                    && path.scatterings > 0;
                radiance += if is_alone { ending.held(light) } else { light };
            }
            let frame = Frame::new(if front { point.normal } else { -point.normal });
            let wo = frame.to_local(-direction);
            if wo.z <= 0.0 {
                break;
            }
            let mut lighting = None;
            let mut branches = 1;
            if !scatter.is_delta() {
                if matches!(scatter, Scatter::Black) || path.scatterings > self.bounces {
                    break;
                }
                path.scatterings += 1;
                let (normal, inside, scatterings) = (frame.n, &path.inside, path.scatterings);
                let met =
                    Met { raycaster, point: &point, normal, scatter, inside, scatterings, depth };
                let indirect = ending.indirect(&met, sampler);
                let direct = if indirect.is_some() { Direct::Lights } else { self.direct };
                if direct != Direct::Materials && self.lights.any() {
                    let count = ending.light_samples(self, scatterings, indirect.is_some());
                    let seen = direct::seen(&self.lights, scatter, &point, frame.n);
                    let (surfaces, panes) = (&self.surfaces, &*self.panes);
                    let vertex = Vertex {
                        raycaster,
                        surfaces,
                        panes,
                        scatter,
                        point: &point,
                        frame: &frame,
                        wo,
                        front,
                    };
                    sampler.turn(depth, Purpose::Light);
                    let lit = vertex.lit(&self.lights, &seen, self.sky, count, direct, sampler);
                    radiance += throughput * lit;
                    lighting = Some(Lit::new(&seen, scatter, &point, frame.n, count));
                }
                if let Some(indirect) = indirect {
                    radiance += throughput * indirect;
                    break;
                }
                branches = if scatterings == 1 { self.branches } else { 1 };
            }
            let sources = self.secondary.as_ref().filter(|_| scatter.is_wide());
            let aimed = sources.and_then(|sources| sources.aimed(&point, frame.n));
            let error = if crossing.is_some() { point.error * TOUCH } else { point.error };
            let vertex = Leaving {
                point: &point,
                error,
                frame,
                wo,
                front,
                scatter,
                beyond,
                aimed,
                lighting,
            };
            if path.forks < ending.forks(path.scatterings)
                && let Some(ways) = scatter.ways(wo, front)
            {
                path.forks += 1;
                for (way, sampled) in (0..).zip(&ways) {
                    let (mut path, ending) = (path, ending.clone());
                    path.throughput *= sampled.weight;
                    path.eta2 *= sampled.eta2;
                    self.step(raycaster, &mut path, &vertex, sampled);
                    radiance += self.go_on(raycaster, path, &ending, &mut sampler.way(way));
                }
                break;
            }
            if branches == 1 {
                if self.leave(raycaster, &mut path, &vertex, sampler) {
                    continue;
                }
                break;
            }
            let mut sum = Vec3::ZERO;
            for branch in 0..branches {
                let mut sampler = sampler.branch(branches, branch);
                let mut path = path;
                if self.leave(raycaster, &mut path, &vertex, &mut sampler) {
                    sum += self.go_on(raycaster, path, ending, &mut sampler);
                }
            }
            radiance += sum / branches as f32;
            break;
        }
        radiance
    }

    /// Adds a segment to a path; whether there is one.
    #[inline]
    fn leave(
        &self,
        raycaster: &Raycaster,
        path: &mut Path,
        vertex: &Leaving,
        sampler: &mut Sampler,
    ) -> bool {
        let Leaving { point, ref frame, wo, front, scatter, aimed, .. } = *vertex;
        let depth = path.depth;
        let choice = aimed.as_ref().map_or(Choice::Material, |aimed| {
            sampler.turn(depth, Purpose::Aim);
            aimed.choose(raycaster, sampler)
        });
        let sampled = match &choice {
            Choice::Material => {
                sampler.turn(depth, Purpose::Scatter);
                scatter.sample(wo, front, sampler)
            }
            Choice::Source(target) if target.triangle != point.triangle => {
                let direction = (target.point - point.point).normalize_or_zero();
                scatter.towards(wo, frame.to_local(direction), front)
            }
            Choice::Source(_) | Choice::Nothing => None,
        };
        let Some(sampled) = sampled else { return false };
        path.throughput *= sampled.weight;
        path.eta2 *= sampled.eta2;
        if path.scatterings >= ROULETTE_SCATTERINGS || depth >= ROULETTE_DEPTH {
            // Radiance is greater inside glass: without eta2, paths would be ended for having gone in. What samples are aimed at is
            // brighter too: the few that roulette left would be as bright as if none had been aimed.
            let survival =
                (ROULETTE_FACTOR * path.throughput.max_element() * path.eta2 * path.aimed_by)
                    .min(ROULETTE_CEILING);
            sampler.turn(depth, Purpose::Roulette);
            if sampler.one() >= survival {
                return false;
            }
            path.throughput /= survival;
        }
        if path.throughput == Vec3::ZERO {
            return false;
        }
        self.step(raycaster, path, vertex, &sampled);
        if let (Some(aimed), Some(pdf)) = (&aimed, sampled.pdf) {
            let Some(found) = aimed.weight(raycaster, pdf, &choice, path.hit.as_ref()) else {
                return false;
            };
            path.throughput *= found.weight;
            if found.on_source {
                path.aimed_by /= found.weight;
            }
        }
        true
    }

    /// Goes on to the next surface that way.
    #[inline]
    fn step(&self, raycaster: &Raycaster, path: &mut Path, vertex: &Leaving, sampled: &Sampled) {
        let Leaving { point, error, ref frame, scatter, beyond, lighting, .. } = *vertex;
        if let Some(beyond) = beyond.filter(|_| sampled.wi.z < 0.0) {
            path.inside = *beyond;
        }
        // Light samples have found what is straight on behind a pane, too, but not what a mirror shows, unless as an image.
        let straight = matches!(scatter, Scatter::Pane { .. }) && sampled.wi.z < 0.0;
        let shown = path.aims.take_if(|_| !straight).and_then(|aims| aims.shown_by(point.triangle));
        path.through = straight || shown.is_some();
        if !straight {
            path.shown = shown;
            path.arrived = match sampled.pdf.zip(lighting) {
                Some((pdf, lit)) => Arrived::Weighed(lit.left(pdf, scatter, sampled.wi)),
                None => Arrived::Alone,
            };
        }
        path.direction = frame.to_world(sampled.wi);
        let ray = Ray::new(spawn(point.point, error, point.normal, path.direction), path.direction);
        path.hit = raycaster.nearest_from(&ray, point.triangle);
        path.depth += 1;
    }
}

/// The first hit of a world ray, and its distance.
pub(crate) fn first_hit(
    raycaster: &Raycaster,
    origin: DVec3,
    direction: DVec3,
) -> (Option<Hit>, f64) {
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
