//! Direct light at one vertex: samples of the lights, and the weights that combine them with what materials find.
//!
//! Always true: light is combined by the power heuristic for n samples of the lights and one of the material (Veach 1997,
//! §9.2.2 and §9.2.4); the densities on both sides are the same functions.

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};

use crate::bsdf::Scatter;
use crate::geometry::{Frame, cosine_hemisphere, cosine_pdf};
use crate::lights::{Aim, Chosen, Lights, Seen};
use crate::panes::Panes;
use crate::path::{Direct, Surface};
use crate::sampler::Sampler;

/// A vertex whose surface scatters with a density.
pub(crate) struct Vertex<'a> {
    pub raycaster: &'a Raycaster,
    /// By material.
    pub surfaces: &'a [Surface],
    pub panes: &'a Panes,
    pub scatter: &'a Scatter,
    pub point: &'a SurfacePoint,
    pub frame: &'a Frame,
    pub wo: Vec3,
    pub front: bool,
}

/// How lights were sampled at a vertex: enough to know again with which density.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lit {
    point: Vec3,
    /// As [`Lights::seen`] has it.
    normal: Vec3,
    /// Probability of choosing the sky.
    sky: f32,
    samples: u32,
}

impl Lit {
    #[inline]
    pub(crate) fn new(
        seen: &Seen,
        scatter: &Scatter,
        point: &SurfacePoint,
        normal: Vec3,
        samples: u32,
    ) -> Self {
        Self { point: point.point, normal: lit_from(scatter, normal), sky: seen.sky, samples }
    }

    /// For weighing what a sample of the material towards `wi`, made with density `pdf`, finds.
    #[inline]
    pub(crate) fn left(self, pdf: f32, scatter: &Scatter, wi: Vec3) -> Left {
        Left { pdf, lit: self, sky_pdf: sky_pdf(self.sky, scatter, wi) }
    }
}

/// What light sampling at a vertex could have found, for weighing what its material's sample finds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Left {
    /// Density of the material's sample, per solid angle.
    pub pdf: f32,
    lit: Lit,
    /// Density with which one light sample aims at the sky in the sample's direction.
    sky_pdf: f32,
}

impl Left {
    /// Expected number of light samples per solid angle towards the sky.
    pub(crate) fn sky_density(&self) -> f32 {
        self.lit.samples as f32 * self.sky_pdf
    }

    /// The same towards a point on an emitter that the sample met. Few samples meet one: to weigh the lights again takes less than to carry
    /// their weights along all paths.
    pub(crate) fn emitter_density(
        &self,
        lights: &Lights,
        raycaster: &Raycaster,
        met: &Hit,
        cosine: f32,
    ) -> f32 {
        let Lit { point, normal, samples, .. } = self.lit;
        let probability = lights.probability(&lights.seen(point, normal), met.triangle);
        if probability == 0.0 {
            return 0.0;
        }
        let aim = Aim::new(point, raycaster.vertices(met.triangle));
        let distance2 = raycaster.point(met.triangle, met.u, met.v).distance_squared(point);
        samples as f32 * probability * aim.density(distance2, cosine)
    }
}

/// The side from which a surface is lit, given the normal that is turned to the eye; 0 if from everywhere.
#[inline]
fn lit_from(scatter: &Scatter, normal: Vec3) -> Vec3 {
    if scatter.transmits() { Vec3::ZERO } else { normal }
}

/// Lights as a vertex sees them: `normal` is turned to the eye.
#[inline]
pub(crate) fn seen(lights: &Lights, scatter: &Scatter, point: &SurfacePoint, normal: Vec3) -> Seen {
    lights.seen(point.point, lit_from(scatter, normal))
}

#[inline]
fn sky_pdf(sky: f32, scatter: &Scatter, wi: Vec3) -> f32 {
    sky * if scatter.transmits() { 0.5 * cosine_pdf(wi.z.abs()) } else { cosine_pdf(wi.z) }
}

impl Vertex<'_> {
    /// Direct light by `count` stratified samples of the lights.
    #[inline]
    pub(crate) fn lit(
        &self,
        lights: &Lights,
        seen: &Seen,
        sky: Vec3,
        count: u32,
        direct: Direct,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let pairs = sampler.pairs(count);
        for j in 0..count {
            let (first, second) = pairs.at(j);
            match lights.choose(seen, first) {
                Some(Chosen::Sky { rest }) => {
                    sum += self.sky(seen, sky, count, direct, [rest, second])
                }
                Some(Chosen::Triangle { triangle, probability, rest }) => {
                    sum += self.emitter(triangle, probability, count, direct, [rest, second]);
                }
                None => {}
            }
        }
        sum / count as f32
    }

    /// Value over density of one sample of the sky, weighed against the material's.
    #[inline]
    fn sky(
        &self,
        seen: &Seen,
        sky: Vec3,
        count: u32,
        direct: Direct,
        [mut x, y]: [f32; 2],
    ) -> Vec3 {
        let mut side = 1.0;
        if self.scatter.transmits() {
            x *= 2.0;
            if x >= 1.0 {
                (x, side) = (x - 1.0, -1.0);
            }
        }
        let mut wi = cosine_hemisphere([x, y]);
        wi.z *= side;
        let (value, pdf) = self.scatter.evaluate(self.wo, wi, self.front);
        let density = sky_pdf(seen.sky, self.scatter, wi);
        if value == Vec3::ZERO || density <= 0.0 {
            return Vec3::ZERO;
        }
        let direction = self.frame.to_world(wi);
        let ray = Ray::new(
            spawn(self.point.point, self.point.error, self.point.normal, direction),
            direction,
        );
        if self.raycaster.occluded_from(&ray, self.point.triangle) {
            return Vec3::ZERO;
        }
        value * sky * (direct.light_weight(density * count as f32, pdf) / density)
    }

    /// The same of a chosen emitter.
    #[inline]
    fn emitter(
        &self,
        triangle: u32,
        probability: f32,
        count: u32,
        direct: Direct,
        u: [f32; 2],
    ) -> Vec3 {
        if triangle == self.point.triangle {
            return Vec3::ZERO;
        }
        let aim = Aim::new(self.point.point, self.raycaster.vertices(triangle));
        let (u, v) = aim.sample(u);
        // The point itself and not the one that `surface` keeps off the edges, which is another one on small triangles far from the
        // scene's origin: light in a glowing box of 5 mm, 250 m from there, was 2 to 3 % too bright.
        let towards = self.raycaster.point(triangle, u, v) - self.point.point;
        let light = self.raycaster.surface(triangle, u, v);
        let emitter =
            &self.surfaces[self.raycaster.scene().material_ids[triangle as usize] as usize];
        let distance2 = towards.length_squared();
        if distance2 == 0.0 {
            return Vec3::ZERO;
        }
        let direction = towards / distance2.sqrt();
        let cosine = -direction.dot(light.normal);
        if !(cosine > 0.0 || emitter.two_sided && cosine < 0.0) {
            return Vec3::ZERO;
        }
        let (value, pdf) =
            self.scatter.evaluate(self.wo, self.frame.to_local(direction), self.front);
        if value == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let passed = self.panes.between(self.raycaster, self.point, &light);
        if passed == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let density = probability * aim.density(distance2, cosine.abs());
        value
            * passed
            * emitter.emission
            * (direct.light_weight(density * count as f32, pdf) / density)
    }
}

impl Direct {
    /// Weight of light found by the material, given the density of its sample and of the lights'.
    #[inline]
    pub(crate) fn material_weight(self, pdf: f32, lights: f32) -> f32 {
        match self {
            Self::Both => power_heuristic(pdf, lights),
            Self::Lights => 0.0,
            Self::Materials => 1.0,
        }
    }

    #[inline]
    fn light_weight(self, lights: f32, pdf: f32) -> f32 {
        if self == Self::Lights { 1.0 } else { power_heuristic(lights, pdf) }
    }
}

/// Veach's power heuristic with exponent 2, safe for densities whose squares overflow.
#[inline]
pub(crate) fn power_heuristic(chosen: f32, other: f32) -> f32 {
    let ratio = other / chosen;
    1.0 / (1.0 + ratio * ratio)
}
