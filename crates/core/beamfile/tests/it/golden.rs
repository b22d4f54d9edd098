//! Files as earlier and present versions have written them: `plain.holo` by a version without index
//! and layers, `indexed.holo` with both, and with a block of an unknown kind.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use crate::common::{key, options, run, samples};
use crate::layers::{announced, append_block, append_shares, read_shares, shares};
use holo_beamfile::{BeamFile, Maker, Skipped};
use holo_section::{NumberRun, Sample, SampleKind};

/// The kind that no version knows.
const UNKNOWN: u32 = 0xfeed;

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)
}

fn uniform() -> NumberRun {
    run(key(0, 3), 0)
}

fn limited() -> NumberRun {
    NumberRun { kind: SampleKind::ViewpointLimited, ..run(key(0, 4), 5) }
}

fn single() -> NumberRun {
    NumberRun { kind: SampleKind::SingleRay, ..run(key(1, 2), 0) }
}

fn scene() -> Vec<u8> {
    (0..5000u32).map(|i| (i % 251) as u8).collect()
}

/// Makes the golden file of the present version.
#[test]
fn the_golden_file_of_this_version_can_be_written_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = match std::env::var_os("WRITE_GOLDEN") {
        Some(_) => golden("indexed.holo"),
        None => folder.path().join("indexed.holo"),
    };
    let _ = fs::remove_file(&path);
    let file = BeamFile::create(&path, options()).unwrap();
    for (run, count, maker) in [(uniform(), 30, 1), (limited(), 20, 1), (single(), 10, 2)] {
        file.append(run, Maker(maker), &samples(&run, count, 0)).unwrap();
    }
    file.flush().unwrap();
    let better = NumberRun { paths: 8, ..uniform() };
    file.supersede(better, Maker(2), &samples(&better, 10, 1)).unwrap();
    file.put_blob("holodeck", b"{\"golden\": true}").unwrap();
    file.flush().unwrap();
    file.close().unwrap();
    append_shares(&path, &[(announced(&uniform(), 30, 1), shares(1..=3, 0, 30))]);
    append_block(&path, UNKNOWN, 1, b"what".to_vec(), vec![9; 100]);
    let file = BeamFile::open(&path, options()).unwrap();
    file.begin_generation(1).unwrap();
    file.append(uniform(), Maker(2), &samples(&uniform(), 7, 2)).unwrap();
    file.flush().unwrap();
    file.put_blob_once("scene", &scene()).unwrap();
    file.close().unwrap();
    check(&BeamFile::open(&path, options()).unwrap(), &[]);
}

/// Checks the content that all golden files have. `more` are samples that were added since.
fn check(file: &BeamFile, more: &[Sample]) {
    assert!(file.report().damage.is_empty(), "{:?}", file.report());
    assert!(file.verify().unwrap().is_empty());
    assert_eq!(file.generation(), 1);
    let read = file.read(uniform().key).unwrap();
    assert_eq!(read.samples, [samples(&uniform(), 7, 2).as_slice(), more].concat());
    assert!(file.makers(uniform().key).iter().all(|(_, maker)| *maker == Maker(2)));
    let mut earlier = Vec::new();
    let keys = [uniform().key, limited().key, single().key];
    file.read_earlier(&keys, &mut |key, read| {
        earlier.push((key, read));
        ControlFlow::Continue(())
    })
    .unwrap();
    earlier.sort_by_key(|(key, _)| *key);
    let [(_, first), (_, second), (_, third)] = earlier.as_slice() else { panic!("three beams") };
    let expected =
        [samples(&uniform(), 10, 1), samples(&NumberRun { first: 10, ..uniform() }, 20, 0)]
            .concat();
    assert_eq!(first.samples, expected);
    assert_eq!(first.runs.iter().map(|run| run.paths).collect::<Vec<_>>(), [8, 1]);
    assert_eq!(second.samples, samples(&limited(), 20, 0));
    assert_eq!(third.samples, samples(&single(), 10, 0));
    assert_eq!(file.blob("holodeck").unwrap().as_deref(), Some(&b"{\"golden\": true}"[..]));
    assert_eq!(file.blob("scene").unwrap(), Some(scene()));
}

#[test]
fn files_of_all_versions_open_and_go_on() {
    for (name, indexed) in [("plain.holo", false), ("indexed.holo", true)] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::copy(golden(name), &path).unwrap();
        let before = fs::read(&path).unwrap();
        let file = BeamFile::open_read_only(&path, 0).unwrap();
        check(&file, &[]);
        let report = file.report();
        assert_eq!(report.indexed, if indexed { report.blocks - 1 } else { 0 }, "{report:?}");
        if indexed {
            assert_eq!(file.layers(), [(1, 20), (2, 20), (3, 20)]);
            assert_eq!(file.skipped(), [Skipped { kind: UNKNOWN, blocks: 1, bytes: 192 }]);
            let shares = read_shares(&before, &uniform(), Maker(1), 0);
            assert_eq!(shares.len(), 30);
        }
        // To open and close it changes nothing.
        BeamFile::open(&path, options()).unwrap().close().unwrap();
        assert!(fs::read(&path).unwrap() == before);

        let file = BeamFile::open(&path, options()).unwrap();
        let more = NumberRun { first: 7, ..uniform() };
        file.append(more, Maker(2), &samples(&more, 11, 2)).unwrap();
        file.close().unwrap();
        let file = BeamFile::open_read_only(&path, 0).unwrap();
        check(&file, &samples(&more, 11, 2));
        assert!(file.report().indexed + 1 == file.report().blocks);
        // What was there stays, but for the place of the index.
        let now = fs::read(&path).unwrap();
        assert!(now[32_768..before.len()] == before[32_768..]);
        assert!(now[..16_352] == before[..16_352]);
    }
}
