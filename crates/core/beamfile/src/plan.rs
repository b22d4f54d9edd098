//! Plans for reading beams.
//!
//! Invariant: a plan owns a share of everything that it refers to, so that reading takes no lock.

use std::ops::Range;
use std::sync::Arc;

use holo_section::{BeamKey, NumberRun, Sample, SampleKind};

use crate::batch::WriteBatch;
use crate::directory::{DiskBlock, Extent};
use crate::format::{CHUNK_SAMPLES, Class, SAMPLE_BYTES};
use crate::state::FileState;
use crate::types::{Maker, Mark};
use crate::visible::{Offer, visible};

/// The location of a planned run's samples.
pub(crate) enum Location {
    /// On disk: in block number `id`, from sample `at` of its payload on.
    Disk { id: u32, block: Arc<DiskBlock>, at: u32 },
    /// In a batch that waits to be written, from its sample `at` on.
    Frozen { batch: Arc<WriteBatch>, at: u32 },
    /// A copy of samples of the active batch.
    Copied(Vec<Sample>),
}

/// A run that a read returns, and the location of its samples.
pub(crate) struct PlannedRun {
    pub run: NumberRun,
    pub location: Location,
}

/// A plan for reading one beam.
pub(crate) struct ReadPlan {
    pub key: BeamKey,
    /// The beam's version in the directory when the plan was made.
    pub version: u32,
    /// In the order (kind, sample number).
    pub runs: Vec<PlannedRun>,
}

impl ReadPlan {
    /// Returns the number of samples that the plan reads.
    pub fn samples(&self) -> u64 {
        self.runs.iter().map(|planned| u64::from(planned.run.count)).sum()
    }

    /// Returns the offset in the file of the plan's first samples; 0 if all are in memory.
    pub fn file_position(&self) -> u64 {
        let positions = self.runs.iter().filter_map(|planned| match &planned.location {
            Location::Disk { block, at, .. } => {
                Some(block.chunk_range(0).0 + u64::from(*at) * u64::from(SAMPLE_BYTES))
            }
            Location::Frozen { .. } | Location::Copied(_) => None,
        });
        positions.min().unwrap_or(0)
    }
}

/// The location of an [`Offer`]'s samples, like [`Location`] but without copies.
enum OfferedAt<'a> {
    Disk { id: u32, at: u32 },
    Frozen { batch: &'a Arc<WriteBatch>, at: u32 },
    Active { at: u32 },
}

fn run(key: BeamKey, class: Class, first: u32, count: u32) -> NumberRun {
    NumberRun { key, kind: class.sample_kind(), first, count, paths: class.paths }
}

impl FileState {
    /// Returns everything that was appended to a beam, oldest first, with its location.
    fn offers(&self, key: BeamKey) -> (Vec<Offer>, Vec<(Class, OfferedAt<'_>)>) {
        self.offers_where(key, |_| true)
    }

    /// Returns those appends to a beam that are `wanted`, oldest first, with their locations.
    fn offers_where(
        &self,
        key: BeamKey,
        wanted: impl Fn(&Offer) -> bool,
    ) -> (Vec<Offer>, Vec<(Class, OfferedAt<'_>)>) {
        let mut offers: Vec<Offer> = Vec::new();
        let mut places: Vec<(Class, OfferedAt)> = Vec::new();
        let mut offer = |class: Class, first: u32, count: u32, place| {
            let offer = Offer { kind: class.kind, supersedes: class.supersedes, first, count };
            if !wanted(&offer) {
                return;
            }
            offers.push(offer);
            places.push((class, place));
        };
        for extent in self.directory.extents_of(key) {
            for (skip, count) in self.intact(extent.block, extent.at, extent.count) {
                let place = OfferedAt::Disk { id: extent.block, at: extent.at + skip };
                offer(extent.class, extent.first + skip, count, place);
            }
        }
        for batch in &self.frozen {
            for append in batch.appends_of(key) {
                let place = OfferedAt::Frozen { batch, at: append.at };
                offer(append.class, append.first, append.count, place);
            }
        }
        for append in self.active.appends_of(key) {
            offer(append.class, append.first, append.count, OfferedAt::Active { at: append.at });
        }
        (offers, places)
    }

    /// Returns how to read a beam's samples of its newest earlier generation; `None` if there are
    /// none. All of them are on disk.
    pub fn plan_earlier(&self, key: BeamKey) -> Option<ReadPlan> {
        self.plan_extents(key, self.directory.earlier_extents_of(key))
    }

    /// Returns how to read those of a beam's samples that were on disk at a mark; `None` if there
    /// are none.
    pub fn plan_until(&self, key: BeamKey, mark: Mark) -> Option<ReadPlan> {
        let extents = self.directory.extents_of(key).take_while(|extent| extent.block < mark.0);
        self.plan_extents(key, extents)
    }

    fn plan_extents<'a>(
        &self,
        key: BeamKey,
        extents: impl Iterator<Item = &'a Extent>,
    ) -> Option<ReadPlan> {
        let mut offers: Vec<Offer> = Vec::new();
        let mut places = Vec::new();
        for extent in extents {
            let Class { kind, supersedes, .. } = extent.class;
            for (skip, count) in self.intact(extent.block, extent.at, extent.count) {
                offers.push(Offer { kind, supersedes, first: extent.first + skip, count });
                places.push((extent.class, extent.block, extent.at + skip));
            }
        }
        let runs = visible(&offers).into_iter().map(|seen| {
            let (class, id, at) = places[seen.offer];
            let at = at + (seen.first - offers[seen.offer].first);
            let block = Arc::clone(&self.directory.blocks[id as usize]);
            let location = Location::Disk { id, block, at };
            PlannedRun { run: run(key, class, seen.first, seen.count), location }
        });
        let runs: Vec<PlannedRun> = runs.collect();
        (!runs.is_empty()).then_some(ReadPlan { key, version: 0, runs })
    }

    /// Returns the runs that [`FileState::plan`] would read, in its order, and their makers.
    pub fn runs(&self, key: BeamKey) -> impl Iterator<Item = (NumberRun, Maker)> {
        let (offers, places) = self.offers(key);
        visible(&offers).into_iter().map(move |seen| {
            let class = places[seen.offer].0;
            (run(key, class, seen.first, seen.count), class.maker)
        })
    }

    /// Returns the parts of these runs whose samples are of one kind and whose numbers lie in a
    /// range, in order.
    pub fn runs_within(
        &self,
        key: BeamKey,
        kind: SampleKind,
        numbers: &Range<u32>,
    ) -> Vec<NumberRun> {
        // Other appends do not decide about these numbers. A beam may have a hundred thousand.
        let (offers, places) = self.offers_where(key, |offer| {
            offer.kind == kind as u8
                && offer.first < numbers.end
                && offer.first.saturating_add(offer.count) > numbers.start
        });
        let within = visible(&offers).into_iter().map(|seen| {
            let first = seen.first.max(numbers.start);
            let end = (seen.first + seen.count).min(numbers.end);
            run(key, places[seen.offer].0, first, end.saturating_sub(first))
        });
        within.filter(|run| run.count > 0).collect()
    }

    /// Returns a plan for reading the present state of a beam; `None` if nothing was ever appended
    /// to it.
    pub fn plan(&self, key: BeamKey) -> Option<ReadPlan> {
        let version = self.directory.beams.get(&key)?.version;
        let (offers, places) = self.offers(key);
        let runs = visible(&offers).into_iter().map(|seen| {
            let (class, place) = &places[seen.offer];
            let skip = seen.first - offers[seen.offer].first;
            let location = match *place {
                OfferedAt::Disk { id, at } => Location::Disk {
                    id,
                    block: Arc::clone(&self.directory.blocks[id as usize]),
                    at: at + skip,
                },
                OfferedAt::Frozen { batch, at } => {
                    Location::Frozen { batch: Arc::clone(batch), at: at + skip }
                }
                OfferedAt::Active { at } => {
                    Location::Copied(self.active.samples(at + skip, seen.count).to_vec())
                }
            };
            PlannedRun { run: run(key, *class, seen.first, seen.count), location }
        });
        Some(ReadPlan { key, version, runs: runs.collect() })
    }

    /// Returns the samples outside bad chunks, among `count` samples from `at` in a block. Each
    /// range has its distance from `at` and its number of samples.
    fn intact(&self, block: u32, at: u32, count: u32) -> Vec<(u32, u32)> {
        if self.bad.is_empty() {
            return vec![(0, count)];
        }
        let mut stretches: Vec<(u32, u32)> = Vec::new();
        let end = at + count;
        let mut from = at;
        while from < end {
            let chunk = from / CHUNK_SAMPLES;
            let to = ((chunk + 1) * CHUNK_SAMPLES).min(end);
            if !self.bad.contains(&(block, chunk)) {
                match stretches.last_mut() {
                    Some((skip, length)) if at + *skip + *length == from => *length += to - from,
                    _ => stretches.push((from - at, to - from)),
                }
            }
            from = to;
        }
        stretches
    }
}
