//! Places samples on surfaces: casts the short piece of a sample's ray around its stored distance.
//!
//! Invariants:
//! - Samples that arrive together do not influence each other.
//! - A sample is left out if no surface lies near its stored distance, or if it shows a lamp or the
//!   sky.

use super::cell::{FaceClass, SampleLight};
use super::materials::{MaterialClass, Materials};
use super::trail::{AtPanes, Follower, RayContent, TrailEnd};
use glam::{DVec3, Vec3};
use holo_raycast::{Hit, MAX_TOGETHER, Ray, Raycaster};
use holo_section::{BeamId, Sample, Section, distance};

/// Relative rounding of stored distances.
const ROUNDING: f64 = 2e-4;

/// Least share of light that comes back through mirrors and panes. Samples with a smaller share
/// hardly depend on the surface.
const LEAST_SHARE: f32 = 0.05;

/// Most surfaces one behind the other, among which a sample's own is looked for.
const MOST_COVERS: usize = 8;

/// A sample as a ray of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RaySample {
    /// The ray's origin.
    pub origin: DVec3,
    /// The ray's unit direction.
    pub direction: DVec3,
    /// Distance to the first surface, scene units; infinite if the ray hits nothing.
    pub distance: f64,
    /// Greatest error of the distance, scene units.
    pub uncertainty: f64,
    /// Radiance, finite and not negative.
    pub radiance: [f32; 3],
    /// Number of paths whose mean the radiance is.
    pub paths: u32,
}

/// A sample on its surface.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    pub(crate) point: Vec3,
    pub(crate) face: FaceClass,
    pub(crate) light: SampleLight,
}

impl Placed {
    /// Returns where the sample lies, relative to the scene's origin.
    #[must_use]
    pub fn point(&self) -> Vec3 {
        self.point
    }
}

/// Finds the surfaces of samples.
#[derive(Debug)]
pub struct Placer<'a> {
    raycaster: &'a Raycaster,
    follower: Follower<'a>,
}

impl<'a> Placer<'a> {
    /// Returns a placer for the scene that the ray caster was built from.
    #[must_use]
    pub fn new(raycaster: &'a Raycaster, materials: &'a Materials) -> Self {
        Self { raycaster, follower: Follower::new(raycaster, materials) }
    }

    /// Appends a beam's samples to `placed`. If the section has no such beam, nothing is added.
    pub fn place_beam(
        &self,
        section: &Section,
        beam: BeamId,
        paths: u16,
        samples: &[Sample],
        placed: &mut Vec<Placed>,
    ) {
        let Some(pair) = section.cells(beam) else { return };
        let diagonal = section.diagonal();
        for samples in samples.chunks(MAX_TOGETHER) {
            let mut rays = [None; MAX_TOGETHER];
            for (ray, sample) in rays.iter_mut().zip(samples) {
                if sample.distance_code() == distance::NOTHING_HIT {
                    continue;
                }
                let through = section.ray(pair, sample.coords);
                let distance = sample.distance(diagonal);
                *ray = Some(RaySample {
                    origin: through.origin,
                    direction: through.direction,
                    distance,
                    uncertainty: 2.5e-4 * distance.max(diagonal),
                    radiance: sample.rgb(),
                    paths: u32::from(paths),
                });
            }
            self.place_together(rays.iter().flatten(), placed);
        }
    }

    /// Appends the samples of rays to `placed`.
    pub fn place_rays(&self, rays: &[RaySample], placed: &mut Vec<Placed>) {
        for rays in rays.chunks(MAX_TOGETHER) {
            self.place_together(rays.iter().filter(|ray| ray.distance.is_finite()), placed);
        }
    }

    /// Appends the samples of at most [`MAX_TOGETHER`] rays, which are cast together.
    fn place_together<'b>(
        &self,
        samples: impl Iterator<Item = &'b RaySample>,
        placed: &mut Vec<Placed>,
    ) {
        let nowhere = Ray { origin: Vec3::ZERO, direction: Vec3::ZERO, t_min: 0.0, t_max: 0.0 };
        let mut rays = [nowhere; MAX_TOGETHER];
        let mut shown = [([0.0; 3], 0); MAX_TOGETHER];
        let mut count = 0;
        for sample in samples.take(MAX_TOGETHER) {
            rays[count] = self.piece(sample);
            shown[count] = (sample.radiance, sample.paths);
            count += 1;
        }
        let mut hits = [None; MAX_TOGETHER];
        self.raycaster.nearest_many(&rays[..count], &mut hits[..count]);
        for ((ray, hit), shown) in rays.iter().zip(hits).zip(shown).take(count) {
            let hit = hit.map(|hit| self.nearest_to_middle(ray, hit));
            placed.extend(hit.and_then(|hit| self.on_surface(ray, hit, shown)));
        }
    }

    /// Returns the piece of a sample's ray in which its surface must lie.
    fn piece(&self, sample: &RaySample) -> Ray {
        let reach = 2.0 * sample.uncertainty + ROUNDING * sample.distance;
        let start = sample.origin + sample.direction * (sample.distance - reach);
        let start = (start - self.raycaster.scene().origin).as_vec3();
        Ray { t_max: 2.0 * reach as f32, ..Ray::new(start, sample.direction.as_vec3()) }
    }

    /// Returns the hit of a sample's piece of ray that is nearest to its middle, if the first one
    /// is on a partly covered surface.
    fn nearest_to_middle(&self, ray: &Ray, first: Hit) -> Hit {
        let away = |hit: &Hit| (hit.t - 0.5 * ray.t_max).abs();
        let (mut best, mut last) = (first, first);
        for _ in 0..MOST_COVERS {
            if self.follower.opacity(&last) >= 1.0 {
                break;
            }
            let rest = Ray { t_min: last.t, ..*ray };
            let Some(next) = self.raycaster.nearest(&rest) else { break };
            if away(&next) < away(&best) {
                best = next;
            }
            last = next;
        }
        best
    }

    /// Returns the sample of a ray with this hit that shows this radiance, a mean of so many paths.
    /// `None` if it shows no light on a surface.
    fn on_surface(&self, ray: &Ray, hit: Hit, shown: ([f32; 3], u32)) -> Option<Placed> {
        match self.follower.follow(*ray, hit, AtPanes::PassAll) {
            RayContent::Surface(end) => self.on_end(&end, shown),
            RayContent::Sky(..) | RayContent::Light(..) | RayContent::Unknown => None,
        }
    }

    fn on_end(&self, end: &TrailEnd, (radiance, paths): ([f32; 3], u32)) -> Option<Placed> {
        let finish = self.follower.finish(end.material);
        if finish.shines(end.front) || end.share.iter().any(|&share| share < LEAST_SHARE) {
            return None;
        }
        let unit = self.follower.materials.unit;
        let reflectance = finish.reflectance_by(self.follower.texture(end, 0.0));
        let steps = [0, 1, 2].map(|channel: usize| {
            radiance[channel] / end.share[channel] / reflectance[channel] / unit
        });
        let leaving = (finish.kind == MaterialClass::Glossy).then_some(end.direction);
        let face = FaceClass::new(end.normal, end.material, leaving);
        Some(Placed { point: end.point, face, light: SampleLight::new(steps, paths) })
    }
}
