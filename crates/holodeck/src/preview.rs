//! Adds light to dark scenes: a sky, lamps in rooms without a view of the sky, and a sun for
//! objects without rooms.

use anyhow::Result;
use glam::{DVec3, Vec3};
use holo_raycast::{Ray, Raycaster};
use holo_scene::{Bsdf, Material, Rgb, Scene, Sun};
use holo_survey::{ChosenView, LEAST_LAMP, Room};

/// Radiance of the sky for a scene in which nothing glows, W·sr⁻¹·m⁻².
const SKY: f32 = 1.0;

/// Ratio of the irradiance of a clear sky to that of its sun.
const SKY_OVER_SUN: f32 = 0.2;

/// Ratio of the lamps' radiance to the sky's. A panel of a twentieth of the ceiling is then as
/// bright as a window.
const LAMP_OVER_SKY: f32 = 10.0;

/// Most rooms with an added lamp, the largest first.
const MOST_LAMPS: usize = 8;

/// Width and depth of a lamp, as shares of the room's.
const SHARE: f64 = 0.25;

/// Height of a lamp, as a share of the way from the eye to the ceiling.
const HEIGHT: f64 = 0.9;

/// Number of directions in which the sky is searched for, and the share of them that must reach it.
const DIRECTIONS: usize = 256;
const ENOUGH: f64 = 0.01;

/// Returns the radiance of the sky for a dark scene, and true if any lamp glows in the scene. The
/// sky is as bright as the brightest glow, so that both are visible.
pub fn sky(scene: &Scene) -> (Rgb, bool) {
    let triangles = scene.triangles();
    let most = triangles.flat_map(|triangle| scene.material(triangle).emission).fold(0.0, f32::max);
    match most >= LEAST_LAMP {
        true => ([most; 3], true),
        false => ([SKY; 3], false),
    }
}

/// Returns a radiance in the form of the command line.
pub fn words(radiance: Rgb) -> String {
    let [r, g, b] = radiance.map(|c| format!("{c:.4e}").parse().unwrap_or(c));
    if r == g && g == b { format!("{r}") } else { format!("{r},{g},{b}") }
}

/// Returns a sun that shows the shape of an object in this view. It shines from above, the left and
/// behind the viewer. It is as strong beside this sky as on a clear day.
pub fn sun(sight: &ChosenView, sky: Rgb) -> Sun {
    let right = sight.direction.cross(sight.up).normalize_or_zero();
    let towards = sight.up * 0.8 - right * 0.7 - sight.direction * 0.6;
    let irradiance = sky.map(|c| c * std::f32::consts::PI / SKY_OVER_SUN);
    Sun { towards: towards.normalize_or(sight.up).as_vec3().to_array(), irradiance }
}

/// Returns the radiance of a sky that suits these suns, for scenes without a sky.
pub fn sky_beside(suns: &[Sun]) -> [f32; 3] {
    let share = SKY_OVER_SUN / std::f32::consts::PI;
    std::array::from_fn(|k| share * suns.iter().map(|sun| sun.irradiance[k]).sum::<f32>())
}

/// Returns the scene with a lamp in each large room without a view of the sky, and the number of
/// lamps. `None` if the sky is visible from every room.
pub fn with_lamps(raycaster: &Raycaster, rooms: &[Room]) -> Result<Option<(Scene, usize)>> {
    let rooms = rooms.iter().take(MOST_LAMPS);
    let dark: Vec<&Room> = rooms.filter(|room| !sees_sky(raycaster, room)).collect();
    if dark.is_empty() {
        return Ok(None);
    }
    let scene: &Scene = raycaster.scene();
    let lamp = Material {
        name: "preview lamp".to_owned(),
        bsdf: Bsdf::Diffuse { kd: [0.0; 3] },
        emission: scene.sky.mean().map(|c| c * LAMP_OVER_SKY),
        two_sided_emission: false,
    };
    let panels = dark.iter().flat_map(|room| panel(raycaster, room));
    let corners: Vec<[f32; 3]> =
        panels.map(|corner| (corner - scene.origin).as_vec3().to_array()).collect();
    let faces: Vec<[u32; 3]> = (0..corners.len() as u32)
        .step_by(4)
        .flat_map(|first| [[first, first + 1, first + 2], [first, first + 2, first + 3]])
        .collect();
    let lit = scene.clone().with_faces(&corners, &faces, lamp)?;
    Ok(Some((lit, dark.len())))
}

/// Returns true if enough of the sky is visible from the middle of a room. Panes and partly
/// covered surfaces hide nothing.
fn sees_sky(raycaster: &Raycaster, room: &Room) -> bool {
    let scene = raycaster.scene();
    let [across, along, up] = room.axes;
    let middle = room.origin + (across + along + up) * 0.5;
    let origin = (middle - scene.origin).as_vec3();
    let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
    let is_sky = |&i: &usize| {
        let z = -1.0 + 2.0 * (i as f32 + 0.5) / DIRECTIONS as f32;
        let (sin, cos) = (golden * i as f32).sin_cos();
        let level = (1.0 - z * z).max(0.0).sqrt();
        let mut ray = Ray::new(origin, Vec3::new(level * cos, level * sin, z));
        for _ in 0..8 {
            let Some(hit) = raycaster.nearest(&ray) else { return true };
            let is_pane = matches!(scene.material(hit.triangle).bsdf, Bsdf::ThinGlass { .. });
            if !is_pane && scene.opacity(hit.triangle, hit.u, hit.v) >= 1.0 {
                return false;
            }
            ray.t_min = hit.t;
        }
        false
    };
    (0..DIRECTIONS).filter(is_sky).count() as f64 >= ENOUGH * DIRECTIONS as f64
}

/// Returns the corners of a room's lamp, which shines down.
fn panel(raycaster: &Raycaster, room: &Room) -> [DVec3; 4] {
    let [across, along, height] = room.axes;
    let middle = room.origin + (across + along + height) * 0.5;
    let up = room.sight.up;
    let ceiling = raycaster
        .localize(middle, up)
        .and_then(|(ray, skipped)| Some(skipped + f64::from(raycaster.nearest(&ray)?.t)));
    let middle = middle + up * (HEIGHT * ceiling.unwrap_or(height.length()));
    let (a, b) = (across * (SHARE * 0.5), along * (SHARE * 0.5));
    // Across, along and up are right-handed, so this runs counter-clockwise as seen from below.
    [middle - a - b, middle - a + b, middle + a + b, middle + a - b]
}
