//! Writing a file anew with the samples of each beam side by side (Larson & Simmons 1999, §2.2).
//!
//! While a file is filled, the samples of a beam come a few at a time, and lie in as many places.
//! A view then needs many short reads. In the new file, a beam's samples are one extent for each
//! kind and maker, and superseded samples are left out.
//!
//! Beams lie along a curve through the cells where rays enter and leave (Morton 1966). The beams of
//! a view pass one eye, so neighbouring cells of entry have neighbouring cells of exit. By the
//! beams' numbers, all exits of one entry come before the next entry, and a view needs a read for
//! each.
//!
//! Invariant: the new file takes the old one's place only when it is complete on the disk. Until
//! then an error or a killed process leaves the old file as it was.

use std::{collections::BTreeMap, fs::File, ops::ControlFlow, path::Path, sync::Arc};

use anyhow::{Context, Result, bail, ensure};
use holo_beamfile::{BeamSamples, Caching};
use holo_section::{BeamKey, Section};
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
        new.file.keep_order();
        for group in groups(self) {
            let mut beams: BTreeMap<CurvePlace, (BeamKey, Arc<BeamSamples>)> = BTreeMap::new();
            self.file.read_many(&group, Caching::Bypass, &mut |key, samples| {
                beams.insert(place(&self.sections, key), (key, samples));
                ControlFlow::Continue(())
            })?;
            for (key, samples) in beams.into_values() {
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

/// The place of a beam on the curve: section, walls, position among their cells, and the beam.
type CurvePlace = (u16, [u8; 2], u64, u64);

/// Returns a beam's place on the curve.
fn place(sections: &[Section], key: BeamKey) -> CurvePlace {
    let section = sections.get(usize::from(key.section));
    let Some(pair) = section.and_then(|section| section.cells(key.beam)) else {
        return (key.section, [u8::MAX; 2], 0, key.beam.0);
    };
    let (entry, exit) = (pair.entry, pair.exit);
    let along = interleaved([entry.u, entry.v, exit.u, exit.v]);
    (key.section, [entry.wall, exit.wall], along, key.beam.0)
}

/// Returns the bits of four numbers in turn, the highest ones first.
fn interleaved(numbers: [u16; 4]) -> u64 {
    let bits = (0..u16::BITS).rev().flat_map(|bit| numbers.map(|number| (number >> bit) & 1));
    bits.fold(0, |all, bit| (all << 1) | u64::from(bit))
}

/// Returns a file's beams with samples, in the order of the curve, in groups that are read
/// together.
fn groups(holodeck: &Holodeck) -> Vec<Vec<BeamKey>> {
    let mut beams = Vec::new();
    holodeck.file.for_each_beam(&mut |key, count| {
        beams.push((place(&holodeck.sections, key), key, count));
    });
    beams.sort_unstable_by_key(|&(place, ..)| place);
    let (mut groups, mut group, mut samples) = (Vec::new(), Vec::new(), 0);
    for (_, key, count) in beams {
        if samples + count > GROUP_SAMPLES || group.len() >= GROUP_BEAMS {
            groups.push(std::mem::take(&mut group));
            samples = 0;
        }
        group.push(key);
        samples += count;
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_meets_every_cell_of_a_cube_before_the_next_cube() {
        assert_eq!(interleaved([0; 4]), 0);
        assert_eq!(interleaved([u16::MAX; 4]), u64::MAX);
        assert_eq!(interleaved([1, 0, 0, 0]), 8);
        assert_eq!(interleaved([2, 0, 1, 1]), 0b1000_0011);
        let cube = |number: u16| (0..4).map(move |axis| (number >> axis) & 1).map(|bit| 6 + bit);
        let mut inside: Vec<u64> = (0..16)
            .map(|number| {
                let cells: Vec<u16> = cube(number).collect();
                interleaved([cells[0], cells[1], cells[2], cells[3]])
            })
            .collect();
        inside.sort_unstable();
        assert!(inside.windows(2).all(|pair| pair[1] == pair[0] + 1), "{inside:?}");
    }
}
