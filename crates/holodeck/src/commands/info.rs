//! `holodeck info` and `verify`: show the content of a file, and check it for damage.

use std::path::PathBuf;

use anyhow::{Result, bail};
use holo_progress::{HumanBytes, HumanCount};
use holo_proto::control::Engine;
use holo_section::ViewClass;
use holodeck::info::{HolodeckInfo, SkippedInfo, WorkerInfo};

/// Show what a holodeck holds; if it is being written, also how fast it grows (this takes 2
/// seconds)
#[derive(clap::Args)]
#[command(after_help = "Example:\n  holodeck info room.holo --json")]
pub struct InfoArgs {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

/// Read a whole holodeck and check every checksum
#[derive(clap::Args)]
#[command(after_help = "Example:\n  holodeck verify room.holo")]
pub struct VerifyArgs {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

/// See [`InfoArgs`].
pub fn info(args: &InfoArgs) -> Result<()> {
    let info = holodeck::info::info(&args.file)?;
    if args.json {
        holo_progress::print_line!("{}", serde_json::to_string_pretty(&info)?);
        return Ok(());
    }
    holo_progress::print_line!(
        "{}: {}, {} samples",
        args.file.display(),
        HumanBytes(info.bytes),
        HumanCount(info.samples)
    );
    if info.bytes_per_hour > 0.0 {
        holo_progress::print_line!(
            "being written: growing by about {}/h",
            HumanBytes(info.bytes_per_hour as u64)
        );
    }
    if info.superseded_bytes > 0 {
        holo_progress::print_line!(
            "superseded: {} of samples that better ones have replaced",
            HumanBytes(info.superseded_bytes)
        );
    }
    if info.generation > 0 {
        holo_progress::print_line!(
            "generation {}: {} samples of the scene before, shown until new ones come",
            info.generation,
            HumanCount(info.earlier_samples)
        );
    }
    let is_captured = info.settings.engine == Engine::Captured;
    let paths =
        info.paths.iter().map(|(paths, samples)| format!("{} have {paths}", HumanCount(*samples)));
    if !is_captured {
        holo_progress::print_line!("paths per sample: {}", paths.collect::<Vec<_>>().join(", "));
    }
    for WorkerInfo { made_by, samples } in &info.workers {
        if is_captured {
            let (id, name, samples) = (made_by.id, &made_by.name, HumanCount(*samples));
            holo_progress::print_line!("picture {id} ({name}): {samples} samples");
            continue;
        }
        let token = made_by.token.as_ref().map_or_else(String::new, |t| format!(", token {t}"));
        let of = made_by.light_of.iter().map(u16::to_string).collect::<Vec<_>>().join(", ");
        let light = if of.is_empty() { of } else { format!(", with surface light of {of}") };
        holo_progress::print_line!(
            "worker {} ({}{token}{light}): {} samples, {} beams that see nothing",
            made_by.id,
            made_by.name,
            HumanCount(*samples),
            HumanCount(made_by.claims)
        );
    }
    if is_captured {
        holo_progress::print_line!("scene: none; the rays are pixels of {}", info.scene.source);
        holo_progress::print_line!("engine: captured, nothing is traced");
    } else {
        print_tracing(&info);
    }
    if info.cells > 0 {
        holo_progress::print_line!("surface light: {} cells", HumanCount(info.cells as u64));
    }
    for (index, section) in info.sections.iter().enumerate() {
        let [w, d, h] = section.grid;
        let obstructions = if section.obstructions { "on" } else { "off" };
        let class = match section.class {
            ViewClass::Interior => "interior",
            ViewClass::Exterior => "exterior",
        };
        holo_progress::print_line!(
            "section {index}: {class}, grid {w}x{d}x{h}, obstructions {obstructions}, {} of {} beams \
             hold {} samples, {} see nothing",
            HumanCount(section.nonempty),
            HumanCount(section.beams),
            HumanCount(section.samples),
            HumanCount(section.unseen)
        );
    }
    for (section, kind, source) in &info.stand_ins {
        holo_progress::print_line!("section {section}: {kind} from {source}");
    }
    for choice in &info.choices {
        holo_progress::print_line!("chosen: {choice}");
    }
    for (name, options) in &info.views {
        holo_progress::print_line!("view {name}: {options}");
    }
    print_blocks(&info);
    for damage in &info.damage {
        holo_progress::print_line!("damaged: {damage}");
    }
    Ok(())
}

/// Prints the scene, and how it is traced.
fn print_tracing(info: &HolodeckInfo) {
    holo_progress::print_line!("scene: {}", info.scene.source);
    let bounces =
        info.settings.bounces.map_or("unlimited bounces".to_owned(), |n| format!("{n} bounces"));
    let engine = info.settings.engine.name();
    let earlier = info.earlier_engine.as_ref();
    let earlier = earlier.map_or_else(String::new, |name| format!(" (first samples: {name})"));
    let distances = if info.settings.virtual_distance { ", virtual distances" } else { "" };
    holo_progress::print_line!(
        "engine: {engine}{earlier}, {bounces}, {} paths per new sample{distances}",
        info.settings.paths_per_sample
    );
}

/// Prints the index, layers, and blocks of unknown kinds.
fn print_blocks(info: &HolodeckInfo) {
    holo_progress::print_line!(
        "index: {} of {} blocks",
        HumanCount(info.indexed_blocks),
        HumanCount(info.blocks)
    );
    if !info.layers.is_empty() {
        holo_progress::print_line!(
            "layers: {}, with {} shares of samples",
            info.layers.len(),
            HumanCount(info.layers.values().sum())
        );
    }
    for SkippedInfo { kind, blocks, bytes } in &info.skipped {
        holo_progress::print_line!(
            "skipped: {blocks} blocks of kind {kind} ({}), which a later version wrote",
            HumanBytes(*bytes)
        );
    }
}

/// See [`VerifyArgs`].
pub fn verify(args: &VerifyArgs) -> Result<()> {
    let damage = holodeck::info::verify(&args.file)?;
    if args.json {
        holo_progress::print_line!(
            "{}",
            serde_json::json!({ "file": args.file, "damage": damage })
        );
    } else {
        for damage in &damage {
            holo_progress::print_line!("{damage}");
        }
    }
    if damage.is_empty() {
        if !args.json {
            holo_progress::print_line!("{}: whole", args.file.display());
        }
        return Ok(());
    }
    bail!("{}: {} damaged places; the rest can be used", args.file.display(), damage.len());
}
