//! Punctual lights: lights at a point, without a surface.

use glam::Vec3;

use crate::Rgb;
use crate::limits::{MAX_COORDINATE, MAX_NAME_BYTES, MAX_RADIANCE};

/// Most punctual lights of a scene. A stadium has hundreds, and a city model thousands.
pub const MAX_PUNCTUAL_LIGHTS: usize = 1 << 16;

/// Least difference of the cosines of a spot's inner and outer angle (KHR_lights_punctual).
const LEAST_FALLOFF: f64 = 0.001;

/// A light at a point. It gives light and sharp shadows, but is not seen itself and hides nothing.
///
/// Where mirrors and glass throw its light onto surfaces, a small sphere stands for it.
#[derive(Clone, Debug, PartialEq)]
pub struct PunctualLight {
    /// Its own name.
    pub name: String,
    /// The name of the lights that belong together, such as all lights of one type.
    pub group: String,
    /// Its place, relative to the scene's origin.
    pub position: [f32; 3],
    /// Radiant intensity where [`PunctualBeam::share`] is 1, W·sr⁻¹.
    pub intensity: Rgb,
    /// Radius of the sphere, in scene units.
    pub radius: f32,
    /// The distribution of its light over directions.
    pub beam: PunctualBeam,
}

/// The distribution of a punctual light over directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualBeam {
    /// The same in all directions: a point light.
    Everywhere,
    /// A cone: a spot light. All light is within `outer`, and its intensity is full within `inner`.
    Cone {
        /// Unit direction of the middle.
        axis: [f32; 3],
        /// Half angle of the full intensity, radians.
        inner: f32,
        /// Half angle of the whole cone, radians: from `inner` to π.
        outer: f32,
    },
}

impl PunctualBeam {
    /// Returns the factors of a cone's falloff by the cosine to its axis: scale and offset of
    /// KHR_lights_punctual. `None` for light in all directions.
    #[must_use]
    pub fn falloff(&self) -> Option<[f32; 2]> {
        let Self::Cone { inner, outer, .. } = *self else { return None };
        let (inner, outer) = (f64::from(inner).cos(), f64::from(outer).cos());
        let scale = 1.0 / (inner - outer).max(LEAST_FALLOFF);
        Some([scale as f32, (-outer * scale) as f32])
    }

    /// Returns the intensity in a unit direction away from the light, relative to the greatest.
    #[must_use]
    pub fn share(&self, direction: Vec3) -> f32 {
        let (Self::Cone { axis, .. }, Some([scale, offset])) = (self, self.falloff()) else {
            return 1.0;
        };
        (Vec3::from(*axis).dot(direction) * scale + offset).clamp(0.0, 1.0).powi(2)
    }

    fn is_valid(&self) -> bool {
        match *self {
            Self::Everywhere => true,
            Self::Cone { axis, inner, outer } => {
                (Vec3::from(axis).length() - 1.0).abs() < 1e-3
                    && (0.0..=outer).contains(&inner)
                    && outer <= std::f32::consts::PI
            }
        }
    }
}

impl PunctualLight {
    /// Returns the greatest intensity of a light whose sphere has this radius, W·sr⁻¹.
    #[must_use]
    pub fn greatest_intensity(radius: f32) -> f32 {
        MAX_RADIANCE * (std::f32::consts::PI * radius * radius).min(1.0)
    }

    /// Returns the radiance of its sphere where its beam is brightest, W·sr⁻¹·m⁻².
    #[must_use]
    pub fn radiance(&self) -> Rgb {
        self.intensity.map(|c| c / (std::f32::consts::PI * self.radius * self.radius))
    }

    pub(crate) fn is_valid(&self) -> bool {
        let most = Self::greatest_intensity(self.radius);
        self.position.iter().all(|c| f64::from(c.abs()) <= MAX_COORDINATE)
            && self.radius > 0.0
            && self.radius.is_finite()
            && self.intensity.iter().all(|c| (0.0..=most).contains(c))
            && self.intensity.iter().any(|&c| c > 0.0)
            && self.radiance().iter().all(|c| c.is_finite())
            && self.name.len().max(self.group.len()) <= MAX_NAME_BYTES
            && self.beam.is_valid()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cone_has_the_falloff_of_the_format() {
        let cone =
            |inner: f32, outer: f32| PunctualBeam::Cone { axis: [0.0, 0.0, -1.0], inner, outer };
        let at =
            |beam: &PunctualBeam, angle: f32| beam.share(Vec3::new(angle.sin(), 0.0, -angle.cos()));
        let beam = cone(0.3, 0.6);
        for angle in [0.0, 0.2, 0.299_f32] {
            assert!((at(&beam, angle) - 1.0).abs() < 1e-5, "{angle}");
        }
        for angle in [0.35_f32, 0.45, 0.55] {
            let cosine = f64::from(angle).cos();
            let expected = (cosine - 0.6_f64.cos()) / (0.3_f64.cos() - 0.6_f64.cos());
            let error = f64::from(at(&beam, angle)) - expected.powi(2);
            assert!(error.abs() < 1e-5, "{angle}: {error}");
        }
        assert!([0.601, 1.5, 3.0].iter().all(|&angle| at(&beam, angle) == 0.0));
        // Equal angles leave an edge of a thousandth in the cosine.
        let hard = cone(0.6, 0.6);
        assert_eq!((at(&hard, 0.598), at(&hard, 0.601)), (1.0, 0.0));
        assert_eq!(PunctualBeam::Everywhere.share(Vec3::X), 1.0);
    }
}
