//! Tests advice that is given before any work is done.

use holo_beamfile::{BeamFile, Options};
use holo_net::Message;
use holo_picture::Picture;
use holo_proto::{
    control::{Control, RenderSettings},
    hello::Role,
};
use holo_section::{SectionSpec, ViewClass};
use holo_server::{Holodeck, HolodeckDescription};
use holo_tests::{LIMIT, Place, analytic::join};

/// A square above another, and no light unless `more` adds some to the material.
fn squares(place: &Place, more: &str) {
    place.write("squares.mtl", &format!("newmtl grey\nKd 0.5 0.5 0.5\n{more}"));
    let obj = "mtllib squares.mtl\nusemtl grey\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n\
               v 0.5 0.5 1\nv 1.5 0.5 1\nv 1.5 1.5 1\nv 0.5 1.5 1\nf 1 2 3 4\nf 5 6 7 8\n";
    place.write("squares.obj", obj);
}

#[test]
fn a_picture_of_a_kind_that_cannot_be_written_is_refused_before_the_work() {
    let place = Place::new();
    let view = ["--vp", "1,1,1", "--vd", "0,0,1"];
    for words in [
        &["picture", "{}/none.holo", "-o", "x.jpg"][..],
        &["replay", "{}/none.holo", "--headless", "-o", "x.jpg"],
        &["view", "{}/none.obj", "--headless", "-o", "x.jpg"],
        &["render", "{}/none.obj", "--spp", "1", "-o", "x.jpg"],
        &["render", "{}/none.obj", "--spp", "1", "-o", "x.pfm", "--se", "x.jpg"],
    ] {
        // Nothing is read before: the missing scene is not reported.
        let ended = place.run(&[words, &view].concat()).failed(2, &["x.jpg", ".png"]);
        assert!(!ended.stderr.contains("none."), "{}", ended.stderr);
    }
}

#[test]
fn a_session_that_would_write_nothing_is_refused_with_an_example() {
    let place = Place::new();
    for words in [
        &["view", "{}/cornell.obj", "--headless"][..],
        &["view", "{}/cornell.obj", "--headless", "--time", "5s"],
        &["view", "{}/cornell.obj", "--headless", "--keep", "{}/a.holo"],
        &["replay", "{}/a.holo", "--headless", "--time", "5s"],
    ] {
        place.run(words).failed(2, &["write nothing", "-o FILE", "--script", "holodeck "]);
    }
}

#[test]
fn a_scene_without_light_gets_a_sky_which_is_said() {
    let place = Place::new();
    let render = |words: &[&str]| {
        let always = ["render", "{}/squares.obj", "--spp", "1", "-o", "{}/a.pfm"];
        let view = ["--vp", "1,1,5", "--vd", "0,0,-1", "--vu", "0,1,0", "--size", "8x8"];
        place.run(&[&always[..], &view, words].concat()).ok().stderr
    };
    squares(&place, "");
    let dark = render(&[]);
    for word in ["squares.obj", "preview sky", "luminances mean nothing", "--sky R,G,B"] {
        assert!(dark.contains(word), "{word}: {dark}");
    }
    let lit = Picture::read(place.path("a.pfm")).unwrap();
    assert!(lit.pixels.iter().any(|rgb| rgb[0] > 0.0));
    assert!(!render(&["--sky", "1,1,1"]).contains("preview"));
    assert!(!render(&["--sky", "0,0,0"]).contains("preview"), "darkness may be wanted");
    squares(&place, "Ke 1 1 1\n");
    assert!(!render(&[]).contains("preview"));
}

#[test]
fn an_exterior_fill_needs_no_section() {
    let place = Place::new();
    squares(&place, "");
    let fill = ["fill", "{}/squares.obj", "-o", "{}/a.holo", "--exterior", "--sky", "1,1,1"];
    place.run(&[&fill[..], &["--engine", "path", "--samples", "200k"]].concat()).ok();
    let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    let section = &info["sections"][0];
    assert_eq!(section["class"], "Exterior", "{info}");
    let high = |axis: usize| {
        section["origin"][axis].as_f64().unwrap() + section["axes"][axis][axis].as_f64().unwrap()
    };
    for (axis, size) in [2.0, 2.0, 1.0].into_iter().enumerate() {
        assert!(section["origin"][axis].as_f64().unwrap() < 0.0 && high(axis) > size, "{info}");
    }
    let view = ["-vp", "1", "1", "6", "-vd", "0", "0", "-1", "-vu", "0", "1", "0", "-vh", "30"];
    let picture = ["picture", "{}/a.holo", "-o", "{}/a.pfm", "--size", "32x32"];
    place.run(&[&picture[..], &view].concat()).ok();
    let lit = Picture::read(place.path("a.pfm")).unwrap();
    let lit = lit.pixels.iter().filter(|rgb| rgb[0] > 0.0).count();
    assert!(lit > 32 * 32 / 4, "{lit} pixels are lit");
}

#[test]
fn view_options_may_be_written_as_in_radiance() {
    let place = Place::new();
    place.fill_small("a.holo", "20k");
    let picture = |name: &str, view: &[&str]| {
        let words = ["picture", "{}/a.holo", "-o", &place.text(name), "--size", "16x16"];
        place.run(&[&words[..], view].concat()).ok();
        std::fs::read(place.path(name)).unwrap()
    };
    let ours = ["--vt", "a", "--vp", "2.7,2.7,-2", "--vd", "0,0,1", "--vu", "0,1,0", "--vh", "90"];
    let theirs = "-vta -vp 2.7 2.7 -2 -vd 0 0 1 -vu 0 1 0 -vh 90";
    let theirs: Vec<&str> = theirs.split(' ').collect();
    assert!(picture("ours.pfm", &ours) == picture("theirs.pfm", &theirs));
    let none = ["picture", "{}/a.holo", "-o", "{}/a.pfm", "-vt", "x"];
    place.run(&none).failed(1, &["-vtx"]);
}

#[test]
fn an_error_is_said_once() {
    let place = Place::new();
    for words in [
        &["info", "{}/none.holo"][..],
        &["fill", "{}/none.obj", "-o", "{}/a.holo", "--samples", "1k"],
        &["compare", "{}/none.pfm", "{}/none.pfm"],
    ] {
        let said = place.run(words).failed(1, &["none."]).stderr;
        assert_eq!(said.matches("No such file").count(), 1, "{said}");
        assert_eq!(said.matches("none.").count(), 1, "{said}");
    }
}

#[test]
fn a_scene_that_cannot_be_read_is_named_and_nobody_waits_for_it() {
    let place = Place::new();
    let spec = SectionSpec {
        origin: [0.0; 3],
        axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        grid: [2, 2, 2],
        class: ViewClass::Interior,
        obstructions: false,
    };
    let settings = RenderSettings::default();
    let about = HolodeckDescription::new(vec![spec], settings, b"the scene", "a room".into());
    drop(Holodeck::create(&place.path("a.holo"), about, b"the scene", 0).unwrap());
    let file =
        BeamFile::open(place.path("a.holo"), Options { cache_bytes: 0, layout: vec![] }).unwrap();
    file.put_blob("scene", b"another").unwrap();
    drop(file);
    let server = place.server("a.holo", &["--quiet"]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let (mut inbox, outbox, _) = join(server.address, Role::Display).await;
        outbox.control(&Control::SceneWanted).unwrap();
        let piece = loop {
            let message = tokio::time::timeout(LIMIT, inbox.next()).await.expect("an answer");
            if let Message::BlobChunk(piece) = message.unwrap() {
                break piece;
            }
        };
        assert_eq!(piece, holo_net::absent());
    });
    server.process.wait_for_error("a.holo: the scene is damaged");
}
