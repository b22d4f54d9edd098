//! Reads the content of a holodeck file independently of the program under test.

use std::{collections::BTreeMap, path::Path};

use holo_beamfile::BeamFile;
use holo_section::{BeamId, BeamKey, Sample, SampleKind};

/// The samples of a file, by beam and kind, in the order of their numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// Every sample.
    pub beams: BTreeMap<(BeamKey, SampleKind), Vec<(u32, Sample)>>,
}

impl Stored {
    /// Returns the number of samples.
    pub fn count(&self) -> u64 {
        self.beams.values().map(|samples| samples.len() as u64).sum()
    }

    /// Checks that the numbers of every beam and kind are 0, 1, 2 … without a gap. Then no work was
    /// lost, and none was done twice.
    #[track_caller]
    pub fn assert_no_gaps(&self) {
        assert_eq!(
            self.gap(),
            None,
            "a beam, and its first number that is not there or there twice"
        );
    }

    /// Returns the first beam and kind whose numbers are not 0, 1, 2 …, with the first wrong
    /// number.
    pub fn gap(&self) -> Option<(BeamKey, SampleKind, u32)> {
        self.beams.iter().find_map(|(&(key, kind), samples)| {
            let mut numbered = (0..).zip(samples);
            let wrong = numbered.find(|(expected, (number, _))| number != expected);
            wrong.map(|(expected, _)| (key, kind, expected))
        })
    }

    /// Returns how many numbers below the last one of their beam and kind are not there.
    ///
    /// # Panics
    /// If a number is there twice.
    #[track_caller]
    pub fn missing(&self) -> u64 {
        let of_beam = |samples: &Vec<(u32, Sample)>| {
            let is_once = samples.is_sorted_by(|one, next| one.0 < next.0);
            assert!(is_once, "a sample is there twice");
            samples.last().map_or(0, |(last, _)| u64::from(*last) + 1) - samples.len() as u64
        };
        self.beams.values().map(of_beam).sum()
    }

    /// Returns true if the file has the sample with this number.
    pub fn has(&self, key: BeamKey, kind: SampleKind, number: u32) -> bool {
        let samples = self.beams.get(&(key, kind));
        samples.is_some_and(|samples| samples.binary_search_by_key(&number, |s| s.0).is_ok())
    }

    /// Checks that the file still has all samples of `earlier`, unchanged.
    #[track_caller]
    pub fn assert_contains(&self, earlier: &Stored) {
        for (name, samples) in &earlier.beams {
            let mine = self.beams.get(name).unwrap_or_else(|| panic!("{name:?} is gone"));
            let mine: BTreeMap<u32, Sample> = mine.iter().copied().collect();
            for (number, sample) in samples {
                assert_eq!(mine.get(number), Some(sample), "sample {number} of {name:?}");
            }
        }
    }
}

/// Returns a beam of the first section.
pub fn beam(number: u64) -> BeamKey {
    BeamKey { section: 0, beam: BeamId(number) }
}

/// Reads every sample of a file, and verifies all checksums.
///
/// # Panics
/// If the file cannot be opened, or if its own statistics do not agree with its samples.
#[track_caller]
pub fn stored(path: &Path) -> Stored {
    let file = BeamFile::open_read_only(path, 1 << 20).unwrap_or_else(|error| panic!("{error}"));
    let mut keys = Vec::new();
    file.for_each_beam(&mut |key, count| keys.push((key, count)));
    let mut beams: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for (key, count) in keys {
        let beam = file.read(key).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(beam.samples.len() as u64, count, "{key:?}");
        for (run, samples) in beam.iter() {
            let numbered = (run.first..).zip(samples.iter().copied());
            beams.entry((key, run.kind)).or_default().extend(numbered);
        }
    }
    let stored = Stored { beams };
    assert_eq!(stored.count(), file.stats().samples);
    stored
}
