//! Files without a scene, and cells of samples: which driver shows them, and whether the picture is
//! right.

use holo_picture::{Picture, ViewSpec};
use holo_proto::control::RenderSettings;
use holo_section::{DVec3, Section, SectionSpec, ViewClass};
use holo_server::{Holodeck, HolodeckDescription};
use holo_tests::{
    Place,
    analytic::{World, compare, work},
    patiently,
};
use rustix::process::Signal;

const VIEW: &str = "-vp 0.3 0.4 1.7 -vd 1 0.4 0.2 -vu 0 0 1 -vh 60";

#[test]
fn a_file_without_a_scene_is_shown_in_cells_and_seen_right() {
    let place = Place::new();
    let axes = [[3.3, 0.0, 0.0], [0.0, 2.1, 0.0], [0.0, 0.0, 2.7]];
    let origin = [-1.0, -0.5, 0.5];
    let spec = SectionSpec {
        origin,
        axes,
        grid: [5, 4, 3],
        class: ViewClass::Interior,
        obstructions: false,
    };
    let settings = RenderSettings::default();
    let about = HolodeckDescription::new(vec![spec.clone()], settings, b"", "a known room".into());
    assert_eq!(about.scene.bytes, 0);
    drop(Holodeck::create(&place.path("room.holo"), about, b"", 0).unwrap());
    let world = World {
        room: [DVec3::new(-3.0, -2.0, -1.0), DVec3::new(5.0, 4.0, 6.0)],
        object: None,
        stretch: 1.0,
    };
    let sections = [Section::new(spec).unwrap()];
    let mut spec = ViewSpec::default();
    spec.apply_line(VIEW).unwrap();
    let (view, _) = spec.resolve((80, 60)).unwrap();
    let check = |name: &str, wrong: usize| {
        let verdict = compare(&world, &sections, &view, &Picture::read(place.path(name)).unwrap());
        assert!(verdict.compared > verdict.covered / 2, "{name}: {verdict:?}");
        assert!(
            verdict.wrong.len() <= wrong && verdict.mean_error.abs() < 4e-3,
            "{name}: {verdict:?}"
        );
    };

    let server = place.server("room.holo", &[]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.spawn(work(server.address, world));
    let show = |seconds| {
        let script = place.write("walk.txt", &format!("0 view {VIEW}\n{seconds} quit\n"));
        let output = place.text("live.pfm");
        let words = ["--script", &script, "--size", "80x60", "--json", "-o"];
        let report =
            place.viewer(server.address, &[&words[..], &[&output]].concat()).wait().ok().json();
        assert_eq!(report["driver"], "cells");
        report["samples"].as_u64().unwrap()
    };
    let samples = patiently(show, |samples| *samples > 50_000);
    assert!(samples > 50_000, "{samples}");
    check("live.pfm", 0);
    server.process.end(Signal::TERM).ok();
    runtime.shutdown_background();

    // Stored samples are shown in cells too, without any option.
    let picture = |name: &str, words: &[&str]| {
        let output = place.text(name);
        let view = [
            "--vp",
            "0.3,0.4,1.7",
            "--vd",
            "1,0.4,0.2",
            "--vu",
            "0,0,1",
            "--vh",
            "60",
            "--size",
            "80x60",
        ];
        let words =
            [&["picture", "{}/room.holo", "--json", "-o", &output][..], &view, words].concat();
        place.run(&words).ok().json()
    };
    for (name, words) in [("asked.pfm", &["--cells", "smooth"][..]), ("auto.pfm", &[])] {
        assert_eq!(picture(name, words)["driver"], "cells");
        assert!(
            std::fs::read(place.path(name)).unwrap()
                == std::fs::read(place.path("live.pfm")).unwrap()
        );
    }
    // A constant cell shows one sample: the colour of its wall at that place, except for the
    // rounding of RGBE.
    assert_eq!(picture("constant.pfm", &["--cells", "constant"])["driver"], "cells");
    check("constant.pfm", 10);
}

#[test]
fn cells_are_used_with_a_scene_if_they_are_requested() {
    let place = Place::new();
    place.fill_small("a.holo", "100k");
    let picture = |name: &str, words: &[&str]| {
        let output = place.text(name);
        let view = ["--vp", "2.78,2.73,-2", "--size", "48x48", "--json", "-o", &output];
        let report = place.run(&[&["picture", "{}/a.holo"][..], &view, words].concat()).ok().json();
        (report["driver"].as_str().unwrap().to_owned(), Picture::read(place.path(name)).unwrap())
    };
    let (name, scene) = picture("scene.pfm", &[]);
    assert_eq!(name, "surfaces");
    let (name, smooth) = picture("smooth.pfm", &["--cells", "smooth"]);
    assert_eq!(name, "cells");
    let (name, constant) = picture("constant.pfm", &["--cells", "constant"]);
    assert_eq!(name, "cells");
    assert!(scene != smooth && smooth != constant);
    // Each pixel has the colour of one sample. Few of many samples have equal colours, but
    // neighbours in a cell do.
    let colours = |picture: &Picture| {
        let mut colours: Vec<[u32; 3]> =
            picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect();
        colours.sort_unstable();
        colours.dedup();
        colours.len()
    };
    assert!(colours(&constant) < colours(&smooth), "{} {}", colours(&constant), colours(&smooth));
}
