//! Reading beams from a [`BeamFile`], through its cache.

use std::collections::HashSet;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;

use holo_section::{BeamKey, NumberRun, SampleKind};

use crate::Result;
use crate::file::BeamFile;
use crate::load::load;
use crate::plan::ReadPlan;
use crate::state::FileState;
use crate::types::{BeamSamples, Maker, Mark, NextNumbers};

/// Most samples and most beams that [`BeamFile::read_many`] reads together.
const GROUP_SAMPLES: u64 = 400_000;
const GROUP_BEAMS: usize = 8192;
/// Beams looked up under one lock.
const LOOKUP_BEAMS: usize = 512;

/// What a read of many beams does with the cache. Either uses the beams that are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Caching {
    /// Puts beams into it that were read from the disk.
    Fill,
    /// Leaves it as it is, for beams that are read once.
    Bypass,
}

impl BeamFile {
    /// Returns all samples of a beam, also those not yet on disk: each number once, in the order
    /// (kind, number).
    ///
    /// Empty if the beam has none. Damaged samples are left out and listed by
    /// [`BeamFile::damage`].
    ///
    /// # Errors
    /// If the beam does not exist or the disk cannot be read.
    pub fn read(&self, key: BeamKey) -> Result<Arc<BeamSamples>> {
        self.check(key)?;
        if let Some(samples) = self.cached(&self.shared.state(), key) {
            return Ok(samples);
        }
        let plan = self.shared.state().plan(key);
        let read = self.load_group(plan.into_iter().collect(), Caching::Fill)?;
        Ok(read.into_iter().next().map(|(_, samples)| samples).unwrap_or_default())
    }

    /// Calls `sink` once for each beam: first those in memory, then the others in file order.
    /// Neighbours in the file are read together. Stops when `sink` returns `Break`.
    ///
    /// # Errors
    /// If a beam does not exist (before the first call) or the disk cannot be read.
    pub fn read_many(
        &self,
        keys: &[BeamKey],
        caching: Caching,
        sink: &mut dyn FnMut(BeamKey, Arc<BeamSamples>) -> ControlFlow<()>,
    ) -> Result<()> {
        keys.iter().try_for_each(|&key| self.check(key))?;
        let mut seen = HashSet::with_capacity(keys.len());
        let mut plans: Vec<ReadPlan> = Vec::new();
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
            for (key, samples) in self.load_group(group, caching)? {
                if sink(key, samples).is_break() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Calls `sink` for each beam that has samples of an earlier generation, in file order, with
    /// those of its newest one. Stops when `sink` says so. The cache has no part in it.
    ///
    /// # Errors
    /// If a beam does not exist (before the first call) or the disk cannot be read.
    pub fn read_earlier(
        &self,
        keys: &[BeamKey],
        sink: &mut dyn FnMut(BeamKey, Arc<BeamSamples>) -> ControlFlow<()>,
    ) -> Result<()> {
        self.read_planned(keys, &FileState::plan_earlier, sink)
    }

    /// Returns a mark of what is on disk now, for [`read_until`](Self::read_until).
    pub fn mark(&self) -> Mark {
        Mark(self.shared.state().directory.blocks.len() as u32)
    }

    /// Calls `sink` for each beam with those of its samples that were on disk at a mark, in file
    /// order. Stops when `sink` says so. The cache has no part in it.
    ///
    /// # Errors
    /// If a beam does not exist (before the first call) or the disk cannot be read.
    pub fn read_until(
        &self,
        keys: &[BeamKey],
        mark: Mark,
        sink: &mut dyn FnMut(BeamKey, Arc<BeamSamples>) -> ControlFlow<()>,
    ) -> Result<()> {
        self.read_planned(keys, &|state, key| state.plan_until(key, mark), sink)
    }

    /// Reads beams by plans, without the cache.
    fn read_planned(
        &self,
        keys: &[BeamKey],
        plan: &dyn Fn(&FileState, BeamKey) -> Option<ReadPlan>,
        sink: &mut dyn FnMut(BeamKey, Arc<BeamSamples>) -> ControlFlow<()>,
    ) -> Result<()> {
        keys.iter().try_for_each(|&key| self.check(key))?;
        for some in keys.chunks(LOOKUP_BEAMS) {
            let state = self.shared.state();
            let mut plans: Vec<ReadPlan> =
                some.iter().filter_map(|&key| plan(&state, key)).collect();
            drop(state);
            plans.sort_by_cached_key(|plan| (plan.file_position(), plan.key));
            let beams = loop {
                let loaded = load(&*self.shared.storage, &plans)
                    .map_err(|error| self.shared.io("reading samples", error))?;
                match loaded {
                    Ok(beams) => break beams,
                    Err(bad) => {
                        let mut state = self.shared.state();
                        state.mark_bad(&bad);
                        plans = plans.iter().filter_map(|p| plan(&state, p.key)).collect();
                    }
                }
            };
            for (plan, samples) in plans.iter().zip(beams) {
                if sink(plan.key, samples).is_break() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Returns how many samples a beam has of its newest earlier generation.
    pub fn count_earlier(&self, key: BeamKey) -> u64 {
        self.shared.state().directory.earlier_of(key)
    }

    /// Returns the beam as it is now, if it is in the cache or has no samples.
    fn cached(&self, state: &FileState, key: BeamKey) -> Option<Arc<BeamSamples>> {
        match state.directory.beams.get(&key) {
            Some(beam) => self.shared.cache().get(key, beam.version),
            None => Some(Arc::default()),
        }
    }

    /// Reads beams, and puts them into the cache if `caching` says so. If it finds damage, it plans
    /// again without the damaged chunks.
    fn load_group(
        &self,
        mut plans: Vec<ReadPlan>,
        caching: Caching,
    ) -> Result<Vec<(BeamKey, Arc<BeamSamples>)>> {
        loop {
            let loaded = load(&*self.shared.storage, &plans)
                .map_err(|error| self.shared.io("reading samples", error))?;
            match loaded {
                Ok(beams) => {
                    if caching == Caching::Fill {
                        let mut cache = self.shared.cache();
                        for (plan, samples) in plans.iter().zip(&beams) {
                            cache.put(plan.key, plan.version, samples);
                        }
                    }
                    return Ok(plans.iter().map(|plan| plan.key).zip(beams).collect());
                }
                Err(bad) => {
                    let mut state = self.shared.state();
                    state.mark_bad(&bad);
                    plans = plans.iter().filter_map(|plan| state.plan(plan.key)).collect();
                }
            }
        }
    }

    /// Returns the runs that a read of the beam would give now, without reading any sample.
    ///
    /// The runs are in the same order, but runs that continue each other are not joined. Empty if
    /// the beam has no samples.
    pub fn runs(&self, key: BeamKey) -> Vec<NumberRun> {
        self.shared.state().runs(key).map(|(run, _)| run).collect()
    }

    /// Returns the parts of these runs whose samples are of one kind and whose numbers lie in a
    /// range, in order. Cheaper than all runs: of the beam's other appends only the numbers are
    /// compared.
    pub fn runs_within(
        &self,
        key: BeamKey,
        kind: SampleKind,
        numbers: &Range<u32>,
    ) -> Vec<NumberRun> {
        self.shared.state().runs_within(key, kind, numbers)
    }

    /// Returns the same runs as [`BeamFile::runs`], each with its samples' maker.
    pub fn makers(&self, key: BeamKey) -> Vec<(NumberRun, Maker)> {
        self.shared.state().runs(key).collect()
    }

    /// Returns the maker with the greatest number that the file has on disk.
    pub fn last_maker(&self) -> Maker {
        self.shared.state().directory.last_maker
    }

    /// Returns the next free sample numbers of a beam.
    pub fn counts(&self, key: BeamKey) -> NextNumbers {
        let next = self.shared.state().directory.beams.get(&key).map_or([0; 3], |beam| beam.next);
        NextNumbers { uniform: next[0], limited: next[1], single: next[2] }
    }

    /// Returns the number of samples of a beam, also of those not yet on disk; each number counts
    /// once.
    ///
    /// Samples that a read or [`BeamFile::verify`] found damaged still count. Those in blocks left
    /// out at opening do not.
    pub fn count(&self, key: BeamKey) -> u64 {
        self.shared.state().directory.beams.get(&key).map_or(0, |beam| beam.samples)
    }

    /// Calls `f` for every beam that has samples, in order, with their number.
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
}
