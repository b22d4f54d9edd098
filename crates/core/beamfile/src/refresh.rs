//! Reads additions of another process to the file.

use crate::Result;
use crate::file::BeamFile;
use crate::scan::{ScanRange, Tail, scan};

impl BeamFile {
    /// Checks that the file was not cut off. Otherwise [`BeamFile::lost`] reports it from now on.
    ///
    /// # Errors
    /// [`Error::Lost`](crate::Error::Lost), or if the disk cannot be read.
    pub fn check_length(&self) -> Result<()> {
        // While a block is written, its writer checks the file.
        let Some(appender) = self.shared.free_appender() else { return Ok(()) };
        let length = self.shared.storage.length();
        let bytes = length.map_err(|error| self.shared.io("reading its length", error))?;
        self.shared.check_length(&appender, bytes)
    }

    /// Reads the blocks that another process has completed since, and returns their number.
    ///
    /// Returns 0 for a file that was not opened read-only.
    ///
    /// # Errors
    /// If the disk cannot be read, or the file was cut off.
    pub fn refresh(&self) -> Result<u64> {
        if !self.shared.read_only {
            return Ok(0);
        }
        self.check_length()?;
        let mut appender = self.shared.appender();
        let mut found = Vec::new();
        let mut damage = Vec::new();
        let end = scan(
            &*self.shared.storage,
            &self.shared.path,
            &self.shared.header,
            ScanRange { from: appender.at, to: u64::MAX, sequence: appender.sequence },
            &mut damage,
            &mut |block, table| -> Result<()> {
                found.push((block, table));
                Ok(())
            },
        )?;
        // Bytes at the end that were no block before may be a block now.
        if let Tail::Damaged(tail) = &end.tail {
            damage.push(tail.clone());
        }
        let new = found.len() as u64;
        let mut state = self.shared.state();
        state.damage.retain(|old| old.offset < appender.at);
        for (block, table) in found {
            state.found(block, table)?;
        }
        state.damage.append(&mut damage);
        appender.at = end.resume;
        appender.sequence = end.sequence;
        Ok(new)
    }
}
