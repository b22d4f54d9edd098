//! Punctual lights, as small lamps and suns: the tracer knows only surfaces that shine, and discs
//! in the sky.
//!
//! A point light becomes an octahedron, and a spot light a square in a dark funnel that bounds its
//! cone. Intensities along the axis are kept. A directional light becomes a sun.

use std::f64::consts::TAU;

use glam::{DMat4, DVec3};
use gltf::khr_lights_punctual::{Kind, Light};

use super::reading::Reading;
use crate::limits::MAX_RADIANCE;
use crate::text::excerpt;
use crate::{Bsdf, MAX_SUNS, Material, Rgb, Sun};

/// Luminous efficacy for converting radiance to luminance, lm/W (Ward 1994).
pub(super) const EFFICACY: f64 = 179.0;

/// Distance of a lamp's corners from its middle, metres.
const RADIUS: f64 = 0.03;

/// Length of a spot light's funnel, metres, and its number of sides.
const FUNNEL: f64 = 0.1;
const SIDES: usize = 12;

/// Widest half angle of a funnel. A wider spot is a square that shines to one side.
const WIDEST: f64 = 1.3;

/// Adds a light at the origin of `matrix`; it shines towards -z.
pub(super) fn add(reading: &mut Reading, light: &Light, matrix: DMat4) {
    let place = matrix.transform_point3(DVec3::ZERO);
    let axis = matrix.transform_vector3(DVec3::NEG_Z).normalize_or_zero();
    let name = light.name().map_or_else(|| format!("light {}", light.index()), excerpt);
    let candela = light.color().map(|c| f64::from(c) * f64::from(light.intensity()));
    if !candela.iter().all(|c| c.is_finite() && *c >= 0.0) || axis == DVec3::ZERO {
        reading.count("lights without a plausible intensity or direction are ignored");
        return;
    }
    let emission =
        |area: f64| -> Rgb { candela.map(|c| ((c / EFFICACY / area) as f32).min(MAX_RADIANCE)) };
    match light.kind() {
        Kind::Directional => sun(reading, axis, candela),
        Kind::Point => {
            reading.count("point lights are shown as small lamps");
            // The mean projected area of a convex solid is a quarter of its surface (Cauchy).
            let emission = emission(3f64.sqrt() * RADIUS * RADIUS);
            octahedron(reading, place, lamp(name, emission));
        }
        Kind::Spot { outer_cone_angle, .. } => {
            reading.count("spot lights are shown as small lamps in a funnel");
            let emission = emission(2.0 * RADIUS * RADIUS);
            spot(reading, place, axis, f64::from(outer_cone_angle), lamp(name, emission));
        }
    }
}

/// Adds a sun that shines along `axis` with these illuminances, lux.
fn sun(reading: &mut Reading, axis: DVec3, lux: [f64; 3]) {
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

fn lamp(name: String, emission: Rgb) -> Material {
    Material { name, bsdf: Bsdf::Diffuse { kd: [0.0; 3] }, emission, two_sided_emission: false }
}

fn octahedron(reading: &mut Reading, place: DVec3, material: Material) {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let corners: Vec<DVec3> =
        axes.iter().flat_map(|&axis| [place + axis * RADIUS, place - axis * RADIUS]).collect();
    let mut triangles = Vec::new();
    for (x, y, z) in (0..8).map(|k| (k & 1, k >> 1 & 1, k >> 2)) {
        let [a, b, c] = [x, 2 + y, 4 + z];
        // An odd number of negative axes turns the corners round.
        triangles.push(if (x + y + z) % 2 == 0 { [a, b, c] } else { [a, c, b] });
    }
    push(reading, &corners, &triangles, material);
}

fn spot(reading: &mut Reading, place: DVec3, axis: DVec3, outer: f64, material: Material) {
    let (right, up) = axis.any_orthonormal_pair();
    let at = |angle: f64, radius: f64, ahead: f64| {
        place + axis * ahead + (right * angle.cos() + up * angle.sin()) * radius
    };
    let square: Vec<DVec3> = (0..4).map(|k| at(f64::from(k) / 4.0 * TAU, RADIUS, 0.0)).collect();
    push(reading, &square, &[[0, 1, 2], [0, 2, 3]], material);
    if !(0.01..WIDEST).contains(&outer) {
        return;
    }
    let widened = RADIUS + FUNNEL * outer.tan();
    let ring = |k: usize| (k % SIDES) as f64 / SIDES as f64 * TAU;
    let corners: Vec<DVec3> =
        (0..SIDES).flat_map(|k| [at(ring(k), RADIUS, 0.0), at(ring(k), widened, FUNNEL)]).collect();
    let triangles: Vec<[u32; 3]> = (0..SIDES as u32)
        .flat_map(|k| {
            let next = (k + 1) % SIDES as u32;
            [[2 * k, 2 * next, 2 * k + 1], [2 * next, 2 * next + 1, 2 * k + 1]]
        })
        .collect();
    push(reading, &corners, &triangles, lamp("funnel of a spot light".to_owned(), [0.0; 3]));
}

fn push(reading: &mut Reading, corners: &[DVec3], triangles: &[[u32; 3]], material: Material) {
    let key = Some(usize::MAX - reading.model.materials.len());
    let Ok(id) = reading.add_material(key, material) else { return };
    let first = reading.model.positions.len() as u32;
    reading.model.positions.extend(corners);
    reading.model.triangles.extend(triangles.iter().map(|t| t.map(|corner| first + corner)));
    reading.model.material_ids.extend(std::iter::repeat_n(id, triangles.len()));
}
