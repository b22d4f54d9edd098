//! Compares the whole file with its checksums.

use crate::checksums::{bad_chunks, block_damage};
use crate::file::BeamFile;
use crate::types::{Damage, DamageKind};
use crate::{Result, open};

impl BeamFile {
    /// Reads the whole file, compares it with its checksums, and returns every damaged part in file
    /// order, including known ones.
    ///
    /// It ignores samples that still wait in memory, and a torn tail, which [`BeamFile::report`]
    /// lists.
    ///
    /// # Errors
    /// If the disk cannot be read.
    pub fn verify(&self) -> Result<Vec<Damage>> {
        let failed = |error| self.shared.io("verifying", error);
        let mut damage = Vec::new();
        open::read_header(&*self.shared.storage, &self.shared.path, &mut damage)?;
        let blocks = self.shared.state().directory.blocks.clone();
        for (id, block) in (0..).zip(&blocks) {
            damage.extend(
                block_damage(&*self.shared.storage, &self.shared.header, block).map_err(failed)?,
            );
            let bad = bad_chunks(&*self.shared.storage, block).map_err(failed)?;
            self.shared
                .state()
                .mark_bad(&bad.into_iter().map(|chunk| (id, chunk)).collect::<Vec<_>>());
        }
        let left_out =
            |d: &&Damage| !matches!(d.what, DamageKind::HeaderCopy(_) | DamageKind::TornTail);
        damage.extend(self.shared.state().damage.iter().filter(left_out).cloned());
        damage.sort_by_key(|d| (d.offset, d.bytes));
        Ok(damage)
    }
}
