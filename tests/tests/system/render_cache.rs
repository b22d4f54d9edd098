//! The drivers that keep what they have from view to view: a stored holodeck warms them, and at rest they tend to `render`.

use holo_picture::{Picture, compare};
use holo_tests::{CORNELL_SMALL_SECTION, Place};

const VIEW: [&str; 8] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60", "--size", "64x64"];
const LINE: &str = "-vp 2.78 2.73 -2 -vd 0 0 1 -vh 60";
const STAGES: [&str; 4] = ["Project and Tile Sort", "Z-Buffer Tiles", "Depth Cull", "Interpolate / Smooth"];

/// The same view by the tracer, direct light only.
fn truth(place: &Place) -> Picture {
    let render = ["render", "--config", "{}/cornell.toml", "--bounces", "0", "--spp", "400", "-o", "{}/truth.pfm"];
    place.run(&[&render[..], &VIEW].concat()).ok();
    Picture::read(place.path("truth.pfm")).unwrap()
}

fn psnr(place: &Place, name: &str, truth: &Picture) -> f64 {
    compare(&Picture::read(place.path(name)).unwrap(), truth).unwrap().psnr_disp
}

#[test]
fn at_rest_both_tend_to_what_the_tracer_renders() {
    let place = Place::new();
    let truth = truth(&place);
    for driver in ["pointimage", "frameless"] {
        // Another view first: what it leaves behind must not stay.
        let script = format!(
            "0 view -vp 2.5 2.5 -2.5 -vd 0.1 0 1 -vh 60\n0.5 view {LINE}\n0.05 picture {{0}}\n6 picture {{1}}\n7 quit\n"
        );
        let names = ["first", "last"].map(|when| format!("{driver}-{when}.pfm"));
        let script = script.replace("{0}", &place.text(&names[0])).replace("{1}", &place.text(&names[1]));
        let script = place.write("walk.txt", &script);
        let scene = ["view", "--config", "{}/cornell.toml", "--section", CORNELL_SMALL_SECTION, "--bounces", "0"];
        let words = ["--headless", "--script", &script, "--size", "64x64", "--driver", driver, "--json"];
        let reports = place.run(&[&scene[..], &words].concat()).ok();
        let last: serde_json::Value =
            reports.stdout.lines().last().map(|line| serde_json::from_str(line).unwrap()).unwrap();
        assert_eq!(last["driver"], driver);
        assert!(last["traced"].as_u64().unwrap() > 10_000, "{last}");
        let stages: Vec<&str> = last["stages"]
            .as_array()
            .map_or(Vec::new(), |all| all.iter().map(|one| one["stage"].as_str().unwrap()).collect());
        assert_eq!(STAGES.iter().all(|stage| stages.contains(stage)), driver == "pointimage", "{stages:?}");
        let [first, last] = [0, 1].map(|at| psnr(&place, &names[at], &truth));
        println!("{driver}: {first:.1} dB at once, {last:.1} dB at rest");
        assert!(last > first, "{driver}: {first} dB, then {last}");
        // A wrong pixel in twenty, or a blur of a pixel, would leave less.
        assert!(last > 26.0, "{driver}: {last} dB");
    }
}

#[test]
fn a_stored_holodeck_warms_an_empty_cache_and_its_parts_can_be_left_out() {
    let place = Place::new();
    let truth = truth(&place);
    place.fill_small_with("a.holo", "400k", &["--bounces", "0"]);
    let show = |name: &str, words: &[&str]| {
        let output = place.text(name);
        let picture = ["picture", "{}/a.holo", "--json", "-o", &output];
        let report = place.run(&[&picture[..], &VIEW, words].concat()).ok().json();
        assert_eq!(report["traced"], 0);
        assert!(report["stored"].as_u64().unwrap() > 0 && report["samples"].as_u64().unwrap() > 0, "{report}");
        psnr(&place, name, &truth)
    };
    let all = show("all.pfm", &["--driver", "pointimage"]);
    let gaps = ["--driver", "pointimage", "--without", "prefilter,interpolation", "--empty-pixels", "black"];
    let bare = show("bare.pfm", &gaps);
    let guesses = show("guesses.pfm", &["--driver", "frameless"]);
    println!("all stages {all:.1} dB, points alone {bare:.1} dB, frameless {guesses:.1} dB");
    assert!(all > bare, "filling gaps does not help: {all} dB, {bare} dB without");
    let black = |name: &str| {
        let picture = Picture::read(place.path(name)).unwrap();
        picture.pixels.iter().filter(|pixel| **pixel == [0.0; 3]).count()
    };
    assert!(black("bare.pfm") > black("all.pfm"));
    place.run(&["picture", "{}/a.holo", "-o", "{}/b.pfm", "--without", "colour"]).failed(2, &["--without", "dither"]);
}
