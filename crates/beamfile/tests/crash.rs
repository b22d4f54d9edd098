//! A writer that is killed.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::{key, options, run, sample, samples};
use holo_beamfile::{BeamFile, Error};
use holo_section::SampleKind;

const CHILD: &str = "HOLO_BEAMFILE_TEST_CHILD";
/// Set for a child that flushes; without it, only the passing of time brings samples to the disk.
const FLUSHES: &str = "HOLO_BEAMFILE_TEST_FLUSHES";
const PACKET: u32 = 21;

/// The child: appends packets to one beam after another, notes after each millisecond how many were
/// appended (and flushed) by then, and never ends by itself.
#[test]
fn child_that_is_killed() {
    let Some(folder) = std::env::var_os(CHILD) else { return };
    let folder = PathBuf::from(folder);
    let file = BeamFile::open(folder.join("test.holo"), options()).unwrap();
    let mut log = fs::File::create(folder.join("log")).unwrap();
    let flushes = std::env::var_os(FLUSHES).is_some();
    let start = Instant::now();
    // A block may end between two beams: go on where the last one is, and give the others some packets twice.
    let begin = file.counts(key(0, 9)).uniform;
    let (mut next, mut flushed) = (begin, begin);
    for round in 0u32.. {
        // So slowly that only time, not size, makes the writer write.
        for _ in 0..4 {
            for beam in 0..10 {
                let run = run(key(0, beam), next);
                file.append(run, &samples(&run, PACKET, 0)).unwrap();
            }
            next += PACKET;
        }
        if flushes && round % 100 == 99 {
            file.flush().unwrap();
            flushed = next;
        }
        // One write call: the line is whole or absent.
        let line = format!("{} {next} {flushed}\n", start.elapsed().as_micros());
        log.write_all(line.as_bytes()).unwrap();
        sleep(Duration::from_millis(1));
    }
}

/// The child's notes: microseconds since its start, samples appended, samples flushed.
fn noted(log: &Path) -> Vec<Vec<u64>> {
    let text = fs::read_to_string(log).unwrap_or_default();
    text.lines().map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect()).collect()
}

#[test]
fn a_killed_writer_loses_nothing_flushed_and_at_most_one_second_besides() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    BeamFile::create(&path, options()).unwrap().close().unwrap();
    let mut kept_before = 0;
    for (life, flushes) in [(1100, false), (613, true), (1630, false)] {
        let _ = fs::remove_file(folder.path().join("log"));
        let mut command = Command::new(std::env::current_exe().unwrap());
        if flushes {
            command.env(FLUSHES, "");
        }
        let mut child = command
            .args(["--exact", "child_that_is_killed", "--nocapture"])
            .env(CHILD, folder.path())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        // By the child's own clock, so that a busy machine only makes the test longer.
        let log = folder.path().join("log");
        let far_enough =
            |line: &Vec<u64>| line[0] >= 1000 * life && (!flushes || line[2] > kept_before);
        let patience = Instant::now() + Duration::from_secs(60);
        while !noted(&log).last().is_some_and(far_enough) {
            assert!(Instant::now() < patience, "the child does not get on");
            sleep(Duration::from_millis(5));
        }
        if life == 1100 {
            let second = BeamFile::open(&path, options());
            let message = second.err().expect("one writer at a time").to_string();
            assert!(
                message.contains("test.holo") && message.contains("another process"),
                "{message}"
            );
        }
        child.kill().unwrap();
        child.wait().unwrap();

        let lines = noted(&log);
        let last = lines.last().expect("the child ran");
        let old =
            lines.iter().rfind(|line| line[0] + 1_000_000 < last[0]).map_or(0, |line| line[1]);

        assert!(
            if flushes { last[2] > kept_before } else { old > kept_before },
            "the child got that far"
        );
        let file = BeamFile::open(&path, options()).unwrap();
        let kept = u64::from(file.counts(key(0, 9)).uniform);
        assert!(kept >= last[2], "{kept} kept, {} flushed", last[2]);
        assert!(kept >= old, "{kept} kept, {old} appended more than a second before the end");
        assert!(kept >= kept_before);
        kept_before = kept;
        for beam in 0..10 {
            let read = file.read(key(0, beam)).unwrap();
            let counted: u32 = read.runs.iter().map(|extent| extent.count).sum();
            assert_eq!(counted, file.counts(key(0, beam)).uniform, "no gaps");
            assert!(u64::from(counted) >= kept);
            for (number, found) in (0..).zip(&read.samples) {
                assert_eq!(*found, sample(key(0, beam), SampleKind::Uniform, number, 0));
            }
        }
        assert!(file.verify().unwrap().is_empty());
        file.close().unwrap();
    }
    assert!(kept_before > 0);
}

#[test]
fn a_second_writer_in_the_same_process_is_refused_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let first = BeamFile::create(&path, options()).unwrap();
    assert!(matches!(BeamFile::open(&path, options()), Err(Error::Locked { .. })));
    assert!(
        matches!(BeamFile::create(&path, options()), Err(Error::Io { .. })),
        "never overwritten"
    );
    drop(first);
    BeamFile::open(&path, options()).unwrap();
}
