//! The samples of the last views, oldest first, so that the next view can show them.

use holo_section::{BeamKey, Sample};

/// Largest number of samples in a log: those that two views of a large file cross. A new quadtree
/// takes so many in about 40 ms.
const MAX_SAMPLES: usize = 500_000;

/// Samples of the current view and of earlier ones.
#[derive(Default)]
pub(crate) struct Log {
    batches: Vec<Batch>,
    samples: Vec<Sample>,
    /// Number of the batches that arrived before the current view.
    earlier: usize,
}

/// Samples of one beam that arrived together.
#[derive(Clone, Copy)]
struct Batch {
    key: BeamKey,
    paths: u16,
    count: usize,
}

impl Log {
    /// Adds samples of one beam. If there are then more than [`MAX_SAMPLES`], removes the older
    /// half.
    pub fn add(&mut self, key: BeamKey, paths: u16, samples: &[Sample]) {
        self.batches.push(Batch { key, paths, count: samples.len() });
        self.samples.extend_from_slice(samples);
        if self.samples.len() > MAX_SAMPLES {
            let mut count = self.samples.len();
            let is_enough = |batch: &Batch| {
                count -= batch.count;
                count <= MAX_SAMPLES / 2
            };
            let removed =
                self.batches.iter().position(is_enough).map_or(self.batches.len(), |at| at + 1);
            self.forget(removed);
        }
    }

    /// Starts the next view: all samples so far belong to earlier ones.
    pub fn begin_view(&mut self) {
        self.earlier = self.batches.len();
    }

    /// Forgets the samples of earlier views.
    pub fn forget_earlier(&mut self) {
        self.forget(self.earlier);
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.forget(self.batches.len());
    }

    /// Returns whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Calls `insert` with the beam, paths and samples of each batch, oldest first.
    pub fn replay(&self, mut insert: impl FnMut(BeamKey, u16, &[Sample])) {
        let mut rest = self.samples.as_slice();
        for batch in &self.batches {
            let (samples, tail) = rest.split_at(batch.count);
            insert(batch.key, batch.paths, samples);
            rest = tail;
        }
    }

    /// Removes the oldest `batches` batches.
    fn forget(&mut self, batches: usize) {
        let samples: usize = self.batches.drain(..batches).map(|batch| batch.count).sum();
        self.samples.drain(..samples);
        self.earlier = self.earlier.saturating_sub(batches);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_section::{BeamId, RayCoords};

    /// Adds a sample of one beam for each number.
    fn add(log: &mut Log, beams: std::ops::Range<u64>) {
        for beam in beams {
            let sample = Sample::from_codes(RayCoords::default(), [beam as u8; 4], 7);
            log.add(BeamKey { section: 0, beam: BeamId(beam) }, 1, &[sample]);
        }
    }

    fn beams(log: &Log) -> Vec<u64> {
        let mut beams = Vec::new();
        log.replay(|BeamKey { beam, .. }, _, samples| {
            assert_eq!(samples[0].rgbe[0], beam.0 as u8);
            beams.push(beam.0);
        });
        beams
    }

    #[test]
    fn earlier_views_are_forgotten_and_the_current_one_stays() {
        let mut log = Log::default();
        add(&mut log, 0..3);
        log.begin_view();
        add(&mut log, 3..5);
        assert_eq!(beams(&log), [0, 1, 2, 3, 4]);
        log.forget_earlier();
        assert_eq!(beams(&log), [3, 4]);
        log.forget_earlier();
        assert_eq!(beams(&log), [3, 4]);
        log.clear();
        assert!(log.is_empty());
    }

    #[test]
    fn no_more_than_the_most_is_kept_and_the_newest_stay() {
        let (mut log, most) = (Log::default(), MAX_SAMPLES as u64);
        add(&mut log, 0..10);
        log.begin_view();
        add(&mut log, 10..most + 1);
        let kept = beams(&log);
        assert_eq!(kept, (most / 2 + 1..most + 1).collect::<Vec<_>>());
        // All of the earlier view are gone.
        log.forget_earlier();
        assert_eq!(beams(&log), kept);
    }
}
