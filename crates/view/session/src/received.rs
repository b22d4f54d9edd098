//! Records which samples have arrived. A sample that is stored while stored samples are being sent
//! may arrive twice: from the file and from the worker.

use holo_proto::bulk::MAX_HELD;
use holo_section::{BeamKey, NumberRun};
use rustc_hash::FxHashMap;

use super::earlier::Earlier;

/// Sample numbers received, by beam.
#[derive(Default)]
pub struct Received {
    beams: FxHashMap<BeamKey, OfBeam>,
    samples: u64,
    /// Samples of an earlier generation. They have no numbers.
    pub earlier: Earlier,
}

/// The received samples of a beam.
#[derive(Default)]
struct OfBeam {
    count: u64,
    /// Ranges of numbers, by kind.
    ranges: [Vec<(u32, u32)>; 3],
}

impl Received {
    /// Returns how many samples of a beam have arrived.
    pub fn count(&self, key: BeamKey) -> u64 {
        self.beams.get(&key).map_or(0, |beam| beam.count)
    }

    /// Returns how many samples of a beam have arrived, at most [`MAX_HELD`].
    pub fn held(&self, key: BeamKey) -> u16 {
        u16::try_from(self.count(key)).unwrap_or(MAX_HELD).min(MAX_HELD)
    }

    /// Returns how many samples have arrived.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Adds a run. Returns the parts of it that are new, as ranges of positions in the run.
    pub fn add(&mut self, run: &NumberRun) -> Vec<std::ops::Range<usize>> {
        let OfBeam { count, ranges } = self.beams.entry(run.key).or_default();
        let ranges = &mut ranges[run.kind as usize];
        let (first, end) = (run.first, run.first + run.count);
        // Runs mostly arrive in order, so the search begins at the end. `at` is the first range
        // that ends at or after `first`.
        let mut at = ranges.len();
        while at > 0 && ranges[at - 1].1 >= first {
            at -= 1;
        }
        let mut fresh = Vec::new();
        let (mut merged, mut next, mut upto) = ((first, end), first, at);
        while let Some(&(low, high)) = ranges.get(upto).filter(|(low, _)| *low <= end) {
            if next < low {
                fresh.push((next - first) as usize..(low - first) as usize);
            }
            next = next.max(high);
            merged = (merged.0.min(low), merged.1.max(high));
            upto += 1;
        }
        if next < end {
            fresh.push((next - first) as usize..run.count as usize);
        }
        ranges.splice(at..upto, [merged]);
        let new = fresh.iter().map(|part| part.len() as u64).sum::<u64>();
        *count += new;
        self.samples += new;
        fresh
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use holo_section::{BeamId, SampleKind};

    use super::*;

    #[test]
    fn each_sample_number_is_new_exactly_once() {
        let mut received = Received::default();
        let mut model = HashSet::new();
        let mut state = 1u64;
        for _ in 0..2000 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let (first, count) = ((state >> 33) as u32 % 500, (state >> 50) as u32 % 21 + 1);
            let run = NumberRun {
                key: BeamKey { section: 0, beam: BeamId(state >> 63) },
                kind: SampleKind::Uniform,
                first,
                count,
                paths: 1,
            };
            let fresh: Vec<u32> =
                received.add(&run).into_iter().flatten().map(|at| first + at as u32).collect();
            let expected: Vec<u32> =
                (first..first + count).filter(|&number| model.insert((run.key, number))).collect();
            assert_eq!(fresh, expected);
            let held = model.iter().filter(|(key, _)| *key == run.key).count();
            assert_eq!(usize::from(received.held(run.key)), held);
        }
        let key = BeamKey { section: 0, beam: BeamId(0) };
        let ranges = &received.beams[&key].ranges[SampleKind::Uniform as usize];
        assert!(
            ranges.windows(2).all(|pair| pair[0].1 < pair[1].0),
            "touching ranges are merged: {ranges:?}"
        );
    }
}
