//! State shared by the callers' threads and the writer's thread of one open file.
//!
//! Invariant: the state's lock is never held during input or output, nor while a caller's function
//! runs. Locks are taken in the order appender, state, cache.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use parking_lot::{Condvar, Mutex, MutexGuard};

use crate::appender::Appender;
use crate::batch::BlockBytes;
use crate::cache::Cache;
use crate::directory::DiskBlock;
use crate::format::{FileHeader, aligned};
use crate::state::FileState;
use crate::storage::Storage;
use crate::{Error, FileLoss, Result};

/// One open file, without the handle of its writer's thread.
pub(crate) struct OpenFile {
    pub path: PathBuf,
    pub storage: Box<dyn Storage>,
    pub header: FileHeader,
    pub read_only: bool,
    state: Mutex<FileState>,
    /// Signals to the writer that it has work.
    pub wake: Condvar,
    /// Signals from the writer that a write was done, or failed.
    pub progress: Condvar,
    appender: Mutex<Appender>,
    cache: Mutex<Cache>,
}

impl OpenFile {
    pub fn new(
        path: PathBuf,
        storage: Box<dyn Storage>,
        header: FileHeader,
        read_only: bool,
        (state, appender, cache): (FileState, Appender, Cache),
    ) -> OpenFile {
        OpenFile {
            path,
            storage,
            header,
            read_only,
            state: Mutex::new(state),
            wake: Condvar::new(),
            progress: Condvar::new(),
            appender: Mutex::new(appender),
            cache: Mutex::new(cache),
        }
    }

    pub fn state(&self) -> MutexGuard<'_, FileState> {
        self.state.lock()
    }

    pub fn appender(&self) -> MutexGuard<'_, Appender> {
        self.appender.lock()
    }

    /// Returns the appender. `None` if a block is being written.
    pub fn free_appender(&self) -> Option<MutexGuard<'_, Appender>> {
        self.appender.try_lock()
    }

    pub fn cache(&self) -> MutexGuard<'_, Cache> {
        self.cache.lock()
    }

    /// Returns the error of an operation that the system refused.
    pub fn io(&self, doing: &'static str, source: io::Error) -> Error {
        Error::Io { path: self.path.clone(), doing, source }
    }

    /// Returns the error for samples that could not be written.
    pub fn not_written(&self, state: &FileState) -> Error {
        if let Some(how) = state.lost {
            return Error::Lost { path: self.path.clone(), how };
        }
        if state.writer_gone && state.last_error.is_none() {
            return Error::WriterStopped { path: self.path.clone() };
        }
        let reason = state.last_error.clone().unwrap_or_default();
        Error::NotWritten { path: self.path.clone(), pending: state.pending_bytes(), reason }
    }

    /// Waits until the writer makes progress, or a second has passed.
    pub fn wait_for_writer(&self, state: &mut MutexGuard<'_, FileState>) {
        self.progress.wait_for(state, Duration::from_secs(1));
    }

    /// Appends one block. When this returns, the block is on the disk itself, in the file at the
    /// path.
    pub fn write_block(&self, body: &BlockBytes, doing: &'static str) -> Result<DiskBlock> {
        let mut appender = self.appender();
        self.check_file(&appender)?;
        let written = appender.write(&*self.storage, self.header.file_id, body);
        let block = written.map_err(|error| self.io(doing, error))?;
        self.check_file(&appender)?;
        Ok(block)
    }

    /// Checks that the path still names the written file, and that the file is as long as the
    /// appender left it.
    pub fn check_file(&self, appender: &Appender) -> Result<()> {
        let bytes = self.storage.length().map_err(|error| self.io("reading its length", error))?;
        if !self.storage.is_at_its_path() {
            return Err(self.lose(FileLoss::NotAtPath));
        }
        self.check_length(appender, bytes)
    }

    /// Checks that a file of so many bytes is as long as the appender left it. A reader's appender
    /// is where the last block ends that the reader knows.
    pub fn check_length(&self, appender: &Appender, bytes: u64) -> Result<()> {
        if aligned(bytes) < appender.at {
            return Err(self.lose(FileLoss::Shortened { bytes, written: appender.at }));
        }
        Ok(())
    }

    fn lose(&self, how: FileLoss) -> Error {
        self.state().lost = Some(how);
        Error::Lost { path: self.path.clone(), how }
    }
}
