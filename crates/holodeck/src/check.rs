//! `holodeck check`: lists the peculiarities of a model, with their number, place and effect on
//! pictures.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use holo_progress::{HumanBytes, HumanCount};
use holo_raycast::Raycaster;
use holo_scene::Scene;
use serde_json::json;

use crate::{
    loading, places,
    scene_args::{SceneArgs, check_units},
};

/// Check a model: lists what is odd, how often, where, and what it does to pictures
#[derive(clap::Args)]
#[command(after_help = "Example:\n  holodeck check house.obj --json")]
pub struct CheckArgs {
    /// The scene
    #[arg(value_name = "MODEL")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    scene_args: SceneArgs,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

/// See [`CheckArgs`].
pub fn run(args: &CheckArgs) -> Result<()> {
    let config = args.scene_args.resolve(args.scene.as_ref())?;
    check_units(&config)?;
    let loaded = loading::load_quietly(&config)?;
    let raycaster = Raycaster::build(Arc::new(loaded.scene))?;
    let scene: &Scene = raycaster.scene();
    let findings = holo_survey::findings(&raycaster);
    let memory = holo_survey::memory(scene);
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    let (low, high) = scene.bounds();
    if args.json {
        let findings: Vec<_> = findings
            .iter()
            .map(|found| {
                json!({
                    "kind": found.kind, "count": found.count, "at": found.at,
                    "material": found.material, "means": found.means,
                })
            })
            .collect();
        let report = json!({
            "triangles": scene.triangles().len(), "stored_triangles": stored_triangles(scene),
            "instances": scene.instances().len(), "materials": scene.materials.len(),
            "textures": scene.shading.as_ref().map_or(0, |shading| shading.textures.len()),
            "low": low.to_array(), "high": high.to_array(), "memory_bytes": memory,
            "findings": findings, "warnings": warnings,
        });
        holo_progress::print_line!("{report}");
        return Ok(());
    }
    holo_progress::print_line!(
        "{}, {} materials, {} in memory without its hierarchy",
        triangles_in_words(scene),
        scene.materials.len(),
        HumanBytes(memory as u64)
    );
    let stated = config.unit.map(|unit| unit.0);
    let unit = stated.or(loaded.about.unit.as_ref().map(|said| said.value)).unwrap_or(1.0);
    let step = places::step(low.distance(high), unit);
    for found in &findings {
        let place = found
            .at
            .map(|place| place.map(|part| places::rounded(part, step)))
            .map_or_else(String::new, |[x, y, z]| format!(", first at {x} {y} {z}"));
        let of = found.material.as_ref().map_or_else(String::new, |name| format!(" of `{name}`"));
        holo_progress::print_line!(
            "{}: {}{of}{place}: {}",
            found.kind,
            HumanCount(found.count as u64),
            found.means
        );
    }
    warnings.iter().for_each(|warning| holo_progress::print_line!("{warning}"));
    if findings.is_empty() && warnings.is_empty() {
        holo_progress::print_line!("nothing odd");
    }
    Ok(())
}

/// Returns the number of triangles in memory. Those of a mesh that instances share count once.
fn stored_triangles(scene: &Scene) -> usize {
    let of_meshes: usize = scene.meshes().map(|mesh| mesh.triangles.len()).sum();
    scene.own().triangles.len() + of_meshes
}

/// Returns the number of triangles that the scene shows. With instances, it also says why so many
/// take so little memory.
fn triangles_in_words(scene: &Scene) -> String {
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
        let plain = Scene::new(glam::DVec3::ZERO, own.0, own.1, own.2, material, [0.0; 3]).unwrap();
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
