//! Whole files: merging several into one, and removing the samples of some workers.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use holo_beamfile::{Maker, Skipped};
use holo_server::Holodeck;

pub use holo_server::{Forgotten, Merged};

use crate::prepare::SMALL_CACHE;

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

/// Removes the samples of the workers with these numbers from a file. 0 stands for all unknown
/// workers. A later fill traces the removed samples again.
///
/// # Errors
/// If the file cannot be read or written, or another process writes to it.
pub fn forget(file: &Path, workers: &[u16]) -> Result<Forgotten> {
    let makers: Vec<Maker> = workers.iter().map(|&number| Maker(number)).collect();
    Holodeck::forget(file, &makers)
}
