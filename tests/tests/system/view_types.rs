//! Views of Radiance's types, from the tracer and through a holodeck; and parts of a driver
//! switched while it shows one.

use holo_picture::{Picture, compare};
use holo_tests::{CORNELL_SMALL_SECTION, Place};

/// Direct light only, from before the open side.
const RENDER: [&str; 6] = ["render", "--config", "{}/cornell.toml", "--bounces", "0", "-q"];

fn psnr(place: &Place, name: &str, truth: &str) -> f64 {
    let read = |name: &str| Picture::read(place.path(name)).unwrap();
    compare(&read(name), &read(truth)).unwrap().psnr_disp
}

#[test]
fn every_type_of_view_is_shown_by_every_driver_as_the_tracer_renders_it() {
    let place = Place::new();
    place.fill_small_with("a.holo", "400k", &["--bounces", "0"]);
    for (name, words) in [
        ("l", "--vt l --vp 2.78,2.73,-1 --vh 3"),
        ("c", "--vt c --vp 2.78,2.73,-2 --vh 70"),
        ("a", "--vt a --vp 2.78,2.73,-2 --vh 70"),
        ("h", "--vt h --vp 2.78,2.73,-2 --vh 70 --vs 0.05"),
    ] {
        let view: Vec<&str> =
            words.split(' ').chain(["--vd", "0,0,1", "--size", "64x64"]).collect();
        let (truth, output) = (place.text("truth.pfm"), place.text("shown.pfm"));
        place.run(&[&RENDER[..], &["--spp", "100", "-o", &truth], &view].concat()).ok();
        for driver in ["surfaces", "quadtree", "pointimage"] {
            let picture = ["picture", "{}/a.holo", "--json", "-o", &output, "--driver", driver];
            let report = place.run(&[&picture[..], &view].concat()).ok().json();
            assert_eq!(report["driver"], driver);
            let quality = psnr(&place, "shown.pfm", "truth.pfm");
            println!("{name} {driver}: {quality:.1} dB from {} samples", report["samples"]);
            // From a few samples a pixel, and from two pixels a sample for `pointimage`.
            assert!(quality > 14.0, "{name} {driver}: {quality}");
        }
        if name == "l" {
            // This driver shows mostly its own rays: live ones, from an empty file.
            let script = place.write("rest.txt", &format!("4 picture {output}\nquit\n"));
            let live = [
                "view",
                "--config",
                "{}/cornell.toml",
                "--section",
                CORNELL_SMALL_SECTION,
                "--bounces",
                "0",
            ];
            let follow = ["--headless", "--script", &script, "--driver", "frameless", "-q"];
            place.run(&[&live[..], &follow, &view].concat()).ok();
            let quality = psnr(&place, "shown.pfm", "truth.pfm");
            println!("{name} frameless, live: {quality:.1} dB");
            assert!(quality > 26.0, "frameless: {quality}");
        }
    }
    // A picture's file states how the picture was made.
    let words = [
        "picture",
        "{}/a.holo",
        "-o",
        "{}/c.hdr",
        "--vt",
        "c",
        "--vp",
        "2.78,2.73,-2",
        "--vd",
        "0,0,1",
        "--vh",
        "70",
    ];
    place.run(&[&words[..], &["--size", "64x64", "--vl", "-0.1"]].concat()).ok();
    let view = Picture::read(place.path("c.hdr")).unwrap().view.unwrap();
    assert!(view.to_vf_options().starts_with("-vtc -vp 2.78 2.73 -2 "), "{}", view.to_vf_options());
    assert_eq!((view.vh, view.vl), (70.0, -0.1));
    let ended = place.run(&[
        "picture",
        "{}/a.holo",
        "-o",
        "{}/b.pfm",
        "--vt",
        "s",
        "--vp",
        "0,0,0",
        "--vd",
        "0,0,1",
    ]);
    ended.failed(1, &["-vts (planispheric fisheye) is not supported", "-vth shows a hemisphere"]);
    let ended = place.run(&[
        "picture",
        "{}/a.holo",
        "-o",
        "{}/b.pfm",
        "--vt",
        "l",
        "--vp",
        "0,0,0",
        "--vd",
        "0,0,1",
    ]);
    ended.failed(1, &["-vh: how wide it is, in scene units"]);
}

#[test]
fn parts_of_the_render_cache_are_switched_while_it_shows_a_view() {
    let place = Place::new();
    place.fill_small_with("a.holo", "200k", &["--bounces", "0"]);
    let pictures = ["all.pfm", "without.pfm", "again.pfm"].map(|name| place.text(name));
    let script = format!(
        "0 view -vp 2.78 2.73 -2 -vd 0 0 1 -vh 60\n3 picture {}\nwithout prefilter,interpolation\npicture {}\n\
         with prefilter,interpolation\npicture {}\nquit\n",
        pictures[0], pictures[1], pictures[2]
    );
    let script = place.write("walk.txt", &script);
    let words =
        ["replay", "{}/a.holo", "--headless", "--script", &script, "--size", "64x64", "--json"];
    let points = ["--driver", "pointimage", "--empty-pixels", "black"];
    let reports = place.run(&[&words[..], &points].concat()).ok();
    let stages = |line: &str| {
        let report: serde_json::Value = serde_json::from_str(line).unwrap();
        report["stages"].as_array().unwrap().iter().any(|one| one["stage"] == "Prefilter")
    };
    let ran: Vec<bool> = reports.stdout.lines().map(stages).collect();
    // The first picture may have had nothing to do, if everything had been drawn before to
    // determine how near things are.
    assert_eq!(ran[1..], [false, true]);
    let read = |name: &str| Picture::read(place.path(name)).unwrap().pixels;
    let black = |name: &str| read(name).iter().filter(|pixel| **pixel == [0.0; 3]).count();
    assert!(black("without.pfm") > black("all.pfm"));
    assert_eq!(read("again.pfm"), read("all.pfm"));
    let wrong = [
        "replay",
        "{}/a.holo",
        "--headless",
        "--script",
        &script,
        "--size",
        "64x64",
        "--driver",
        "quadtree",
    ];
    place.run(&wrong).failed(1, &["`--driver pointimage` has parts"]);
}

#[test]
fn clipping_surfaces_are_those_of_the_tracer_s_pictures_by_every_driver() {
    let place = Place::new();
    place.fill_small_with("a.holo", "400k", &["--bounces", "0"]);
    // The view begins in front of the open side and ends before the back wall; beyond is black.
    let file = place.write(
        "cut.vf",
        "rview -vtv -vp 2.78 2.73 -2 -vd 0 0 1 -vu 0 1 0 -vh 60 -vv 60 -vo 0 -va 7\n",
    );
    let same = place.write(
        "zero.vf",
        "rview -vtv -vp 2.78 2.73 -2 -vd 0 0 1 -vu 0 1 0 -vh 60 -vv 60 -vo 0 -va 0\n",
    );
    let (truth, output, whole) =
        (place.text("truth.pfm"), place.text("shown.pfm"), place.text("whole.pfm"));
    let render = |vf: &str, more: &[&str], output: &str| {
        let words = ["--spp", "100", "-o", output, "--vf", vf, "--size", "64x64"];
        place.run(&[&RENDER[..], &words, more].concat()).ok();
    };
    render(&file, &[], &truth);
    render(&same, &[], &whole);
    let black = |name: &str| {
        Picture::read(place.path(name)).unwrap().pixels.iter().filter(|p| **p == [0.0; 3]).count()
    };
    // The back wall is 5.5 wide at 7.6 from the eye, and 60 degrees are 8.8 there.
    assert!(
        black("truth.pfm") > black("whole.pfm") + 600,
        "{} {}",
        black("truth.pfm"),
        black("whole.pfm")
    );
    for driver in ["surfaces", "quadtree", "pointimage"] {
        let words = [
            "picture",
            "{}/a.holo",
            "-o",
            &output,
            "--driver",
            driver,
            "--vf",
            &file,
            "--size",
            "64x64",
        ];
        place.run(&words).ok();
        let quality = psnr(&place, "shown.pfm", "truth.pfm");
        println!("{driver}: {quality:.1} dB");
        assert!(quality > 14.0, "{driver}: {quality}");
    }
    // A fore plane in the box's depth removes the sides and the blocks in front of it; the back
    // wall stays the same.
    render(&same, &["--vo", "6.5"], &truth);
    assert!(
        black("truth.pfm") > black("whole.pfm") + 500,
        "{} {}",
        black("truth.pfm"),
        black("whole.pfm")
    );
    let light = |name: &str| Picture::read(place.path(name)).unwrap().get(32, 19).unwrap()[1];
    // Each is the mean of 100 points of the lamp, which differ by a third of their value: within
    // ten deviations.
    assert!((light("truth.pfm") / light("whole.pfm") - 1.0).abs() < 0.3);
    place
        .run(&[
            "picture",
            "{}/a.holo",
            "-o",
            &output,
            "--vf",
            &same,
            "--vo",
            "6.5",
            "--size",
            "64x64",
        ])
        .ok();
    let quality = psnr(&place, "shown.pfm", "truth.pfm");
    println!("surfaces, fore: {quality:.1} dB");
    assert!(quality > 14.0, "{quality}");
    let wrong = ["picture", "{}/a.holo", "-o", &output, "--vf", &file, "--vo", "8"];
    place.run(&wrong).failed(1, &["-va 7 must be larger than -vo 8, or 0 for none"]);
}
