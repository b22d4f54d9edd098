//! Tests messages about wrong usage, and the reports on pictures.

use holo_picture::{Picture, ViewSpec};
use holo_section::Section;
use holo_tests::Place;

#[test]
fn a_reader_that_stops_early_is_no_error() {
    let place = Place::new();
    place.fill_small("a.holo", "1k").ok();
    for options in [&[][..], &["--json"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = std::process::Command::new(holo_tests::program());
        let ended = command.arg("info").arg(place.path("a.holo")).args(options).stdout(writer);
        let ended = ended.output().unwrap();
        assert!(ended.status.success() && ended.stderr.is_empty(), "{ended:?}");
    }
}

/// Runs the program in a shell that limits its address space to this many KiB.
fn with_limit(place: &Place, kib: u32, words: &str) -> std::process::Output {
    let line = format!("ulimit -v {kib} && exec \"$0\" {words}");
    let mut shell = std::process::Command::new("sh");
    shell.arg("-c").arg(line).arg(holo_tests::program()).current_dir(place.path(""));
    shell.output().unwrap()
}

#[test]
fn a_process_that_gets_no_more_memory_ends_with_a_sentence() {
    let place = Place::new();
    let ended = with_limit(&place, 700_000, "render cornell.obj --size 8000x8000 -o a.pfm");
    assert!(!ended.status.success());
    let said = String::from_utf8(ended.stderr).unwrap();
    let last = said.lines().last().unwrap();
    assert!(last.starts_with("holodeck: no more memory: the limit of 683 MiB"), "{said}");
    assert!(last.contains("ulimit -v") && !place.path("a.pfm").exists(), "{said}");
}

#[test]
fn wrong_usage_ends_with_status_2() {
    let place = Place::new();
    let cases: [(&[&str], &[&str]); 14] = [
        (&["fil"], &["fil", "Usage"]),
        (&["fill", "-o", "{}/a.holo", "--samples", "1k"], &["no scene"]),
        (&["render"], &["no scene"]),
        (&["fill", "{}/cornell.obj", "-o", "{}/a.holo", "--time", "soon"], &["soon", "30s"]),
        (
            &["fill", "{}/cornell.obj", "-o", "{}/a.holo", "--samples", "1k", "--section", "1,2,3"],
            &["section"],
        ),
        (&["render", "{}/cornell.obj", "--up", "north"], &["--up", "y, z or X,Y,Z"]),
        (&["picture", "{}/a.holo", "-o", "{}/a.pfm", "--size", "0x7"], &["--size"]),
        (&["view", "{}/cornell.obj", "--time", "2s"], &["--time", "--headless"]),
        (&["view", "{}/cornell.obj", "--headless"], &["-o FILE", "--script FILE"]),
        (
            &["picture", "{}/a.holo", "-o", "{}/a.pfm", "--tone", "camera"],
            &["change .png pictures only", "a.pfm"],
        ),
        (
            &["render", "{}/cornell.obj", "-o", "{}/a.png", "--spp", "1", "--exposure", "bright"],
            &["--exposure", "stops"],
        ),
        (
            &["view", "{}/cornell.obj", "--headless", "-o", "{}/a.png", "--log"],
            &["--log needs --falsecolor"],
        ),
        (
            &[
                "picture",
                "{}/a.holo",
                "-o",
                "{}/a.pfm",
                "--driver",
                "quadtree",
                "--cells",
                "smooth",
            ],
            &["leave out --driver quadtree", "quadtree has no cells"],
        ),
        (
            &[
                "view",
                "{}/cornell.obj",
                "--headless",
                "--driver",
                "frameless",
                "--cells",
                "constant",
            ],
            &["frameless has no cells"],
        ),
    ];
    for (words, said) in cases {
        place.run(words).failed(2, said);
    }
    assert!(!place.path("a.holo").exists(), "a command that was refused has made a file");
}

#[test]
fn a_look_changes_pngs_and_reports_the_exposure() {
    let place = Place::new();
    place.run(&["fill", "{}/cornell.obj", "-o", "{}/a.holo", "--samples", "2k"]).ok();
    let picture = |name: &str, options: &[&str]| {
        let file = format!("{{}}/{name}");
        let words = ["picture", "{}/a.holo", "--size", "96x96", "--json", "-o", &file];
        let said = place.run(&[&words[..], options].concat()).ok().stdout;
        let report: serde_json::Value = serde_json::from_str(&said).unwrap();
        (report["exposure"].clone(), std::fs::read(place.path(name)).unwrap())
    };
    let (exposure, plain) = picture("plain.png", &[]);
    let locked = format!("={exposure}");
    assert!(exposure.as_f64().unwrap() > 0.0);
    assert_eq!(picture("locked.png", &["--exposure", &locked]), (exposure, plain.clone()));
    assert_ne!(picture("dark.png", &["--exposure", "-2"]).1, plain);
    let width = |png: &[u8]| u32::from_be_bytes([png[16], png[17], png[18], png[19]]);
    let (exposure, colors) = picture("colors.png", &["--falsecolor", "--contours", "--log"]);
    assert!(width(&plain) == 96 && width(&colors) > 140 && exposure.is_null());
    let (_, bare) = picture("bare.png", &["--falsecolor=0:50", "--no-legend"]);
    assert_eq!(width(&bare), 96);
}

#[test]
fn failures_end_with_status_1_and_name_the_file() {
    let place = Place::new();
    place.write("text.holo", "this is not a holodeck");
    place.write("broken.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    place.write("wrong.toml", "scene = \"cornell.obj\"\nbouncs = 3\n");
    let view = ["--vp", "1,1,1", "--vd", "0,0,1"];
    place.run(&["info", "{}/none.holo"]).failed(1, &["none.holo"]);
    place.run(&["info", "{}/text.holo"]).failed(1, &["text.holo"]);
    place.run(&["verify", "{}/text.holo"]).failed(1, &["text.holo"]);
    place
        .run(&["holoserver", "{}/text.holo", "--listen", "127.0.0.1:0", "--with-parent"])
        .failed(1, &["text.holo"]);
    place
        .run(&[&["picture", "{}/none.holo", "-o", "{}/a.pfm"], &view[..]].concat())
        .failed(1, &["none.holo"]);
    let fill = |scene: &str| place.run(&["fill", scene, "-o", "{}/new.holo", "--samples", "1k"]);
    fill("{}/none.obj").failed(1, &["none.obj"]);
    fill("{}/broken.obj").failed(1, &["broken.obj", "line 4", "vertex 9"]);
    place
        .run(&["fill", "--config", "{}/wrong.toml", "-o", "{}/new.holo", "--samples", "1k"])
        .failed(1, &["wrong.toml", "bouncs"]);
    let render = ["render", "{}/cornell.obj", "--time", "1000h", "-o", "{}/a.pfm"];
    place
        .run(&[&render[..], &["--denoise", "{}/none.so"]].concat())
        .failed(1, &["none.so", "name"]);
    assert!(!place.path("new.holo").exists(), "a fill that failed has made a file");
    place.fill_small("a.holo", "1k");
    let picture =
        |words: &[&str]| place.run(&[&["picture", "{}/a.holo", "--size", "16x16"], words].concat());
    picture(&["-o", "{}/a.gif"]).failed(2, &["a.gif"]);
    picture(&["-o", "{}/cornell.obj/a.pfm"]).failed(2, &["cornell.obj"]);
    picture(&["-o", "{}/a.pfm", "--view", "nowhere"]).failed(1, &["nowhere", "front", "left"]);
    picture(&["-o", "{}/a.pfm", "--vp", "100,100,100", "--vd", "1,0,0"]).failed(1, &["no section"]);
    let file = place.text("a.holo");
    place
        .run(&["holoserver", &file, "--listen", "192.0.2.1:0", "--with-parent"])
        .failed(1, &["listening at 192.0.2.1"]);
    place.run(&["rtworker", "--connect", "192.0.2.1:7070"]).failed(1, &["192.0.2.1", "join"]);
    place.run(&["rtworker", "--join", "holodeck://192.0.2.1:7070/abc"]).failed(1, &["string"]);
}

#[test]
fn a_scripts_mistakes_are_named_by_file_and_line() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    for (script, line, said) in [
        ("0 view -vp 1 2\n", 1, "-vp"),
        ("# a walk\n\n0.1 picture\n", 3, "takes the name"),
        ("0 view -vh 50\n1 jump\n", 2, "jump"),
    ] {
        let path = place.write("walk.txt", script);
        let ended = place.run(&["replay", "{}/a.holo", "--headless", "--script", &path]);
        ended.failed(1, &[&format!("walk.txt:{line}"), said]);
    }
    place
        .run(&["replay", "{}/a.holo", "--headless", "--script", "{}/none.txt"])
        .failed(1, &["none.txt"]);
}

#[test]
fn pixels_that_no_section_covers_are_black_without_the_scene_and_counted() {
    let place = Place::new();
    place.fill_small("a.holo", "60k");
    // The eye is in front of the section, to its side: half of the picture misses the section.
    let view = "-vp 0.6 2.7 -8 -vd 0 0 1 -vu 0 1 0 -vh 50";
    let words = ["--vp", "0.6,2.7,-8", "--vd", "0,0,1", "--vh", "50", "--size", "80x60"];
    let picture = ["picture", "{}/a.holo", "--driver", "quadtree", "-o", "{}/a.pfm", "--json"];
    let report = place.run(&[&picture[..], &words].concat()).ok().json();
    let picture = Picture::read(place.path("a.pfm")).unwrap();
    let holodeck = holo_server::Holodeck::open_read_only(&place.path("a.holo"), 0).unwrap();
    let sections: &[Section] = &holodeck.sections;
    let mut spec = ViewSpec::default();
    spec.apply_line(view).unwrap();
    let (view, size) = spec.resolve((80, 60)).unwrap();
    let mut uncovered = 0u64;
    for row in 0..60 {
        for column in 0..80 {
            let (x, y) = holo_picture::View::pixel_centre(size, column, row);
            let (eye, direction) = view.ray(x, y);
            if sections.iter().all(|section| section.line(eye, direction).is_none()) {
                uncovered += 1;
                assert_eq!(picture.get(column, row), Some([0.0; 3]), "column {column}, row {row}");
            }
        }
    }
    assert!((1000..4000).contains(&uncovered), "{uncovered}: the view should be covered in part");
    assert_eq!(report["uncovered_pixels"], uncovered);
    let lit = picture.pixels.iter().filter(|rgb| rgb[0] > 0.0).count();
    assert!(lit > 400, "{lit} pixels are lit");
}

/// A closed box in the middle of its section: rays from the section's walls end on its outside.
#[test]
fn a_view_that_no_section_reaches_gives_advice() {
    let place = Place::new();
    place.write("box.mtl", "newmtl grey\nKd 0.5 0.5 0.5\nnewmtl lamp\nKe 5 5 5\n");
    let mut obj = String::from("mtllib box.mtl\n");
    for corner in 0..8 {
        obj += &format!("v {} {} {}\n", corner & 1, corner >> 1 & 1, corner >> 2);
    }
    obj += "v -3 -3 3\nv 4 -3 3\nv 4 4 3\nv -3 4 3\nusemtl grey\n";
    obj += "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\nusemtl lamp\nf 9 12 11 10\n";
    place.write("box.obj", &obj);
    let fill = ["fill", "{}/box.obj", "--section=-1,-1,-1 3,0,0 0,3,0 0,0,3", "-o", "{}/box.holo"];
    place.run(&[&fill[..], &["--bounces", "0", "--samples", "400000"]].concat()).ok();
    let picture = |eye: &str| {
        let view = ["--vp", eye, "--vd", "1,0.2,-0.3", "--vh", "60", "--size", "64x64"];
        place
            .run(&[&["picture", "{}/box.holo", "-o", "{}/box.png"][..], &view].concat())
            .ok()
            .stderr
    };
    let inside = picture("0.5,0.5,0.5");
    assert!(inside.contains("give a section within the room"), "{inside}");
    let outside = picture("-0.8,0.5,0.5");
    assert!(!outside.contains("give a section"), "{outside}");
}
