//! Putting one holodeck's samples into another.
//!
//! Invariants:
//! - A sample is known by its beam, kind and number. One that both files have is stored once, with
//!   the larger number of paths.
//! - So merging a file again changes nothing.

use std::{
    collections::HashMap,
    ops::{ControlFlow, Range},
};

use anyhow::{Result, ensure};
use holo_beamfile::{Caching, Error, Maker};
use holo_section::{NumberRun, Sample};
use serde::Serialize;

use crate::{better, holodeck::Holodeck};

/// What a merge did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Merged {
    /// Samples that were new.
    pub added: u64,
    /// Samples that replaced some of fewer paths.
    pub better: u64,
    /// Samples that were there already.
    pub known: u64,
}

impl Holodeck {
    /// Adds what another holodeck of the same scene, sections and settings has: samples and their
    /// shares in layers, unseen beams, cells of surface light, and named views. All is on the
    /// disk afterwards.
    ///
    /// # Errors
    /// If the two are not of one kind, or one cannot be read or the other not be written.
    pub fn merge(&self, other: &Holodeck) -> Result<Merged> {
        let (ours, theirs) = (&self.about, &other.about);
        ensure!(ours.scene == theirs.scene, "they are of different scenes");
        ensure!(ours.sections == theirs.sections, "they have different sections");
        ensure!(ours.settings == theirs.settings, "they were traced with different settings");
        // Their numbers name pixels of different pictures.
        ensure!(
            !ours.is_captured(),
            "they hold captured rays: import all pictures into one file with a list"
        );
        let mut merged = Merged::default();
        let makers: HashMap<Maker, Maker> =
            self.makers_mut().merge(&other.makers()).into_iter().collect();
        let mut keys = Vec::new();
        other.file.for_each_beam(&mut |key, _| keys.push(key));
        let mut written = Ok(());
        other.file.read_many(&keys, Caching::Bypass, &mut |key, beam| {
            let made = other.file.makers(key);
            let parts = beam.iter().flat_map(|(run, samples)| by_maker(run, samples, &made));
            written = { parts }.try_for_each(|(run, samples, maker)| {
                let maker = makers.get(&maker).copied().unwrap_or_default();
                self.merge_run(&run, maker, samples, &mut merged)
            });
            if written.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        })?;
        written?;
        other.file.copy_shares(&self.file, &|maker, generation| {
            let maker = makers.get(&maker).copied().unwrap_or_default();
            (generation == theirs.generation).then_some((maker, ours.generation))
        })?;
        self.merge_unseen(other, &makers);
        let maker = |maker| makers.get(&maker).copied().unwrap_or_default();
        self.cells_mut().merge(&other.cells(), maker);
        self.save_makers()?;
        self.save_unseen()?;
        self.save_cells(true)?;
        for (name, options) in &theirs.views {
            if !self.about.views.iter().any(|(known, _)| known == name) {
                self.keep_view(name, options)?;
            }
        }
        self.file.flush()?;
        Ok(merged)
    }

    /// Adds another file's unseen beams. What either file has proven is proven.
    fn merge_unseen(&self, other: &Holodeck, makers: &HashMap<Maker, Maker>) {
        let (theirs, claims) = (other.unseen(), other.unproven());
        let (mut unseen, mut unproven) = (self.unseen_mut(), self.unproven_mut());
        for (maker, claims) in claims.iter() {
            let maker = makers.get(&maker).copied().unwrap_or_default();
            for key in claims.iter().filter(|key| !unseen.contains(*key)) {
                unproven.insert(maker, key);
            }
        }
        let proven = claims.proven(&theirs);
        let known: Vec<Maker> = unproven.iter().map(|(maker, _)| maker).collect();
        known.into_iter().for_each(|maker| unproven.remove(maker, &proven));
        unseen.add(&theirs);
    }

    fn merge_run(
        &self,
        run: &NumberRun,
        maker: Maker,
        samples: &[Sample],
        merged: &mut Merged,
    ) -> Result<(), Error> {
        let numbers = run.first..run.first + samples.len() as u32;
        let have = self.file.runs_within(run.key, run.kind, &numbers);
        let part = |range: &Range<u32>| {
            let run = NumberRun { first: range.start, count: range.len() as u32, ..*run };
            (run, &samples[(range.start - numbers.start) as usize..][..range.len()])
        };
        let missing = missing(&have, &numbers);
        let worse = better::worse(&have, run.paths, &numbers);
        let is_uniform = run.kind == holo_section::SampleKind::Uniform;
        merged.known += samples.len() as u64;
        for range in &missing {
            let (run, samples) = part(range);
            self.file.append(run, maker, samples)?;
            merged.added += samples.len() as u64;
            merged.known -= samples.len() as u64;
        }
        for range in worse.iter().filter(|_| is_uniform) {
            let (run, samples) = part(range);
            self.file.supersede(run, maker, samples)?;
            merged.better += samples.len() as u64;
            merged.known -= samples.len() as u64;
        }
        Ok(())
    }
}

/// Divides a run's samples among those who made them.
pub(crate) fn by_maker<'a>(
    run: &NumberRun,
    samples: &'a [Sample],
    made: &[(NumberRun, Maker)],
) -> Vec<(NumberRun, &'a [Sample], Maker)> {
    let of_kind = made.iter().filter(|(part, _)| part.kind == run.kind);
    let part = |(part, maker): &(NumberRun, Maker)| {
        let first = part.first.max(run.first);
        let end = (part.first + part.count).min(run.first + run.count);
        let count = end.checked_sub(first).filter(|count| *count > 0)?;
        let samples = samples.get((first - run.first) as usize..)?.get(..count as usize)?;
        Some((NumberRun { first, count, ..*run }, samples, *maker))
    };
    of_kind.filter_map(part).collect()
}

/// Returns the numbers that lie between the runs `have`, which lie within `numbers`, in order.
fn missing(have: &[NumberRun], numbers: &Range<u32>) -> Vec<Range<u32>> {
    let ends = have.iter().map(|run| run.first + run.count);
    let starts = have.iter().map(|run| run.first);
    let gaps = std::iter::once(numbers.start).chain(ends).zip(starts.chain([numbers.end]));
    gaps.map(|(end, start)| end..start).filter(|gap| !gap.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use holo_section::{BeamId, BeamKey, SampleKind};

    use super::*;

    #[test]
    fn what_is_missing_is_all_that_no_run_has() {
        let key = BeamKey { section: 0, beam: BeamId(1) };
        let run = |first, count| {
            let kind = SampleKind::Uniform;
            NumberRun { key, first, count, kind, paths: 1 }
        };
        let of = |have: &[NumberRun], numbers: Range<u32>| {
            let missing = missing(have, &numbers);
            missing.into_iter().map(|range| (range.start, range.end)).collect::<Vec<_>>()
        };
        assert_eq!(of(&[run(3, 4), run(20, 2), run(22, 3)], 0..30), [(0, 3), (7, 20), (25, 30)]);
        assert_eq!(of(&[run(4, 2)], 4..6), []);
        assert_eq!(of(&[run(5, 2)], 5..10), [(7, 10)]);
        assert_eq!(of(&[], 4..9), [(4, 9)]);
    }

    #[test]
    fn samples_go_to_those_who_made_them_by_kind_and_number() {
        let key = BeamKey { section: 0, beam: BeamId(1) };
        let run = |kind, first, count| NumberRun { key, first, count, kind, paths: 1 };
        let (uniform, single) = (SampleKind::Uniform, SampleKind::SingleRay);
        let made = [
            (run(uniform, 0, 4), Maker(1)),
            (run(uniform, 4, 6), Maker(2)),
            (run(single, 0, 9), Maker(3)),
            (run(uniform, 10, 5), Maker(1)),
        ];
        let samples = vec![Sample::default(); 9];
        let parts = |first| -> Vec<(u32, u32, usize, u16)> {
            let parts = by_maker(&run(uniform, first, 9), &samples, &made).into_iter();
            parts
                .map(|(run, samples, maker)| (run.first, run.count, samples.len(), maker.0))
                .collect()
        };
        assert_eq!(parts(3), [(3, 1, 1, 1), (4, 6, 6, 2), (10, 2, 2, 1)]);
        assert_eq!(parts(20), []);
    }
}
