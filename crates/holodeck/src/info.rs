//! `holodeck info` and `verify`: show the content of a file, and check it for damage.

use std::{
    collections::BTreeMap,
    fs::{File, TryLockError},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use holo_beamfile::{BeamFile, Maker, Skipped};
use holo_progress::{HumanBytes, HumanCount, said_once};
use holo_proto::control::{Engine, RenderSettings};
use holo_section::{ImportanceTable, Section, ViewClass};
use holo_server::{Holodeck, MadeBy, UnseenBeams, superseded_bytes};
use serde::Serialize;

use crate::prepare::SMALL_CACHE;

/// Time without a change after which a file has no writer.
const QUIET: Duration = Duration::from_secs(2);

/// Time for which a file with a writer is watched, in order to measure its growth.
const WATCHED: Duration = Duration::from_secs(2);

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

#[derive(Serialize)]
struct Info {
    file: PathBuf,
    bytes: u64,
    /// The part of these bytes for samples that better ones have replaced.
    superseded_bytes: u64,
    /// Growth; 0 if no process writes to the file.
    bytes_per_hour: f64,
    samples: u64,
    /// How often the scene was replaced by an edited one.
    generation: u32,
    /// Samples of scenes before. Displays show them until new ones come.
    earlier_samples: u64,
    /// Number of samples by their paths.
    paths: BTreeMap<u16, u64>,
    /// The makers of the samples.
    workers: Vec<WorkerInfo>,
    extents: u64,
    sections: Vec<SectionInfo>,
    settings: RenderSettings,
    scene: SceneSummary,
    /// Records of indirect light.
    light_records: usize,
    /// Cells of surface light.
    cells: usize,
    /// Rays traced for these records.
    light_rays: u64,
    views: Vec<(String, String)>,
    /// Factor from radiance to display light that pictures share.
    exposure: Option<f32>,
    /// The choices made in place of missing options, with their reasons.
    choices: Vec<String>,
    /// Simpler scenes for displays: section, `geometry` or `portals`, and the file's origin.
    stand_ins: Vec<(u16, String, String)>,
    up: [f64; 3],
    unit: f64,
    /// Blocks of the file, and those of them that its index describes.
    blocks: u64,
    indexed_blocks: u64,
    /// Number of shares of samples, by layer.
    layers: BTreeMap<u16, u64>,
    /// Blocks of kinds that this version does not know.
    skipped: Vec<SkippedInfo>,
    damage: Vec<String>,
}

#[derive(Serialize)]
struct SkippedInfo {
    kind: u32,
    blocks: u64,
    bytes: u64,
}

#[derive(Serialize)]
struct SectionInfo {
    grid: [u32; 3],
    beams: u64,
    nonempty: u64,
    /// Beams that see nothing and are not traced.
    unseen: u64,
    /// Share of the unseen beams in the section's importance, which is the share of tracing saved.
    unseen_share: f64,
    samples: u64,
    origin: [f64; 3],
    axes: [[f64; 3]; 3],
    class: ViewClass,
    obstructions: bool,
}

/// A machine that has worked for the file. Number 0 stands for all unknown ones.
#[derive(Serialize)]
struct WorkerInfo {
    #[serde(flatten)]
    made_by: MadeBy,
    /// The machine's samples, except those that better ones have replaced.
    samples: u64,
}

#[derive(Serialize)]
struct SceneSummary {
    source: String,
    hash: String,
    bytes: u64,
}

fn collect(file: &Path) -> Result<Info> {
    let bytes_per_hour =
        bytes_per_hour(file).with_context(|| format!("reading {}", file.display()))?;
    let holodeck = Holodeck::open_read_only(file, SMALL_CACHE)?;
    let stats = holodeck.file.stats();
    let about = &holodeck.about;
    let unseen = holodeck.unseen();
    let numbers = numbers(&holodeck.file);
    let shares = unseen_shares(&holodeck.sections, &unseen);
    let sections = holodeck.sections.iter().zip(&stats.sections).enumerate().map(
        |(index, (section, stats))| SectionInfo {
            grid: section.spec().grid,
            beams: section.beam_count(),
            nonempty: stats.nonempty_beams,
            unseen: unseen.count_in(index),
            unseen_share: shares[index],
            samples: stats.samples,
            origin: section.spec().origin,
            axes: section.spec().axes,
            class: section.spec().class,
            obstructions: section.spec().obstructions,
        },
    );
    Ok(Info {
        file: file.to_owned(),
        bytes: stats.file_bytes,
        superseded_bytes: superseded_bytes(&stats),
        bytes_per_hour,
        paths: numbers.paths,
        workers: workers(&holodeck, &numbers.makers),
        samples: stats.samples,
        generation: about.generation,
        earlier_samples: stats.earlier,
        extents: stats.extents,
        sections: sections.collect(),
        settings: about.settings,
        scene: SceneSummary {
            source: about.source.clone(),
            hash: about.scene.hash.iter().map(|byte| format!("{byte:02x}")).collect(),
            bytes: about.scene.bytes,
        },
        light_records: holodeck.light().len(),
        cells: holodeck.cells().len(),
        light_rays: holodeck.light().rays(),
        views: about.views.clone(),
        exposure: about.exposure,
        choices: about.choices.clone(),
        stand_ins: about
            .stand_ins
            .as_ref()
            .map_or_else(Vec::new, |stand_ins| stand_ins.sources.clone()),
        up: about.up,
        unit: about.unit,
        blocks: holodeck.file.report().blocks,
        indexed_blocks: holodeck.file.report().indexed,
        layers: holodeck.file.layers().into_iter().collect(),
        skipped: skipped(&holodeck.file),
        damage: damage(&holodeck),
    })
}

/// Returns whether a process has the file open to write to it. The system ends that with the
/// process, however the process ends.
fn has_writer(file: &Path) -> std::io::Result<bool> {
    // The lock is released at once.
    match File::open(file)?.try_lock_shared() {
        Err(TryLockError::WouldBlock) => Ok(true),
        Err(TryLockError::Error(error)) => Err(error),
        Ok(()) => Ok(false),
    }
}

/// Returns a file's present growth. A writer holds the file's lock, and appends twice a second.
fn bytes_per_hour(file: &Path) -> std::io::Result<f64> {
    let before = file.metadata()?;
    let is_quiet = before.modified()?.elapsed().is_ok_and(|age| age > QUIET);
    if is_quiet || !has_writer(file)? {
        return Ok(0.0);
    }
    let start = Instant::now();
    std::thread::sleep(WATCHED);
    let grown = file.metadata()?.len().saturating_sub(before.len());
    Ok(grown as f64 / start.elapsed().as_secs_f64() * 3600.0)
}

/// Numbers of samples.
#[derive(Default)]
struct SampleCounts {
    /// Samples by their number of paths.
    paths: BTreeMap<u16, u64>,
    /// Samples by their maker.
    makers: BTreeMap<Maker, u64>,
}

fn numbers(file: &BeamFile) -> SampleCounts {
    let mut beams = Vec::new();
    file.for_each_beam(&mut |key, _| beams.push(key));
    let mut numbers = SampleCounts::default();
    for (run, maker) in beams.into_iter().flat_map(|key| file.makers(key)) {
        *numbers.paths.entry(run.paths).or_default() += u64::from(run.count);
        *numbers.makers.entry(maker).or_default() += u64::from(run.count);
    }
    numbers
}

/// Returns all workers of the file, by number.
fn workers(holodeck: &Holodeck, samples: &BTreeMap<Maker, u64>) -> Vec<WorkerInfo> {
    let makers = holodeck.makers();
    let samples_of = |maker| samples.get(&maker).copied().unwrap_or(0);
    let nobody = MadeBy { name: "nobody knows who".into(), ..MadeBy::default() };
    let nobodys = samples_of(Maker::UNKNOWN);
    let known = makers.iter().cloned().map(|made_by| (samples_of(Maker(made_by.id)), made_by));
    let all = known.chain((nobodys > 0).then_some((nobodys, nobody)));
    all.map(|(samples, made_by)| WorkerInfo { made_by, samples }).collect()
}

/// Returns the unseen beams' share of each section's importance.
fn unseen_shares(sections: &[Section], unseen: &UnseenBeams) -> Vec<f64> {
    let tables: Vec<_> = sections.iter().map(ImportanceTable::new).collect();
    let mut shares = vec![0.0; sections.len()];
    for key in unseen.iter() {
        let section = usize::from(key.section);
        if let Some(pair) = sections.get(section).and_then(|section| section.cells(key.beam)) {
            shares[section] += tables[section].of(pair) / tables[section].total();
        }
    }
    shares
}

fn skipped(file: &BeamFile) -> Vec<SkippedInfo> {
    let skipped = file.skipped().into_iter();
    skipped.map(|Skipped { kind, blocks, bytes }| SkippedInfo { kind, blocks, bytes }).collect()
}

/// Returns the damage that was found when the file was opened.
fn damage(holodeck: &Holodeck) -> Vec<String> {
    let damage = holodeck.file.damage().into_iter().map(|damage| damage.to_string());
    damage.chain(holodeck.warnings.iter().cloned()).collect()
}

/// See [`InfoArgs`].
pub fn info(args: &InfoArgs) -> Result<()> {
    let info = collect(&args.file)?;
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
    let paths =
        info.paths.iter().map(|(paths, samples)| format!("{} have {paths}", HumanCount(*samples)));
    holo_progress::print_line!("paths per sample: {}", paths.collect::<Vec<_>>().join(", "));
    for WorkerInfo { made_by, samples } in &info.workers {
        let token = made_by.token.as_ref().map_or_else(String::new, |t| format!(", token {t}"));
        holo_progress::print_line!(
            "worker {} ({}{token}): {} samples, {} beams that see nothing",
            made_by.id,
            made_by.name,
            HumanCount(*samples),
            HumanCount(made_by.claims)
        );
    }
    holo_progress::print_line!("scene: {}", info.scene.source);
    let bounces =
        info.settings.bounces.map_or("unlimited bounces".to_owned(), |n| format!("{n} bounces"));
    let engine = match info.settings.engine {
        Engine::Path => "path",
        Engine::Cached => "cached",
        Engine::Gather => "gather",
    };
    let distances = if info.settings.virtual_distance { ", virtual distances" } else { "" };
    holo_progress::print_line!(
        "engine: {engine}, {bounces}, {} paths per new sample{distances}",
        info.settings.paths_per_sample
    );
    if info.light_records > 0 {
        holo_progress::print_line!(
            "indirect light: {} records",
            HumanCount(info.light_records as u64)
        );
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

/// Prints the index, layers, and blocks of unknown kinds.
fn print_blocks(info: &Info) {
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
    let holodeck = Holodeck::open_read_only(&args.file, SMALL_CACHE)?;
    let mut damage = damage(&holodeck);
    for found in holodeck.file.verify()? {
        let found = found.to_string();
        if !damage.contains(&found) {
            damage.push(found);
        }
    }
    if let Err(error) = holodeck.packed_scene() {
        damage.push(said_once(error.as_ref()));
    }
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
