//! Beams that look past everything: recognised, not traced, remembered, and shown as the sky.

use holo_picture::Picture;
use holo_section::{Sample, distance::NOTHING_HIT};
use holo_tests::{CORNELL_SMALL_SECTION, Place, stored};

/// The view looks across the far end of the section before the box: past the box, and nothing is
/// behind the eye either.
const PAST: [&str; 10] =
    ["--vp", "2.7,2.7,-3.4", "--vd", "1,0,0", "--vu", "0,1,0", "--vh", "20", "--size", "64x48"];

fn unseen(place: &Place, file: &str) -> (u64, u64, u64) {
    let info = place.run(&["info", file, "--json"]).ok().whole_json();
    let section = &info["sections"][0];
    let count = |name: &str| section[name].as_u64().unwrap();
    (count("unseen"), count("nonempty"), count("beams"))
}

#[test]
fn beams_that_look_out_of_the_box_are_not_traced_and_all_others_are() {
    let place = Place::new();
    place.fill_small("a.holo", "100k").ok();
    place.fill_small_with("all.holo", "100k", &["--no-skip-unseen"]).ok();
    let (skipped, nonempty, beams) = unseen(&place, "{}/a.holo");
    assert!(skipped > beams / 3, "{skipped} of {beams}");
    assert_eq!(skipped + nonempty, beams, "every beam is one or the other");
    let (none, more, _) = unseen(&place, "{}/all.holo");
    assert!(none == 0 && more > nonempty, "{none} {more}");
    // In every beam that the other file does not trace, all traced rays hit nothing.
    let (some, all) = (stored(&place.path("a.holo")), stored(&place.path("all.holo")));
    let meets = |samples: &[(u32, Sample)]| {
        samples.iter().any(|(_, sample)| sample.distance_code() != NOTHING_HIT)
    };
    for (name, samples) in &all.beams {
        assert!(
            some.beams.contains_key(name) || !meets(samples),
            "{name:?} sees something and was left out"
        );
    }
    some.assert_no_gaps();
    // The list is read from the file when it is opened, and grows from there.
    place.run(&["verify", "{}/a.holo"]).ok();
    place.fill_small("a.holo", "20k").ok();
    assert_eq!(unseen(&place, "{}/a.holo"), (skipped, nonempty, beams));
}

#[test]
fn a_view_past_everything_is_the_sky_without_a_single_sample() {
    let place = Place::new();
    let words = ["--section", CORNELL_SMALL_SECTION, "--sky", "0.25,0.5,1"];
    let fill = ["fill", "--config", "{}/cornell.toml", "-o", "{}/a.holo", "--samples", "60k"];
    place.run(&[&fill[..], &words].concat()).ok();
    let picture = ["picture", "{}/a.holo", "-o", "{}/a.pfm", "--json"];
    let is_sky = || {
        Picture::read(place.path("a.pfm"))
            .unwrap()
            .pixels
            .iter()
            .all(|pixel| *pixel == [0.25, 0.5, 1.0])
    };
    // A driver with the scene sees the sky in the scene. A driver with only samples learns which
    // beams see nothing.
    place.run(&[&picture[..], &PAST].concat()).ok();
    assert!(is_sky());
    let report = place.run(&[&picture[..], &PAST, &["--driver", "quadtree"]].concat()).ok().json();
    let known = report["unseen_pixels"].as_u64().unwrap();
    assert_eq!(known, 64 * 48, "{report}");
    assert_eq!((report["stored"].as_u64(), report["empty_pixels"].as_u64()), (Some(0), Some(0)));
    assert!(is_sky());
}

#[test]
fn a_view_reports_unseen_beams_as_they_are_found() {
    let place = Place::new();
    let view = [
        "view",
        "--headless",
        "--config",
        "{}/cornell.toml",
        "--section",
        CORNELL_SMALL_SECTION,
        "--json",
    ];
    let last = ["--time", "1s", "--keep", "{}/a.holo", "-o", "{}/a.pfm", "--driver", "quadtree"];
    let report = place.run(&[&view[..], &last, &PAST].concat()).ok().json();
    assert_eq!(report["unseen_pixels"], 64 * 48, "{report}");
    assert_eq!(report["traced"], 0, "{report}");
    // A replay knows them from the file, without a worker.
    let replay =
        ["replay", "{}/a.holo", "--headless", "--json", "-o", "{}/b.pfm", "--driver", "quadtree"];
    let again = place.run(&[&replay[..], &PAST].concat()).ok().json();
    assert_eq!(again["unseen_pixels"], 64 * 48, "{again}");
}

#[test]
fn a_fill_of_a_section_that_sees_nothing_ends() {
    let place = Place::new();
    // The whole scene lies inside the section, whose rays begin where they leave it.
    let away = ["--section", "0,0,0 1,0,0 0,1,0 0,0,1 1,1,1", "--obstructions", "off"];
    place.write("inside.obj", "v 0.4 0.4 0.5\nv 0.6 0.4 0.5\nv 0.5 0.6 0.5\nf 1 2 3\n");
    let fill = ["fill", "{}/inside.obj", "-o", "{}/a.holo", "--samples", "1k", "--json"];
    let report = place.run(&[&fill[..], &away].concat()).ok().json();
    assert_eq!(report["added"], 0);
    let (skipped, _, beams) = unseen(&place, "{}/a.holo");
    assert_eq!(skipped, beams);
}
