//! Pictures of a room whose every pixel is known, through server, file and viewer.

use std::net::SocketAddr;

use holo_picture::{Picture, ViewSpec};
use holo_proto::control::RenderSettings;
use holo_section::{DVec3, Section, SectionSpec, ViewClass};
use holo_server::{Holodeck, HolodeckDescription};
use holo_tests::{
    Place,
    analytic::{Verdict, World, compare, work},
    patiently,
};
use rustix::process::Signal;

const ROOM: [DVec3; 2] = [DVec3::new(-3.0, -2.0, -1.0), DVec3::new(5.0, 4.0, 6.0)];

fn section(
    origin: [f64; 3],
    axes: [[f64; 3]; 3],
    grid: [u32; 3],
    class: ViewClass,
    obstructions: bool,
) -> SectionSpec {
    SectionSpec { origin, axes, grid, class, obstructions }
}

/// A file of these sections without a sample in it. Its description of the scene is never
/// requested.
fn make(place: &Place, sections: Vec<SectionSpec>) {
    let settings = RenderSettings::default();
    let about = HolodeckDescription::new(sections, settings, b"known", "a known room".into());
    let file = Holodeck::create(&place.path("room.holo"), about, b"known", 0).unwrap();
    file.file.flush().unwrap();
}

/// Looks at the room from these places while it is traced, and checks the pictures.
fn look(world: World, sections: Vec<SectionSpec>, views: &[(&str, &str)]) {
    let place = Place::new();
    make(&place, sections.clone());
    let sections: Vec<Section> =
        sections.into_iter().map(|spec| Section::new(spec).unwrap()).collect();
    let server = place.server("room.holo", &[]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.spawn(work(server.address, world));
    for (name, view) in views {
        let mut spec = ViewSpec::default();
        spec.apply_line(view).unwrap();
        let (resolved, _) = spec.resolve((80, 60)).unwrap();
        let shown = |seconds| {
            show(&place, server.address, view, seconds);
            compare(&world, &sections, &resolved, &Picture::read(place.path("a.pfm")).unwrap())
        };
        let verdict = patiently(shown, is_right);
        assert!(is_right(&verdict), "{name}: {verdict:?}");
    }
    server.process.end(Signal::TERM).ok();
    runtime.shutdown_background();
}

/// Looks for so many seconds, and writes the last picture to `a.pfm`.
fn show(place: &Place, address: SocketAddr, view: &str, seconds: u32) {
    let script = place.write("walk.txt", &format!("0 view {view}\n{seconds} quit\n"));
    let output = place.text("a.pfm");
    place.viewer(address, &["--script", &script, "--size", "80x60", "-o", &output]).wait().ok();
}

fn is_right(verdict: &Verdict) -> bool {
    let is_enough = verdict.compared > (verdict.covered + verdict.uncovered) / 3;
    // Pixels outside every section are traced for the view alone.
    let is_whole = verdict.live == verdict.uncovered;
    // RGBE and the spread of samples have no bias. The largest error measured is 2.6e-4; any
    // mistake is far above eight times that.
    is_enough && is_whole && verdict.wrong.is_empty() && verdict.mean_error.abs() < 2e-3
}

#[test]
fn a_room_is_seen_right_from_inside_outside_and_behind_a_section() {
    let axes = [[3.3, 0.0, 0.0], [0.0, 2.1, 0.0], [0.0, 0.0, 2.7]];
    let one = section([-1.0, -0.5, 0.5], axes, [5, 4, 3], ViewClass::Interior, false);
    let views = [
        ("inside", "-vp 0.3 0.4 1.7 -vd 1 0.4 0.2 -vu 0 0 1 -vh 60"),
        ("inside, the other way", "-vp 0.9 0.6 1.2 -vd -0.8 0.5 -0.6 -vu 0 1 0 -vh 70"),
        ("outside, looking in", "-vp -2.5 0.3 2 -vd 1 0.05 0 -vu 0 0 1 -vh 50"),
        (
            "behind: the section is at the viewer's back",
            "-vp 3.5 0.6 1.9 -vd 1 0.1 0.05 -vu 0 0 1 -vh 40",
        ),
    ];
    look(World { room: ROOM, object: None, stretch: 1.0 }, vec![one], &views);
}

#[test]
fn a_room_is_seen_right_through_two_sections_and_between_them() {
    let axes = [[1.5, 0.0, 0.0], [0.0, 2.5, 0.0], [0.0, 0.0, 2.0]];
    let left = section([-2.0, -1.0, 0.5], axes, [2, 4, 3], ViewClass::Interior, false);
    // The axes are left-handed, so cells have another order, but the picture is the same.
    let axes = [[0.0, 2.7, 0.0], [1.6, 0.0, 0.0], [0.0, 0.0, 2.2]];
    let right = section([2.0, -0.8, 0.4], axes, [4, 2, 3], ViewClass::Interior, false);
    let views = [
        ("between, towards the right", "-vp 0.7 0.4 1.5 -vd 1 0.1 0 -vu 0 0 1 -vh 60"),
        ("between, towards the left", "-vp 0.9 0.4 1.5 -vd -1 0.1 0.1 -vu 0 0 1 -vh 60"),
        ("in the left one", "-vp -1.2 0.3 1.4 -vd 1 0.1 0.1 -vu 0 0 1 -vh 70"),
    ];
    look(World { room: ROOM, object: None, stretch: 1.0 }, vec![left, right], &views);
}

#[test]
fn a_room_is_seen_right_through_a_sheared_section() {
    let axes = [[2.6, 0.5, 0.2], [-0.6, 2.0, 0.3], [0.4, -0.3, 2.4]];
    let sheared = section([-0.5, -0.4, 0.6], axes, [4, 3, 5], ViewClass::Interior, false);
    let views = [
        ("inside", "-vp 0.8 0.7 1.9 -vd 0.3 1 0.2 -vu 0 0 1 -vh 60"),
        ("outside", "-vp -2.4 -1.2 0.2 -vd 1 0.6 0.5 -vu 0 0 1 -vh 45"),
    ];
    look(World { room: ROOM, object: None, stretch: 1.0 }, vec![sheared], &views);
}

#[test]
fn an_object_is_seen_right_from_outside_and_within_a_section_around_it() {
    let object = [DVec3::new(0.2, 0.1, 1.4), DVec3::new(1.4, 1.1, 2.6)];
    let world = World { room: ROOM, object: Some(object), stretch: 1.0 };
    let axes = [[2.4, 0.0, 0.0], [0.0, 2.2, 0.0], [0.0, 0.0, 2.4]];
    let around = |class| section([-0.4, -0.5, 0.8], axes, [4, 4, 4], class, true);
    let outside = [
        ("from the left", "-vp -2.5 0.5 2.1 -vd 1 0.02 0 -vu 0 0 1 -vh 45"),
        ("from above, at a corner", "-vp 3.8 3.4 5.2 -vd -1 -0.95 -1.05 -vu 0 0 1 -vh 30"),
    ];
    look(world, vec![around(ViewClass::Exterior)], &outside);
    let within = [("from within, at its side", "-vp -0.2 0.6 2 -vd 1 0.02 -0.05 -vu 0 0 1 -vh 80")];
    look(world, vec![around(ViewClass::Interior)], &within);
}

/// Tests the comparison itself: it must detect another room, however small the difference is.
#[test]
fn another_room_is_detected() {
    let axes = [[3.3, 0.0, 0.0], [0.0, 2.1, 0.0], [0.0, 0.0, 2.7]];
    let one = section([-1.0, -0.5, 0.5], axes, [5, 4, 3], ViewClass::Interior, false);
    let view = "-vp 0.3 0.4 1.7 -vd 1 0.4 0.2 -vu 0 0 1 -vh 60";
    let mut spec = ViewSpec::default();
    spec.apply_line(view).unwrap();
    let (resolved, _) = spec.resolve((80, 60)).unwrap();
    let sections = [Section::new(one.clone()).unwrap()];
    let place = Place::new();
    make(&place, vec![one]);
    let server = place.server("room.holo", &[]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.spawn(work(server.address, World { room: ROOM, object: None, stretch: 1.0 }));
    show(&place, server.address, view, 1);
    let picture = Picture::read(place.path("a.pfm")).unwrap();
    let wrong_share = |world: &World, picture: &Picture| {
        let verdict = compare(world, &sections, &resolved, picture);
        verdict.wrong.len() as f64 / verdict.compared as f64
    };
    let longer = World { room: [ROOM[0], ROOM[1] + DVec3::X], object: None, stretch: 1.0 };
    assert!(wrong_share(&longer, &picture) > 0.5, "a wall farther by an eighth of the room");
    let mut swapped = picture.clone();
    swapped.pixels.iter_mut().for_each(|rgb| rgb.swap(0, 2));
    assert!(
        wrong_share(&World { room: ROOM, object: None, stretch: 1.0 }, &swapped) > 0.5,
        "red and blue"
    );
    let mut mirrored = picture.clone();
    mirrored.pixels.chunks_mut(80).for_each(|row| row.reverse());
    assert!(
        wrong_share(&World { room: ROOM, object: None, stretch: 1.0 }, &mirrored) > 0.5,
        "left and right"
    );
    runtime.shutdown_background();
}

/// A file filled without a viewer: its rays go everywhere, and only their distances determine where
/// an eye sees what they hit. The same file with all distances halved must fail. (`samples` checks
/// each distance exactly.)
///
/// The quadtree would pass the wrong file: it finds that samples from elsewhere do not agree with
/// aligned ones, and leaves them out.
#[test]
fn a_filled_room_is_seen_right_by_its_distances() {
    let axes = [[3.3, 0.0, 0.0], [0.0, 2.1, 0.0], [0.0, 0.0, 2.7]];
    let one = section([-1.0, -0.5, 0.5], axes, [3, 2, 3], ViewClass::Interior, false);
    let sections = [Section::new(one.clone()).unwrap()];
    let views = [
        "-vp 0.3 0.4 1.7 -vd 1 0.1 0.1 -vu 0 0 1 -vh 50",
        "-vp 1.1 0.9 2.2 -vd -0.2 -0.1 -1 -vu 0 1 0 -vh 45",
    ];
    let wrong_share = |stretch: f64, driver: &str| {
        let place = Place::new();
        make(&place, vec![one.clone()]);
        let server = place.server("room.holo", &["--fill", "--samples", "1M"]);
        let runtime = tokio::runtime::Runtime::new().unwrap();
        runtime.spawn(work(server.address, World { room: ROOM, object: None, stretch }));
        server.process.wait().ok();
        runtime.shutdown_background();
        views.map(|view| {
            let script = place.write("walk.txt", &format!("0 view {view}\n"));
            let words =
                ["replay", "{}/room.holo", "--headless", "--driver", driver, "--script", &script];
            place.run(&[&words[..], &["--size", "40x30", "-o", "{}/a.pfm"]].concat()).ok();
            let mut spec = ViewSpec::default();
            spec.apply_line(view).unwrap();
            let (resolved, _) = spec.resolve((40, 30)).unwrap();
            let world = World { room: ROOM, object: None, stretch: 1.0 };
            let verdict =
                compare(&world, &sections, &resolved, &Picture::read(place.path("a.pfm")).unwrap());
            assert!(verdict.compared > 400, "{verdict:?}");
            verdict.wrong.len() as f64 / verdict.compared as f64
        })
    };
    for driver in ["pointimage", "quadtree"] {
        assert_eq!(wrong_share(1.0, driver), [0.0; 2], "{driver}: share of pixels that are wrong");
    }
    let halved = wrong_share(0.5, "pointimage");
    assert!(
        halved.iter().all(|&share| share > 0.1),
        "{halved:?} of the pixels are wrong with wrong distances"
    );
}
