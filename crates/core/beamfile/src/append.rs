//! Adding samples to a [`BeamFile`].

use std::time::Instant;

use holo_section::{BeamKey, NumberRun, Sample};
use parking_lot::MutexGuard;

use crate::file::BeamFile;
use crate::format::Class;
use crate::state::FileState;
use crate::{Error, Maker, Result};

/// Memory for samples that wait for the disk, in bytes. Appends wait while more than this is used.
const MAX_PENDING_BYTES: u64 = 256 << 20;
/// Memory of a batch at which it is closed, in bytes. Its block is then well below the format's
/// limits.
const BATCH_BYTES: u64 = 32 << 20;
/// Samples that enter a batch at once. Longer appends are split, for the same reason.
const APPEND_SAMPLES: usize = 1 << 20;
/// Number of extents at which the directory counts as full. The rest is room for extents that still
/// wait.
const MAX_EXTENTS: u64 = u32::MAX as u64 - (1 << 27);

impl BeamFile {
    /// Takes samples with consecutive numbers from `run.first`: into memory now, on disk within a
    /// second.
    ///
    /// All samples in `samples` are taken; `run.count` is ignored. Numbers that the beam has
    /// already keep their old samples. Waits while the disk is far behind.
    ///
    /// # Errors
    /// - The beam does not exist, the numbers do not fit in 32 bits, or the file is read-only.
    /// - [`Error::NotWritten`]: the disk accepts nothing, and the memory for waiting samples is
    ///   full. The samples were not taken. If there were more than a million, only the last ones
    ///   were not taken.
    /// - [`Error::Lost`]: another program deleted, moved, replaced or cut off the file.
    pub fn append(&self, run: NumberRun, maker: Maker, samples: &[Sample]) -> Result<()> {
        self.put(run, maker, samples, false)
    }

    /// Appends like [`BeamFile::append`], but these samples replace older ones of the same kind and
    /// number.
    ///
    /// # Errors
    /// The errors of [`BeamFile::append`].
    pub fn supersede(&self, run: NumberRun, maker: Maker, samples: &[Sample]) -> Result<()> {
        self.put(run, maker, samples, true)
    }

    pub(crate) fn put(
        &self,
        run: NumberRun,
        maker: Maker,
        samples: &[Sample],
        supersedes: bool,
    ) -> Result<()> {
        self.writable()?;
        self.check(run.key)?;
        let count = u32::try_from(samples.len()).ok();
        if count.and_then(|count| run.first.checked_add(count)).is_none() {
            return Err(Error::SampleNumbers { first: run.first, count: samples.len() });
        }
        let NumberRun { key, kind, mut first, paths, .. } = run;
        let class = Class { kind: kind as u8, supersedes, paths, maker };
        for part in samples.chunks(APPEND_SAMPLES) {
            let mut state = self.room()?;
            if state.directory.extents() > MAX_EXTENTS {
                return Err(Error::DirectoryFull);
            }
            let begins = state.active.is_empty();
            state.append(key, class, first, part);
            first += part.len() as u32;
            if begins {
                state.active_since = Some(Instant::now());
            }
            let full = state.active.bytes() >= BATCH_BYTES;
            if full {
                state.freeze();
            }
            drop(state);
            if begins || full {
                self.shared.wake.notify_one();
            }
        }
        Ok(())
    }

    /// Stores beams in the order in which they are appended from now on. Otherwise the beams of a
    /// block are in the order of their sections and numbers. The caller appends each beam at once.
    pub fn keep_order(&self) {
        self.shared.state().keeps_order = true;
    }

    /// Returns the state once there is room for more samples.
    fn room(&self) -> Result<MutexGuard<'_, FileState>> {
        let mut state = self.shared.state();
        while state.pending_bytes() >= MAX_PENDING_BYTES {
            if state.writer_gone || state.last_error.is_some() {
                return Err(self.shared.not_written(&state));
            }
            self.shared.wait_for_writer(&mut state);
        }
        if state.lost.is_some() {
            return Err(self.shared.not_written(&state));
        }
        Ok(state)
    }

    pub(crate) fn writable(&self) -> Result<()> {
        if self.shared.read_only {
            Err(Error::ReadOnly { path: self.shared.path.clone() })
        } else {
            Ok(())
        }
    }

    pub(crate) fn check(&self, key: BeamKey) -> Result<()> {
        if self.shared.header.has(key) { Ok(()) } else { Err(Error::NoSuchBeam(key)) }
    }

    /// Waits until everything appended before the call is on the disk itself. It then survives a
    /// killed process and a power failure.
    ///
    /// # Errors
    /// - [`Error::NotWritten`]: an attempt to write failed. The samples stay in memory, can be
    ///   read, and will be tried again.
    /// - [`Error::Lost`]: another program deleted, moved, replaced or cut off the file.
    pub fn flush(&self) -> Result<()> {
        if self.shared.read_only {
            return Ok(());
        }
        let mut state = self.shared.state();
        state.freeze();
        let target = state.active.id;
        let failures = state.failures;
        while state.written < target {
            if state.writer_gone || state.failures > failures {
                return Err(self.shared.not_written(&state));
            }
            state.hurry = true;
            self.shared.wake.notify_one();
            self.shared.wait_for_writer(&mut state);
        }
        drop(state);
        self.shared.check_file(&self.shared.appender())
    }
}
