//! The peculiarities of a model, with their number, place and effect on pictures.

use std::sync::Arc;

use anyhow::Result;
use glam::DVec3;
use holo_progress::HumanCount;
use holo_raycast::Raycaster;
use holo_scene::{Luminaire, Scene};
use holo_survey::Finding;

use crate::{
    config::HolodeckConfig, light::hang, loading, opening::stated_unit, places,
    settings::check_units,
};

/// A model that was checked.
pub struct CheckedModel {
    /// The model, prepared for tracing.
    pub raycaster: Raycaster,
    /// What is odd.
    pub findings: Vec<Finding>,
    /// What of its file is left out or odd, for people.
    pub warnings: Vec<String>,
    /// The luminaires, for people.
    pub luminaires: Vec<String>,
    /// The scene's memory without its hierarchy, bytes.
    pub memory: usize,
    /// The step to which places in it are rounded for people, scene units.
    pub step: f64,
}

/// Loads a configuration's scene, and lists what is odd. Prints nothing.
///
/// # Errors
/// If there is no scene, or it cannot be loaded or traced.
pub fn check(config: &HolodeckConfig) -> Result<CheckedModel> {
    check_units(config)?;
    let loaded = loading::load_quietly(config)?;
    let mut warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    let up = config.up.map(|up| DVec3::from_array(up.0));
    let up = up.unwrap_or_else(|| holo_survey::guess_up(&loaded.scene, &loaded.about).value);
    let unit = stated_unit(config, &loaded.about);
    let luminaires = &config.light().luminaires;
    let (scene, said) = hang(luminaires, &loaded.photometry, loaded.scene, up, unit)?;
    warnings.extend(dark_lamps(&scene));
    let raycaster = Raycaster::build(Arc::new(scene))?;
    let scene: &Scene = raycaster.scene();
    let (low, high) = scene.bounds();
    let step = places::step(low.distance(high), unit.unwrap_or(1.0));
    let (findings, memory) = (holo_survey::findings(&raycaster), holo_survey::memory(scene));
    Ok(CheckedModel { raycaster, findings, warnings, luminaires: said, memory, step })
}

/// Returns words about luminaires without light.
fn dark_lamps(scene: &Scene) -> Vec<String> {
    let is_dark = |lamp: &&Luminaire| !scene.materials[lamp.material as usize].emits();
    let dark = scene.luminaires().iter().filter(is_dark);
    dark.map(|lamp| format!("luminaire {}: it has no light", lamp.name)).collect()
}

/// Returns the number of triangles in memory. Those of a mesh that instances share count once.
pub fn stored_triangles(scene: &Scene) -> usize {
    let of_meshes: usize = scene.meshes().map(|mesh| mesh.triangles.len()).sum();
    scene.own().triangles.len() + of_meshes
}

/// Returns the number of triangles that the scene shows. With instances, it also says why so many
/// take so little memory.
pub fn triangles_in_words(scene: &Scene) -> String {
    let count = |number: usize| HumanCount(number as u64);
    let shown = format!("{} triangles", count(scene.triangles().len()));
    match scene.instances().len() {
        0 => shown,
        instances => format!(
            "{shown} ({} in memory, because {} instances share meshes)",
            count(stored_triangles(scene)),
            count(instances)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_scene::{Geometry, Material, Placement};

    #[test]
    fn triangles_are_counted_as_placed_and_as_stored() {
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let material = vec![Material::grey("m")];
        let own = (corners.to_vec(), vec![[0, 1, 2]], vec![0]);
        let plain = Scene::new(DVec3::ZERO, own.0, own.1, own.2, material, [0.0; 3]).unwrap();
        assert_eq!(triangles_in_words(&plain), "1 triangles");
        let mesh = Geometry {
            positions: &corners,
            triangles: &[[0, 1, 2], [0, 2, 1]],
            material_ids: &[0; 2],
        };
        let at = |x: f64| {
            let rows = [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
            (0, Placement::new(rows).unwrap())
        };
        let placed: Vec<_> = (0..1000).map(|k| at(f64::from(k))).collect();
        let shared = plain.with_instances(&[mesh], &placed).unwrap();
        let words = "2,001 triangles (3 in memory, because 1,000 instances share meshes)";
        assert_eq!(triangles_in_words(&shared), words);
        assert_eq!(triangles_in_words(&shared.flattened()), "2,001 triangles");
    }
}
