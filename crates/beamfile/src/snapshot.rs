//! What the threads of one open file share under a lock, and the plan for reading a beam that is made from it.
//!
//! Invariant: every appended sample is in the active batch, a frozen batch, or the directory (in the last two at once
//! while a batch's extents are being listed, which changes nothing: taking the same extents twice gives the same). A plan
//! keeps what it refers to alive, so reading by it needs no lock.

use std::collections::{HashSet, VecDeque};
use std::sync::Arc;
use std::time::Instant;

use holo_section::{BeamKey, Run, Sample};

use crate::batch::Batch;
use crate::blobs::Blobs;
use crate::directory::{Block, Directory};
use crate::format::{CHUNK_SAMPLES, Class, Entry, SAMPLE_BYTES, Table};
use crate::types::{Damage, DamageKind};
use crate::visible::{Offer, Visible, visible};
use crate::{Error, FileLoss, Result};

pub(crate) struct State {
    pub directory: Directory,
    pub blobs: Blobs,
    pub active: Batch,
    /// When the first samples of the active batch came.
    pub active_since: Option<Instant>,
    /// Memory for the next batch.
    pub spare: Option<Batch>,
    /// Waiting to be written, oldest first.
    pub frozen: VecDeque<Arc<Batch>>,
    frozen_bytes: u64,
    /// All batches with smaller ids are on disk.
    pub written: u64,
    /// Failed attempts to write so far.
    pub failures: u64,
    /// Why the last attempt failed; cleared by one that succeeds.
    pub last_error: Option<String>,
    /// Somebody waits: write now, whatever the clock says.
    pub hurry: bool,
    pub stop: bool,
    pub writer_gone: bool,
    /// What became of the file at the path, if it is no longer the one that is written.
    pub lost: Option<FileLoss>,
    pub damage: Vec<Damage>,
    /// Chunks whose samples do not match their checksum: (block, chunk).
    bad: HashSet<(u32, u32)>,
}

/// Where a run's samples are.
pub(crate) enum Location {
    Disk { id: u32, block: Arc<Block>, at: u32 },
    Frozen { batch: Arc<Batch>, at: u32 },
    Copied(Vec<Sample>),
}

/// A run of samples that counts, and where they are.
pub(crate) struct PlannedRun {
    pub run: Run,
    pub location: Location,
}

/// How to read one beam.
pub(crate) struct Plan {
    pub key: BeamKey,
    pub version: u32,
    /// In the order (kind, sample number).
    pub runs: Vec<PlannedRun>,
}

fn run(key: BeamKey, class: Class, first: u32, count: u32) -> Run {
    Run { key, kind: class.sample_kind(), first, count, paths: class.paths }
}

impl Plan {
    pub fn samples(&self) -> u64 {
        self.runs.iter().map(|planned| u64::from(planned.run.count)).sum()
    }

    /// Where in the file its first samples are; 0 when all are in memory.
    pub fn file_position(&self) -> u64 {
        let positions = self.runs.iter().filter_map(|planned| match &planned.location {
            Location::Disk { block, at, .. } => Some(
                block.offset
                    + block.header.payload_offset()
                    + u64::from(*at) * u64::from(SAMPLE_BYTES),
            ),
            _ => None,
        });
        positions.min().unwrap_or(0)
    }
}

/// A candidate for a plan: samples that were appended together.
enum Source<'a> {
    Disk { id: u32, at: u32 },
    Frozen { batch: &'a Arc<Batch>, at: u32 },
    Active { at: u32 },
}

impl State {
    pub fn new(sections: usize) -> Self {
        Self {
            directory: Directory::new(sections),
            blobs: Blobs::default(),
            active: Batch::default(),
            active_since: None,
            spare: None,
            frozen: VecDeque::new(),
            frozen_bytes: 0,
            written: 0,
            failures: 0,
            last_error: None,
            hurry: false,
            stop: false,
            writer_gone: false,
            lost: None,
            damage: Vec::new(),
            bad: HashSet::new(),
        }
    }

    pub fn pending_bytes(&self) -> u64 {
        self.frozen_bytes + self.active.bytes()
    }

    /// Closes the active batch, if it holds anything, so that it can be written.
    pub fn freeze(&mut self) {
        if self.active.is_empty() {
            return;
        }
        let id = self.active.id + 1;
        let next = self.spare.take().unwrap_or_default().with_id(id);
        let batch = std::mem::replace(&mut self.active, next);
        self.active_since = None;
        self.frozen_bytes += batch.bytes();
        self.frozen.push_back(Arc::new(batch));
    }

    /// Takes samples into memory and counts them.
    pub fn append(&mut self, key: BeamKey, class: Class, first: u32, samples: &[Sample]) {
        let (active, frozen) = (&self.active, &self.frozen);
        self.directory.account(key, class.kind, first, samples.len() as u32, |directory| {
            let batches = frozen.iter().map(|batch| &**batch).chain([active]);
            let pieces = batches
                .flat_map(|batch| batch.pieces_of(key))
                .filter(|piece| piece.class.kind == class.kind);
            let pending = pieces.map(|piece| (piece.first, piece.first + piece.count));
            directory.numbers_of(key, class.kind).chain(pending).collect()
        });
        self.active.push(key, class, first, samples);
    }

    /// Forgets the oldest frozen batch: all its extents are in the directory. Gives its memory back.
    pub fn batch_written(&mut self) -> Option<Arc<Batch>> {
        let batch = self.frozen.pop_front()?;
        self.frozen_bytes -= batch.bytes();
        self.written = batch.id + 1;
        Some(batch)
    }

    /// Takes in a block that was found in the file.
    pub fn found(&mut self, block: Block, table: Table) -> Result<()> {
        let block = Arc::new(block);
        let id = self.directory.add_block(Arc::clone(&block))?;
        match table {
            Table::Blob(part) => self.blobs.add(part, id, block),
            Table::Samples(entries) => {
                let mut at = 0;
                for entry in &entries {
                    let Entry { key, class, first, count } = *entry;
                    self.directory.account(key, class.kind, first, count, |d| {
                        d.numbers_of(key, class.kind).collect()
                    });
                    self.directory.add_extent(id, at, entry)?;
                    at += count;
                }
            }
        }
        Ok(())
    }

    /// Leaves out chunks that did not match their checksums, from now on.
    pub fn mark_bad(&mut self, chunks: &[(u32, u32)]) {
        for &(id, chunk) in chunks {
            let Some(block) = self.directory.blocks.get(id as usize) else { continue };
            if self.bad.insert((id, chunk)) {
                let (begin, end) = block.chunk_range(chunk);
                let what = block
                    .blob
                    .as_deref()
                    .map_or(DamageKind::Samples, |name| DamageKind::Blob(name.into()));
                self.damage.push(Damage { offset: begin, bytes: end - begin, what });
            }
        }
    }

    /// Everything that was appended to a beam, oldest first, and where it is.
    fn offers(&self, key: BeamKey) -> (Vec<Offer>, Vec<(Class, Source<'_>)>) {
        let mut offers: Vec<Offer> = Vec::new();
        let mut sources: Vec<(Class, Source)> = Vec::new();
        let mut offer = |class: Class, first: u32, count: u32, source| {
            offers.push(Offer { kind: class.kind, supersedes: class.supersedes, first, count });
            sources.push((class, source));
        };
        for extent in self.directory.extents_of(key) {
            let class = extent.class;
            for (skip, count) in self.intact(extent.block, extent.at, extent.count) {
                offer(
                    class,
                    extent.first + skip,
                    count,
                    Source::Disk { id: extent.block, at: extent.at + skip },
                );
            }
        }
        for batch in &self.frozen {
            for piece in batch.pieces_of(key) {
                offer(
                    piece.class,
                    piece.first,
                    piece.count,
                    Source::Frozen { batch, at: piece.at },
                );
            }
        }
        for piece in self.active.pieces_of(key) {
            offer(piece.class, piece.first, piece.count, Source::Active { at: piece.at });
        }
        (offers, sources)
    }

    /// What [`State::plan`] would read, in its order.
    pub fn runs(&self, key: BeamKey) -> Vec<Run> {
        let (offers, sources) = self.offers(key);
        let run = |seen: Visible| run(key, sources[seen.offer].0, seen.first, seen.count);
        visible(&offers).into_iter().map(run).collect()
    }

    /// How to read a beam as it is now; `None` if nothing was ever appended to it.
    pub fn plan(&self, key: BeamKey) -> Option<Plan> {
        let version = self.directory.beams.get(&key)?.version;
        let (offers, sources) = self.offers(key);
        let runs = visible(&offers).into_iter().map(|seen| {
            let (class, source) = &sources[seen.offer];
            let skip = seen.first - offers[seen.offer].first;
            let location = match *source {
                Source::Disk { id, at } => Location::Disk {
                    id,
                    block: Arc::clone(&self.directory.blocks[id as usize]),
                    at: at + skip,
                },
                Source::Frozen { batch, at } => {
                    Location::Frozen { batch: Arc::clone(batch), at: at + skip }
                }
                Source::Active { at } => {
                    Location::Copied(self.active.samples(at + skip, seen.count).to_vec())
                }
            };
            PlannedRun { run: run(key, *class, seen.first, seen.count), location }
        });
        Some(Plan { key, version, runs: runs.collect() })
    }

    /// The parts of `count` samples from `at` in a block that lie in no bad chunk: (offset from `at`, count).
    fn intact(&self, block: u32, at: u32, count: u32) -> Vec<(u32, u32)> {
        if self.bad.is_empty() {
            return vec![(0, count)];
        }
        let mut parts: Vec<(u32, u32)> = Vec::new();
        let end = at + count;
        let mut from = at;
        while from < end {
            let chunk = from / CHUNK_SAMPLES;
            let to = ((chunk + 1) * CHUNK_SAMPLES).min(end);
            if !self.bad.contains(&(block, chunk)) {
                match parts.last_mut() {
                    Some((skip, length)) if at + *skip + *length == from => *length += to - from,
                    _ => parts.push((from - at, to - from)),
                }
            }
            from = to;
        }
        parts
    }
}

impl From<std::io::Error> for Error {
    /// For use within the crate only, where the path is added one level up.
    fn from(source: std::io::Error) -> Self {
        Self::Io { path: Default::default(), doing: "reading", source }
    }
}
