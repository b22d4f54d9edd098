//! `holodeck info` and `verify`: what a file holds, and whether it is whole.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use holo_beamfile::BeamFile;
use holo_progress::{HumanBytes, HumanCount};
use holo_proto::control::RenderSettings;
use holo_section::{ImportanceTable, Section, ViewClass};
use holo_server::{Holodeck, UnseenBeams, superseded_bytes};
use serde::Serialize;

use crate::prepare::SMALL_CACHE;

/// A file that has not changed for so long has no writer.
const QUIET: Duration = Duration::from_secs(2);

/// How long a file that is being written is watched to see how fast it grows.
const WATCHED: Duration = Duration::from_secs(2);

/// What a holodeck holds. Of one that is being written, how fast it grows, too: that takes two seconds.
///
/// Example: holodeck info room.holo --json
#[derive(clap::Args)]
pub struct InfoArgs {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

/// Read a whole holodeck and check every checksum.
///
/// Example: holodeck verify room.holo
#[derive(clap::Args)]
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
    /// Of these, bytes of samples that better ones have replaced.
    superseded_bytes: u64,
    /// How fast it grows: 0 if nobody writes to it.
    bytes_per_hour: f64,
    samples: u64,
    /// Samples by the paths that were averaged into each.
    paths: BTreeMap<u16, u64>,
    extents: u64,
    sections: Vec<SectionInfo>,
    settings: RenderSettings,
    scene: SceneInfo,
    /// Records of indirect light.
    light_records: usize,
    /// Rays that were traced for them.
    light_rays: u64,
    views: Vec<(String, String)>,
    /// Section, `geometry` or `portals`, and where it came from.
    stand_ins: Vec<(u16, String, String)>,
    up: [f64; 3],
    unit: f64,
    damage: Vec<String>,
}

#[derive(Serialize)]
struct SectionInfo {
    grid: [u32; 3],
    beams: u64,
    nonempty: u64,
    /// Beams known to see nothing, which are not traced.
    unseen: u64,
    /// Their share of the section's importance: of what would be traced in them.
    unseen_share: f64,
    samples: u64,
    origin: [f64; 3],
    axes: [[f64; 3]; 3],
    class: ViewClass,
    obstructions: bool,
}

#[derive(Serialize)]
struct SceneInfo {
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
        paths: paths(&holodeck.file),
        samples: stats.samples,
        extents: stats.extents,
        sections: sections.collect(),
        settings: about.settings,
        scene: SceneInfo {
            source: about.source.clone(),
            hash: about.scene.hash.iter().map(|byte| format!("{byte:02x}")).collect(),
            bytes: about.scene.bytes,
        },
        light_records: holodeck.light().len(),
        light_rays: holodeck.light().rays(),
        views: about.views.clone(),
        stand_ins: about
            .stand_ins
            .as_ref()
            .map_or_else(Vec::new, |stand_ins| stand_ins.sources.clone()),
        up: about.up,
        unit: about.unit,
        damage: damage(&holodeck),
    })
}

/// How fast a file grows at present. A writer adds to it twice a second, so one that has not changed for longer has none.
fn bytes_per_hour(file: &Path) -> std::io::Result<f64> {
    let before = file.metadata()?;
    if before.modified()?.elapsed().is_ok_and(|age| age > QUIET) {
        return Ok(0.0);
    }
    let start = Instant::now();
    std::thread::sleep(WATCHED);
    let grown = file.metadata()?.len().saturating_sub(before.len());
    Ok(grown as f64 / start.elapsed().as_secs_f64() * 3600.0)
}

fn paths(file: &BeamFile) -> BTreeMap<u16, u64> {
    let mut beams = Vec::new();
    file.for_each_beam(&mut |key, _| beams.push(key));
    let mut samples = BTreeMap::new();
    for run in beams.into_iter().flat_map(|key| file.runs(key)) {
        *samples.entry(run.paths).or_default() += u64::from(run.count);
    }
    samples
}

/// The unseen beams' share of each section's importance.
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

/// What was wrong with the file at opening.
fn damage(holodeck: &Holodeck) -> Vec<String> {
    let damage = holodeck.file.damage().into_iter().map(|damage| damage.to_string());
    damage.chain(holodeck.warnings.iter().cloned()).collect()
}

/// See [`InfoArgs`].
pub fn info(args: &InfoArgs) -> Result<()> {
    let info = collect(&args.file)?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&info)?);
        return Ok(());
    }
    println!(
        "{}: {}, {} samples",
        args.file.display(),
        HumanBytes(info.bytes),
        HumanCount(info.samples)
    );
    if info.bytes_per_hour > 0.0 {
        println!("being written: {} more an hour", HumanBytes(info.bytes_per_hour as u64));
    }
    if info.superseded_bytes > 0 {
        println!(
            "superseded: {} of samples that were traced again with more paths",
            HumanBytes(info.superseded_bytes)
        );
    }
    let paths =
        info.paths.iter().map(|(paths, samples)| format!("{} of {paths}", HumanCount(*samples)));
    println!("samples by paths: {}", paths.collect::<Vec<_>>().join(", "));
    println!("scene: {}", info.scene.source);
    let bounces =
        info.settings.bounces.map_or("no limit of bounces".to_owned(), |n| format!("{n} bounces"));
    let distances = if info.settings.virtual_distance { ", virtual distances" } else { "" };
    println!(
        "engine: {:?}, {bounces}, {} paths per sample{distances}",
        info.settings.engine, info.settings.paths_per_sample
    );
    if info.light_records > 0 {
        println!("indirect light: {} records", HumanCount(info.light_records as u64));
    }
    for (index, section) in info.sections.iter().enumerate() {
        let [w, d, h] = section.grid;
        let obstructions = if section.obstructions { "on" } else { "off" };
        println!(
            "section {index}: {:?}, grid {w}x{d}x{h}, obstructions {obstructions}, {} of {} beams hold {} samples, {} see nothing",
            section.class,
            HumanCount(section.nonempty),
            HumanCount(section.beams),
            HumanCount(section.samples),
            HumanCount(section.unseen)
        );
    }
    for (section, kind, source) in &info.stand_ins {
        println!("section {section}: {kind} from {source}");
    }
    for (name, options) in &info.views {
        println!("view {name}: {options}");
    }
    for damage in &info.damage {
        println!("damaged: {damage}");
    }
    Ok(())
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
        damage.push(format!("{error:#}"));
    }
    if args.json {
        println!("{}", serde_json::json!({ "file": args.file, "damage": damage }));
    } else {
        for damage in &damage {
            println!("{damage}");
        }
    }
    if damage.is_empty() {
        if !args.json {
            println!("{}: whole", args.file.display());
        }
        return Ok(());
    }
    bail!("{}: {} damaged places; everything else can be used", args.file.display(), damage.len());
}
