//! Punctual lights of KHR_lights_punctual. A directional light becomes a sun.

use std::f32::consts::FRAC_PI_2;
use std::f64::consts::TAU;

use glam::{DMat4, DVec3};
use gltf::khr_lights_punctual::{Kind, Light};

use super::reading::GltfReading;
use crate::limits::{MAX_COORDINATE, MAX_RADIANCE};
use crate::text::excerpt;
use crate::units::EFFICACY;
use crate::{MAX_PUNCTUAL_LIGHTS, MAX_SUNS, PunctualBeam, PunctualLight, Sun};

/// Luminous efficacy with which Blender writes lamps by default, lm/W.
const BLENDER: f64 = 683.0;

/// Adds a light of a node at the origin of `matrix`; it shines towards -z.
pub(super) fn add(reading: &mut GltfReading, light: &Light, node: &str, matrix: DMat4) {
    let place = matrix.transform_point3(DVec3::ZERO);
    let axis = matrix.transform_vector3(DVec3::NEG_Z).normalize_or_zero();
    let candela = light.color().map(|c| f64::from(c) * f64::from(light.intensity()));
    if !candela.iter().all(|c| c.is_finite() && *c >= 0.0) || axis == DVec3::ZERO {
        reading.count("lights without a plausible intensity or direction are ignored");
        return;
    }
    let beam = match light.kind() {
        Kind::Directional => return sun(reading, axis, candela),
        Kind::Point => PunctualBeam::Everywhere,
        Kind::Spot { inner_cone_angle, outer_cone_angle } => {
            cone(reading, axis, [inner_cone_angle, outer_cone_angle])
        }
    };
    if light.range().is_some() {
        reading.count("ranges of lights are ignored: light has no end");
    }
    if !candela.iter().any(|&c| c > 0.0) {
        reading.count(format!("the light of node {node} has no intensity and is ignored"));
        return;
    }
    if place.abs().max_element() > MAX_COORDINATE
        || reading.model.punctual_lights.len() == MAX_PUNCTUAL_LIGHTS
    {
        reading.count("lights beyond 1e12, or beyond the 65536th, are ignored");
        return;
    }
    if let Some(watts) = blender_watts(f64::from(light.intensity())) {
        reading.count(format!(
            "lights of {watts} W × 683 lm/W ÷ 4π, as Blender exports by default, are taken as they \
             are: real lamps of that power are dimmer"
        ));
    }
    reading.count(match beam {
        PunctualBeam::Everywhere => "point lights give light and are not seen",
        PunctualBeam::Cone { .. } => "spot lights give light and are not seen",
    });
    let group = light.name().map_or_else(|| format!("light {}", light.index()), excerpt);
    let light = PunctualLight {
        name: node.to_owned(),
        group,
        position: [0.0; 3],
        intensity: candela.map(|c| (c / EFFICACY) as f32),
        radius: 0.0,
        beam,
    };
    reading.model.punctual_lights.push((place, light));
}

/// Returns the cone of a spot light. Impossible angles become the nearest possible ones.
fn cone(reading: &mut GltfReading, axis: DVec3, angles: [f32; 2]) -> PunctualBeam {
    let [inner, outer] = angles;
    let is_possible =
        outer > 0.0 && (0.0..=outer).contains(&inner) && outer <= FRAC_PI_2 * 1.000_001;
    if !is_possible {
        reading.count("spot lights whose angles are not 0 ≤ inner ≤ outer ≤ 90° are cut to that");
    }
    let outer = if outer >= 0.0 { outer.min(FRAC_PI_2) } else { 0.0 };
    let inner = if inner >= 0.0 { inner.min(outer) } else { 0.0 };
    PunctualBeam::Cone { axis: axis.as_vec3().to_array(), inner, outer }
}

/// Returns the power that Blender's default export (683 lm/W, the same in all directions) turns
/// into this many candela. `None` if that would not be a power with three digits, such as people
/// choose.
fn blender_watts(candela: f64) -> Option<f64> {
    let watts = candela * 2.0 * TAU / BLENDER;
    let digits = 10_f64.powf(watts.log10().floor() - 2.0);
    let rounded = (watts / digits).round() * digits;
    let is_round = (watts / rounded - 1.0).abs() < 2e-6;
    // Sums of decimal digits, without their rounding.
    is_round.then(|| format!("{rounded:.6}").parse().unwrap_or(rounded))
}

/// Adds a sun that shines along `axis` with these illuminances, lux.
fn sun(reading: &mut GltfReading, axis: DVec3, lux: [f64; 3]) {
    if !lux.iter().any(|&c| c > 0.0) {
        return;
    }
    if reading.model.suns.len() == MAX_SUNS {
        reading.count("directional lights beyond the sixteenth are ignored");
        return;
    }
    let most = f64::from(MAX_RADIANCE) * Sun::projected_solid_angle() * 0.99;
    reading.count("directional lights are suns of half a degree");
    reading.model.suns.push(Sun {
        towards: (-axis).as_vec3().to_array(),
        irradiance: lux.map(|c| (c / EFFICACY).min(most) as f32),
    });
}
