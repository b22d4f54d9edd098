//! The radiance of each direction of a sky.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

/// Least sine of an altitude. Below, the formulas have no digits left, and the sky is as at this
/// altitude, as in Radiance.
const LEAST_SINE: f64 = 0.01;

/// How bright the parts of a sky are, relative to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SkyShape {
    /// The same everywhere.
    Even,
    /// `(1 + 2·sin γ)/3`: the CIE's overcast sky (Moon and Spencer 1942).
    Overcast,
    /// `(1 + a·exp(b/sin γ)) · (k + c·exp(d·χ) + e·cos² χ)` for the altitude γ and the angle χ to
    /// the sun: the CIE's clear sky, its fifteen general skies, and those of Perez.
    Gradation {
        /// `a`, `b`, `k`, `c`, `d` and `e`.
        factors: [f64; 6],
    },
    /// The CIE's intermediate sky, as in Radiance.
    Intermediate,
}

/// A sky above the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyFormula {
    /// The relative radiance.
    pub shape: SkyShape,
    /// The radiance where the relative radiance is 1, W·sr⁻¹·m⁻².
    pub scale: f64,
    /// The unit direction of the sun that shapes the sky, in the horizon's frame. It is never below
    /// the horizon.
    pub sun: DVec3,
}

impl SkyFormula {
    /// Returns a sky of this shape with a zenith of this radiance.
    pub fn with_zenith(shape: SkyShape, sun: DVec3, zenith: f64) -> SkyFormula {
        let mut sky = SkyFormula { shape, scale: 1.0, sun: above_horizon(sun) };
        let relative = sky.radiance(DVec3::Z);
        sky.scale = if relative > 0.0 { zenith.max(0.0) / relative } else { 0.0 };
        sky
    }

    /// Returns a sky of this shape that brings this irradiance to a horizontal surface.
    pub fn with_horizontal(shape: SkyShape, sun: DVec3, irradiance: f64) -> SkyFormula {
        let sky = SkyFormula { shape, scale: 1.0, sun: above_horizon(sun) };
        let relative = sky.horizontal();
        if relative > 0.0 {
            SkyFormula { scale: irradiance.max(0.0) / relative, ..sky }
        } else {
            let scale = irradiance.max(0.0) / std::f64::consts::PI;
            SkyFormula { shape: SkyShape::Even, scale, ..sky }
        }
    }

    /// Returns the radiance from a unit direction, W·sr⁻¹·m⁻². Below the horizon, it is that of the
    /// horizon.
    #[inline]
    pub fn radiance(&self, direction: DVec3) -> f64 {
        let relative = match self.shape {
            SkyShape::Even => 1.0,
            SkyShape::Overcast => (1.0 + 2.0 * direction.z.clamp(0.0, 1.0)) / 3.0,
            SkyShape::Gradation { factors: [a, b, k, c, d, e] } => {
                let cosine = direction.dot(self.sun).clamp(-1.0, 1.0);
                let gradation = 1.0 + a * (b / direction.z.max(LEAST_SINE)).exp();
                let scattering = if c == 0.0 { k } else { k + c * (d * cosine.acos()).exp() };
                gradation * (scattering + e * cosine * cosine)
            }
            SkyShape::Intermediate => self.intermediate(direction),
        };
        self.scale * relative.max(0.0)
    }

    fn intermediate(&self, direction: DVec3) -> f64 {
        let from_sun = direction.dot(self.sun).clamp(-1.0, 1.0).acos();
        let from_zenith = direction.z.clamp(0.0, 1.0).acos();
        let sun = self.sun.z.clamp(0.0, 1.0).acos();
        let level = (1.35 * (5.631 - 3.59 * from_zenith).sin() + 3.12) * (4.396 - 2.6 * sun).sin();
        let fall = 0.563 * ((2.629 - from_zenith) * (1.562 - sun) + 0.812);
        (level + 6.37 - from_zenith) / 2.326 * (-from_sun * fall).exp()
    }

    /// Returns the irradiance that the sky brings to a horizontal surface without obstacles, W·m⁻².
    /// Its relative error is below 1e-4.
    pub fn horizontal(&self) -> f64 {
        // Equal steps of sin² γ are equal shares of the projected hemisphere.
        const RINGS: u32 = 128;
        const SECTORS: u32 = 128;
        let mut sum = 0.0;
        for ring in 0..RINGS {
            let square = (f64::from(ring) + 0.5) / f64::from(RINGS);
            let (height, level) = (square.sqrt(), (1.0 - square).sqrt());
            for sector in 0..SECTORS {
                let (sin, cos) = (TAU * (f64::from(sector) + 0.5) / f64::from(SECTORS)).sin_cos();
                sum += self.radiance(DVec3::new(level * cos, level * sin, height));
            }
        }
        std::f64::consts::PI * sum / f64::from(RINGS * SECTORS)
    }
}

/// Returns the factors of a general sky of the CIE from its five parameters.
pub(crate) fn standard_shape([a, b, c, d, e]: [f64; 5]) -> SkyShape {
    SkyShape::Gradation { factors: [a, b, 1.0 - c * (d * FRAC_PI_2).exp(), c, d, e] }
}

/// Returns a unit direction, or the nearest one on the horizon if it points below.
fn above_horizon(direction: DVec3) -> DVec3 {
    if direction.z >= 0.0 {
        return direction;
    }
    DVec3::new(direction.x, direction.y, 0.0).try_normalize().unwrap_or(DVec3::Y)
}
