//! Cached reflections (Ruff, Clua and Fernandes 2013): a ray that leaves a shiny object ends in the
//! object's reflection cube if the cube knows its direction. Otherwise it is traced, and its light
//! goes into the cube.
//!
//! Pictures made so have a bias, because a texel serves many rays. It is the price of the method,
//! and the reason why [`Tracer::with_cached_reflections`](crate::Tracer::with_cached_reflections)
//! is off unless it is asked for.
//!
//! Only perfect mirrors and smooth glass use cubes: their rays have one direction. Rays inside
//! glass are always traced.

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster};
use holo_reflection_cube::{
    CubeAnswer, CubeLight, LEAST_RESOLUTION, ReflectionCube, ReflectionSample, bytes_of,
};
use holo_scene::{Scene, ShinyObjects};
use parking_lot::RwLock;

use crate::engine::PathEngine;
use crate::path::Start;
use crate::policy::{Carried, LeavingRay, PathPolicy};
use crate::sampler::Sampler;

/// Most bytes of all cubes. If cubes of the least resolution would take more, the last objects have
/// none.
const MOST_BYTES: usize = 3 << 29;

/// Most cubes that a path fills. Later rays are traced without filling one.
const MOST_LESSONS: usize = 4;

/// How reflections are cached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReflectionSettings {
    /// Texels along a side of a face. Fewer if all cubes would take more than 1.5 GiB.
    pub resolution: u32,
    /// Paths from which a texel answers. The paper's 1 suits pictures without noise only.
    pub least_paths: u16,
    /// Whether a ray finds the texel of the point that it hits. If not, it finds that of its
    /// direction, as in the paper.
    pub has_parallax: bool,
    /// Whether rays that may hit their own object are always traced. The paper's are not.
    pub traces_self_hits: bool,
}

impl Default for ReflectionSettings {
    fn default() -> Self {
        Self { resolution: 256, least_paths: 16, has_parallax: true, traces_self_hits: true }
    }
}

/// The state of all cubes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReflectionReport {
    /// Shiny objects.
    pub objects: usize,
    /// Texels of all cubes that were used.
    pub texels: usize,
    /// Texels with light.
    pub valid: usize,
    /// Texels whose rays are always traced.
    pub marked: usize,
    /// Memory of these cubes, bytes.
    pub bytes: usize,
}

/// The reflection cubes of a scene. Each is made when its object is met first.
#[derive(Debug)]
pub(crate) struct CachedReflections {
    objects: ShinyObjects,
    cubes: Vec<RwLock<Option<ReflectionCube>>>,
    settings: ReflectionSettings,
}

/// A texel that waits for its light, and what the path had collected before.
#[derive(Clone, Copy, Debug)]
struct CubeLesson {
    object: u32,
    sample: ReflectionSample,
    radiance: Vec3,
    throughput: Vec3,
    is_taught: bool,
}

/// The texels that wait for the light of one path, in the order of its rays.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CubeLessons {
    count: usize,
    lessons: [Option<CubeLesson>; MOST_LESSONS],
}

impl CachedReflections {
    /// Prepares the shiny objects of a scene. `None` if it has none.
    pub(crate) fn new(scene: &Scene, mut settings: ReflectionSettings) -> Option<Self> {
        let objects = ShinyObjects::find(scene)?;
        let count = objects.centres().len();
        let bytes = |resolution| count.saturating_mul(bytes_of(resolution));
        while bytes(settings.resolution) > MOST_BYTES && settings.resolution > LEAST_RESOLUTION {
            settings.resolution /= 2;
        }
        let most = MOST_BYTES / bytes_of(settings.resolution);
        let cubes = (0..count.min(most)).map(|_| RwLock::default()).collect();
        Some(Self { objects, cubes, settings })
    }

    /// Returns one estimate of the radiance that arrives against `start.direction`.
    pub(crate) fn radiance(
        &self,
        engine: &PathEngine,
        raycaster: &Raycaster,
        start: Start,
        sampler: &mut Sampler,
    ) -> Vec3 {
        engine.follow(raycaster, start, &CubePolicy(self), sampler)
    }

    /// Returns how much the cubes know.
    pub(crate) fn report(&self) -> ReflectionReport {
        let mut report = ReflectionReport { objects: self.cubes.len(), ..Default::default() };
        for cube in &self.cubes {
            let cube = cube.read();
            if let Some(of_cube) = cube.as_ref().map(ReflectionCube::statistics) {
                report.texels += of_cube.texels;
                report.valid += of_cube.valid;
                report.marked += of_cube.marked;
                report.bytes += of_cube.bytes;
            }
        }
        report
    }

    /// Returns the light of a ray that leaves an object.
    fn look_up(&self, object: u32, ray: &Ray) -> CubeAnswer {
        let cube = self.cubes[object as usize].read();
        let Some(cube) = cube.as_ref() else { return CubeAnswer::Unknown };
        let is_known = |light: &CubeLight| light.count >= self.settings.least_paths;
        let answer = match (cube.grid().texel_of(ray.direction), self.settings.has_parallax) {
            (_, true) => cube.look_up(ray.origin, ray.direction, 0.0..=0.0),
            (texel, false) if cube.is_marked(texel) => CubeAnswer::MustTrace,
            (texel, false) => cube.light_of(texel).map_or(CubeAnswer::Unknown, CubeAnswer::Light),
        };
        match answer {
            CubeAnswer::Light(light) if !is_known(&light) => CubeAnswer::Unknown,
            answer => answer,
        }
    }

    fn change(&self, object: u32, change: impl FnOnce(&mut ReflectionCube)) {
        let cube = &self.cubes[object as usize];
        let mut cube = cube.write();
        let centre = self.objects.centres()[object as usize];
        change(cube.get_or_insert_with(|| ReflectionCube::new(centre, self.settings.resolution)));
    }
}

/// The policy of paths that end in cubes.
struct CubePolicy<'a>(&'a CachedReflections);

impl PathPolicy for CubePolicy<'_> {
    type Lessons = CubeLessons;

    fn leaves(
        &self,
        lessons: &mut CubeLessons,
        leaving: &LeavingRay,
        carried: &mut Carried,
    ) -> bool {
        let reflections = self.0;
        let has_cube = |object: &u32| (*object as usize) < reflections.cubes.len();
        let Some(object) = reflections.objects.of(leaving.triangle).filter(has_cube) else {
            return false;
        };
        let ray = leaving.ray;
        if leaving.is_solid && leaving.normal.dot(ray.direction) <= 0.0 {
            return false;
        }
        match reflections.look_up(object, ray) {
            CubeAnswer::Light(light) => {
                *carried.radiance += *carried.throughput * Vec3::from(light.radiance);
                return true;
            }
            CubeAnswer::MustTrace => return false,
            CubeAnswer::Unknown => {}
        }
        let Some(free) = lessons.lessons.get_mut(lessons.count) else { return false };
        lessons.count += 1;
        let Carried { radiance, throughput, worth } = carried;
        *free = Some(CubeLesson {
            object,
            sample: ReflectionSample {
                origin: ray.origin,
                direction: ray.direction,
                distance: f32::INFINITY,
                radiance: [0.0; 3],
                count: 1,
                generation: 0,
            },
            radiance: **radiance,
            throughput: **throughput,
            is_taught: true,
        });
        **worth *= **throughput;
        (**throughput, **radiance) = (Vec3::ONE, Vec3::ZERO);
        false
    }

    fn met(&self, lessons: &mut CubeLessons, triangle: u32, hit: Option<&Hit>) {
        let last = lessons.count.checked_sub(1).and_then(|last| lessons.lessons[last].as_mut());
        let object = self.0.objects.of(triangle);
        // The ray that began the last lesson, and not a later one, has no distance yet.
        let Some(lesson) = last.filter(|lesson| {
            Some(lesson.object) == object && lesson.sample.distance == f32::INFINITY
        }) else {
            return;
        };
        let Some(hit) = hit else { return };
        lesson.sample.distance = hit.t;
        let is_own = self.0.objects.of(hit.triangle) == object;
        if is_own && self.0.settings.traces_self_hits {
            lesson.is_taught = false;
            let direction = lesson.sample.direction;
            self.0.change(lesson.object, |cube| cube.mark_self_hit(direction));
        }
    }

    fn learn(&self, _: &Raycaster, lessons: CubeLessons, mut radiance: Vec3) -> Vec3 {
        for lesson in lessons.lessons.iter().rev().flatten() {
            if radiance.is_finite() && lesson.is_taught {
                let mut sample =
                    ReflectionSample { radiance: radiance.to_array(), ..lesson.sample };
                self.0.change(lesson.object, |cube| {
                    if !self.0.settings.has_parallax {
                        sample.origin = cube.centre();
                    }
                    cube.insert(&sample);
                });
            }
            // 0 times infinity must not reach the picture.
            radiance = match lesson.throughput == Vec3::ZERO {
                true => lesson.radiance,
                false => lesson.radiance + lesson.throughput * radiance,
            };
        }
        radiance
    }
}
