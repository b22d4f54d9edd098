//! Ctrl-C and kills: everything is stored, and no process is left behind.

use std::{fs, path::Path};

use holo_tests::{CORNELL_SMALL_SECTION, Place, Process, stored, wait_until};
use rustix::process::Signal;

/// The processes that `id` has started, with the time of their start (an id may be used again).
pub fn children(id: u32) -> Vec<(u32, String)> {
    let Ok(tasks) = fs::read_dir(format!("/proc/{id}/task")) else { return Vec::new() };
    let lists =
        tasks.filter_map(|task| fs::read_to_string(task.ok()?.path().join("children")).ok());
    let ids: Vec<u32> = lists
        .flat_map(|list| list.split_whitespace().map(|id| id.parse().unwrap()).collect::<Vec<_>>())
        .collect();
    ids.into_iter().filter_map(|id| Some((id, started(id)?))).collect()
}

/// When a process was started, unless it has ended: field 22 of its line, counted after the name,
/// which may hold spaces.
fn started(id: u32) -> Option<String> {
    let line = fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    let fields: Vec<&str> = line[line.rfind(')')? + 2..].split(' ').collect();
    (fields[0] != "Z").then(|| fields[19].to_owned())
}

fn all_ended(children: &[(u32, String)]) -> bool {
    children.iter().all(|(id, start)| started(*id).as_ref() != Some(start))
}

/// A long fill that has begun to store samples, and its children.
pub fn filling(place: &Place) -> (Process, Vec<(u32, String)>) {
    let words = [
        "fill",
        "--config",
        "{}/cornell.toml",
        "--section",
        CORNELL_SMALL_SECTION,
        "--threads",
        "1",
    ];
    let process =
        place.start(&[&words[..], &["-o", "{}/a.holo", "--time", "10m", "--json"]].concat());
    wait_until("the fill to store something", || {
        (count(&place.path("a.holo")) > 20_000).then_some(())
    });
    let children = children(process.id());
    assert_eq!(children.len(), 2, "a server and a worker");
    (process, children)
}

pub fn count(file: &Path) -> u64 {
    let opened = holo_beamfile::BeamFile::open_read_only(file, 0);
    opened.map_or(0, |file| file.stats().samples)
}

#[test]
fn an_interrupted_fill_keeps_everything_and_leaves_nobody_behind() {
    for signal in [Signal::INT, Signal::TERM] {
        let place = Place::new();
        let (process, children) = filling(&place);
        let summary = process.end(signal).ok().json();
        assert!(all_ended(&children), "{children:?}");
        let stored = stored(&place.path("a.holo"));
        assert_eq!(summary["samples"], stored.count());
        stored.assert_no_gaps();
        place.run(&["verify", "{}/a.holo"]).ok();
    }
}

#[test]
fn the_children_of_a_killed_fill_end_by_themselves() {
    let place = Place::new();
    let (process, children) = filling(&place);
    assert_eq!(process.end(Signal::KILL).signal(), Some(9));
    wait_until("the children to end", || all_ended(&children).then_some(()));
    stored(&place.path("a.holo")).assert_no_gaps();
    place.run(&["verify", "{}/a.holo"]).ok();
    place.fill_small("a.holo", "10k");
}

#[test]
fn an_ended_server_stores_everything_and_says_goodbye() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    for signal in [Signal::INT, Signal::TERM] {
        let before = count(&place.path("a.holo"));
        let server = place.server("a.holo", &["--fill", "--json"]);
        let worker = place.worker(server.address, &[]);
        let display = place.viewer(server.address, &["--time", "60", "--size", "64x64"]);
        wait_until("samples", || (count(&place.path("a.holo")) > before + 5_000).then_some(()));
        let summary = server.process.end(signal).ok().json();
        let stored = stored(&place.path("a.holo"));
        assert_eq!(summary["samples"], stored.count());
        assert_eq!(summary["added"], stored.count() - before);
        worker.wait().ok();
        display.wait().failed(1, &["the server ended the session"]);
    }
}

#[test]
fn an_interrupted_session_ends_in_order() {
    let place = Place::new();
    let words = [
        "view",
        "--config",
        "{}/cornell.toml",
        "--section",
        CORNELL_SMALL_SECTION,
        "--threads",
        "1",
    ];
    let session = ["--headless", "--keep", "{}/a.holo", "--time", "600", "--size", "64x64"];
    let process = place.start(&[&words[..], &session].concat());
    wait_until("samples", || (count(&place.path("a.holo")) > 5_000).then_some(()));
    let children = children(process.id());
    assert_eq!(children.len(), 2, "a server and a worker");
    process.end(Signal::INT).ok();
    assert!(all_ended(&children), "{children:?}");
    stored(&place.path("a.holo")).assert_no_gaps();
}
