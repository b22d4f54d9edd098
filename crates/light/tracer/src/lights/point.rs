//! Punctual lights as leaves of the light tree.
//!
//! Invariant: a light's intensity is that of its format in every direction. No ray of a path can
//! meet a point, so only samples of the lights count, in full.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use holo_raycast::{NO_TRIANGLE, SurfacePoint};
use holo_scene::{PunctualBeam, PunctualLight};

use super::build::Emitter;
use crate::geometry::ShadingFrame;
use crate::luminance::luminance;

/// Margin of the cosine of a cone's edge in the tree, to allow for rounding.
const SLACK: f32 = 1e-5;

/// A cone of light.
#[derive(Clone, Copy, Debug)]
struct SpotCone {
    axis: Vec3,
    /// Cosine of the half angle.
    edge: f32,
    /// Of the falloff between inner and outer angle ([`PunctualBeam::falloff`]).
    scale: f32,
    offset: f32,
}

/// A punctual light, prepared for sampling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedPoint {
    pub position: Vec3,
    /// Radius of the sphere that stands for it beyond mirrors and glass.
    pub radius: f32,
    intensity: Vec3,
    /// `None` for light in all directions.
    cone: Option<SpotCone>,
}

impl PreparedPoint {
    pub(crate) fn new(light: &PunctualLight) -> Self {
        let cone = match (light.beam, light.beam.falloff()) {
            (PunctualBeam::Cone { axis, outer, .. }, Some([scale, offset])) => {
                let axis = Vec3::from(axis).normalize_or_zero();
                Some(SpotCone { axis, edge: outer.cos(), scale, offset })
            }
            _ => None,
        };
        Self {
            position: light.position.into(),
            radius: light.radius,
            intensity: light.intensity.into(),
            cone,
        }
    }

    /// Returns the greatest intensity, by luminance.
    pub(crate) fn strength(&self) -> f32 {
        luminance(self.intensity.to_array())
    }

    /// Returns the intensity in a unit direction away from the light.
    #[inline]
    pub(crate) fn intensity(&self, away: Vec3) -> Vec3 {
        self.intensity * self.share(away)
    }

    #[inline]
    fn share(&self, away: Vec3) -> f32 {
        let Some(SpotCone { axis, scale, offset, .. }) = self.cone else { return 1.0 };
        (axis.dot(away) * scale + offset).clamp(0.0, 1.0).powi(2)
    }

    /// Returns the emitted flux over π and over the greatest intensity.
    pub(crate) fn extent(&self) -> f32 {
        let Some(SpotCone { edge, scale, .. }) = self.cone else { return 4.0 };
        let ramp = ((1.0 - edge) * scale).min(1.0);
        2.0 * (ramp.powi(3) / (3.0 * scale) + (1.0 - edge - 1.0 / scale).max(0.0))
    }

    /// Returns a direction of a light path by two uniform numbers, and its share of the flux over
    /// its probability.
    pub(crate) fn direction(&self, [x, y]: [f32; 2]) -> (Vec3, f32) {
        let (axis, edge) = self.cone.map_or((Vec3::Z, -1.0), |cone| (cone.axis, cone.edge));
        let z = 1.0 - x * (1.0 - edge);
        let (sin, cos) = (2.0 * PI * y).sin_cos();
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let direction = ShadingFrame::new(axis).to_world(Vec3::new(radius * cos, radius * sin, z));
        let solid_angle = 2.0 * PI * (1.0 - edge);
        (direction, self.share(direction) * solid_angle * FRAC_1_PI / self.extent())
    }

    /// Returns the light's place as the end of a shadow ray.
    #[inline]
    pub(crate) fn place(&self) -> SurfacePoint {
        SurfacePoint {
            point: self.position,
            error: Vec3::ZERO,
            normal: Vec3::Z,
            triangle: NO_TRIANGLE,
        }
    }

    /// Returns the leaf of a tree whose powers have this unit.
    pub(super) fn emitter(&self, unit: f64) -> Emitter {
        let power = f64::from(self.strength()) / unit;
        let cone = self.cone.map(|cone| (cone.axis, cone.edge - SLACK));
        Emitter::point(self.position, cone, power)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::Sampler;

    #[test]
    fn directions_of_light_paths_follow_the_intensity() {
        let beams = [
            PunctualBeam::Everywhere,
            PunctualBeam::Cone { axis: [0.0, 0.6, 0.8], inner: 0.3, outer: 0.6 },
            PunctualBeam::Cone { axis: [0.0, -1.0, 0.0], inner: 0.0, outer: 1.5 },
            PunctualBeam::Cone { axis: [1.0, 0.0, 0.0], inner: 0.4, outer: 0.4 },
        ];
        for beam in beams {
            let light = PunctualLight {
                name: String::new(),
                group: String::new(),
                position: [0.0; 3],
                intensity: [2.0; 3],
                radius: 0.01,
                beam,
            };
            let point = PreparedPoint::new(&light);
            let mut sampler = Sampler::new(5, 0);
            // The mean share of directions is 1: each path carries its part of the flux. Uniform
            // directions of the sphere bring the same flux, by another way.
            let n = 200_000;
            let (mut mean, mut squares, mut flux, mut flux2) = (0.0, 0.0, 0.0, 0.0);
            for _ in 0..n {
                let (_, share) = point.direction(sampler.two());
                mean += f64::from(share) / f64::from(n);
                squares += f64::from(share).powi(2) / f64::from(n);
                let [x, y] = sampler.two();
                let z = 2.0 * x - 1.0;
                let (sin, cos) = (2.0 * PI * y).sin_cos();
                let radius = (1.0 - z * z).max(0.0).sqrt();
                let away = Vec3::new(radius * cos, radius * sin, z);
                let found = f64::from(4.0 * point.intensity(away).x / 2.0);
                flux += found / f64::from(n);
                flux2 += found.powi(2) / f64::from(n);
            }
            let error = ((squares - mean * mean).max(0.0) / f64::from(n)).sqrt();
            // 8 comparisons at 4.5 sigma, and the rounding of sums.
            assert!((mean - 1.0).abs() < 4.5 * error + 1e-5, "{beam:?}: {mean} ± {error}");
            let error = ((flux2 - flux * flux).max(0.0) / f64::from(n)).sqrt();
            let extent = f64::from(point.extent());
            assert!((flux - extent).abs() < 4.5 * error + 1e-5, "{beam:?}: {flux} {extent}");
        }
    }
}
