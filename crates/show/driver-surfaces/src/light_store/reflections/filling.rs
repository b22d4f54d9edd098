//! Fills cubes, a few texels at a time.
//!
//! Invariant: a texel of which nothing is known stays as it was.

use super::{ObjectCube, Reflections, is_open};
use glam::Vec3;
use holo_raycast::{Ray, Raycaster};
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

impl Reflections {
    /// Fills some texels of an object that one of the last views shows, the latest first. Returns
    /// true if more are left. `samples` is the number of samples in the store.
    ///
    /// `along` returns the radiance along a ray and the distance to what it shows; `None` if
    /// nothing is known. Its second argument is the width of the texel at distance 1. The ray
    /// passes the triangles for which the third is true.
    pub fn fill(
        &mut self,
        raycaster: &Raycaster,
        samples: u64,
        along: impl Fn(Ray, f32, &dyn Fn(u32) -> bool) -> Option<(Vec3, f32)> + Sync,
    ) -> bool {
        let (objects, views) = (&self.objects, self.views);
        let is_due =
            |filled: &ObjectCube| filled.view + LAST_VIEWS > views && filled.is_due(samples);
        let due = || self.cubes.iter().filter(|(_, filled)| is_due(filled));
        let others = due().nth(1).is_some();
        let latest = due().max_by_key(|(object, filled)| (filled.view, Reverse(**object)));
        let Some(object) = latest.map(|(&object, _)| object) else { return false };
        let Some(filled) = self.cubes.get_mut(&object) else { return false };
        if filled.is_open.is_none() {
            filled.is_open = Some(is_open(objects, object, raycaster));
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
            let (radiance, distance) = along(ray, width, &own)?;
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
