//! Shared by the tests: samples that name their own place, and a model of the file in memory.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

use holo_beamfile::format::{HEADER_COPY_BYTES, POINTER_BYTES, POINTER_OFFSET};
use holo_beamfile::{BeamFile, Options};
use holo_section::{BeamId, BeamKey, NumberRun, Sample, SampleKind};

/// Beams of the two sections that test files have.
pub const LAYOUT: [u64; 2] = [40, 12];

pub fn options() -> Options {
    Options { cache_bytes: 1 << 20, layout: LAYOUT.to_vec() }
}

pub fn key(section: u16, beam: u64) -> BeamKey {
    BeamKey { section, beam: BeamId(beam) }
}

pub fn kind(code: u8) -> SampleKind {
    match code {
        0 => SampleKind::Uniform,
        1 => SampleKind::ViewpointLimited,
        _ => SampleKind::SingleRay,
    }
}

pub fn run(key: BeamKey, first: u32) -> NumberRun {
    NumberRun { key, first, count: 0, kind: SampleKind::Uniform, paths: 1 }
}

/// Ten bytes that are different for each (beam, kind, number, tag).
pub fn sample(key: BeamKey, kind: SampleKind, number: u32, tag: u32) -> Sample {
    let seed = [u64::from(key.section), key.beam.0, kind as u64, u64::from(number), u64::from(tag)];
    let mixed = seed.iter().fold(0x9e37_79b9_7f4a_7c15u64, |h, &x| {
        let h = (h ^ x).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h ^ (h >> 29)
    });
    let mut bytes = [0; 10];
    bytes[..8].copy_from_slice(&mixed.to_le_bytes());
    bytes[8..].copy_from_slice(&(number as u16).to_le_bytes());
    bytemuck::pod_read_unaligned(&bytes)
}

pub fn samples(run: &NumberRun, count: u32, tag: u32) -> Vec<Sample> {
    (run.first..run.first + count).map(|n| sample(run.key, run.kind, n, tag)).collect()
}

/// Removes the index of a file whose last block before the index ends at `end`. What is left is a
/// file of a program that writes no index.
pub fn remove_index(path: &Path, end: u64) {
    let file = File::options().write(true).open(path).unwrap();
    file.set_len(end).unwrap();
    for copy in 0..2 {
        let at = copy * HEADER_COPY_BYTES + POINTER_OFFSET;
        file.write_all_at(&[0; POINTER_BYTES], at as u64).unwrap();
    }
}

/// A sample's bytes, and its paths.
pub type Truth = (Vec<u8>, u16);

/// The expected content of a file: by beam, then by (kind, number).
#[derive(Clone, Default)]
pub struct Model(pub BTreeMap<BeamKey, BTreeMap<(u8, u32), Truth>>);

impl Model {
    pub fn put(&mut self, run: &NumberRun, samples: &[Sample], supersedes: bool) {
        for (number, sample) in (run.first..).zip(samples) {
            let truth = (bytemuck::bytes_of(sample).to_vec(), run.paths);
            let numbers = self.0.entry(run.key).or_default();
            let old = numbers.entry((run.kind as u8, number)).or_insert_with(|| truth.clone());
            if supersedes {
                *old = truth;
            }
        }
    }

    pub fn len(&self) -> usize {
        self.0.values().map(BTreeMap::len).sum()
    }
}

/// Returns the content of a file, by `read`.
pub fn contents(file: &BeamFile) -> Model {
    let mut model = Model::default();
    for (section, &beams) in (0..).zip(&LAYOUT) {
        for beam in 0..beams {
            let key = key(section, beam);
            let read = file.read(key).unwrap();
            assert_eq!(
                read.samples.len() as u64,
                read.runs.iter().map(|e| u64::from(e.count)).sum::<u64>()
            );
            let mut last = None;
            for (run, samples) in read.iter() {
                assert_eq!(run.key, key);
                assert!(
                    last < Some((run.kind as u8, run.first)),
                    "runs are in the order (kind, number)"
                );
                last = Some((run.kind as u8, run.first + run.count - 1));
                model.put(run, samples, false);
            }
        }
    }
    model
}

/// Checks that a file has exactly the content of the model.
pub fn assert_same(file: &BeamFile, model: &Model) {
    let found = contents(file);
    assert!(found.0 == model.0, "found {} samples of {}", found.len(), model.len());
}

/// Checks that no content of a file differs from the model. Returns the missing numbers.
pub fn missing(file: &BeamFile, model: &Model) -> Vec<(BeamKey, u8, u32)> {
    let found = contents(file);
    for (key, numbers) in &found.0 {
        for (number, truth) in numbers {
            let right = model.0.get(key).and_then(|beam| beam.get(number));
            assert_eq!(
                Some(truth),
                right,
                "{key:?} {number:?}: a wrong sample was given without a word"
            );
        }
    }
    let has = |key: &BeamKey, number: &(u8, u32)| {
        found.0.get(key).is_some_and(|beam| beam.contains_key(number))
    };
    let all = model.0.iter().flat_map(|(key, beam)| beam.keys().map(move |number| (key, number)));
    all.filter(|(key, number)| !has(key, number))
        .map(|(key, number)| (*key, number.0, number.1))
        .collect()
}
