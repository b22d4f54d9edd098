//! A writer that is killed.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::{key, meta, options, sample, samples};
use holo_beamfile::{BeamFile, Error};
use holo_section::SampleKind;

const CHILD: &str = "HOLO_BEAMFILE_TEST_CHILD";
/// Set for a child that flushes; without it, only the passing of time brings samples to the disk.
const FLUSHES: &str = "HOLO_BEAMFILE_TEST_FLUSHES";
const PACKET: u32 = 21;

/// The child. It appends packets to one beam after another and never ends by itself.
///
/// Each round it writes to the log how many samples of each beam are appended, and how many of them
/// are flushed.
#[test]
fn child_that_is_killed() {
    let Some(folder) = std::env::var_os(CHILD) else { return };
    let folder = PathBuf::from(folder);
    let file = BeamFile::open(folder.join("test.holo"), options()).unwrap();
    let mut log = fs::File::create(folder.join("log")).unwrap();
    let flushes = std::env::var_os(FLUSHES).is_some();
    // A block may end between two beams: go on where the last one is, and give the others some packets twice.
    let begin = file.counts(key(0, 9)).uniform;
    let (mut next, mut flushed) = (begin, begin);
    for round in 0u32.. {
        // So slowly that only time, not size, makes the writer write.
        for _ in 0..4 {
            for beam in 0..10 {
                let meta = meta(key(0, beam), next);
                file.append(meta, &samples(&meta, PACKET, 0)).unwrap();
            }
            next += PACKET;
        }
        if flushes && round % 100 == 99 {
            file.flush().unwrap();
            flushed = next;
        }
        // One write call: the line is whole or absent.
        log.write_all(format!("{next} {flushed}\n").as_bytes()).unwrap();
        sleep(Duration::from_millis(1));
    }
}

/// The last line of the child's log: how many samples it has appended, and how many of them flushed.
fn noted(log: &Path) -> [u64; 2] {
    let text = fs::read_to_string(log).unwrap_or_default();
    let last = text.lines().last().unwrap_or("0 0");
    let (appended, flushed) = last.split_once(' ').unwrap();
    [appended, flushed].map(|number| number.parse().unwrap())
}

#[test]
fn a_killed_writer_loses_nothing_that_was_flushed_or_that_a_reader_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let log = folder.path().join("log");
    BeamFile::create(&path, options()).unwrap().close().unwrap();
    let mut kept_before = 0;
    for (life, flushes) in [false, true, false].into_iter().enumerate() {
        let _ = fs::remove_file(&log);
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
        // Without flushes, time alone brings samples to the disk. The child must also have appended more
        // than a reader finds, so that it dies with samples in memory.
        let reader = BeamFile::open_read_only(&path, 0).unwrap();
        // Only a hang reaches this limit.
        let limit = Instant::now() + Duration::from_secs(120);
        let mut found = 0;
        loop {
            let [appended, flushed] = noted(&log);
            if appended > found && if flushes { flushed } else { found } > kept_before {
                break;
            }
            assert!(Instant::now() < limit, "the child does not get on");
            sleep(Duration::from_millis(5));
            reader.refresh().unwrap();
            found = u64::from(reader.counts(key(0, 9)).uniform);
        }
        if life == 0 {
            let second = BeamFile::open(&path, options());
            let message = second.err().expect("one writer at a time").to_string();
            assert!(
                message.contains("test.holo") && message.contains("another process"),
                "{message}"
            );
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let [_, flushed] = noted(&log);
        let file = BeamFile::open(&path, options()).unwrap();
        let kept = u64::from(file.counts(key(0, 9)).uniform);
        assert!(kept >= flushed, "{kept} kept, {flushed} flushed");
        assert!(kept >= found, "{kept} kept, {found} found by a reader");
        assert!(kept > kept_before);
        kept_before = kept;
        for beam in 0..10 {
            let read = file.read(key(0, beam)).unwrap();
            let counted: u32 = read.extents.iter().map(|extent| extent.count).sum();
            assert_eq!(counted, file.counts(key(0, beam)).uniform, "no gaps");
            assert!(u64::from(counted) >= kept);
            for (number, found) in (0..).zip(&read.samples) {
                assert_eq!(*found, sample(key(0, beam), SampleKind::Uniform, number, 0));
            }
        }
        assert!(file.verify().unwrap().is_empty());
        file.close().unwrap();
    }
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
