//! [`BeamFile`]: one open holodeck file, from opening to closing.

use std::fs::OpenOptions;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};

use crate::cache::Cache;
use crate::open::{self, OpenedFile};
use crate::shared::OpenFile;
use crate::storage::{DiskStorage, Storage};
use crate::types::{Damage, OpenReport, Options, Skipped, Stats};
use crate::writer;
use crate::{Error, Result};

/// One open holodeck file: appends, reads through a cache, named blobs.
///
/// Threads share it by reference or `Arc`. Dropping it writes pending samples if the disk permits.
/// [`BeamFile::flush`] and [`BeamFile::close`] report failures.
pub struct BeamFile {
    pub(crate) shared: Arc<OpenFile>,
    report: OpenReport,
    writer: Option<JoinHandle<()>>,
    /// Locked while a blob is written: one at a time.
    pub(crate) blob_writing: Mutex<()>,
}

impl BeamFile {
    /// Makes a new file for sections of `options.layout` beams.
    ///
    /// # Errors
    /// If the file exists or cannot be written, or the number of sections is not 1 to
    /// [`crate::format::MAX_SECTIONS`].
    pub fn create(path: impl AsRef<Path>, options: Options) -> Result<Self> {
        let path = path.as_ref();
        let file =
            open::file(path, OpenOptions::new().read(true).write(true).create_new(true), true)?;
        Self::create_on(Box::new(DiskStorage::new(file, path)), path, options)
    }

    /// Opens a file to read and append.
    ///
    /// It repairs a damaged copy of the header, and cuts off a block that was never completed;
    /// [`BeamFile::report`] names both.
    ///
    /// # Errors
    /// If another process writes the file ([`Error::Locked`]), it is no holodeck, or it was made
    /// for other sections.
    pub fn open(path: impl AsRef<Path>, options: Options) -> Result<Self> {
        let path = path.as_ref();
        let file = open::file(path, OpenOptions::new().read(true).write(true), true)?;
        Self::open_on(Box::new(DiskStorage::new(file, path)), path, options)
    }

    /// Opens a file to read, also while another process writes it.
    ///
    /// [`BeamFile::refresh`] reads the other process's additions.
    ///
    /// # Errors
    /// If the file cannot be read or is no holodeck.
    pub fn open_read_only(path: impl AsRef<Path>, cache_bytes: u64) -> Result<Self> {
        let path = path.as_ref();
        let file = open::file(path, OpenOptions::new().read(true), false)?;
        let storage = Box::new(DiskStorage::new(file, path));
        let opened = open::open(&*storage, path, false)?;
        Self::start(storage, path, opened, cache_bytes, true)
    }

    /// Creates a file like [`BeamFile::create`], on a storage of the caller. It takes no lock, and
    /// uses `path` only in messages.
    ///
    /// # Errors
    /// The errors of [`BeamFile::create`].
    pub fn create_on(
        storage: Box<dyn Storage>,
        path: impl AsRef<Path>,
        options: Options,
    ) -> Result<Self> {
        let opened = open::create(&*storage, path.as_ref(), &options.layout)?;
        Self::start(storage, path.as_ref(), opened, options.cache_bytes, false)
    }

    /// Opens a file like [`BeamFile::open`], on a storage of the caller. It takes no lock, and uses
    /// `path` only in messages.
    ///
    /// # Errors
    /// The errors of [`BeamFile::open`].
    pub fn open_on(
        storage: Box<dyn Storage>,
        path: impl AsRef<Path>,
        options: Options,
    ) -> Result<Self> {
        let path = path.as_ref();
        let found = open::read_header(&*storage, path, &mut Vec::new())?.layout;
        if !options.layout.is_empty() && options.layout != found {
            return Err(Error::Layout { path: path.to_owned(), found, wanted: options.layout });
        }
        let opened = open::open(&*storage, path, true)?;
        Self::start(storage, path, opened, options.cache_bytes, false)
    }

    fn start(
        storage: Box<dyn Storage>,
        path: &Path,
        opened: OpenedFile,
        cache_bytes: u64,
        read_only: bool,
    ) -> Result<Self> {
        let OpenedFile { header, state, appender, report, index } = opened;
        let parts = (state, appender, Cache::new(cache_bytes));
        let shared = Arc::new(OpenFile::new(path.to_owned(), storage, header, read_only, parts));
        let writer = if read_only {
            None
        } else {
            let shared_with_writer = Arc::clone(&shared);
            let thread = thread::Builder::new().name("beamfile-writer".into());
            let started = thread.spawn(move || writer::run(&shared_with_writer, index));
            Some(started.map_err(|error| shared.io("starting its writer thread", error))?)
        };
        Ok(Self { shared, report, writer, blob_writing: Mutex::new(()) })
    }

    /// Returns the path with which the file was opened.
    pub fn path(&self) -> &Path {
        &self.shared.path
    }

    /// Returns the report on opening the file, including the parts that were left out.
    pub fn report(&self) -> &OpenReport {
        &self.report
    }

    /// Returns the number of beams in each section.
    pub fn layout(&self) -> &[u64] {
        &self.shared.header.layout
    }

    /// Returns the present generation: that of samples that are appended now.
    pub fn generation(&self) -> u32 {
        self.shared.state().directory.generation
    }

    /// Begins a generation of samples, unless the file has it or a later one. Samples that are
    /// there keep their places but lose their numbers: [`BeamFile::read_earlier`] still reads them,
    /// and other functions ignore them.
    ///
    /// The file says so only with the first sample of the new generation. Its owner must note the
    /// generation elsewhere, and begin it again after opening the file.
    ///
    /// # Errors
    /// As [`BeamFile::flush`]: what is pending still belongs to the generation before.
    pub fn begin_generation(&self, generation: u32) -> Result<()> {
        if generation > self.generation() {
            self.flush()?;
            self.shared.state().directory.begin(generation);
        }
        Ok(())
    }

    /// Returns the current figures of the file.
    pub fn stats(&self) -> Stats {
        let file_bytes = self.shared.storage.length().unwrap_or(0);
        let state = self.shared.state();
        let cache = self.shared.cache();
        Stats {
            file_bytes,
            samples: state.directory.sections.iter().map(|section| section.samples).sum(),
            sections: state.directory.sections.clone(),
            earlier: state.directory.earlier_samples,
            superseded: state.directory.superseded,
            extents: state.directory.extents(),
            cache_bytes: cache.bytes,
            cache_hits: cache.hits,
            cache_misses: cache.misses,
            pending_bytes: state.pending_bytes(),
            damage: state.damage.len() as u64,
            last_error: state.last_error.clone(),
        }
    }

    /// Returns every damaged part found so far: at opening, by reads, by [`BeamFile::verify`].
    pub fn damage(&self) -> Vec<Damage> {
        self.shared.state().damage.clone()
    }

    /// Returns the number of shares of each layer that the file has on disk. Layer 0, which is all
    /// light, is not listed.
    pub fn layers(&self) -> Vec<(u16, u64)> {
        self.shared.state().layers.iter().map(|(&layer, &shares)| (layer, shares)).collect()
    }

    /// Returns the blocks of unknown kinds, by kind. They were skipped, and are no damage.
    pub fn skipped(&self) -> Vec<Skipped> {
        self.shared.state().skipped.values().copied().collect()
    }

    /// Returns [`Error::Lost`] if the file was found deleted, moved, replaced or cut off. It does
    /// not wait for the disk.
    ///
    /// The file is checked with every written block and every [`BeamFile::flush`].
    pub fn lost(&self) -> Option<Error> {
        let state = self.shared.state();
        state.lost.map(|_| self.shared.not_written(&state))
    }

    /// Writes pending samples and stops the writer.
    ///
    /// # Errors
    /// The errors of [`BeamFile::flush`]. Samples that could not be written are then lost.
    pub fn close(mut self) -> Result<()> {
        let flushed = self.flush();
        self.stop();
        // The writer's last attempt may have succeeded although the flush failed.
        let state = self.shared.state();
        let all_written = state.frozen.is_empty() && state.active.is_empty();
        if all_written && state.lost.is_none() { Ok(()) } else { flushed }
    }

    fn stop(&mut self) {
        let Some(writer) = self.writer.take() else { return };
        self.shared.state().stop = true;
        self.shared.wake.notify_one();
        // A writer that panicked has reported it on standard error, and its samples are lost.
        let _ = writer.join();
    }
}

impl Drop for BeamFile {
    fn drop(&mut self) {
        self.stop();
    }
}
