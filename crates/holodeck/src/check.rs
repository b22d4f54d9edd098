//! `holodeck check`: lists the peculiarities of a model, with their number, place and effect on
//! pictures.

use std::path::PathBuf;

use anyhow::Result;
use holo_progress::{HumanBytes, HumanCount};
use serde_json::json;

use crate::{
    loading,
    scene_args::{SceneArgs, check_units},
};

/// Check a model: lists what is odd, how often, where, and what it does to pictures
#[derive(clap::Args)]
#[command(after_help = "Example:\n  holodeck check house.obj --json")]
pub struct Args {
    /// The scene
    #[arg(value_name = "MODEL")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    scene_args: SceneArgs,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

/// See [`Args`].
pub fn run(args: &Args) -> Result<()> {
    let config = args.scene_args.resolve(args.scene.as_ref())?;
    check_units(&config)?;
    let loaded = loading::load_quietly(&config)?;
    let scene = &loaded.scene;
    let findings = holo_survey::findings(scene);
    let memory = holo_survey::memory(scene);
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    if args.json {
        let (low, high) = scene.bounds();
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
            "triangles": scene.triangles().len(), "materials": scene.materials.len(),
            "textures": scene.shading.as_ref().map_or(0, |shading| shading.textures.len()),
            "low": low.to_array(), "high": high.to_array(), "memory_bytes": memory,
            "findings": findings, "warnings": warnings,
        });
        holo_progress::print_line!("{report}");
        return Ok(());
    }
    holo_progress::print_line!(
        "{} triangles, {} materials, {} in memory without its hierarchy",
        HumanCount(scene.triangles().len() as u64),
        scene.materials.len(),
        HumanBytes(memory as u64)
    );
    for found in &findings {
        let place = found
            .at
            .map_or_else(String::new, |[x, y, z]| format!(", first at {x:.3} {y:.3} {z:.3}"));
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
