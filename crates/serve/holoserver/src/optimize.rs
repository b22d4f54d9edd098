//! Writing a file anew with the samples of each beam side by side (Larson & Simmons 1999, §2.2).
//!
//! While a file is filled, the samples of a beam come a few at a time, and lie in as many places.
//! A view then needs many short reads. In the new file, a beam's samples are one extent for each
//! kind and maker, beams follow each other in the order of their numbers, and superseded samples
//! are left out.
//!
//! Invariant: the new file takes the old one's place only when it is complete on the disk. Until
//! then an error or a killed process leaves the old file as it was.

use std::{collections::BTreeMap, fs::File, ops::ControlFlow, path::Path, sync::Arc};

use anyhow::{Context, Result, bail, ensure};
use holo_beamfile::{BeamSamples, Caching};
use holo_section::BeamKey;
use serde::Serialize;

use crate::holodeck::{Holodeck, beside};
use crate::merge::by_maker;

/// Most samples, and most beams, that are in memory at a time: 40 MB.
const GROUP_SAMPLES: u64 = 4_000_000;
const GROUP_BEAMS: usize = 1 << 16;

/// What an optimization gained.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Optimized {
    /// Samples in the file.
    pub samples: u64,
    /// Samples that were left out, because others of the same number count.
    pub superseded: u64,
    /// Samples of scenes before an edit; they stay as they were.
    pub earlier: u64,
    /// Places in the file in which the samples of its beams lay: before, and now.
    pub extents: [u64; 2],
    /// Length of the file, bytes: before, and now.
    pub bytes: [u64; 2],
}

impl Holodeck {
    /// Writes a file anew with the samples of each beam side by side, and without superseded ones.
    /// Pictures of it are the same.
    ///
    /// # Errors
    /// If another process writes to the file, it is damaged or has blocks of an unknown kind, or
    /// the disk fails. The file is then as before.
    pub fn optimize(path: &Path) -> Result<Optimized> {
        let old = Self::open(path, 0)?;
        if let Some(skipped) = old.file.skipped().first() {
            bail!(
                "{} has blocks of kind {}, which a later version wrote; they would be lost: \
                 optimize the file with that version",
                path.display(),
                skipped.kind
            );
        }
        let fresh = beside(path)?;
        let optimized = old.write_in_order(&fresh);
        if optimized.is_err() {
            // Nothing of value is in it.
            let _ = std::fs::remove_file(&fresh);
        }
        let optimized = optimized?;
        replace(&fresh, path)?;
        Ok(optimized)
    }

    fn write_in_order(&self, fresh: &Path) -> Result<Optimized> {
        let new = self.without_samples(fresh)?;
        let present = self.about.generation;
        let earlier = self.file.copy_samples(&new.file, &|_, generation| generation < present)?;
        new.file.begin_generation(present)?;
        for group in groups(self) {
            let mut beams: BTreeMap<BeamKey, Arc<BeamSamples>> = BTreeMap::new();
            self.file.read_many(&group, Caching::Bypass, &mut |key, samples| {
                beams.insert(key, samples);
                ControlFlow::Continue(())
            })?;
            for (key, samples) in beams {
                let makers = self.file.makers(key);
                for (run, part, maker) in
                    samples.iter().flat_map(|(run, samples)| by_maker(run, samples, &makers))
                {
                    new.file.append(run, maker, part)?;
                }
            }
        }
        self.file.copy_shares(&new.file, &|maker, generation| Some((maker, generation)))?;
        *new.makers_mut() = self.makers().clone();
        new.unseen_mut().add(&self.unseen());
        *new.unproven_mut() = self.unproven().clone();
        new.cells_mut().merge_those(&self.cells(), |_| true);
        new.save_makers()?;
        new.save_unseen()?;
        new.save_cells(true)?;
        new.file.flush()?;
        let (before, now) = (self.file.stats(), new.file.stats());
        let damage = self.file.damage();
        if let Some(damage) = damage.iter().find(|damage| damage.samples() > 0) {
            bail!(
                "{} is damaged, and the rest of the damaged part would be lost: {damage}. \
                 `holodeck verify` lists the damage; `holodeck merge NEW.holo {}` copies what is \
                 intact",
                self.path().display(),
                self.path().display()
            );
        }
        ensure!(
            now.samples == before.samples,
            "{} samples were read of {}: the file stays as it was",
            now.samples,
            before.samples
        );
        let superseded = before.superseded.saturating_sub(now.superseded);
        let earlier = earlier.samples;
        let (samples, path) = (now.samples, new.path().to_owned());
        let extents = [before.extents, now.extents];
        // The index is written when the file is closed.
        drop(new);
        let bytes = std::fs::metadata(&path).map_or(now.file_bytes, |data| data.len());
        let bytes = [before.file_bytes, bytes];
        Ok(Optimized { samples, superseded, earlier, extents, bytes })
    }
}

/// Returns a file's beams with samples, in order, in groups that are read together.
fn groups(holodeck: &Holodeck) -> Vec<Vec<BeamKey>> {
    let (mut groups, mut group, mut samples) = (Vec::new(), Vec::new(), 0);
    holodeck.file.for_each_beam(&mut |key, count| {
        if samples + count > GROUP_SAMPLES || group.len() >= GROUP_BEAMS {
            groups.push(std::mem::take(&mut group));
            samples = 0;
        }
        group.push(key);
        samples += count;
    });
    groups.push(group);
    groups
}

/// Puts a file that is complete on the disk in the place of another one, also on the disk.
pub(crate) fn replace(fresh: &Path, path: &Path) -> Result<()> {
    let doing = || format!("replacing {}", path.display());
    File::open(fresh).and_then(|file| file.sync_all()).with_context(doing)?;
    std::fs::rename(fresh, path).with_context(doing)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = File::open(folder.unwrap_or(Path::new("."))).with_context(doing)?;
    folder.sync_all().with_context(doing)
}
