//! Whole files: merging several into one, removing the samples of some workers, putting samples in
//! order, and copying rays into other sections.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use holo_beamfile::{Maker, Skipped};
use holo_scene::Scene;
use holo_server::Holodeck;

pub use holo_server::{Forgotten, Merged, Optimized, Reframed};

use crate::{
    config::HolodeckConfig,
    prepare::{SMALL_CACHE, spec},
};

/// A file whose samples were merged into another one.
pub struct MergedPart<'a> {
    /// The file.
    pub path: &'a Path,
    /// What became of its samples.
    pub merged: Merged,
    /// Its blocks of kinds that this version does not know. They are not merged.
    pub skipped: Vec<Skipped>,
}

/// Merges the samples of `parts` into `into`, which is made if it does not exist. `each` gets every
/// part once it is merged. Returns the sums. Merging a part again changes nothing.
///
/// # Errors
/// If a file cannot be read or written, or the files are not of one scene.
pub fn merge(into: &Path, parts: &[PathBuf], mut each: impl FnMut(MergedPart)) -> Result<Merged> {
    let mut total = Merged::default();
    let mut opened = None;
    for path in parts {
        let part = Holodeck::open_read_only(path, SMALL_CACHE)?;
        let target = match &opened {
            Some(target) => target,
            None if into.exists() => opened.insert(Holodeck::open(into, SMALL_CACHE)?),
            None => opened.insert(part.without_samples(into)?),
        };
        let doing = || format!("merging {} into {}", path.display(), into.display());
        let merged = target.merge(&part).with_context(doing)?;
        total.added += merged.added;
        total.better += merged.better;
        total.known += merged.known;
        each(MergedPart { path, merged, skipped: part.file.skipped() });
    }
    Ok(total)
}

/// Removes the samples of the workers with these numbers from a file, and those of all workers that
/// joined with the tokens of these names. Number 0 stands for all unknown workers. A later fill
/// traces the removed samples again.
///
/// # Errors
/// If the file knows none of the workers, cannot be read or written, or another process writes to
/// it.
pub fn forget(file: &Path, workers: &[u16], tokens: &[String]) -> Result<Forgotten> {
    let mut makers: Vec<Maker> = workers.iter().map(|&number| Maker(number)).collect();
    if !tokens.is_empty() {
        let known = Holodeck::open_read_only(file, SMALL_CACHE)?;
        for token in tokens {
            let joined = known.makers().of_token(token);
            ensure!(!joined.is_empty(), "no worker of {} joined with {token}", file.display());
            makers.extend(joined);
        }
    }
    Holodeck::forget(file, &makers)
}

/// Writes a file anew with the samples of each beam side by side, and without superseded ones.
/// Views are then read faster, and pictures are the same.
///
/// # Errors
/// If the file cannot be read or written, is damaged, or another process writes to it. It is then
/// as before.
pub fn optimize(file: &Path) -> Result<Optimized> {
    Holodeck::optimize(file)
}

/// Makes the file `to` of the same scene and settings with the sections of `config`, and copies the
/// rays of `from` into it where these sections can store them.
///
/// # Errors
/// If `to` exists or cannot be written, `from` cannot be read, or a section is not valid or stores
/// none of the rays.
pub fn copy(from: &Path, to: &Path, config: &HolodeckConfig) -> Result<Reframed> {
    ensure!(!to.exists(), "{} exists already: name a new file", to.display());
    let old = Holodeck::open_read_only(from, SMALL_CACHE)?;
    let packed = old.packed_scene().with_context(|| format!("reading {}", from.display()))?;
    let scene = (!packed.is_empty()).then(|| Scene::unpack(&packed)).transpose();
    let scene = scene.with_context(|| format!("reading the scene of {}", from.display()))?;
    let sections = config.section.iter().enumerate().map(|(index, section)| {
        spec(config, scene.as_ref(), section, index).with_context(|| format!("section {index}"))
    });
    let sections = sections.collect::<Result<Vec<_>>>()?;
    let doing = || format!("copying {} to {}", from.display(), to.display());
    old.reframe(to, sections).with_context(doing)
}
