//! The rays of one record.

use std::cell::Cell;
use std::f32::consts::FRAC_1_PI;
use std::sync::atomic::Ordering;

use glam::Vec3;
use holo_light::{Arrival, Hemisphere, Record, Source, limit_outliers};
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};

use super::settings::{AIMED, Kind};
use super::{CachePolicy, Cached, Quality, Role};
use crate::engine::PathEngine;
use crate::geometry::Frame;
use crate::images::{ImageSampling, Images};
use crate::medium::Inside;
use crate::path::{EmissionWeight, Start};
use crate::policy::ShadingPoint;
use crate::sampler::{Purpose, Sampler, mix};
use crate::secondary::AimedVertex;
use crate::shading;
use crate::weighting::power_heuristic;

impl Cached {
    /// Traces the rays of a record over the hemisphere, and aims more at secondary sources and at
    /// images of lamps. All kinds are combined (Veach 1997, §9.2.4, balance heuristic; power
    /// heuristic for images). No hemisphere ray may bring more than a share `most_per_ray` of the
    /// light of all.
    pub(super) fn gather(
        &self,
        engine: &PathEngine,
        at: &ShadingPoint,
        quality: &Quality,
        rays: u32,
        kind: Kind,
        most_per_ray: f32,
    ) -> Record {
        let &ShadingPoint { raycaster, point, normal, inside, .. } = at;
        let number = self.made.fetch_add(1, Ordering::Relaxed);
        let id = mix(self.salt.wrapping_add(mix(number)));
        let frame = Frame::new(normal);
        let hemisphere = Hemisphere::new(rays);
        let aimed_count = (hemisphere.rays() as f32 * AIMED) as u32;
        let aimed = engine.secondary.as_ref().map(|sources| sources.aimed_from(point, normal));
        let source_rays = if aimed.is_some() { aimed_count } else { 0 };
        let images = Images::visible_from(
            raycaster,
            &engine.lights,
            &engine.panes,
            &self.mirrors,
            [point.point, normal],
        );
        let image_rays = if images.is_some() { aimed_count } else { 0 };
        let role = match kind {
            Kind::Exact => Role::Record,
            Kind::Coarse => Role::Coarse,
        };
        let gathering = Gathering {
            policy: CachePolicy { cached: self, engine, role: Cell::new(role) },
            raycaster,
            point,
            normal,
            inside,
            aimed,
            images,
            hemisphere_rays: hemisphere.rays(),
            source_rays,
            image_rays,
        };
        let mut arrivals: Vec<Arrival> = (0..hemisphere.rays())
            .map(|index| {
                let mut sampler = Sampler::new(id, u64::from(index));
                sampler.turn(0, Purpose::Scatter);
                let direction = frame.to_world(hemisphere.direction(index, sampler.two()));
                gathering.hemisphere_ray(direction, &mut sampler)
            })
            .collect();
        limit_outliers(&mut arrivals, most_per_ray);
        let mut record = hemisphere.record(&arrivals, [frame.s, frame.t, normal]);
        record.point = point.point.to_array();
        record.id = id;
        let mut next = hemisphere.rays();
        let mut samplers = |count: u32| {
            let first = next;
            next += count;
            (0..count).map(move |index| (index, Sampler::new(id, u64::from(first + index))))
        };
        let sources: Vec<Source> = samplers(source_rays)
            .map(|(index, mut sampler)| {
                gathering.source_ray(index, &mut sampler).unwrap_or_default()
            })
            .collect();
        record.add(&sources);
        let images: Vec<Source> = samplers(image_rays)
            .map(|(index, mut sampler)| {
                gathering.image_ray(index, &mut sampler).unwrap_or_default()
            })
            .collect();
        record.add(&images);
        self.effort.add_rays(next);
        record.radius = (record.radius * quality.reach).min(quality.max_radius);
        record
    }
}

/// The rays of one record.
struct Gathering<'a> {
    policy: CachePolicy<'a>,
    raycaster: &'a Raycaster,
    point: &'a SurfacePoint,
    normal: Vec3,
    /// The solids that contain the point.
    inside: &'a Inside,
    /// Set if the scene has secondary sources.
    aimed: Option<AimedVertex<'a>>,
    /// Set if mirrors may show lamps here.
    images: Option<Images<'a>>,
    /// Number of rays over the hemisphere.
    hemisphere_rays: u32,
    /// Number of rays aimed at secondary sources.
    source_rays: u32,
    /// Number of rays aimed at images of lamps.
    image_rays: u32,
}

impl Gathering<'_> {
    fn nearest(&self, direction: Vec3) -> Option<Hit> {
        let ray = Ray::new(
            spawn(self.point.point, self.point.error, self.point.normal, direction),
            direction,
        );
        self.raycaster.nearest_from(&ray, self.point.triangle)
    }

    /// Returns the radiance along a ray, without light that comes straight from lamps and sky.
    fn radiance(&self, hit: Option<Hit>, direction: Vec3, sampler: &mut Sampler) -> Vec3 {
        let image_sampling = self.images.as_ref().map(|images| ImageSampling {
            images,
            count: self.image_rays,
            others: self.hemisphere_density(direction.dot(self.normal).max(0.0)),
        });
        let start = Start {
            hit,
            direction,
            inside: *self.inside,
            emission_weight: EmissionWeight::Zero,
            image_sampling,
            depth: 1,
        };
        let radiance = self.policy.engine.follow(self.raycaster, start, &self.policy, sampler);
        if radiance.is_finite() { radiance } else { Vec3::ZERO }
    }

    /// Returns the expected number of hemisphere rays per solid angle at a cosine.
    fn hemisphere_density(&self, cosine: f32) -> f32 {
        self.hemisphere_rays as f32 * cosine * FRAC_1_PI
    }

    /// Returns the expected number of rays per solid angle towards a point, over the hemisphere and
    /// at secondary sources.
    fn density(&self, hit: Option<&Hit>, cosine: f32) -> f32 {
        let aimed = self
            .aimed
            .as_ref()
            .zip(hit)
            .map_or(0.0, |(aimed, hit)| aimed.density(self.raycaster, hit));
        self.hemisphere_density(cosine) + self.source_rays as f32 * aimed
    }

    /// Traces a ray over the hemisphere.
    fn hemisphere_ray(&self, direction: Vec3, sampler: &mut Sampler) -> Arrival {
        let direction = shading::above(self.point.normal, self.normal, direction);
        let hit = self.nearest(direction);
        let distance = hit.map_or(f32::INFINITY, |hit| hit.t.max(f32::MIN_POSITIVE));
        let cosine = direction.dot(self.normal).max(0.0);
        let share = self.hemisphere_density(cosine) / self.density(hit.as_ref(), cosine);
        let radiance = self.radiance(hit, direction, sampler);
        Arrival {
            radiance: if share.is_finite() { radiance * share } else { Vec3::ZERO },
            distance,
        }
    }

    /// Aims a ray at a secondary source; `None` if it brings nothing.
    fn source_ray(&self, index: u32, sampler: &mut Sampler) -> Option<Source> {
        sampler.turn(0, Purpose::Aim);
        let (first, second) = sampler.pairs(1).at(0);
        let stratified = (f64::from(index) + first) / f64::from(self.source_rays);
        let target = self.aimed.as_ref()?.target(self.raycaster, stratified, second)?;
        let towards = target.point - self.point.point;
        let direction = towards.try_normalize()?;
        let cosine = direction.dot(self.normal);
        let is_above = shading::is_above(self.point.normal, self.normal, direction);
        let hit = self
            .nearest(direction)
            .filter(|hit| cosine > 0.0 && is_above && hit.triangle == target.triangle)?;
        let radiance = self.radiance(Some(hit), direction, sampler);
        let irradiance = radiance * (cosine / self.density(Some(&hit), cosine));
        let material = self.raycaster.scene().material_id(target.triangle) as usize;
        let diffuse = self.policy.engine.surfaces[material].scatter.is_wide();
        let normal = diffuse.then_some(target.normal);
        irradiance.is_finite().then_some(Source { irradiance, towards, normal })
    }

    /// Aims a ray at an image of a lamp; `None` if it brings nothing.
    fn image_ray(&self, index: u32, sampler: &mut Sampler) -> Option<Source> {
        let images = self.images.as_ref()?;
        sampler.turn(0, Purpose::Image);
        let (first, second) = sampler.pairs(1).at(0);
        let stratified = (f64::from(index) + first) / f64::from(self.image_rays);
        let image = images.choose(stratified, second)?;
        let direction = image.towards.try_normalize()?;
        let cosine = direction.dot(self.normal);
        if cosine <= 0.0 {
            return None;
        }
        let material = self.raycaster.scene().material_id(image.triangle) as usize;
        let radiance = self.policy.engine.sampled_emission_at(
            self.raycaster,
            image.triangle,
            image.barycentrics,
            images.arrives_along(&image),
            self.policy.engine.surfaces[material].emission,
        ) * images.arriving(self.point, &image);
        let density = self.image_rays as f32 * image.density;
        let weight = power_heuristic(density, self.hemisphere_density(cosine));
        let irradiance = radiance * (cosine * weight / density);
        let (towards, normal) = (image.towards, image.normal);
        irradiance.is_finite().then_some(Source { irradiance, towards, normal: Some(normal) })
    }
}
