//! What a file holds, and its damage.

use std::{
    collections::BTreeMap,
    fs::{File, TryLockError},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use holo_beamfile::{BeamFile, Maker, Skipped};
use holo_progress::said_once;
use holo_proto::control::RenderSettings;
use holo_section::{ImportanceTable, Section, ViewClass};
use holo_server::{Holodeck, MadeBy, UnseenBeams, superseded_bytes};
use serde::Serialize;

use crate::prepare::SMALL_CACHE;

/// Time without a change after which a file has no writer.
const QUIET: Duration = Duration::from_secs(2);

/// Time for which a file with a writer is watched, in order to measure its growth.
const WATCHED: Duration = Duration::from_secs(2);

/// What a holodeck holds.
#[derive(Serialize)]
pub struct HolodeckInfo {
    /// The file.
    pub file: PathBuf,
    /// Length of the file, bytes.
    pub bytes: u64,
    /// The part of these bytes for samples that better ones have replaced.
    pub superseded_bytes: u64,
    /// Growth; 0 if no process writes to the file.
    pub bytes_per_hour: f64,
    /// Number of samples.
    pub samples: u64,
    /// How often the scene was replaced by an edited one.
    pub generation: u32,
    /// Samples of scenes before. Displays show them until new ones come.
    pub earlier_samples: u64,
    /// Number of samples by their paths.
    pub paths: BTreeMap<u16, u64>,
    /// The makers of the samples.
    pub workers: Vec<WorkerInfo>,
    /// Number of extents, each with samples of one beam.
    pub extents: u64,
    /// The sections.
    pub sections: Vec<SectionInfo>,
    /// The settings of samples.
    pub settings: RenderSettings,
    /// The engine of the first samples, if it is no more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub earlier_engine: Option<String>,
    /// The scene.
    pub scene: SceneSummary,
    /// Cells of surface light.
    pub cells: usize,
    /// Views by name, as Radiance options.
    pub views: Vec<(String, String)>,
    /// Factor from radiance to display light that pictures share.
    pub exposure: Option<f32>,
    /// The choices made in place of missing options, with their reasons.
    pub choices: Vec<String>,
    /// Simpler scenes for displays: section, `geometry` or `portals`, and the file's origin.
    pub stand_ins: Vec<(u16, String, String)>,
    /// The scene's up axis.
    pub up: [f64; 3],
    /// Length of the scene's unit, metres.
    pub unit: f64,
    /// Blocks of the file.
    pub blocks: u64,
    /// Blocks that the index describes.
    pub indexed_blocks: u64,
    /// Number of shares of samples, by layer.
    pub layers: BTreeMap<u16, u64>,
    /// Blocks of kinds that this version does not know.
    pub skipped: Vec<SkippedInfo>,
    /// The damage that was found when the file was opened.
    pub damage: Vec<String>,
}

/// Blocks of a kind that this version does not know.
#[derive(Serialize)]
pub struct SkippedInfo {
    /// The kind's number.
    pub kind: u32,
    /// Number of blocks.
    pub blocks: u64,
    /// Their length.
    pub bytes: u64,
}

/// What a section holds.
#[derive(Serialize)]
pub struct SectionInfo {
    /// Cells along each axis.
    pub grid: [u32; 3],
    /// Number of beams.
    pub beams: u64,
    /// Beams with samples.
    pub nonempty: u64,
    /// Beams that see nothing and are not traced.
    pub unseen: u64,
    /// Share of the unseen beams in the section's importance, which is the share of tracing saved.
    pub unseen_share: f64,
    /// Number of samples.
    pub samples: u64,
    /// One corner.
    pub origin: [f64; 3],
    /// The three edges from that corner.
    pub axes: [[f64; 3]; 3],
    /// Whether views look out of the section or into it.
    pub class: ViewClass,
    /// True if objects inside the section are visible.
    pub obstructions: bool,
}

/// A machine that has worked for the file. Number 0 stands for all unknown ones.
#[derive(Serialize)]
pub struct WorkerInfo {
    /// The machine.
    #[serde(flatten)]
    pub made_by: MadeBy,
    /// The machine's samples, except those that better ones have replaced.
    pub samples: u64,
}

/// The scene of a holodeck.
#[derive(Serialize)]
pub struct SceneSummary {
    /// The file that it was read from.
    pub source: String,
    /// Checksum of its packed form, in hexadecimal.
    pub hash: String,
    /// Length of its packed form.
    pub bytes: u64,
}

/// Returns what a holodeck holds. If a process writes to the file, this takes two seconds.
///
/// # Errors
/// If the file cannot be read.
pub fn info(file: &Path) -> Result<HolodeckInfo> {
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
    Ok(HolodeckInfo {
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
        earlier_engine: about.earlier_engine.clone(),
        scene: SceneSummary {
            source: about.source.clone(),
            hash: about.scene.hash.iter().map(|byte| format!("{byte:02x}")).collect(),
            bytes: about.scene.bytes,
        },
        cells: holodeck.cells().len(),
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

/// Reads a whole holodeck, checks every checksum, and returns the damage, for people.
///
/// # Errors
/// If the file cannot be read.
pub fn verify(file: &Path) -> Result<Vec<String>> {
    let holodeck = Holodeck::open_read_only(file, SMALL_CACHE)?;
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
    Ok(damage)
}
