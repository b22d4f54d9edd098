//! Removing what some machines have made from a file.
//!
//! The file is written anew without it, and takes the old one's place at the end. So an error or a
//! crash leaves the old file as it was.

use std::path::Path;

use anyhow::{Result, bail};
use holo_beamfile::Maker;
use serde::Serialize;

use crate::holodeck::{Holodeck, beside};
use crate::optimize::replace;

/// Numbers of removed and remaining parts of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Forgotten {
    /// Samples removed, also those that others had superseded.
    pub samples: u64,
    /// Those of them that other machines made, with surface light of the forgotten ones.
    pub samples_of_others: u64,
    /// Unseen beams that are no longer known.
    pub unseen: u64,
    /// Cells of surface light removed.
    pub cells: u64,
    /// Samples that stay.
    pub left: u64,
}

impl Holodeck {
    /// Removes from a file what these makers have made, and what others have made with their
    /// surface light. 0 stands for whoever is not known.
    ///
    /// The file does not say who found which unseen beam. If one of these makers has found any, all
    /// are removed, and workers find the true ones again.
    ///
    /// # Errors
    /// If the file has no such maker or blocks of an unknown kind, another process writes to it, or
    /// the disk fails. The file is then as before.
    pub fn forget(path: &Path, makers: &[Maker]) -> Result<Forgotten> {
        let old = Self::open(path, 0)?;
        for maker in makers.iter().filter(|maker| **maker != Maker::UNKNOWN) {
            if old.makers().get(*maker).is_none() {
                bail!("{} knows no worker {}", path.display(), maker.0);
            }
        }
        if let Some(skipped) = old.file.skipped().first() {
            bail!(
                "{} has blocks of kind {}, which a later version wrote; they would be lost: remove \
                 the samples with that version",
                path.display(),
                skipped.kind
            );
        }
        let fresh = beside(path)?;
        let forgotten = old.copy_without(&fresh, makers);
        if forgotten.is_err() {
            // Nothing of value is in it.
            let _ = std::fs::remove_file(&fresh);
        }
        let forgotten = forgotten?;
        replace(&fresh, path)?;
        Ok(forgotten)
    }

    fn copy_without(&self, fresh: &Path, makers: &[Maker]) -> Result<Forgotten> {
        let new = self.without_samples(fresh)?;
        let known = self.makers();
        let gone = known.tainted_by(makers);
        let others: Vec<Maker> = gone
            .iter()
            .copied()
            .filter(|maker| {
                let machine = known.get(*maker).and_then(|made| made.machine).map(Maker);
                !makers.contains(maker) && !machine.is_some_and(|machine| makers.contains(&machine))
            })
            .collect();
        let copied = self.file.copy_samples(&new.file, &|maker, _| !gone.contains(&maker))?;
        self.file.copy_shares(&new.file, &|maker, generation| {
            (!gone.contains(&maker)).then_some((maker, generation))
        })?;
        new.file.begin_generation(self.about.generation)?;
        let made = || known.iter().filter(|made| makers.contains(&Maker(made.id)));
        // Claims of unknown workers are not counted.
        let is_unknown = makers.contains(&Maker::UNKNOWN);
        let has_claims = is_unknown || made().any(|made| made.claims > 0);
        *new.makers_mut() = known.clone();
        new.makers_mut().remove(&gone);
        if !has_claims {
            new.unseen_mut().add(&self.unseen());
            *new.unproven_mut() = self.unproven().clone();
        }
        new.save_makers()?;
        new.save_unseen()?;
        new.cells_mut().merge_those(&self.cells(), |maker| !gone.contains(&maker));
        new.save_cells(true)?;
        new.file.flush()?;
        Ok(Forgotten {
            samples: copied.left_out,
            samples_of_others: self.samples_of(&others),
            unseen: self.unseen().count() - new.unseen().count(),
            cells: (self.cells().len() - new.cells().len()) as u64,
            left: new.file.stats().samples,
        })
    }

    /// Returns how many samples these makers have made, without those that others had superseded.
    fn samples_of(&self, makers: &[Maker]) -> u64 {
        let mut keys = Vec::new();
        if !makers.is_empty() {
            self.file.for_each_beam(&mut |key, _| keys.push(key));
        }
        let runs = keys.into_iter().flat_map(|key| self.file.makers(key));
        runs.filter(|(_, maker)| makers.contains(maker)).map(|(run, _)| u64::from(run.count)).sum()
    }
}
