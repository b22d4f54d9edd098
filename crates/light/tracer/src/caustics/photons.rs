//! Light paths from lamps, suns and the sky over mirrors, glass and metal, up to the first wide
//! surface.
//!
//! A path begins at a random point of a caster: a mirror, glass or narrow metal. The lamps are
//! sampled from there, and the light goes on as the caster scatters it. So small casters get as
//! many photons for their area as large ones.
//!
//! Each kind of light source has its own light paths. Paths from suns begin at the middle of the
//! disc: their cones cover the rest of it. Paths from the sky begin at solid glass only, because
//! samples of the sky find no other way through it. What mirrors show of the sky is wide, and
//! samples of materials find it.

use std::sync::Arc;

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::{Bsdf, SUN_RADIUS, Scene};

use crate::bsdf::{Scatter, Tables};
use crate::geometry::{ShadingFrame, cosine_hemisphere, cosine_pdf, triangle};
use crate::interface::Interface;
use crate::lights::{Aim, ChosenLight, LATER, Lights};
use crate::luminance::luminance;
use crate::panes::Panes;
use crate::sampled::Sampled;
use crate::sampler::{NumberPurpose, Sampler};
use crate::shading::{self, PathArrival};
use crate::sky::PreparedSky;
use crate::suns::Suns;
use crate::surface::TracedMaterial;
use holo_optics::{mirrored, pane};

/// Number of light paths for each kind of light source.
const PATHS: u32 = 1 << 16;
/// Most casters of a light path.
const DEPTH: u32 = 12;
/// Roughness above which metal and glass are too wide to be casters.
const WIDE: f32 = 0.4;
/// Light paths per area that begin at a pane, relative to other casters. Panes reflect little.
const PANES: f64 = 0.1;
/// Distance of suns and sky over the scene's diagonal. At this distance, rays to them are parallel
/// within the precision of f32.
const FAR: f32 = 1e5;
/// Half angle of the cone of a photon from a sun over that of the disc. Less would leave parts of
/// the disc to chance, after rounding.
const AROUND_SUN: f64 = 1.02;
/// The least half angle of the cones of other photons, radians: that of 1°.
const AROUND_LAMP: f64 = 0.017_453;
/// Seed of the light paths; any number will do.
const SEED: u64 = 0x0CA5;

/// Light that arrives at a wide surface from a caster.
#[derive(Clone, Copy, Debug)]
pub(super) struct Photon {
    pub point: Vec3,
    /// Normal on the side at which the light arrives.
    pub normal: Vec3,
    /// The point from which the light seems to come, for observers near `point`.
    pub from: Vec3,
    /// Luminous flux without the factor of units: irradiance by luminance times area.
    pub flux: f32,
    /// Least squared chord between the middle and the edge of its cone, on the unit sphere.
    pub least_chord2: f32,
}

/// What light paths begin with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSources<'a> {
    pub lights: &'a Lights,
    pub suns: &'a Suns,
    pub sky: &'a PreparedSky,
    pub panes: &'a Panes,
}

/// A kind of light source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PhotonSource {
    Lamps,
    Suns,
    Sky,
}

/// The surfaces that throw light.
#[derive(Debug)]
pub(super) struct Casters {
    /// Indexed by material; `None` for materials that are no casters.
    scatters: Vec<Option<Scatter>>,
    triangles: Vec<u32>,
    /// Sums of the triangles' shares of light paths.
    sums: Vec<f64>,
    /// One bit per triangle of the scene.
    members: Vec<u64>,
}

impl Casters {
    /// Finds the casters of a scene. `None` if there are none.
    pub(super) fn new(scene: &Scene) -> Option<Self> {
        let mut tables = Tables::default();
        let scatters: Vec<_> = scene
            .materials
            .iter()
            .map(|material| match material.bsdf {
                _ if material.emits() => None,
                Bsdf::Dielectric { ior, transmittance, alpha } if alpha < WIDE => {
                    Some(Scatter::dielectric(ior, transmittance.into(), alpha, |ggx| {
                        Arc::new(Interface::without_compensation(ggx, ior))
                    }))
                }
                Bsdf::Conductor { alpha, .. } if alpha >= WIDE => None,
                bsdf @ (Bsdf::Mirror { .. } | Bsdf::Conductor { .. } | Bsdf::ThinGlass { .. }) => {
                    Some(Scatter::new(&bsdf, &mut tables))
                }
                _ => None,
            })
            .collect();
        let mut casters = Self {
            scatters,
            triangles: Vec::new(),
            sums: Vec::new(),
            members: vec![0; scene.triangles().len().div_ceil(64)],
        };
        let mut sum = 0.0;
        for (t, material) in (0_u32..).zip(scene.material_ids()) {
            let Some(scatter) = &casters.scatters[material as usize] else { continue };
            sum += scene.area(t) * share(scatter);
            casters.triangles.push(t);
            casters.sums.push(sum);
            casters.members[t as usize / 64] |= 1 << (t % 64);
        }
        (sum > 0.0 && sum.is_finite()).then_some(casters)
    }

    #[inline]
    pub(super) fn contain(&self, triangle: u32) -> bool {
        self.members[triangle as usize / 64] >> (triangle % 64) & 1 != 0
    }

    fn scatter(&self, scene: &Scene, triangle: u32) -> Option<&Scatter> {
        self.scatters[scene.material_id(triangle) as usize].as_ref()
    }
}

/// Returns the light paths per area that begin at a caster, in an arbitrary unit.
fn share(scatter: &Scatter) -> f64 {
    if matches!(scatter, Scatter::Pane { .. }) { PANES } else { 1.0 }
}

/// Traces all light paths.
pub(super) fn shoot(
    raycaster: &Raycaster,
    surfaces: &[TracedMaterial],
    sources: &LightSources,
    casters: &Casters,
) -> Vec<Photon> {
    let scene = raycaster.scene();
    let (low, high) = scene.bounds();
    let far = FAR * (high - low).length() as f32;
    let shooter = Shooter { raycaster, surfaces, sources, casters, far };
    let has_lamps = !(sources.lights.triangles().is_empty() && sources.lights.points().is_empty());
    let has_sky = sources.sky.mean() > 0.0 && casters.scatters.iter().flatten().any(is_solid);
    let kinds = [
        (PhotonSource::Lamps, has_lamps),
        (PhotonSource::Suns, sources.suns.any()),
        (PhotonSource::Sky, has_sky),
    ];
    let kinds = kinds.into_iter().filter(|(_, is_there)| *is_there).map(|(kind, _)| kind);
    let flux_of_path = casters.sums.last().map_or(0.0, |sum| sum / f64::from(PATHS)) as f32;
    let photons =
        kinds.flat_map(|kind| (0..PATHS).filter_map(move |path| shooter.shoot(kind, path)));
    photons.map(|photon| Photon { flux: photon.flux * flux_of_path, ..photon }).collect()
}

/// Returns whether a caster is solid glass, through which no light sample goes.
fn is_solid(scatter: &Scatter) -> bool {
    matches!(scatter, Scatter::Clear { .. } | Scatter::Smooth { .. } | Scatter::Rough { .. })
}

#[derive(Clone, Copy)]
struct Shooter<'a> {
    raycaster: &'a Raycaster,
    surfaces: &'a [TracedMaterial],
    sources: &'a LightSources<'a>,
    casters: &'a Casters,
    /// Distance of suns and sky.
    far: f32,
}

/// Light that arrives at a caster.
struct Arriving {
    point: SurfacePoint,
    hit: Hit,
    /// Towards where the light comes from.
    back: Vec3,
    weight: f32,
    /// Length of the path from the lamp.
    length: f32,
    /// Size of the lamp.
    lamp: f32,
    /// See [`Photon`].
    least_chord2: f32,
}

/// Light that arrives from a light source.
struct ArrivingLight {
    /// Unit direction towards the source.
    back: Vec3,
    length: f32,
    /// Size of the source.
    size: f32,
    /// Radiance by luminance over the density of the choice per solid angle.
    intensity: f32,
    least_chord2: f32,
}

impl Shooter<'_> {
    /// Returns where a light path ends. `None` if it ends nowhere.
    fn shoot(&self, kind: PhotonSource, path: u32) -> Option<Photon> {
        let mut sampler = Sampler::new(SEED + kind as u64, u64::from(path));
        let mut light = self.begin(kind, &mut sampler)?;
        let mut has_passed = false;
        let scene = self.raycaster.scene();
        for depth in 0..DEPTH {
            let scatter = self.casters.scatter(scene, light.point.triangle)?;
            let front = light.back.dot(light.point.normal) > 0.0;
            let facing = if front { light.point.normal } else { -light.point.normal };
            let frame = ShadingFrame::new(self.normal(&light, scatter, facing));
            let wo = frame.to_local(light.back);
            if wo.z <= 0.0 {
                return None;
            }
            sampler.turn(depth, NumberPurpose::Scatter);
            let sampled = match scatter {
                // Light that goes straight through a pane is found without photons.
                Scatter::Pane { ior, .. } if depth == 0 => {
                    Sampled::delta(mirrored(wo), Vec3::splat(pane(wo.z, *ior)))?
                }
                _ => scatter.sample(wo, front, &mut sampler)?,
            };
            let direction = frame.to_world(sampled.wi);
            if direction.dot(facing) * sampled.wi.z <= 0.0 {
                return None;
            }
            has_passed |= sampled.wi.z < 0.0;
            let SurfacePoint { point, error, normal, triangle } = light.point;
            let ray = Ray::new(spawn(point, error, normal, direction), direction);
            let hit = self.raycaster.nearest_from(&ray, triangle)?;
            let weight = light.weight * luminance((sampled.weight * sampled.eta2).to_array());
            let length = light.length + hit.t;
            let met = self.raycaster.surface(hit.triangle, hit.u, hit.v);
            if self.casters.contain(hit.triangle) {
                light = Arriving { point: met, hit, back: -direction, weight, length, ..light };
                continue;
            }
            let material = scene.material_id(hit.triangle);
            let is_usable =
                weight > 0.0 && weight.is_finite() && (has_passed || kind != PhotonSource::Sky);
            if !is_usable || !self.surfaces[material as usize].scatter.is_wide() {
                return None;
            }
            // From a point nearby, a large mirror shows the lamp at its place behind the mirror. A
            // small mirror is a source of its own.
            let caster = (scene.area(triangle) as f32).sqrt();
            let is_small = caster * length < light.lamp * hit.t;
            let distance = if is_small { hit.t } else { length };
            let arrives_in_front = direction.dot(met.normal) < 0.0;
            return Some(Photon {
                point: met.point,
                normal: if arrives_in_front { met.normal } else { -met.normal },
                from: met.point - direction * distance,
                flux: weight,
                least_chord2: light.least_chord2,
            });
        }
        None
    }

    /// Returns the normal of a caster, with its smooth normal and texture of normals.
    fn normal(&self, light: &Arriving, scatter: &Scatter, facing: Vec3) -> Vec3 {
        if self.raycaster.scene().shading.is_none() {
            return facing;
        }
        let look = PathArrival { towards_eye: light.back, width: 0.0 };
        shading::normals(self.raycaster, &light.hit, scatter, facing, &look).1
    }

    /// Returns light that arrives straight from a light source at a random point of a caster.
    fn begin(&self, kind: PhotonSource, sampler: &mut Sampler) -> Option<Arriving> {
        let Self { raycaster, casters, .. } = *self;
        sampler.turn(0, NumberPurpose::Aim);
        let (first, second) = sampler.pairs(1).at(0);
        let whole = *casters.sums.last()?;
        let at = casters.sums.partition_point(|&sum| sum <= first * whole);
        let chosen = *casters.triangles.get(at)?;
        let (u, v) = triangle([sampler.one(), second]);
        let point = raycaster.surface(chosen, u, v);
        let scatter = casters.scatter(raycaster.scene(), chosen)?;
        let incoming = match kind {
            PhotonSource::Lamps => self.lamp(&point, sampler)?,
            PhotonSource::Suns => self.sun(&point, sampler)?,
            PhotonSource::Sky => self.sky(&point, scatter, sampler)?,
        };
        let ArrivingLight { back, length, size, intensity, least_chord2 } = incoming;
        let weight = intensity * back.dot(point.normal).abs() / share(scatter) as f32;
        let hit = Hit { t: 0.0, triangle: chosen, u, v };
        let arriving = Arriving { point, hit, back, weight, length, lamp: size, least_chord2 };
        (weight > 0.0).then_some(arriving)
    }

    /// Returns the light of a lamp that arrives at a point.
    fn lamp(&self, point: &SurfacePoint, sampler: &mut Sampler) -> Option<ArrivingLight> {
        let Self { raycaster, sources: LightSources { lights, panes, .. }, .. } = *self;
        let scene = raycaster.scene();
        sampler.turn(0, NumberPurpose::Light);
        let (first, second) = sampler.pairs(1).at(0);
        let seen = lights.at_vertex(point.point, Vec3::ZERO, LATER);
        let least_chord2 = chord2(AROUND_LAMP);
        let (lamp, probability, rest) = match lights.choose(&seen, first)? {
            ChosenLight::Triangle { triangle, probability, rest } => (triangle, probability, rest),
            ChosenLight::Point { point: lamp, probability } => {
                let towards = lamp.position - point.point;
                let (length, back) = (towards.length(), towards.try_normalize()?);
                let passed = panes.between(raycaster, point, &lamp.place());
                let arriving = luminance((lamp.intensity(-back) * passed).to_array());
                let intensity = arriving / (length * length * probability);
                return Some(ArrivingLight {
                    back,
                    length,
                    size: lamp.radius,
                    intensity,
                    least_chord2,
                });
            }
            ChosenLight::Sky { .. } => return None,
        };
        let aim = Aim::new(point.point, raycaster.vertices(lamp));
        let (u, v) = aim.sample([rest, second]);
        let on_lamp = raycaster.surface(lamp, u, v);
        let towards = on_lamp.point - point.point;
        let length = towards.length();
        let back = towards.try_normalize()?;
        let emitter = &self.surfaces[scene.material_id(lamp) as usize];
        let cosine = -back.dot(on_lamp.normal);
        if !(cosine > 0.0 || emitter.two_sided && cosine < 0.0) {
            return None;
        }
        let passed = luminance(panes.between(raycaster, point, &on_lamp).to_array());
        let density = probability * aim.density(length * length, cosine.abs());
        let intensity = passed * luminance(emitter.emission_towards(-back).to_array()) / density;
        let size = (scene.area(lamp) as f32).sqrt();
        Some(ArrivingLight { back, length, size, intensity, least_chord2 })
    }

    /// Returns the light of the middle of a sun that arrives at a point.
    fn sun(&self, point: &SurfacePoint, sampler: &mut Sampler) -> Option<ArrivingLight> {
        let LightSources { suns, panes, .. } = self.sources;
        sampler.turn(0, NumberPurpose::Sun);
        let (back, irradiance) = suns.choose_middle(sampler.one())?;
        let passed = panes.to_sky(self.raycaster, point, back);
        Some(ArrivingLight {
            back,
            length: self.far,
            size: 2.0 * SUN_RADIUS as f32 * self.far,
            intensity: luminance((irradiance * passed).to_array()),
            least_chord2: chord2(AROUND_SUN * SUN_RADIUS),
        })
    }

    /// Returns light of the sky that arrives at a point of solid glass.
    fn sky(
        &self,
        point: &SurfacePoint,
        scatter: &Scatter,
        sampler: &mut Sampler,
    ) -> Option<ArrivingLight> {
        if !is_solid(scatter) {
            return None;
        }
        sampler.turn(0, NumberPurpose::Light);
        let normal = if sampler.one() < 0.5 { point.normal } else { -point.normal };
        let mut uniform = sampler.two();
        let (back, cosine) = match self.sources.sky.aim(&mut uniform) {
            Some(direction) => (direction, direction.dot(normal).abs()),
            None => {
                let local = cosine_hemisphere(uniform);
                (ShadingFrame::new(normal).to_world(local), local.z)
            }
        };
        let passed = self.sources.panes.to_sky(self.raycaster, point, back);
        let sky = self.sources.sky.along(back) * passed;
        let density = self.sources.sky.mixed(back, 1.0, 0.5 * cosine_pdf(cosine));
        Some(ArrivingLight {
            back,
            length: self.far,
            size: self.far,
            intensity: luminance(sky.to_array()) / density,
            least_chord2: chord2(AROUND_LAMP),
        })
    }
}

/// Returns the squared chord of an angle on the unit sphere.
fn chord2(angle: f64) -> f32 {
    (2.0 * (0.5 * angle).sin()).powi(2) as f32
}
