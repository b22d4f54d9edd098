//! A session, and the same again from the file.

use holo_tests::{CORNELL_SMALL_SECTION, Place, stored};

const VIEW: [&str; 8] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60", "--size", "96x72"];

#[test]
fn a_replay_without_tracing_gives_the_sessions_last_picture_bit_by_bit() {
    let place = Place::new();
    let scene = ["--config", "{}/cornell.toml", "--section", CORNELL_SMALL_SECTION, "--threads", "1"];
    let live = ["view", "--headless", "--keep", "{}/s.holo", "--time", "1.2", "-o", "{}/live.pfm", "--json"];
    let report = place.run(&[&live[..], &scene, &VIEW].concat()).ok().json();
    assert!(report["traced"].as_u64().unwrap() > 1000, "{report}");
    assert_eq!(report["stored"], 0);
    let replay = ["replay", "{}/s.holo", "--headless", "-o", "{}/replay.pfm", "--json"];
    let again = place.run(&[&replay[..], &VIEW].concat()).ok().json();
    assert_eq!(again["traced"], 0);
    assert_eq!((&again["stored"], &again["samples"]), (&report["traced"], &report["samples"]));
    place.run(&[&["picture", "{}/s.holo", "-o", "{}/picture.pfm"], &VIEW[..]].concat()).ok();
    let read = |name: &str| std::fs::read(place.path(name)).unwrap();
    assert!(read("live.pfm") == read("replay.pfm"), "the replay differs");
    assert!(read("live.pfm") == read("picture.pfm"), "the picture differs");
    stored(&place.path("s.holo")).assert_no_gaps();

    // Going on with the file: all of it is there from the start, and more comes.
    let more = ["view", "{}/s.holo", "--headless", "--time", "2", "-o", "{}/more.pfm", "--json", "--threads", "1"];
    let more = place.run(&[&more[..], &VIEW].concat()).ok().json();
    assert_eq!(more["stored"], report["traced"]);
    assert!(more["traced"].as_u64().unwrap() > 100, "{more}");
    stored(&place.path("s.holo")).assert_no_gaps();
}
