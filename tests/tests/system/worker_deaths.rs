//! Workers that die under a fill or a session: another takes their place.

use holo_tests::{CORNELL_SMALL_SECTION, Place, Process, stored, wait_until};
use rustix::process::{Pid, Signal, kill_process};

use crate::interrupted::{children, count};

/// Returns the worker processes of this process.
fn workers(process: &Process) -> Vec<u32> {
    let is_worker = |id: &u32| {
        std::fs::read(format!("/proc/{id}/cmdline"))
            .is_ok_and(|line| line.split(|byte| *byte == 0).any(|word| word == b"rtworker"))
    };
    children(process.id()).into_iter().map(|(id, _)| id).filter(is_worker).collect()
}

/// Kills the process' worker, once it has one that is not in `dead`. Returns it.
#[track_caller]
fn kill_worker(process: &Process, dead: &[u32]) -> u32 {
    let worker = wait_until("a worker", || {
        workers(process).into_iter().find(|worker| !dead.contains(worker))
    });
    let id = Pid::from_raw(i32::try_from(worker).unwrap()).unwrap();
    kill_process(id, Signal::KILL).unwrap();
    worker
}

fn start(place: &Place, command: &[&str]) -> Process {
    let scene =
        ["--config", "{}/cornell.toml", "--section", CORNELL_SMALL_SECTION, "--threads", "1"];
    place.start(&[command, &scene].concat())
}

#[track_caller]
fn goes_on_after_its_worker_is_killed(place: &Place, process: &Process) {
    let file = place.path("a.holo");
    let more_than = |samples| move |count: u64| (count > samples).then_some(count);
    wait_until("samples", || more_than(5_000)(count(&file)));
    let first = kill_worker(process, &[]);
    process.wait_for_error("the worker died (signal: 9 (SIGKILL))");
    let second = wait_until("another worker", || {
        workers(process).into_iter().find(|worker| *worker != first)
    });
    assert_ne!(first, second);
    let then = count(&file);
    wait_until("more samples", || more_than(then + 5_000)(count(&file)));
}

#[test]
fn a_fill_whose_worker_is_killed_goes_on_with_another() {
    let place = Place::new();
    let process = start(&place, &["fill", "-o", "{}/a.holo", "--time", "10m", "--json"]);
    goes_on_after_its_worker_is_killed(&place, &process);
    let summary = process.end(Signal::INT).ok().json();
    let stored = stored(&place.path("a.holo"));
    assert_eq!(summary["samples"], stored.count());
    stored.assert_no_gaps();
}

#[test]
fn a_session_whose_worker_is_killed_goes_on_with_another() {
    let place = Place::new();
    let view = ["view", "--headless", "--keep", "{}/a.holo", "--time", "600", "--size", "64x64"];
    let process = start(&place, &view);
    goes_on_after_its_worker_is_killed(&place, &process);
    process.end(Signal::INT).ok();
}

#[test]
fn a_worker_that_dies_again_and_again_ends_the_fill_with_the_reason() {
    let place = Place::new();
    let process = start(&place, &["fill", "-o", "{}/a.holo", "--time", "10m"]);
    let mut dead = Vec::new();
    for _ in 0..5 {
        dead.push(kill_worker(&process, &dead));
    }
    process.wait().failed(1, &["died 5 times in a row", "signal: 9", "said nothing"]);
}

#[test]
fn the_last_words_of_a_worker_that_cannot_trace_are_said_at_the_end() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let bytes = std::fs::read(place.path("a.holo")).unwrap();
    // Every copy of the packed scene is damaged: workers without it in their cache cannot get it.
    let copies = packed_scenes(&bytes);
    assert_eq!(copies.len(), 2);
    let mut damaged = bytes;
    copies.iter().for_each(|copy| damaged[copy + 100] ^= 1);
    std::fs::write(place.path("a.holo"), damaged).unwrap();
    std::fs::remove_dir_all(place.path("cache")).unwrap();
    let view = ["view", "{}/a.holo", "--headless", "-o", "{}/a.pfm", "--size", "16x16"];
    place.run(&view).failed(1, &["died 5 times in a row", "cannot read the scene", "a.holo"]);
}

/// Returns where packed scenes begin in a file.
fn packed_scenes(bytes: &[u8]) -> Vec<usize> {
    let begins = |(at, window): (usize, &[u8])| (window == b"holoscn\n").then_some(at);
    bytes.windows(8).enumerate().filter_map(begins).collect()
}
