//! The path tracer: unbiased paths from the eye ("The Rendering Equation", Kajiya 1986).
//!
//! Direct light is sampled twice at each surface: towards the lights and by the material.
//!
//! Invariants:
//! - The mean over seeds is the solution of the rendering equation for the settings' `bounces`, up
//!   to f32 rounding.
//! - The power heuristic (Veach 1997, §9.2.4) combines light that both ways can find. Light that
//!   only the material can find counts in full: at the first surface, and after mirrors and smooth
//!   glass.
//! - A surface of opacity a is met with probability a, by the rays of paths and by shadow rays. The
//!   ray caster decides. The ray alone decides, so the distance of a sample belongs to the surface
//!   whose light it brings. Glass that is something else in part is decided likewise.
//! - Shadow rays towards lamps go straight through panes, as paths do. Solid glass blocks them.
//!   Panes block shadow rays towards an even sky too, because a material's samples find windows
//!   better than samples of the whole sky do.
//! - Russian roulette ends paths from the second scattering or the sixth surface on. It depends
//!   only on their throughput, so a path that has lost no light continues. So paths have no large
//!   weights if surfaces absorb little, and few paths suffice in a closed room of albedo 1.
//! - From surface 300 on, a path survives with at most probability 0.99, so that light between
//!   perfect mirrors ends too. The variance is finite if surfaces absorb more than 1 % of the light
//!   on average.
//! - Light that meets more than [`MAX_DEPTH`] surfaces is lost. A path gets so far with a
//!   probability below 0.99^700, about 9e-4.

mod step;

use glam::{DVec3, Vec3};
use holo_raycast::{Hit, NO_TRIANGLE, Ray, Raycaster, SurfacePoint};

use crate::aim::Aims;
use crate::bsdf::Scatter;
use crate::direct::{self, LightSampling, LitVertex, MaterialSample};
use crate::engine::{PathEngine, Spread};
use crate::gather::Footprint;
use crate::geometry::ShadingFrame;
use crate::medium::{Crossing, Inside, TOUCH};
use crate::panes::MAX_DEPTH;
use crate::policy::{Carried, FirstSurface, LaterVertex, LeavingRay, PathPolicy, Unbiased};
use crate::sampler::{NumberPurpose, Sampler};
use crate::shading::{self, PathArrival};
use crate::surface::TracedMaterial;
use crate::weighting::Direct;

/// Growth of a path's width with the distance from an eye: about one pixel of a common picture.
const EYE_SPREAD: f32 = 1e-3;
/// The same after a surface that scatters widely.
const SCATTERED_SPREAD: f32 = 0.1;

/// Where a path begins: at an eye's first hit, which all paths of a sample share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    pub hit: Option<Hit>,
    pub direction: Vec3,
    /// The solids that the ray travels in.
    pub inside: Inside,
}

impl Start {
    /// Returns the start of an eye's ray.
    pub(crate) fn eye(hit: Option<Hit>, direction: Vec3, inside: Inside) -> Self {
        Self { hit, direction, inside }
    }
}

/// The state of a path.
#[derive(Clone, Copy)]
struct Path {
    hit: Option<Hit>,
    /// Where the ray comes from, once the path has left a surface.
    origin: Vec3,
    direction: Vec3,
    /// The solids that the ray travels in.
    inside: Inside,
    /// The weight of emission that the ray hits. Panes do not change it.
    emission_weight: EmissionWeight,
    /// True if the path has passed a pane since `emission_weight` was set.
    passed_pane: bool,
    /// Number of surfaces left so far.
    depth: u32,
    /// The same without mirrors and glass.
    scatterings: u32,
    throughput: Vec3,
    /// Product of [`Sampled::eta2`](crate::sampled::Sampled::eta2) along the path.
    eta2: f32,
    /// Factor with which aiming at secondary sources and caustics has lowered the throughput.
    aimed_by: f32,
    /// Width of the path at the ray's origin, and its growth with distance.
    width: f32,
    spread: f32,
    footprint: Footprint,
    /// Factor of the throughput with which light counts in the end: paths that teach begin with a
    /// throughput of 1 again.
    worth: Vec3,
}

/// A vertex that a path continues from.
struct OutgoingVertex<'a> {
    point: &'a SurfacePoint,
    /// Bound on the error of `point`. At the boundary of a solid it covers surfaces that touch it.
    error: Vec3,
    frame: ShadingFrame,
    wo: Vec3,
    front: bool,
    scatter: &'a Scatter,
    /// The solids beyond the surface, if the surface bounds a solid.
    beyond: Option<&'a Inside>,
    /// Set if the vertex may see secondary sources or caustics.
    aims: Option<Aims<'a>>,
    /// The way that the lights were sampled here, if they were.
    light_sampling: Option<LightSampling>,
}

/// The weight of emission that a ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) enum EmissionWeight {
    /// Only this ray can find the emission.
    Full,
    /// Light samples could have found it too.
    Combined(MaterialSample),
}

impl EmissionWeight {
    /// `density` returns the expected number of light samples per solid angle.
    #[inline]
    fn factor(&self, direct: Direct, density: impl FnOnce(&MaterialSample) -> f32) -> f32 {
        match self {
            Self::Full => 1.0,
            Self::Combined(sample) => direct.material_weight(sample.pdf, density(sample)),
        }
    }
}

impl Path {
    /// Returns how the path looks at a surface.
    #[inline]
    fn looking(&self) -> PathArrival {
        PathArrival { towards_eye: -self.direction, width: self.width }
    }
}

impl PathEngine {
    /// Returns one estimate of the radiance that arrives against `start.direction`.
    #[inline]
    pub(crate) fn radiance(
        &self,
        raycaster: &Raycaster,
        start: Start,
        sampler: &mut Sampler,
    ) -> Vec3 {
        self.follow(raycaster, start, &Unbiased, sampler)
    }

    /// The same, for paths that `policy` may end earlier.
    pub(crate) fn follow(
        &self,
        raycaster: &Raycaster,
        start: Start,
        policy: &impl PathPolicy,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let Start { hit, direction, inside } = start;
        let path = Path {
            hit,
            origin: Vec3::ZERO,
            direction,
            inside,
            emission_weight: EmissionWeight::Full,
            passed_pane: false,
            depth: 0,
            scatterings: 0,
            throughput: Vec3::ONE,
            eta2: 1.0,
            aimed_by: 1.0,
            width: 0.0,
            spread: EYE_SPREAD,
            footprint: Footprint::none(),
            worth: Vec3::ONE,
        };
        self.trace_rest(raycaster, path, policy, sampler)
    }

    /// Returns the radiance that the rest of a path brings.
    fn trace_rest<P: PathPolicy>(
        &self,
        raycaster: &Raycaster,
        mut path: Path,
        policy: &P,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let mut radiance = Vec3::ZERO;
        let mut lessons = P::Lessons::default();
        while path.depth < MAX_DEPTH {
            if self.finds_points {
                radiance += self.spheres_along(&path);
            }
            let Some(hit) = path.hit else {
                radiance += self.sky_along(&path);
                break;
            };
            let point = raycaster.surface(hit.triangle, hit.u, hit.v);
            let material = raycaster.scene().material_id(hit.triangle);
            let mut surface = &self.surfaces[material as usize];
            let base = self.met_base(raycaster, &hit, surface, path.direction);
            surface = base.unwrap_or(surface);
            let crossing =
                self.nesting.as_ref().filter(|_| base.is_none()).and_then(|n| {
                    n.cross(raycaster, &point, material, path.direction, &path.inside)
                });
            path.width += hit.t * path.spread;
            path.footprint.travel(hit.t);
            let textured;
            let (scatter, beyond) = match &crossing {
                None if self.is_shaded => {
                    textured = self.textured(raycaster, &hit, surface, path.width);
                    (textured.as_ref().unwrap_or(&surface.scatter), None)
                }
                None => (&surface.scatter, None),
                Some(Crossing::Boundary { scatter, beyond }) => (scatter, Some(beyond)),
                Some(Crossing::Opaque(touching)) => {
                    path.hit = Some(Hit { t: hit.t, ..*touching });
                    path.depth += 1;
                    continue;
                }
            };
            let cosine = -path.direction.dot(point.normal);
            let front = cosine > 0.0;
            if surface.emits && (front || surface.two_sided) {
                radiance += self.emission(raycaster, &path, &hit, cosine.abs(), surface);
            }
            let facing = if front { point.normal } else { -point.normal };
            let normal = match self.is_shaded {
                true => shading::normals(raycaster, &hit, scatter, facing, &path.looking()).1,
                false => facing,
            };
            let frame = ShadingFrame::new(normal);
            let wo = frame.to_local(-path.direction);
            if wo.z <= 0.0 {
                break;
            }
            let mut light_sampling = None;
            let mut spread = Spread { lights: 1, branches: 1, is_probe: false };
            let (mut direct_light, mut direct_variance) = (Vec3::ZERO, 0.0);
            // Direct light, and indirect light if it is known, for surfaces that scatter with a
            // density.
            if !scatter.is_delta() {
                if matches!(scatter, Scatter::Black) || path.scatterings > self.bounces {
                    break;
                }
                path.scatterings += 1;
                if path.scatterings > 1 {
                    let at = LaterVertex {
                        raycaster,
                        point: &point,
                        normal: facing,
                        material,
                        scatter,
                        wo,
                        footprint: path.footprint.arrive(wo.z),
                        scatterings: path.scatterings,
                        depth: path.depth,
                    };
                    let Path { throughput, worth, .. } = &mut path;
                    let mut carried = Carried { radiance: &mut radiance, throughput, worth };
                    if policy.ends(&mut lessons, &at, &mut carried, sampler) {
                        break;
                    }
                }
                let Path { depth, scatterings, throughput, .. } = path;
                if scatterings == 1 {
                    spread = policy.spread(self, point.point);
                }
                let ends = scatterings > self.bounces
                    && self.lights_find_all
                    && matches!(scatter, Scatter::Diffuse(_));
                let direct = if ends { Direct::Lights } else { self.direct };
                if direct != Direct::Materials && (self.lights.any() || self.suns.any()) {
                    let count = spread.lights;
                    let vertex = LitVertex {
                        raycaster,
                        engine: self,
                        scatter,
                        point: &point,
                        frame: &frame,
                        wo,
                        front,
                    };
                    let lights =
                        direct::lights_at(&self.lights, scatter, &point, frame.n, scatterings);
                    sampler.turn(depth, NumberPurpose::Light);
                    let (light, variance) = vertex.direct_light(&lights, count, direct, sampler);
                    (direct_light, direct_variance) = (throughput * light, variance);
                    radiance += direct_light;
                    if self.suns.any() {
                        sampler.turn(depth, NumberPurpose::Sun);
                        radiance += throughput * vertex.sunlight(direct, sampler);
                    }
                    let counts = [count, scatterings];
                    light_sampling =
                        Some(LightSampling::new(&lights, scatter, &point, frame.n, counts));
                }
                if ends {
                    break;
                }
            }
            let aims = if scatter.is_wide() { self.aims(&point, frame.n) } else { None };
            let error = if crossing.is_some() { point.error * TOUCH } else { point.error };
            let vertex = OutgoingVertex {
                point: &point,
                error,
                frame,
                wo,
                front,
                scatter,
                beyond,
                aims,
                light_sampling,
            };
            // The usual case: one continuation.
            if spread.branches == 1 {
                let ends = |path: &mut Path, ray: &Ray| {
                    let leaving = LeavingRay {
                        ray,
                        triangle: point.triangle,
                        normal: point.normal,
                        is_solid: beyond.is_some(),
                    };
                    let Path { throughput, worth, .. } = path;
                    let mut carried = Carried { radiance: &mut radiance, throughput, worth };
                    policy.leaves(&mut lessons, &leaving, &mut carried)
                };
                if self.sample_next(raycaster, &mut path, &vertex, sampler, ends) {
                    policy.met(&mut lessons, point.triangle, path.hit.as_ref());
                    continue;
                }
                break;
            }
            // Several continuations share the path up to here.
            let Spread { branches: count, is_probe, .. } = spread;
            let (mut sum, mut squares) = (Vec3::ZERO, 0.0);
            for branch in 0..count {
                let (mut path, mut sampler) = (path, sampler.branch(count, branch, is_probe));
                if self.sample_next(raycaster, &mut path, &vertex, &mut sampler, |_, _| false) {
                    let light = self.trace_rest(raycaster, path, policy, &mut sampler);
                    sum += light;
                    squares += light.element_sum().powi(2);
                }
            }
            let mean = sum / count as f32;
            radiance += mean;
            let indirect = mean.element_sum();
            let seen = FirstSurface {
                direct: direct_light.element_sum(),
                direct_variance: direct_variance * (path.throughput.element_sum() / 3.0).powi(2),
                indirect,
                indirect_variance: ((squares - count as f32 * indirect * indirect)
                    / (count - 1) as f32)
                    .max(0.0),
            };
            policy.branched(point.point, &seen);
            break;
        }
        policy.learn(raycaster, lessons, radiance)
    }

    /// Returns the light of punctual lights that a path brings from its ray, if nothing else can
    /// find it.
    fn spheres_along(&self, path: &Path) -> Vec3 {
        // Paths begin at an eye or with light that is counted elsewhere.
        if path.scatterings == 0 || !matches!(path.emission_weight, EmissionWeight::Full) {
            return Vec3::ZERO;
        }
        let t_max = path.hit.map_or(f32::INFINITY, |hit| hit.t);
        path.throughput * self.lights.spheres_along(path.origin, path.direction, t_max)
    }

    /// Returns the radiance of the sun's disc in a direction, if eyes see it.
    #[inline]
    pub(crate) fn seen_disc(&self, direction: DVec3) -> Vec3 {
        let sun = self.visible_sun.filter(|sun| sun.is_at(direction));
        sun.map_or(Vec3::ZERO, |sun| sun.radiance().into())
    }

    /// Returns the light of sky and suns that a path brings whose ray meets nothing.
    #[inline]
    fn sky_along(&self, path: &Path) -> Vec3 {
        // Samples of an even sky end at panes.
        let weight = if path.passed_pane && self.sky.is_even() {
            1.0
        } else {
            path.emission_weight
                .factor(self.direct, |sample| sample.sky_density(&self.sky, path.direction))
        };
        let sky = path.throughput * self.sky.along(path.direction) * weight;
        if path.scatterings == 0 {
            let direction = path.direction.as_dvec3().normalize_or_zero();
            return sky + path.throughput * self.seen_disc(direction);
        }
        if !self.suns.any() {
            return sky;
        }
        // Light samples look for suns behind panes, too.
        let met = self
            .suns
            .along(path.direction, |density| path.emission_weight.factor(self.direct, |_| density));
        sky + path.throughput * met
    }

    /// Returns the light that a path brings from an emitter that its ray hits at `cosine`.
    #[inline]
    fn emission(
        &self,
        raycaster: &Raycaster,
        path: &Path,
        hit: &Hit,
        cosine: f32,
        surface: &TracedMaterial,
    ) -> Vec3 {
        let weight = path.emission_weight.factor(self.direct, |sample| {
            sample.emitter_density(&self.lights, raycaster, hit, cosine)
        });
        path.throughput
            * self.emission_at(raycaster, hit.triangle, [hit.u, hit.v], -path.direction, surface)
            * weight
    }
}

/// Returns the first hit of a world ray and its distance.
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
    // From the surface point and not from `hit.t`: for a far eye, `t` has no f32 digits to spare.
    let (point, _) = raycaster.surface_point(&hit);
    let offset = (raycaster.scene().origin - origin) + point.as_dvec3();
    (Some(hit), offset.dot(direction).max(0.0))
}
