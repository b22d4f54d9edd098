//! Records which sample numbers of each beam have been given out.
//!
//! Invariant: a number is given out once, unless it is given back. Numbers that the file lacks
//! below its greatest one come first: they were forgotten, or lost to damage.

use holo_beamfile::BeamFile;
use holo_section::{BeamKey, SampleKind};
use rustc_hash::FxHashMap;

/// Gives out sample numbers so that none is traced twice.
#[derive(Default)]
pub struct Allotment(FxHashMap<(BeamKey, SampleKind), FreeNumbers>);

/// The numbers of one beam and kind that may be given out.
struct FreeNumbers {
    /// All from here on.
    next: u32,
    /// Ranges below: the first number, and how many.
    free: Vec<(u32, u32)>,
}

impl Allotment {
    /// Returns up to `count` fresh numbers of a beam: the first, and how many. `None` at the very
    /// end of the numbers.
    pub fn take(
        &mut self,
        file: &BeamFile,
        key: BeamKey,
        kind: SampleKind,
        count: u8,
    ) -> Option<(u32, u8)> {
        let numbers = self.0.entry((key, kind)).or_insert_with(|| FreeNumbers::of(file, key, kind));
        if let Some((first, free)) = numbers.free.last_mut() {
            let taken = (*first, (*free).min(u32::from(count)));
            (*first, *free) = (*first + taken.1, *free - taken.1);
            numbers.free.pop_if(|(_, free)| *free == 0);
            // At most `count`.
            return Some((taken.0, taken.1 as u8));
        }
        let first = numbers.next;
        numbers.next = first.checked_add(u32::from(count))?;
        Some((first, count))
    }

    /// Takes back numbers that will not be traced. They are the beam's next.
    pub fn give_back(&mut self, key: BeamKey, kind: SampleKind, first: u32, count: u8) {
        if let Some(numbers) = self.0.get_mut(&(key, kind)) {
            numbers.free.push((first, u32::from(count)));
        }
    }

    /// Returns how many samples of a beam are stored or under way.
    pub fn taken(&self, file: &BeamFile, key: BeamKey) -> u64 {
        let kinds = [SampleKind::Uniform, SampleKind::ViewpointLimited, SampleKind::SingleRay];
        let known = kinds.map(|kind| self.0.get(&(key, kind)).map(FreeNumbers::taken));
        if known == [None; 3] {
            return file.count(key);
        }
        let stored = kinds.into_iter().zip(known);
        stored
            .map(|(kind, known)| known.unwrap_or_else(|| FreeNumbers::of(file, key, kind).taken()))
            .sum()
    }
}

impl FreeNumbers {
    /// Returns the numbers that a file lacks.
    fn of(file: &BeamFile, key: BeamKey, kind: SampleKind) -> FreeNumbers {
        let counts = file.counts(key);
        let next = match kind {
            SampleKind::Uniform => counts.uniform,
            SampleKind::ViewpointLimited => counts.limited,
            SampleKind::SingleRay => counts.single,
        };
        if next == 0 {
            return FreeNumbers { next, free: Vec::new() };
        }
        let all = [counts.uniform, counts.limited, counts.single].map(u64::from).iter().sum();
        // Most beams lack nothing, and then their runs need not be read.
        let free = if file.count(key) < all { holes(file, key, kind, next) } else { Vec::new() };
        FreeNumbers { next, free }
    }

    fn taken(&self) -> u64 {
        u64::from(self.next - self.free.iter().map(|(_, count)| count).sum::<u32>())
    }
}

/// Returns the numbers below `next` that a beam lacks, the lowest last.
fn holes(file: &BeamFile, key: BeamKey, kind: SampleKind, next: u32) -> Vec<(u32, u32)> {
    let (mut holes, mut at) = (Vec::new(), 0);
    for run in file.runs(key).iter().filter(|run| run.kind == kind) {
        if run.first > at {
            holes.push((at, run.first - at));
        }
        at = run.first + run.count;
    }
    if at < next {
        holes.push((at, next - at));
    }
    holes.reverse();
    holes
}

#[cfg(test)]
mod tests {
    use holo_beamfile::{Maker, Options};
    use holo_section::{BeamId, NumberRun, Sample};

    use super::*;

    #[test]
    fn numbers_that_the_file_lacks_come_first_and_each_number_once() {
        let folder = tempfile::tempdir().unwrap();
        let options = Options { cache_bytes: 0, layout: vec![10] };
        let file = BeamFile::create(folder.path().join("a"), options).unwrap();
        let key = BeamKey { section: 0, beam: BeamId(3) };
        for (first, count) in [(5, 10), (40, 3)] {
            let run = NumberRun { key, kind: SampleKind::Uniform, first, count, paths: 1 };
            file.append(run, Maker::UNKNOWN, &vec![Sample::default(); count as usize]).unwrap();
        }
        let (mut allotment, kind) = (Allotment::default(), SampleKind::Uniform);
        assert_eq!(allotment.taken(&file, key), 13);
        let mut take = |count| allotment.take(&file, key, kind, count).unwrap();
        assert_eq!([take(21), take(21), take(21), take(21)], [(0, 5), (15, 21), (36, 4), (43, 21)]);
        allotment.give_back(key, kind, 50, 3);
        assert_eq!(allotment.taken(&file, key), 61);
        assert_eq!(allotment.take(&file, key, kind, 2), Some((50, 2)));
        assert_eq!(allotment.take(&file, key, kind, 2), Some((52, 1)));
        assert_eq!(allotment.take(&file, key, kind, 2), Some((64, 2)));
        let other = SampleKind::SingleRay;
        assert_eq!(allotment.take(&file, key, other, 21), Some((0, 21)), "kinds have their own");
    }
}
