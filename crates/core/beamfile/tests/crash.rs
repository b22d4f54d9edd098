//! A writer that is killed. It is alone in its process: a child that has not yet begun its program
//! shares the locks of all files that are open.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "it/common/mod.rs"]
mod common;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::{key, options, run, sample, samples};
use holo_beamfile::{BeamFile, Error, Maker};
use holo_section::SampleKind;

const CHILD: &str = "HOLO_BEAMFILE_TEST_CHILD";
/// Set for a child that flushes. Without it, samples reach the disk by time alone.
const FLUSHES: &str = "HOLO_BEAMFILE_TEST_FLUSHES";
const PACKET: u32 = 21;
/// The beam that the child appends to last.
const LAST_BEAM: u64 = 9;

/// The child: it appends packets to one beam after another, and never ends by itself.
///
/// After each millisecond it records the number of flushed samples of the last beam.
#[test]
fn child_that_is_killed() {
    let Some(folder) = std::env::var_os(CHILD) else { return };
    let folder = PathBuf::from(folder);
    let file = BeamFile::open(folder.join("test.holo"), options()).unwrap();
    let mut log = fs::File::create(folder.join("log")).unwrap();
    let flushes = std::env::var_os(FLUSHES).is_some();
    // A block may end between two beams. The child continues at the last beam's position, and
    // appends some packets of the others twice.
    let begin = file.counts(key(0, LAST_BEAM)).uniform;
    let (mut next, mut flushed) = (begin, begin);
    for round in 0u32.. {
        // Appends slowly, so that time and not size makes the writer write.
        for _ in 0..4 {
            for beam in 0..=LAST_BEAM {
                let run = run(key(0, beam), next);
                file.append(run, Maker::UNKNOWN, &samples(&run, PACKET, 0)).unwrap();
            }
            next += PACKET;
        }
        if flushes && round % 100 == 99 {
            file.flush().unwrap();
            flushed = next;
        }
        // One write call: the line is whole or absent.
        log.write_all(format!("{flushed}\n").as_bytes()).unwrap();
        sleep(Duration::from_millis(1));
    }
}

/// Returns the number of samples of the last beam that the child has recorded as flushed.
fn flushed(log: &Path) -> u32 {
    let text = fs::read_to_string(log).unwrap_or_default();
    text.lines().last().map_or(0, |line| line.parse().unwrap())
}

/// Returns the number of samples of the last beam that are on disk.
fn on_disk(path: &Path) -> u32 {
    BeamFile::open_read_only(path, 0).unwrap().counts(key(0, LAST_BEAM)).uniform
}

#[test]
fn a_killed_writer_loses_nothing_that_was_flushed_or_that_a_reader_has_seen() {
    let folder = tempfile::tempdir().unwrap();
    let (path, log) = (folder.path().join("test.holo"), folder.path().join("log"));
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
        let patience = Instant::now() + Duration::from_secs(60);
        while if flushes { flushed(&log) } else { on_disk(&path) } <= kept_before {
            assert!(Instant::now() < patience, "the child does not get on");
            sleep(Duration::from_millis(5));
        }
        if life == 0 {
            let second = BeamFile::open(&path, options());
            let message = second.err().expect("one writer at a time").to_string();
            assert!(
                message.contains("test.holo") && message.contains("another process"),
                "{message}"
            );
        }
        let seen = on_disk(&path);
        child.kill().unwrap();
        child.wait().unwrap();

        let file = BeamFile::open(&path, options()).unwrap();
        let kept = file.counts(key(0, LAST_BEAM)).uniform;
        assert!(kept > kept_before && kept >= seen, "{kept} kept, {seen} seen");
        assert!(kept >= flushed(&log), "{kept} kept, {} flushed", flushed(&log));
        kept_before = kept;
        for beam in 0..=LAST_BEAM {
            let read = file.read(key(0, beam)).unwrap();
            let counted: u32 = read.runs.iter().map(|run| run.count).sum();
            assert_eq!(counted, file.counts(key(0, beam)).uniform, "no gaps");
            assert!(counted >= kept);
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
