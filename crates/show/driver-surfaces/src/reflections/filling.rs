//! Fills cubes from stored light: each texel's ray is followed from the object's centre to what it
//! shows, and takes the light that is stored there. Nothing is traced.
//!
//! Invariant: a texel without stored light stays as it was.

use super::{ObjectCube, Reflections, is_open};
use crate::known::LightMemory;
use crate::store::LightStore;
use crate::trail::{AtPanes, Follower, RayContent, Trail, TrailEnd};
use glam::Vec3;
use holo_raycast::{NO_TRIANGLE, Ray};
use holo_reflection_cube::ReflectionSample;
use rayon::prelude::*;
use std::cmp::Reverse;

/// Texels that are filled in one go: about 5 ms on two cores.
const TEXELS: usize = 1 << 12;

/// All texels are filled again once the samples have grown by this factor, and by so many more.
const GROWTH: u64 = 2;
const LEAST_NEW: u64 = 10_000;

/// Views that count as the last ones: those of two eyes, and of probes of carried objects.
const LAST_VIEWS: u64 = 16;

/// Surfaces of the object itself that a ray from its centre passes.
const MOST_PASSED: usize = 32;

/// The light that is known of a scene.
#[derive(Clone, Copy)]
pub(crate) struct LightSources<'a> {
    pub follower: Follower<'a>,
    pub store: &'a LightStore,
    pub known: &'a LightMemory,
}

impl Reflections {
    /// Fills some texels of an object that one of the last views shows, the latest first. Returns
    /// true if more are left.
    pub fn fill(&mut self, sources: &LightSources) -> bool {
        let samples = sources.store.samples();
        let (objects, views) = (&self.objects, self.views);
        let is_due =
            |filled: &ObjectCube| filled.view + LAST_VIEWS > views && filled.is_due(samples);
        let due = || self.cubes.iter().filter(|(_, filled)| is_due(filled));
        let others = due().nth(1).is_some();
        let latest = due().max_by_key(|(object, filled)| (filled.view, Reverse(**object)));
        let Some(object) = latest.map(|(&object, _)| object) else { return false };
        let Some(filled) = self.cubes.get_mut(&object) else { return false };
        if filled.is_open.is_none() {
            filled.is_open = Some(is_open(objects, object, sources.follower.raycaster));
        }
        if filled.next == 0 {
            filled.samples = samples;
        }
        let texels = filled.next..(filled.next + TEXELS).min(filled.cube.grid().len());
        let cube = &filled.cube;
        let generation = filled.round;
        let own = |triangle: u32| objects.of(triangle) == Some(object);
        let sample = |texel: usize| {
            let direction = cube.grid().direction_of(texel);
            let width = 2.0 / cube.grid().resolution() as f32;
            let ray = Ray::new(cube.centre(), direction);
            let (radiance, distance) = sources.along(ray, width, own)?;
            let origin = cube.centre();
            let radiance = radiance.to_array();
            Some(ReflectionSample { origin, direction, distance, radiance, count: 1, generation })
        };
        let found: Vec<_> = texels.clone().into_par_iter().filter_map(sample).collect();
        for sample in &found {
            filled.cube.insert(sample);
        }
        filled.next = texels.end;
        if filled.next == filled.cube.grid().len() {
            filled.begin_round(filled.samples);
        }
        others || filled.is_due(samples)
    }
}

impl ObjectCube {
    /// Returns whether texels are left to fill, with so many samples in the store.
    fn is_due(&self, samples: u64) -> bool {
        let is_new = samples >= GROWTH * self.samples + LEAST_NEW;
        self.next > 0 || self.round == 1 || is_new
    }
}

impl LightSources<'_> {
    /// Returns the radiance along a ray and the distance to what it shows. `width` is that of the
    /// texel at distance 1. The ray passes the triangles for which `own` is true. `None` if nothing
    /// is known, or if a mirror shows only a part of it.
    fn along(&self, mut ray: Ray, width: f32, own: impl Fn(u32) -> bool) -> Option<(Vec3, f32)> {
        let Follower { raycaster, materials, .. } = self.follower;
        let mut left = NO_TRIANGLE;
        for _ in 0..MOST_PASSED {
            let Some(hit) = raycaster.nearest_from(&ray, left) else {
                return Some((materials.sky_seen(ray.direction).into(), f32::INFINITY));
            };
            if own(hit.triangle) {
                (left, ray.t_min) = (hit.triangle, hit.t);
                continue;
            }
            let mut trail = Trail::new(ray, hit, AtPanes::Pass);
            let shown = self.follower.follow_to_end(&mut trail);
            if trail.passes_mirror() {
                return None;
            }
            let mut radiance = Vec3::ZERO;
            for end in trail.take_covers() {
                radiance += self.of_end(&end, width)?;
            }
            let (behind, distance) = match &shown {
                RayContent::Surface(end) if end.is_mirrored => (self.of_end(end, width)?, hit.t),
                RayContent::Surface(end) => (self.of_end(end, width)?, end.length),
                RayContent::Sky(share, direction) => {
                    let sky = Vec3::from(materials.sky_seen(*direction)) * Vec3::from(*share);
                    (sky, if trail.turns() { hit.t } else { f32::INFINITY })
                }
                RayContent::Light(..) | RayContent::Unknown => return None,
            };
            return Some((radiance + behind, distance));
        }
        None
    }

    /// Returns the radiance that comes back from the surface at the end of a way.
    fn of_end(&self, end: &TrailEnd, width: f32) -> Option<Vec3> {
        let finish = self.follower.finish(end.material);
        let (share, width) = (Vec3::from(end.share), width * end.length);
        if finish.shines(end.front) {
            let glow = Vec3::from(self.follower.glow(end, width));
            return Some(share * Vec3::from(finish.emission) * glow);
        }
        let found = self.known.on(finish, end, width);
        let light = found.or_else(|| {
            let serves =
                |face: crate::cell::FaceClass| face.serves(end.normal, end.material, end.direction);
            let sums = self.store.around(end.point, serves);
            (sums.count > 0).then(|| sums.mean())
        })?;
        let reflectance = finish.reflectance_by(self.follower.texture(end, width));
        Some(share * Vec3::from(reflectance) * light * self.follower.materials.unit)
    }
}
