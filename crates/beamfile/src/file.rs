//! [`BeamFile`]: one open holodeck file.
//!
//! Invariant: the state's lock is never held during disk input or output, nor while a caller's function runs. Locks are
//! taken in the order appender, state, cache.

use std::collections::HashSet;
use std::fs::OpenOptions;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use holo_section::{BeamKey, Run, Sample};

use crate::batch::Body;
use crate::cache::Cache;
use crate::directory::Block;
use crate::format::{Class, FileHeader, aligned};
use crate::load::load;
use crate::open::{self, Opened};
use crate::snapshot::{Plan, State};
use crate::storage::{DiskStorage, Storage};
use crate::types::{BeamSamples, Counts, Damage, OpenReport, Options, Stats};
use crate::writer::{self, Appender};
use crate::{Error, FileLoss, Result};

/// Appends wait while more than this has not reached the disk.
const MAX_PENDING_BYTES: u64 = 256 << 20;
/// A batch is closed when it takes this much memory: its block stays well below the format's bounds.
const BATCH_BYTES: u64 = 32 << 20;
/// A longer append is taken in parts, for the same reason.
const APPEND_SAMPLES: usize = 1 << 20;
/// Room for every extent that may still be pending when the directory is declared full.
const MAX_EXTENTS: u64 = u32::MAX as u64 - (1 << 27);
/// Beams read together by `read_many`: so many samples, or so many beams.
const GROUP_SAMPLES: u64 = 400_000;
const GROUP_BEAMS: usize = 8192;
/// Beams looked up under one lock.
const LOOKUP_BEAMS: usize = 512;

/// What the callers' threads and the writer share.
pub(crate) struct Shared {
    pub path: PathBuf,
    pub storage: Box<dyn Storage>,
    pub header: FileHeader,
    pub read_only: bool,
    state: Mutex<State>,
    /// For the writer: there is something to do.
    pub wake: Condvar,
    /// From the writer: something was done, or failed.
    pub progress: Condvar,
    appender: Mutex<Appender>,
    cache: Mutex<Cache>,
}

/// One open holodeck file: appends, reads through a cache, named blobs.
///
/// Shared between threads by reference or `Arc`. Dropping it writes what is pending, as far as the disk lets it; call
/// [`BeamFile::flush`] or [`BeamFile::close`] to know.
pub struct BeamFile {
    pub(crate) shared: Arc<Shared>,
    report: OpenReport,
    writer: Option<JoinHandle<()>>,
    /// One blob is written at a time.
    pub(crate) blob_writing: Mutex<()>,
}

// State is changed in small steps that cannot panic half-way, so what a panicking thread leaves behind is sound.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    pub fn state(&self) -> MutexGuard<'_, State> {
        locked(&self.state)
    }

    pub fn appender(&self) -> MutexGuard<'_, Appender> {
        locked(&self.appender)
    }

    pub fn io(&self, doing: &'static str, source: io::Error) -> Error {
        Error::Io { path: self.path.clone(), doing, source }
    }

    pub fn wait<'a>(
        &self,
        on: &Condvar,
        state: MutexGuard<'a, State>,
        time: Duration,
    ) -> MutexGuard<'a, State> {
        on.wait_timeout(state, time).unwrap_or_else(PoisonError::into_inner).0
    }

    fn not_written(&self, state: &State) -> Error {
        if let Some(how) = state.lost {
            return Error::Lost { path: self.path.clone(), how };
        }
        if state.writer_gone && state.last_error.is_none() {
            return Error::WriterStopped { path: self.path.clone() };
        }
        let reason = state.last_error.clone().unwrap_or_default();
        Error::NotWritten { path: self.path.clone(), pending: state.pending_bytes(), reason }
    }

    /// Appends one block. When this returns, it is on the disk itself, in the file at the path.
    pub fn write_block(&self, body: &Body, doing: &'static str) -> Result<Block> {
        let mut appender = self.appender();
        self.check_file(&appender)?;
        let written = appender.write(&*self.storage, self.header.file_id, body);
        let block = written.map_err(|error| self.io(doing, error))?;
        self.check_file(&appender)?;
        Ok(block)
    }

    /// Compares the file at the path with the one that is written.
    fn check_file(&self, appender: &Appender) -> Result<()> {
        let bytes = self.storage.length().map_err(|error| self.io("reading its length", error))?;
        let how = if !self.storage.is_at_its_path() {
            FileLoss::NotAtPath
        } else if aligned(bytes) < appender.at {
            FileLoss::Shortened { bytes, written: appender.at }
        } else {
            return Ok(());
        };
        self.state().lost = Some(how);
        Err(Error::Lost { path: self.path.clone(), how })
    }

    /// Until the writer did something. Wakes by itself now and then: nothing is lost if a signal is.
    fn wait_for_writer<'a>(&self, state: MutexGuard<'a, State>) -> MutexGuard<'a, State> {
        self.wait(&self.progress, state, Duration::from_secs(1))
    }
}

impl BeamFile {
    /// Makes a new file for sections of `options.layout` beams.
    ///
    /// # Errors
    /// If the file exists, cannot be written, or the number of sections is not 1 to [`crate::format::MAX_SECTIONS`].
    pub fn create(path: impl AsRef<Path>, options: Options) -> Result<Self> {
        let path = path.as_ref();
        let file =
            open::file(path, OpenOptions::new().read(true).write(true).create_new(true), true)?;
        Self::create_on(Box::new(DiskStorage::new(file, path)), path, options)
    }

    /// Opens a file to read and append. A copy of the header that is damaged is repaired, a block that was never
    /// completed is cut off; see [`BeamFile::report`].
    ///
    /// # Errors
    /// If another process writes it ([`Error::Locked`]), it is no holodeck, or made for other sections.
    pub fn open(path: impl AsRef<Path>, options: Options) -> Result<Self> {
        let path = path.as_ref();
        let file = open::file(path, OpenOptions::new().read(true).write(true), true)?;
        Self::open_on(Box::new(DiskStorage::new(file, path)), path, options)
    }

    /// Opens a file to read, also while another process writes it. What comes later is seen after
    /// [`BeamFile::refresh`].
    ///
    /// # Errors
    /// If it cannot be read or is no holodeck.
    pub fn open_read_only(path: impl AsRef<Path>, cache_bytes: u64) -> Result<Self> {
        let path = path.as_ref();
        let file = open::file(path, OpenOptions::new().read(true), false)?;
        let storage = Box::new(DiskStorage::new(file, path));
        let opened = open::open(&*storage, path, false)?;
        Self::start(storage, path, opened, cache_bytes, true)
    }

    /// [`BeamFile::create`] on a storage of the caller's; `path` is for messages only. Takes no lock.
    ///
    /// # Errors
    /// As [`BeamFile::create`].
    pub fn create_on(
        storage: Box<dyn Storage>,
        path: impl AsRef<Path>,
        options: Options,
    ) -> Result<Self> {
        let opened = open::create(&*storage, path.as_ref(), &options.layout)?;
        Self::start(storage, path.as_ref(), opened, options.cache_bytes, false)
    }

    /// [`BeamFile::open`] on a storage of the caller's; `path` is for messages only. Takes no lock.
    ///
    /// # Errors
    /// As [`BeamFile::open`].
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
        opened: Opened,
        cache: u64,
        read_only: bool,
    ) -> Result<Self> {
        let Opened { header, state, appender, report } = opened;
        let shared = Arc::new(Shared {
            path: path.to_owned(),
            storage,
            header,
            read_only,
            state: Mutex::new(state),
            wake: Condvar::new(),
            progress: Condvar::new(),
            appender: Mutex::new(appender),
            cache: Mutex::new(Cache::new(cache)),
        });
        let writer = if read_only {
            None
        } else {
            let shared_with_writer = Arc::clone(&shared);
            let thread = thread::Builder::new().name("beamfile-writer".into());
            let started = thread.spawn(move || writer::run(&shared_with_writer));
            Some(started.map_err(|error| shared.io("starting its writer thread", error))?)
        };
        Ok(Self { shared, report, writer, blob_writing: Mutex::new(()) })
    }

    /// The path by which it was opened.
    pub fn path(&self) -> &Path {
        &self.shared.path
    }

    /// What opening found, and what it left out.
    pub fn report(&self) -> &OpenReport {
        &self.report
    }

    /// Number of beams in each section.
    pub fn layout(&self) -> &[u64] {
        &self.shared.header.layout
    }

    /// Takes samples with consecutive numbers from `run.first`, as many as there are (`run.count` is not looked at): into memory now, on disk within a second. Numbers that
    /// the beam has already keep their old samples. Waits while the disk is far behind.
    ///
    /// # Errors
    /// If the beam does not exist, the numbers do not fit in 32 bits, or the file is read-only. If nothing can be
    /// written and memory for what waits is used up ([`Error::NotWritten`]), the samples (or the last of more than a
    /// million) were not taken.
    pub fn append(&self, run: Run, samples: &[Sample]) -> Result<()> {
        self.put(run, samples, false)
    }

    /// As [`BeamFile::append`], but these samples replace older ones of the same kind and number.
    ///
    /// # Errors
    /// As [`BeamFile::append`].
    pub fn supersede(&self, run: Run, samples: &[Sample]) -> Result<()> {
        self.put(run, samples, true)
    }

    fn put(&self, run: Run, samples: &[Sample], supersedes: bool) -> Result<()> {
        self.writable()?;
        self.check(run.key)?;
        if u32::try_from(samples.len())
            .ok()
            .and_then(|count| run.first.checked_add(count))
            .is_none()
        {
            return Err(Error::SampleNumbers { first: run.first, count: samples.len() });
        }
        let Run { key, kind, mut first, paths, .. } = run;
        let class = Class { kind: kind as u8, supersedes, paths };
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

    /// The state, once there is room for more samples.
    fn room(&self) -> Result<MutexGuard<'_, State>> {
        let mut state = self.shared.state();
        while state.pending_bytes() >= MAX_PENDING_BYTES {
            if state.writer_gone || state.last_error.is_some() {
                return Err(self.shared.not_written(&state));
            }
            state = self.shared.wait_for_writer(state);
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

    fn check(&self, key: BeamKey) -> Result<()> {
        let known = self.shared.header.has(key);
        if known { Ok(()) } else { Err(Error::NoSuchBeam { section: key.section, beam: key.beam }) }
    }

    /// All samples of a beam, those not yet on disk included, each number once, in the order (kind, number). Empty if it
    /// has none. Damaged samples are left out and listed by [`BeamFile::damage`].
    ///
    /// # Errors
    /// If the beam does not exist or the disk cannot be read.
    pub fn read(&self, key: BeamKey) -> Result<Arc<BeamSamples>> {
        self.check(key)?;
        if let Some(samples) = self.cached(&self.shared.state(), key) {
            return Ok(samples);
        }
        let plan = self.shared.state().plan(key);
        let read = self.load_group(plan.into_iter().collect())?;
        Ok(read.into_iter().next().map(|(_, samples)| samples).unwrap_or_default())
    }

    /// Gives each beam's samples to `sink` once: those in memory first, the others in file order, neighbours read
    /// together. Stops when `sink` says so.
    ///
    /// # Errors
    /// If a beam does not exist (before the first call) or the disk cannot be read.
    pub fn read_many(
        &self,
        keys: &[BeamKey],
        sink: &mut dyn FnMut(BeamKey, Arc<BeamSamples>) -> ControlFlow<()>,
    ) -> Result<()> {
        keys.iter().try_for_each(|&key| self.check(key))?;
        let mut seen = HashSet::with_capacity(keys.len());
        let mut plans: Vec<Plan> = Vec::new();
        for some in keys.chunks(LOOKUP_BEAMS) {
            let mut ready = Vec::new();
            let state = self.shared.state();
            for &key in some.iter().filter(|&&key| seen.insert(key)) {
                match self.cached(&state, key) {
                    Some(samples) => ready.push((key, samples)),
                    None => plans.extend(state.plan(key)),
                }
            }
            drop(state);
            for (key, samples) in ready {
                if sink(key, samples).is_break() {
                    return Ok(());
                }
            }
        }
        plans.sort_by_cached_key(|plan| (plan.file_position(), plan.key));

        let mut plans = plans.into_iter().peekable();
        while plans.peek().is_some() {
            let mut group = Vec::new();
            let mut samples = 0;
            while samples < GROUP_SAMPLES && group.len() < GROUP_BEAMS {
                let Some(plan) = plans.next() else { break };
                samples += plan.samples();
                group.push(plan);
            }
            for (key, samples) in self.load_group(group)? {
                if sink(key, samples).is_break() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// The beam as it is now, if it is in memory or has no samples.
    fn cached(&self, state: &State, key: BeamKey) -> Option<Arc<BeamSamples>> {
        match state.directory.beams.get(&key) {
            Some(beam) => locked(&self.shared.cache).get(key, beam.version),
            None => Some(Arc::default()),
        }
    }

    /// Reads beams and keeps them in the cache. Where damage is found, plans again without it.
    fn load_group(&self, mut plans: Vec<Plan>) -> Result<Vec<(BeamKey, Arc<BeamSamples>)>> {
        loop {
            let loaded = load(&*self.shared.storage, &plans)
                .map_err(|e| self.shared.io("reading samples", e))?;
            match loaded {
                Ok(beams) => {
                    let mut cache = locked(&self.shared.cache);
                    let read = plans.iter().zip(beams).map(|(plan, samples)| {
                        cache.put(plan.key, plan.version, &samples);
                        (plan.key, samples)
                    });
                    return Ok(read.collect());
                }
                Err(bad) => {
                    let mut state = self.shared.state();
                    state.mark_bad(&bad);
                    plans = plans.iter().filter_map(|plan| state.plan(plan.key)).collect();
                }
            }
        }
    }

    /// The runs of a beam as a read would give them now, in the same order, but not joined: how its samples were made, without
    /// reading any. Empty if it has none.
    pub fn runs(&self, key: BeamKey) -> Vec<Run> {
        self.shared.state().runs(key)
    }

    /// The next free sample numbers of a beam.
    pub fn counts(&self, key: BeamKey) -> Counts {
        let next = self.shared.state().directory.beams.get(&key).map_or([0; 3], |beam| beam.next);
        Counts { uniform: next[0], limited: next[1], single: next[2] }
    }

    /// Number of samples of a beam, each number once, those not yet on disk included. Samples that a read or
    /// [`BeamFile::verify`] found damaged are still counted; those in blocks left out at opening are not.
    pub fn count(&self, key: BeamKey) -> u64 {
        self.shared.state().directory.beams.get(&key).map_or(0, |beam| beam.samples)
    }

    /// Every beam that has samples, with their number, in order.
    pub fn for_each_beam(&self, f: &mut dyn FnMut(BeamKey, u64)) {
        let mut beams: Vec<_> = self
            .shared
            .state()
            .directory
            .beams
            .iter()
            .map(|(&key, beam)| (key, beam.samples))
            .collect();
        beams.sort_unstable();
        beams.into_iter().for_each(|(key, samples)| f(key, samples));
    }

    /// Waits until everything appended before the call is on the disk itself: it then survives a killed process and a
    /// power failure.
    ///
    /// # Errors
    /// [`Error::NotWritten`] when an attempt to write failed: the samples stay in memory, are read as before, and will be
    /// tried again.
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
            state = self.shared.wait_for_writer(state);
        }
        drop(state);
        self.shared.check_file(&self.shared.appender())
    }

    /// Returns [`Error::Lost`] if the file was found deleted, moved, replaced or cut off. Does not wait for the disk.
    ///
    /// The file is looked at with every block that is written, and with every [`BeamFile::flush`].
    pub fn lost(&self) -> Option<Error> {
        let state = self.shared.state();
        state.lost.map(|_| self.shared.not_written(&state))
    }

    /// Figures of the file as it is now.
    pub fn stats(&self) -> Stats {
        let file_bytes = self.shared.storage.length().unwrap_or(0);
        let state = self.shared.state();
        let cache = locked(&self.shared.cache);
        Stats {
            file_bytes,
            samples: state.directory.sections.iter().map(|section| section.samples).sum(),
            sections: state.directory.sections.clone(),
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

    /// Every damaged part found so far: at opening, by reads, by [`BeamFile::verify`].
    pub fn damage(&self) -> Vec<Damage> {
        self.shared.state().damage.clone()
    }

    /// Writes what is pending and stops the writer.
    ///
    /// # Errors
    /// As [`BeamFile::flush`]; what could not be written is lost then.
    pub fn close(mut self) -> Result<()> {
        let flushed = self.flush();
        self.stop();
        // A last attempt of the writer may have succeeded where flush did not.
        let state = self.shared.state();
        let all_written = state.frozen.is_empty() && state.active.is_empty();
        if all_written && state.lost.is_none() { Ok(()) } else { flushed }
    }

    fn stop(&mut self) {
        let Some(writer) = self.writer.take() else { return };
        self.shared.state().stop = true;
        self.shared.wake.notify_one();
        // A writer that panicked has said so on standard error, and its samples are gone with it.
        let _ = writer.join();
    }
}

impl Drop for BeamFile {
    fn drop(&mut self) {
        self.stop();
    }
}
