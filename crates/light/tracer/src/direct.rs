//! Direct light at one vertex: samples of the lights, and the densities needed to combine them with
//! samples of the material.
//!
//! Invariant: both sides use the same density functions.

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};

use crate::bsdf::Scatter;
use crate::engine::PathEngine;
use crate::geometry::{ShadingFrame, cosine_hemisphere, cosine_pdf};
use crate::lights::{Aim, ChosenLight, Lights, PreparedPoint, VertexLights};
use crate::sampler::Sampler;
use crate::shading;
use crate::sky::PreparedSky;
use crate::weighting::Direct;

/// A vertex whose surface scatters with a density.
pub(crate) struct LitVertex<'a> {
    pub raycaster: &'a Raycaster,
    pub engine: &'a PathEngine,
    pub scatter: &'a Scatter,
    pub point: &'a SurfacePoint,
    pub frame: &'a ShadingFrame,
    pub wo: Vec3,
    pub front: bool,
}

/// The way that lights were sampled at a vertex, with enough data to compute the same densities
/// again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSampling {
    point: Vec3,
    /// As in [`Lights::at_vertex`].
    normal: Vec3,
    /// Probability of choosing the sky.
    sky: f32,
    samples: u32,
    scatterings: u32,
}

impl LightSampling {
    #[inline]
    pub(crate) fn new(
        lights: &VertexLights,
        scatter: &Scatter,
        point: &SurfacePoint,
        normal: Vec3,
        [samples, scatterings]: [u32; 2],
    ) -> Self {
        let normal = lit_side(scatter, normal);
        Self { point: point.point, normal, sky: lights.sky, samples, scatterings }
    }

    /// Returns the data needed to weigh emission that a sample of the material hits. The sample
    /// goes towards `wi` and has density `pdf`.
    #[inline]
    pub(crate) fn material_sample(self, pdf: f32, scatter: &Scatter, wi: Vec3) -> MaterialSample {
        MaterialSample { pdf, lights: self, sky_pdf: sky_pdf(self.sky, scatter, wi) }
    }
}

/// A sample of a material at a vertex whose lights were sampled too.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MaterialSample {
    /// Density of the sample per solid angle.
    pub pdf: f32,
    lights: LightSampling,
    /// Density per solid angle with which one light sample finds the sky in the same direction by
    /// the cosine alone.
    sky_pdf: f32,
}

impl MaterialSample {
    /// Returns the expected number of light samples per solid angle towards the sky.
    pub(crate) fn sky_density(&self, sky: &PreparedSky, direction: Vec3) -> f32 {
        self.lights.samples as f32 * sky.mixed(direction, self.lights.sky, self.sky_pdf)
    }

    /// Returns the expected number of light samples per solid angle towards a point of an emitter
    /// that the sample met.
    ///
    /// Weighs the lights again: few samples meet an emitter, so this costs less than carrying the
    /// weights along every path.
    pub(crate) fn emitter_density(
        &self,
        lights: &Lights,
        raycaster: &Raycaster,
        hit: &Hit,
        cosine: f32,
    ) -> f32 {
        let LightSampling { point, normal, samples, scatterings, .. } = self.lights;
        let seen = lights.at_vertex(point, normal, scatterings);
        let probability = lights.probability(&seen, hit.triangle);
        if probability == 0.0 {
            return 0.0;
        }
        let aim = Aim::new(point, raycaster.vertices(hit.triangle));
        let distance2 = raycaster.point(hit.triangle, hit.u, hit.v).distance_squared(point);
        samples as f32 * probability * aim.density(distance2, cosine)
    }
}

/// Returns `normal` (turned to the eye) if only its side can be lit, and 0 if both can.
#[inline]
fn lit_side(scatter: &Scatter, normal: Vec3) -> Vec3 {
    if scatter.transmits() { Vec3::ZERO } else { normal }
}

/// Returns the lights as a vertex sees them. `normal` is turned to the eye.
#[inline]
pub(crate) fn lights_at(
    lights: &Lights,
    scatter: &Scatter,
    point: &SurfacePoint,
    normal: Vec3,
    scatterings: u32,
) -> VertexLights {
    lights.at_vertex(point.point, lit_side(scatter, normal), scatterings)
}

/// Returns the density of sky samples towards `wi` if the sky is chosen with probability `sky`.
#[inline]
fn sky_pdf(sky: f32, scatter: &Scatter, wi: Vec3) -> f32 {
    sky * if scatter.transmits() { 0.5 * cosine_pdf(wi.z.abs()) } else { cosine_pdf(wi.z) }
}

impl LitVertex<'_> {
    /// Returns an estimate of direct light from `count` stratified samples of the lights, and the
    /// variance of one sample's brightness (the sum of the channels): 0 if there is only one.
    #[inline]
    pub(crate) fn direct_light(
        &self,
        lights: &VertexLights,
        count: u32,
        direct: Direct,
        sampler: &mut Sampler,
    ) -> (Vec3, f32) {
        let (mut sum, mut squares) = (Vec3::ZERO, 0.0);
        let pairs = sampler.pairs(count);
        for j in 0..count {
            let (first, second) = pairs.at(j);
            let light = match self.engine.lights.choose(lights, first) {
                Some(ChosenLight::Sky { rest }) if self.engine.sky.is_even() => {
                    self.sky(lights, count, direct, [rest, second])
                }
                Some(ChosenLight::Sky { rest }) => {
                    self.varying_sky(lights, count, direct, [rest, second])
                }
                Some(ChosenLight::Triangle { triangle, probability, rest }) => {
                    self.emitter(triangle, probability, count, direct, [rest, second])
                }
                Some(ChosenLight::Point { point, probability }) => self.point(&point) / probability,
                None => Vec3::ZERO,
            };
            sum += light;
            squares += light.element_sum().powi(2);
        }
        let n = count as f32;
        let mean = sum / n;
        let variance = (squares - n * mean.element_sum().powi(2)).max(0.0) / (n - 1.0).max(1.0);
        (mean, variance)
    }

    /// Returns the factor with which a smooth normal dims light from a direction; 1 on facets.
    #[inline]
    fn terminator(&self, direction: Vec3, z: f32) -> f32 {
        match self.engine.is_shaded {
            true => shading::terminator(self.frame, self.point.normal, direction, z, true),
            false => 1.0,
        }
    }

    /// Returns value over density of one sample of an even sky, weighed against the material's.
    #[inline]
    fn sky(&self, lights: &VertexLights, count: u32, direct: Direct, [mut x, y]: [f32; 2]) -> Vec3 {
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
        let density = sky_pdf(lights.sky, self.scatter, wi);
        if value == Vec3::ZERO || density <= 0.0 {
            return Vec3::ZERO;
        }
        let direction = self.frame.to_world(wi);
        let value = value * self.terminator(direction, wi.z);
        let ray = Ray::new(
            spawn(self.point.point, self.point.error, self.point.normal, direction),
            direction,
        );
        if self.raycaster.occluded_from(&ray, self.point.triangle) {
            return Vec3::ZERO;
        }
        let sky = self.engine.sky.along(direction);
        value * sky * (direct.light_weight(density * count as f32, pdf) / density)
    }

    /// The same for a sky that differs by direction. Its samples pass panes.
    fn varying_sky(
        &self,
        lights: &VertexLights,
        count: u32,
        direct: Direct,
        mut uniform: [f32; 2],
    ) -> Vec3 {
        let sky = &*self.engine.sky;
        let (direction, wi) = match sky.aim(&mut uniform) {
            Some(direction) => (direction, self.frame.to_local(direction)),
            None => {
                let [mut x, y] = uniform;
                let mut side = 1.0;
                if self.scatter.transmits() {
                    x *= 2.0;
                    if x >= 1.0 {
                        (x, side) = (x - 1.0, -1.0);
                    }
                }
                let mut wi = cosine_hemisphere([x, y]);
                wi.z *= side;
                (self.frame.to_world(wi), wi)
            }
        };
        let (value, pdf) = self.scatter.evaluate(self.wo, wi, self.front);
        let cosine = sky_pdf(lights.sky, self.scatter, wi);
        let density = sky.mixed(direction, lights.sky, cosine);
        if value == Vec3::ZERO || density <= 0.0 {
            return Vec3::ZERO;
        }
        let value = value * self.terminator(direction, wi.z);
        let passed = self.engine.panes.to_sky(self.raycaster, self.point, direction);
        if value == Vec3::ZERO || passed == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let weight = direct.light_weight(density * count as f32, pdf) / density;
        value * passed * sky.along(direction) * weight
    }

    /// Returns value over density of one sample of the suns, weighed against the material's.
    #[inline]
    pub(crate) fn sunlight(&self, direct: Direct, sampler: &mut Sampler) -> Vec3 {
        let Some(sun) = self.engine.suns.choose(sampler.one(), sampler.two()) else {
            return Vec3::ZERO;
        };
        let wi = self.frame.to_local(sun.direction);
        let (value, pdf) = self.scatter.evaluate(self.wo, wi, self.front);
        let value = value * self.terminator(sun.direction, wi.z);
        if value == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let passed = self.engine.panes.to_sky(self.raycaster, self.point, sun.direction);
        let weight = direct.light_weight(sun.density, pdf) / sun.density;
        value * passed * sun.radiance * weight
    }

    /// Returns the light that a point brings. No sample of the material can find it.
    #[inline]
    fn point(&self, light: &PreparedPoint) -> Vec3 {
        let towards = light.position - self.point.point;
        let distance2 = towards.length_squared();
        let Some(direction) = towards.try_normalize() else { return Vec3::ZERO };
        let intensity = light.intensity(-direction);
        if intensity == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let wi = self.frame.to_local(direction);
        let (value, _) = self.scatter.evaluate(self.wo, wi, self.front);
        let value = value * self.terminator(direction, wi.z);
        if value == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let passed = self.engine.panes.between(self.raycaster, self.point, &light.place());
        value * passed * intensity / distance2
    }

    /// Returns value over density of one sample of an emitter, weighed against the material's.
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
        // `surface` would move points off edges. On small triangles far from the scene's origin,
        // that is a different point, and a glowing box of 5 mm at 250 m would be 2 to 3 % too
        // bright.
        let towards = self.raycaster.point(triangle, u, v) - self.point.point;
        let light = self.raycaster.surface(triangle, u, v);
        let material = self.raycaster.scene().material_id(triangle);
        let emitter = &self.engine.surfaces[material as usize];
        let distance2 = towards.length_squared();
        if distance2 == 0.0 {
            return Vec3::ZERO;
        }
        let direction = towards / distance2.sqrt();
        let cosine = -direction.dot(light.normal);
        if !(cosine > 0.0 || emitter.two_sided && cosine < 0.0) {
            return Vec3::ZERO;
        }
        let wi = self.frame.to_local(direction);
        let (value, pdf) = self.scatter.evaluate(self.wo, wi, self.front);
        let value = value * self.terminator(direction, wi.z);
        if value == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let passed = self.engine.panes.between(self.raycaster, self.point, &light);
        if passed == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let density = probability * aim.density(distance2, cosine.abs());
        value
            * passed
            * self.engine.sampled_emission_at(self.raycaster, triangle, [u, v], direction, emitter)
            * (direct.light_weight(density * count as f32, pdf) / density)
    }
}
