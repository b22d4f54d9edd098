//! Light paths from lamps over mirrors, glass and metal, up to the first wide surface.
//!
//! A path begins at a random point of a caster: a mirror, glass or narrow metal. The lamps are
//! sampled from there, and the light goes on as the caster scatters it. So small casters get as
//! many photons for their area as large ones.

use std::sync::Arc;

use glam::Vec3;
use holo_raycast::{Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::{Bsdf, Scene};

use crate::bsdf::{Scatter, Tables};
use crate::fresnel::{mirrored, pane};
use crate::geometry::{Frame, triangle};
use crate::interface::Interface;
use crate::lights::{Aim, Chosen, LATER, Lights};
use crate::luminance::luminance;
use crate::panes::Panes;
use crate::sampled::Sampled;
use crate::sampler::{Purpose, Sampler};
use crate::surface::Surface;

/// Number of light paths.
const PATHS: u32 = 1 << 16;
/// Most casters of a light path.
const DEPTH: u32 = 12;
/// Roughness above which metal and glass are too wide to be casters.
const WIDE: f32 = 0.4;
/// Light paths per area that begin at a pane, relative to other casters. Panes reflect little.
const PANES: f64 = 0.1;
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
    surfaces: &[Surface],
    lights: &Lights,
    panes: &Panes,
    casters: &Casters,
) -> Vec<Photon> {
    let shooter = Shooter { raycaster, surfaces, lights, panes, casters };
    if lights.triangles().is_empty() {
        return Vec::new();
    }
    let flux_of_path = casters.sums.last().map_or(0.0, |sum| sum / f64::from(PATHS)) as f32;
    let photons = (0..PATHS).filter_map(|path| shooter.shoot(path));
    photons.map(|photon| Photon { flux: photon.flux * flux_of_path, ..photon }).collect()
}

struct Shooter<'a> {
    raycaster: &'a Raycaster,
    surfaces: &'a [Surface],
    lights: &'a Lights,
    panes: &'a Panes,
    casters: &'a Casters,
}

/// Light that arrives at a caster.
struct Arriving {
    point: SurfacePoint,
    /// Towards where the light comes from.
    back: Vec3,
    weight: f32,
    /// Length of the path from the lamp.
    length: f32,
    /// Size of the lamp.
    lamp: f32,
}

impl Shooter<'_> {
    /// Returns where a light path ends. `None` if it ends nowhere.
    fn shoot(&self, path: u32) -> Option<Photon> {
        let mut sampler = Sampler::new(SEED, u64::from(path));
        let mut light = self.begin(&mut sampler)?;
        let scene = self.raycaster.scene();
        for depth in 0..DEPTH {
            let scatter = self.casters.scatter(scene, light.point.triangle)?;
            let front = light.back.dot(light.point.normal) > 0.0;
            let normal = if front { light.point.normal } else { -light.point.normal };
            let frame = Frame::new(normal);
            let wo = frame.to_local(light.back);
            if wo.z <= 0.0 {
                return None;
            }
            sampler.turn(depth, Purpose::Scatter);
            let sampled = match scatter {
                // Light that goes straight through a pane is found without photons.
                Scatter::Pane { ior, .. } if depth == 0 => {
                    Sampled::delta(mirrored(wo), Vec3::splat(pane(wo.z, *ior)))?
                }
                _ => scatter.sample(wo, front, &mut sampler)?,
            };
            let direction = frame.to_world(sampled.wi);
            let SurfacePoint { point, error, normal, triangle } = light.point;
            let ray = Ray::new(spawn(point, error, normal, direction), direction);
            let hit = self.raycaster.nearest_from(&ray, triangle)?;
            let weight = light.weight * luminance((sampled.weight * sampled.eta2).to_array());
            let length = light.length + hit.t;
            let met = self.raycaster.surface(hit.triangle, hit.u, hit.v);
            if self.casters.contain(hit.triangle) {
                light = Arriving { point: met, back: -direction, weight, length, ..light };
                continue;
            }
            let material = scene.material_id(hit.triangle);
            let is_usable = weight > 0.0 && weight.is_finite();
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
            });
        }
        None
    }

    /// Returns light that arrives straight from a lamp at a random point of a caster.
    fn begin(&self, sampler: &mut Sampler) -> Option<Arriving> {
        let Self { raycaster, casters, .. } = *self;
        let scene = raycaster.scene();
        sampler.turn(0, Purpose::Aim);
        let (first, second) = sampler.pairs(1).at(0);
        let whole = *casters.sums.last()?;
        let at = casters.sums.partition_point(|&sum| sum <= first * whole);
        let chosen = *casters.triangles.get(at)?;
        let (u, v) = triangle([sampler.one(), second]);
        let point = raycaster.surface(chosen, u, v);
        sampler.turn(0, Purpose::Light);
        let (first, second) = sampler.pairs(1).at(0);
        let seen = self.lights.at_vertex(point.point, Vec3::ZERO, LATER);
        let Chosen::Triangle { triangle: lamp, probability, rest } =
            self.lights.choose(&seen, first)?
        else {
            return None;
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
        let passed = luminance(self.panes.between(raycaster, &point, &on_lamp).to_array());
        let density = probability * aim.density(length * length, cosine.abs());
        let irradiance =
            luminance(emitter.emission.to_array()) * back.dot(point.normal).abs() / density;
        let by_share = share(casters.scatter(scene, chosen)?) as f32;
        let size = (scene.area(lamp) as f32).sqrt();
        let weight = passed * irradiance / by_share;
        (weight > 0.0).then_some(Arriving { point, back, weight, length, lamp: size })
    }
}
