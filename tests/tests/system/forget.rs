//! Who made the samples of a file, and a file without what one of them made.

use holo_tests::{Place, stored};
use serde_json::Value;

fn workers(place: &Place, file: &str) -> Vec<Value> {
    let info = place.run(&["info", file, "--json"]).ok().whole_json();
    info["workers"].as_array().unwrap().clone()
}

#[test]
fn a_file_lists_its_workers_and_forgets_what_one_has_made() {
    let place = Place::new();
    let first = place.fill_small("a.holo", "3k").json()["samples"].clone();
    let file = place.text("a.holo");
    let [worker] = &workers(&place, &file)[..] else { panic!("one machine has filled it") };
    assert!(worker["name"].as_str().unwrap().starts_with("rtworker on "), "{worker}");
    assert!(!worker["name"].as_str().unwrap().contains('#'), "a machine, and no process: {worker}");
    assert_eq!((&worker["id"], &worker["samples"]), (&1.into(), &first));
    assert!(worker["claims"].as_u64() > Some(0), "the box is open on one side: {worker}");

    // Another fill has the same machine as maker, and a merge keeps the makers.
    let all = place.fill_small("a.holo", "1k").json()["samples"].clone();
    place.run(&["merge", "{}/b.holo", "{}/a.holo"]).ok();
    for file in [&file, &place.text("b.holo")] {
        let [worker] = &workers(&place, file)[..] else { panic!("still one machine") };
        assert_eq!((&worker["id"], &worker["samples"]), (&1.into(), &all));
    }

    place.run(&["forget", &file, "--worker", "7"]).failed(1, &["a.holo", "knows no worker 7"]);
    let nobodys = place.run(&["forget", &file, "--worker", "0", "--json"]).ok().json();
    assert_eq!((&nobodys["samples"], &nobodys["left"]), (&0.into(), &all));
    let forgotten = place.run(&["forget", &file, "--worker", "1", "--json"]).ok().json();
    assert_eq!((&forgotten["samples"], &forgotten["left"]), (&all, &0.into()));
    assert!(workers(&place, &file).is_empty());
    assert_eq!(stored(&place.path("a.holo")).count(), 0);
    assert!(!place.path("a.holo.new").exists());

    // All of it is traced again, from the first numbers on.
    place.fill_small("a.holo", "4k");
    stored(&place.path("a.holo")).assert_no_gaps();
    assert_eq!(workers(&place, &file)[0]["id"], 2, "no number is given twice");
    place.run(&["verify", "{}/a.holo"]).ok();
}

#[test]
fn a_file_that_is_being_written_forgets_nothing() {
    let place = Place::new();
    let all = place.fill_small("a.holo", "1k").json()["samples"].clone();
    let _server = place.server("a.holo", &[]);
    place.run(&["forget", "{}/a.holo", "--worker", "1"]).failed(1, &["a.holo", "another process"]);
    assert_eq!(all, stored(&place.path("a.holo")).count());
}
