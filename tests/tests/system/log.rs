//! The server's log, as programs read it.

use holo_tests::Place;
use rustix::process::Signal;
use serde_json::Value;

#[test]
fn a_log_says_who_came_and_why_they_left_in_json() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let server = place.server("a.holo", &["--log-file", &place.text("log")]);
    let worker = place.worker(server.address, &[]);
    server.process.wait_for_error("joined");
    worker.end(Signal::KILL);
    server.process.wait_for_error("left");
    server.process.end(Signal::TERM).ok();
    let log = std::fs::read_to_string(place.path("log")).unwrap();
    let lines: Vec<Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let messages: Vec<&str> = lines.iter().map(|line| line["message"].as_str().unwrap()).collect();
    assert_eq!(messages, ["serving", "joined", "left", "ended"]);
    assert!(lines.iter().all(|line| line["timestamp"].is_string() && line["level"] == "INFO"));
    let [_, joined, left, ended] = &lines[..] else { panic!("{log}") };
    assert_eq!((&joined["role"], &joined["rights"]), (&"worker".into(), &"admin".into()));
    assert_eq!(left["peer"], joined["peer"]);
    assert_eq!(left["reason"], "it closed its connection");
    assert!(ended["samples"].as_u64() >= Some(1000), "{ended}");
}
