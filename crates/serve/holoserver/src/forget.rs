//! Removing what some machines have made from a file.
//!
//! The file is written anew without it, and takes the old one's place at the end. So an error or a
//! crash leaves the old file as it was.

use std::path::Path;

use anyhow::{Context, Result, bail};
use holo_beamfile::Maker;
use serde::Serialize;

use crate::holodeck::{Holodeck, beside};

/// Numbers of removed and remaining parts of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Forgotten {
    /// Samples removed, also those that others had superseded.
    pub samples: u64,
    /// Unseen beams that are no longer known.
    pub unseen: u64,
    /// Records of indirect light removed.
    pub light_records: u64,
    /// Cells of surface light removed.
    pub cells: u64,
    /// Samples that stay.
    pub left: u64,
}

impl Holodeck {
    /// Removes from a file what these makers have made. 0 stands for whoever is not known.
    ///
    /// The file does not say who found which unseen beam. If one of these makers has found any, all
    /// are removed, and workers find the true ones again. The same holds for records of indirect
    /// light and for cells of surface light, because workers make them from those of others.
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
        std::fs::rename(&fresh, path).with_context(|| format!("replacing {}", path.display()))?;
        Ok(forgotten)
    }

    fn copy_without(&self, fresh: &Path, makers: &[Maker]) -> Result<Forgotten> {
        let new = self.without_samples(fresh)?;
        let copied = self.file.copy_samples(&new.file, &|maker| !makers.contains(&maker))?;
        self.file.copy_shares(&new.file, &|maker, generation| {
            (!makers.contains(&maker)).then_some((maker, generation))
        })?;
        new.file.begin_generation(self.about.generation)?;
        let known = self.makers();
        let made = || known.iter().filter(|made| makers.contains(&Maker(made.id)));
        // Claims and records of unknown workers are not counted.
        let is_unknown = makers.contains(&Maker::UNKNOWN);
        let has_claims = is_unknown || made().any(|made| made.claims > 0);
        let has_light = is_unknown || made().any(|made| made.light_records > 0);
        *new.makers_mut() = known.clone();
        new.makers_mut().remove(makers);
        if !has_claims {
            new.unseen_mut().add(&self.unseen());
            *new.unproven_mut() = self.unproven().clone();
        }
        if !has_light {
            new.light_mut().merge(None, self.light().records());
        }
        new.save_makers()?;
        new.save_unseen()?;
        // Others may have made cells with the light of these makers.
        if !self.cells().are_made_by(|maker| makers.contains(&maker)) {
            new.cells_mut().merge(&self.cells(), |maker| maker);
        }
        new.save_light()?;
        new.save_cells(true)?;
        new.file.flush()?;
        Ok(Forgotten {
            samples: copied.left_out,
            unseen: self.unseen().count() - new.unseen().count(),
            light_records: (self.light().len() - new.light().len()) as u64,
            cells: (self.cells().len() - new.cells().len()) as u64,
            left: new.file.stats().samples,
        })
    }
}
