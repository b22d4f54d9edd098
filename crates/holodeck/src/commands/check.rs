//! `holodeck check`: lists the peculiarities of a model, with their number, place and effect on
//! pictures.

use std::path::PathBuf;

use anyhow::Result;
use holo_progress::{HumanBytes, HumanCount};
use holo_scene::Scene;
use holodeck::{
    check::{CheckedModel, check, stored_triangles, triangles_in_words},
    places,
};
use serde_json::json;

use crate::commands::scene_args::SceneArgs;

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
    let checked = check(&config)?;
    let CheckedModel { findings, warnings, luminaires, memory, step, .. } = &checked;
    let scene: &Scene = checked.raycaster.scene();
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
            "findings": findings, "warnings": warnings, "luminaires": luminaires,
        });
        holo_progress::print_line!("{report}");
        return Ok(());
    }
    holo_progress::print_line!(
        "{}, {} materials, {} in memory without its hierarchy",
        triangles_in_words(scene),
        scene.materials.len(),
        HumanBytes(*memory as u64)
    );
    luminaires.iter().for_each(|line| holo_progress::print_line!("{line}"));
    for found in findings {
        let place = found
            .at
            .map(|place| place.map(|part| places::rounded(part, *step)))
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
