//! One step of a path: the next direction, Russian roulette, and the ray to the next surface.

use glam::Vec3;
use holo_raycast::{Ray, Raycaster, spawn};

use super::{EmissionWeight, OutgoingVertex, Path, SCATTERED_SPREAD};
use crate::aim::LobeChoice;
use crate::bsdf::Scatter;
use crate::engine::PathEngine;
use crate::sampled::Sampled;
use crate::sampler::{NumberPurpose, Sampler};
use crate::shading;

/// Roulette applies from this number of scatterings on. Mirrors and glass do not count.
const ROULETTE_SCATTERINGS: u32 = 2;
/// Factor between a path's throughput and its probability of survival (docs/notes/path-tracing.md).
const ROULETTE_FACTOR: f32 = 3.0;
/// Roulette applies to all paths from this number of surfaces on, because mirrors and glass absorb
/// little.
const ROULETTE_DEPTH: u32 = 5;
/// From this number of surfaces on, the greatest probability of survival is [`CEILING_OF_LONG`].
/// Light in a white room meets fewer surfaces before its lamp absorbs it.
const LONG: u32 = 300;
const CEILING_OF_LONG: f32 = 0.99;

impl PathEngine {
    /// Samples the next direction and traces the ray; returns whether the path continues. A ray of
    /// a mirror or of smooth glass is not traced if `ends` returns true for it.
    #[inline]
    pub(super) fn sample_next(
        &self,
        raycaster: &Raycaster,
        path: &mut Path,
        vertex: &OutgoingVertex,
        sampler: &mut Sampler,
        ends: impl FnOnce(&mut Path, &Ray) -> bool,
    ) -> bool {
        let OutgoingVertex { point, ref frame, wo, front, scatter, aims, .. } = *vertex;
        let depth = path.depth;
        let choice = aims.as_ref().map_or(LobeChoice::Material, |aims| {
            sampler.turn(depth, NumberPurpose::Aim);
            aims.choose(raycaster, sampler)
        });
        let sampled = match &choice {
            LobeChoice::Material => {
                sampler.turn(depth, NumberPurpose::Scatter);
                scatter.sample(wo, front, sampler)
            }
            LobeChoice::Source(target) if target.triangle != point.triangle => {
                let direction = (target.point - point.point).normalize_or_zero();
                scatter.towards(wo, frame.to_local(direction), front)
            }
            LobeChoice::Caustic(direction) => {
                scatter.towards(wo, frame.to_local(*direction), front)
            }
            LobeChoice::Source(_) | LobeChoice::Nothing => None,
        };
        let Some(sampled) = sampled else { return false };
        path.throughput *= sampled.weight * self.terminator(vertex, &sampled);
        path.eta2 *= sampled.eta2;
        if path.scatterings >= ROULETTE_SCATTERINGS || depth >= ROULETTE_DEPTH {
            // Radiance inside glass is greater by eta2: without that factor, roulette would end
            // paths because they entered glass. Secondary sources and caustics are brighter than
            // `aimed_by` lowers the throughput: without that factor, the few survivors would be as
            // noisy as unaimed paths.
            let light = (path.worth * path.throughput).max_element();
            let worth = ROULETTE_FACTOR * light * path.eta2 * path.aimed_by;
            let survival = worth.min(if depth < LONG { 1.0 } else { CEILING_OF_LONG });
            sampler.turn(depth, NumberPurpose::Roulette);
            if sampler.one() >= survival {
                return false;
            }
            path.throughput /= survival;
        }
        if path.throughput == Vec3::ZERO {
            return false;
        }
        let ray = self.leave(path, vertex, &sampled);
        if scatter.is_delta() && ends(path, &ray) {
            return false;
        }
        path.hit = raycaster.nearest_from(&ray, point.triangle);
        path.depth += 1;
        if let (Some(aims), Some(pdf)) = (&aims, sampled.pdf) {
            let way = (path.direction, pdf);
            let Some(weight) = aims.weight(raycaster, way, &choice, path.hit.as_ref()) else {
                return false;
            };
            path.throughput *= weight.weight;
            path.footprint.multiply_density(weight.weight.recip());
            if weight.is_aimed {
                path.aimed_by /= weight.weight;
            }
        }
        true
    }

    /// Returns the factor with which a smooth normal dims a sampled direction; 1 on facets.
    #[inline]
    pub(super) fn terminator(&self, vertex: &OutgoingVertex, sampled: &Sampled) -> f32 {
        if !self.is_shaded {
            return 1.0;
        }
        let direction = vertex.frame.to_world(sampled.wi);
        let is_smooth = sampled.pdf.is_some();
        shading::terminator(&vertex.frame, vertex.point.normal, direction, sampled.wi.z, is_smooth)
    }

    /// Lets a path leave a surface in a sampled direction. Returns its ray.
    #[inline]
    fn leave(&self, path: &mut Path, vertex: &OutgoingVertex, sampled: &Sampled) -> Ray {
        let OutgoingVertex { point, error, ref frame, scatter, beyond, light_sampling, .. } =
            *vertex;
        if let Some(beyond) = beyond.filter(|_| sampled.wi.z < 0.0) {
            path.inside = *beyond;
        }
        // Light samples have also found what is straight ahead behind a pane.
        let straight = matches!(scatter, Scatter::Pane { .. }) && sampled.wi.z < 0.0;
        path.passed_pane = straight;
        if !straight {
            path.emission_weight = match sampled.pdf.zip(light_sampling) {
                Some((pdf, lights)) => {
                    EmissionWeight::Combined(lights.material_sample(pdf, scatter, sampled.wi))
                }
                None => EmissionWeight::Full,
            };
        }
        if let Some(density) = sampled.pdf {
            path.spread = path.spread.max(SCATTERED_SPREAD);
            path.footprint.leave(density);
        }
        path.direction = frame.to_world(sampled.wi);
        path.origin = spawn(point.point, error, point.normal, path.direction);
        Ray::new(path.origin, path.direction)
    }
}
