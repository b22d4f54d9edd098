//! Guesses the up direction.

use glam::DVec3;
use holo_scene::{Material, ModelFacts, Scene, StatedValue};

use crate::{Guess, names};

/// Share of an area that must agree on an axis.
const AGREED: f64 = 0.75;

/// Ratio of height to lesser width below which a scene is lower than wide.
const LOW: f64 = 0.67;

/// Returns the up axis of a scene. It follows, in this order, from the statement of its file, the
/// normals of materials called floor or ceiling, the directions of lamps, the usual axis of its
/// program, or the direction in which the scene is low. Otherwise it is +y, as in most model files.
#[must_use]
pub fn guess_up(scene: &Scene, about: &ModelFacts) -> Guess<DVec3> {
    let said = |up: &StatedValue<[f64; 3]>, how: &str| {
        let axis = DVec3::from_array(up.value);
        Guess::new(axis, format!("+{}, {how} `{}`", name(axis), up.words))
    };
    let stated = about.up.as_ref().map(|up| said(up, "as the file says:"));
    let usual = || about.usual_up.as_ref().map(|up| said(up, "as usual in files of"));
    stated
        .or_else(|| by_names(scene))
        .or_else(|| by_lamps(scene))
        .or_else(usual)
        .or_else(|| by_extent(scene))
        .unwrap_or_else(|| Guess::new(DVec3::Y, "+y, as in most model files"))
}

fn name(axis: DVec3) -> &'static str {
    if axis == DVec3::Y { "y" } else { "z" }
}

/// Returns the sum of area times the normal's components over triangles of some materials, and
/// their total area. `fold` is applied to each component.
fn normals(
    scene: &Scene,
    of: impl Fn(&Material) -> bool,
    fold: impl Fn(DVec3) -> DVec3,
) -> (DVec3, f64) {
    let wanted: Vec<bool> = scene.materials.iter().map(of).collect();
    let (mut sum, mut total) = (DVec3::ZERO, 0.0);
    for (triangle, material) in (0_u32..).zip(scene.material_ids()) {
        if wanted[material as usize] {
            let area = scene.area(triangle);
            sum += fold(scene.normal(triangle).as_dvec3()) * area;
            total += area;
        }
    }
    (sum, total)
}

fn by_names(scene: &Scene) -> Option<Guess<DVec3>> {
    let is_level = |m: &Material| names::is_level(&m.name);
    let (sum, total) = normals(scene, is_level, DVec3::abs);
    let axis = [DVec3::Y, DVec3::Z].into_iter().find(|axis| axis.dot(sum) > AGREED * total)?;
    let example = scene.materials.iter().find(|m| is_level(m)).map_or("", |m| m.name.as_str());
    Some(Guess::new(
        axis,
        format!("+{}, because materials such as `{example}` lie level so", name(axis)),
    ))
}

fn by_lamps(scene: &Scene) -> Option<Guess<DVec3>> {
    let (sum, total) = normals(scene, |m| m.emits() && !m.two_sided_emission, |n| n);
    let axis = [DVec3::Y, DVec3::Z].into_iter().find(|axis| axis.dot(sum) < -AGREED * total)?;
    Some(Guess::new(axis, format!("+{}, because lamps shine the other way", name(axis))))
}

fn by_extent(scene: &Scene) -> Option<Guess<DVec3>> {
    let (low, high) = scene.bounds();
    let size = high - low;
    let is_low = |height: f64, other: f64| height < LOW * size.x.min(other);
    let axis = match (is_low(size.y, size.z), is_low(size.z, size.y)) {
        (true, false) => DVec3::Y,
        (false, true) => DVec3::Z,
        _ => return None,
    };
    let text = format!("+{}, because the scene is lower than wide so", name(axis));
    Some(Guess::new(axis, text))
}
