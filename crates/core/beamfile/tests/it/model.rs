//! Random operations, compared with a model in memory, across flushes and reopenings.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::ops::ControlFlow;

use crate::common::{LAYOUT, Model, assert_same, contents, key, kind, options, run, samples};
use holo_beamfile::{BeamFile, Caching, Maker};
use holo_section::{NumberRun, SampleKind};
use proptest::prelude::*;

#[derive(Clone, Debug)]
enum Step {
    Put { section: u16, beam: u64, kind: u8, first: u32, count: u32, paths: u16, supersedes: bool },
    Read { section: u16, beam: u64 },
    Blob { name: u8, bytes: usize },
    Flush,
    Reopen,
}

fn step() -> impl Strategy<Value = Step> {
    let put = (0u16..2, 0u64..12, 0u8..3, 0u32..80, 1u32..60, 1u16..3, prop::bool::weighted(0.3));
    prop_oneof![
        12 => put.prop_map(|(section, beam, kind, first, count, paths, supersedes)| {
            Step::Put { section, beam, kind, first, count, paths, supersedes }
        }),
        4 => (0u16..2, 0u64..12).prop_map(|(section, beam)| Step::Read { section, beam }),
        1 => (0u8..3, 0usize..9000).prop_map(|(name, bytes)| Step::Blob { name, bytes }),
        1 => Just(Step::Flush),
        1 => Just(Step::Reopen),
    ]
}

/// Checks that counts, statistics, `runs` and `read_many` agree with `read`. `put` samples were
/// appended in all.
fn assert_figures(file: &BeamFile, model: &Model, put: u64) {
    let stats = file.stats();
    assert_eq!(stats.superseded, put - stats.samples);
    for (section, &beams) in (0..).zip(&LAYOUT) {
        for beam in (0..beams).map(|beam| key(section, beam)) {
            let numbers = |runs: &[NumberRun]| {
                let each = |run: &NumberRun| {
                    let run = *run;
                    (0..run.count).map(move |at| NumberRun {
                        first: run.first + at,
                        count: 1,
                        ..run
                    })
                };
                runs.iter().flat_map(each).collect::<Vec<_>>()
            };
            let all = numbers(&file.runs(beam));
            assert_eq!(all, numbers(&file.read(beam).unwrap().runs));
            for kind in [SampleKind::Uniform, SampleKind::ViewpointLimited, SampleKind::SingleRay] {
                for range in [0..u32::MAX, 3..9, 5..6, 8..8] {
                    let within = |run: &NumberRun| run.kind == kind && range.contains(&run.first);
                    let wanted: Vec<_> = all.iter().copied().filter(within).collect();
                    assert_eq!(numbers(&file.runs_within(beam, kind, &range)), wanted);
                }
            }
        }
    }
    assert_eq!(stats.samples as usize, model.len());
    assert_eq!(stats.sections.iter().map(|s| s.nonempty_beams).sum::<u64>(), model.0.len() as u64);
    let mut listed = Vec::new();
    file.for_each_beam(&mut |key, samples| listed.push((key, samples as usize)));
    assert_eq!(listed, model.0.iter().map(|(&key, beam)| (key, beam.len())).collect::<Vec<_>>());
    for (&key, beam) in &model.0 {
        let next =
            |code: u8| beam.keys().filter(|n| n.0 == code).map(|n| n.1 + 1).max().unwrap_or(0);
        let counts = file.counts(key);
        assert_eq!([counts.uniform, counts.limited, counts.single], [next(0), next(1), next(2)]);
        assert_eq!(file.count(key), beam.len() as u64);
    }

    let mut keys: Vec<_> = (0..LAYOUT[1]).map(|beam| key(1, beam)).collect();
    keys.extend((0..LAYOUT[0]).rev().map(|beam| key(0, beam)));
    keys.push(key(0, 3));
    let mut got = Vec::new();
    file.read_many(&keys, Caching::Fill, &mut |key, samples| {
        assert_eq!(*samples, *file.read(key).unwrap());
        got.push(key);
        ControlFlow::Continue(())
    })
    .unwrap();
    keys.pop();
    got.sort_unstable();
    keys.sort_unstable();
    assert_eq!(got, keys, "every beam once");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 48,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]
    #[test]
    fn a_file_returns_the_same_samples_as_a_model_in_memory(
        steps in prop::collection::vec(step(), 1..80),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("test.holo");
        let mut file = BeamFile::create(&path, options()).unwrap();
        let mut model = Model::default();
        let mut blobs = std::collections::BTreeMap::new();
        let mut put = 0;
        for (tag, step) in (0..).zip(steps) {
            match step {
                Step::Put { section, beam, kind: code, first, count, paths, supersedes } => {
                    let start = run(key(section, beam), first);
                    let run = NumberRun { kind: kind(code), paths, ..start };
                    let new = samples(&run, count, tag);
                    if supersedes {
                        file.supersede(run, Maker::UNKNOWN, &new).unwrap();
                    } else {
                        file.append(run, Maker::UNKNOWN, &new).unwrap();
                    }
                    model.put(&run, &new, supersedes);
                    put += u64::from(count);
                }
                Step::Read { section, beam } => {
                    let count = model.0.get(&key(section, beam)).map_or(0, |beam| beam.len());
                    prop_assert_eq!(file.read(key(section, beam)).unwrap().samples.len(), count);
                }
                Step::Blob { name, bytes } => {
                    let bytes = vec![tag as u8; bytes];
                    file.put_blob(&format!("blob {name}"), &bytes).unwrap();
                    blobs.insert(format!("blob {name}"), bytes);
                }
                Step::Flush => file.flush().unwrap(),
                Step::Reopen => {
                    file.close().unwrap();
                    file = BeamFile::open(&path, options()).unwrap();
                    prop_assert!(file.report().damage.is_empty(), "{:?}", file.report());
                }
            }
        }
        assert_same(&file, &model);
        assert_figures(&file, &model, put);
        file.close().unwrap();

        let reader = BeamFile::open_read_only(&path, 1 << 20).unwrap();
        assert_same(&reader, &model);
        assert_figures(&reader, &model, put);
        prop_assert_eq!(contents(&reader).len() as u64, reader.stats().samples);
        prop_assert!(reader.verify().unwrap().is_empty());
        prop_assert_eq!(reader.blob_names(), blobs.keys().cloned().collect::<Vec<_>>());
        for (name, bytes) in blobs {
            prop_assert_eq!(reader.blob(&name).unwrap(), Some(bytes));
        }
    }
}
