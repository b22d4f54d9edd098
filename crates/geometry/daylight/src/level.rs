//! Skies whose brightness follows from the sun's altitude alone, as in Radiance's `gensky`.

use glam::DVec3;

use crate::formula::{SkyFormula, SkyShape, standard_shape};
use crate::standard::STANDARD_SKIES;

/// Lumens per watt of a sky and of a sun, by which `gensky` converts the published luminances.
const SKY_EFFICACY: f64 = 203.0;
const SUN_EFFICACY: f64 = 208.0;

/// Turbidity of the air.
const TURBIDITY: f64 = 2.45;

/// Greatest altitude of the sun in the formulas, degrees: the published luminances grow without
/// bound towards the zenith.
pub(crate) const HIGHEST: f64 = 87.0;

/// Solid angle by which `gensky` converts the radiance of its sun of 0.5° to an irradiance.
const SUN_SOLID_ANGLE: f64 = 5.98e-5;

/// A sky and the sun in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyLevel {
    /// The sky.
    pub sky: SkyFormula,
    /// Irradiance by the sun on a surface that faces it, W·m⁻²; 0 if clouds or the horizon hide it.
    pub sun: f64,
    /// True if the sun was taken lower than it stands, because the formulas end at 87°.
    pub is_lowered: bool,
}

/// Returns the CIE's overcast sky. `sun` is the direction of the sun behind the clouds.
pub fn overcast_sky(sun: DVec3) -> SkyLevel {
    let sky = SkyFormula::with_zenith(SkyShape::Overcast, sun, overcast_zenith(sun));
    SkyLevel { sky, sun: 0.0, is_lowered: false }
}

/// Returns the CIE's clear sky with its sun.
pub fn clear_sky(sun: DVec3) -> SkyLevel {
    let (lowered, is_lowered) = lowered(sun);
    // Factors that sum up to 1 far from the sun, as the formula is published.
    let shape = SkyShape::Gradation { factors: [-1.0, -0.32, 0.91, 10.0, -3.0, 0.45] };
    let sky = SkyFormula::with_zenith(shape, lowered, clear_zenith(lowered));
    SkyLevel { sky, sun: clear_sun(lowered), is_lowered }
}

/// Returns the CIE's intermediate sky with its sun.
pub fn intermediate_sky(sun: DVec3) -> SkyLevel {
    let (lowered, is_lowered) = lowered(sun);
    let sky =
        SkyFormula::with_zenith(SkyShape::Intermediate, lowered, intermediate_zenith(lowered));
    SkyLevel { sky, sun: intermediate_sun(lowered), is_lowered }
}

/// Returns one of the fifteen general skies of the CIE, from 1. The standard leaves the level open.
/// Types 1 to 5 have the zenith of an overcast sky, 6 to 10 that of an intermediate one, and 11 to
/// 15 that of a clear one. Types 1 to 6 hide the sun. `None` if there is no such type.
pub fn standard_sky(number: usize, sun: DVec3) -> Option<SkyLevel> {
    let parameters = *STANDARD_SKIES.get(number.checked_sub(1)?)?;
    let (lowered, is_lowered) = if number <= 5 { (sun, false) } else { lowered(sun) };
    let (zenith, direct) = match number {
        ..=5 => (overcast_zenith(lowered), 0.0),
        6 => (intermediate_zenith(lowered), 0.0),
        7..=10 => (intermediate_zenith(lowered), intermediate_sun(lowered)),
        _ => (clear_zenith(lowered), clear_sun(lowered)),
    };
    let sky = SkyFormula::with_zenith(standard_shape(parameters), lowered, zenith);
    Some(SkyLevel { sky, sun: direct, is_lowered })
}

/// Returns the direction with an altitude of at most [`HIGHEST`], and whether it was higher.
pub(crate) fn lowered(sun: DVec3) -> (DVec3, bool) {
    let (sin, cos) = HIGHEST.to_radians().sin_cos();
    if sun.z <= sin {
        return (sun, false);
    }
    let level = DVec3::new(sun.x, sun.y, 0.0).try_normalize().unwrap_or(DVec3::NEG_Y);
    (level * cos + DVec3::Z * sin, true)
}

fn watts(kilocandela: f64) -> f64 {
    (kilocandela * 1000.0 / SKY_EFFICACY).max(0.0)
}

fn overcast_kilocandela(sun: DVec3) -> f64 {
    8.6 * sun.z + 0.123
}

fn clear_kilocandela(sun: DVec3) -> f64 {
    let tangent = sun.z / (1.0 - sun.z * sun.z).max(f64::MIN_POSITIVE).sqrt();
    (1.376 * TURBIDITY - 1.81) * tangent + 0.38
}

fn overcast_zenith(sun: DVec3) -> f64 {
    watts(overcast_kilocandela(sun))
}

fn clear_zenith(sun: DVec3) -> f64 {
    watts(clear_kilocandela(sun))
}

fn intermediate_zenith(sun: DVec3) -> f64 {
    watts((clear_kilocandela(sun) + overcast_kilocandela(sun)) / 2.0)
}

fn clear_sun(sun: DVec3) -> f64 {
    if sun.z <= 0.0 {
        return 0.0;
    }
    let radiance = 1.5e9 / SUN_EFFICACY * (1.147 - 0.147 / sun.z.max(0.16));
    radiance * SUN_SOLID_ANGLE
}

/// Returns the sun of an intermediate sky, 15 % of that of a clear one.
fn intermediate_sun(sun: DVec3) -> f64 {
    0.15 * clear_sun(sun)
}
