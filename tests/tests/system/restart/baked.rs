//! Objects that were carried in become part of the scene, and are taken out again.

use std::ops::Range;

use holo_picture::Picture;
use holo_tests::{Place, Process, wait_until};
use serde_json::Value;

use super::{Truths, VIEW, of_scene, taken, truth, wait_to_see, walk};

/// Corners of a cube of side 1 whose base is at height 0.
const CORNERS: [[f64; 3]; 8] = [
    [-0.5, 0.0, -0.5],
    [0.5, 0.0, -0.5],
    [0.5, 0.0, 0.5],
    [-0.5, 0.0, 0.5],
    [-0.5, 1.0, -0.5],
    [0.5, 1.0, -0.5],
    [0.5, 1.0, 0.5],
    [-0.5, 1.0, 0.5],
];

/// Its faces. The base shines.
const FACES: &str = "usemtl WHITE\nf -1 -2 -3 -4\nf -8 -4 -3 -7\nf -7 -3 -2 -6\nf -6 -2 -1 -5\n\
    f -5 -1 -4 -8\nusemtl LIGHT\nf -8 -7 -6 -5\n";

/// Its materials, whose names the scene has for others.
const MATERIALS: &str = "newmtl WHITE\nKd 0.1 0.2 0.9\nnewmtl LIGHT\nKd 0 0 0\nKe 4 8 16\n";

const ADD: &str = "object add {}/cube.obj at 2.78 1.7 1.2 scale 1.2 as the cube";

/// The same object at another place, and its way from there.
const ADD_ELSEWHERE: &str = "object add {}/cube.obj at 2.2 1.7 1.2 scale 1.2 as the cube";
const MOVE: &str = "object move the cube to 2.78 1.7 1.2";

fn cube(scale: f64, at: [f64; 3], [white, light]: [&str; 2]) -> String {
    let place = |corner: [f64; 3]| -> String {
        let coordinates = [0, 1, 2].map(|axis| (corner[axis] * scale + at[axis]).to_string());
        format!("v {}\n", coordinates.join(" "))
    };
    let corners: String = CORNERS.map(place).concat();
    corners + &FACES.replace("WHITE", white).replace("LIGHT", light)
}

/// Where the cube is added.
const AT: [f64; 3] = [2.78, 1.7, 1.2];

/// Traces the scene with the cube at a place.
fn joined(place: &Place, at: [f64; 3]) -> Picture {
    let [model, materials] = ["cornell.obj", "cornell.mtl"]
        .map(|name| (name, std::fs::read_to_string(place.path(name)).unwrap()));
    let names = ["cube-white", "cube-light"];
    place.write(model.0, &format!("{}{}", model.1, cube(1.2, at, names)));
    let own = MATERIALS.replace("WHITE", names[0]).replace("LIGHT", names[1]);
    place.write(materials.0, &format!("{}\n{own}", materials.1));
    let joined = truth(place, "joined.pfm");
    for (name, text) in [model, materials] {
        place.write(name, &text);
    }
    joined
}

/// The share of nearly black pixels in these columns, at the height of the cube.
fn black_share(picture: &Picture, columns: &Range<u32>) -> f64 {
    let pixels = (38..62).flat_map(|row| columns.clone().map(move |column| (column, row)));
    let is_black = |&(column, row): &(u32, u32)| {
        picture.get(column, row).is_some_and(|pixel| pixel.iter().sum::<f32>() < 0.05)
    };
    let (all, black) = (pixels.clone().count(), pixels.filter(is_black).count());
    black as f64 / all as f64
}

/// Writes the cube's model, and traces the scene without the cube and with it.
fn truths(place: &Place) -> Truths {
    let (white, painted) = (truth(place, "empty.pfm"), joined(place, AT));
    let names = ["white", "light"];
    place.write("cube.obj", &format!("mtllib cube.mtl\n{}", cube(1.0, [0.0; 3], names)));
    let own = MATERIALS.replace("WHITE", names[0]).replace("LIGHT", names[1]);
    place.write("cube.mtl", &own);
    Truths { white, painted }
}

/// Waits until this many objects are carried.
fn wait_for_carried(place: &Place, count: usize) {
    wait_until("the list of carried objects", || {
        let list = std::fs::read(place.path("a.objects/objects.json")).ok()?;
        let list: Value = serde_json::from_slice(&list).ok()?;
        (list.as_array()?.len() == count).then_some(())
    });
}

fn info(place: &Place) -> Value {
    place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json()
}

fn replayed(place: &Place) -> Picture {
    let words = ["picture", "{}/a.holo", "-o", "{}/replayed.pfm", "-q"];
    place.run(&[&words[..], &VIEW].concat()).ok();
    Picture::read(place.path("replayed.pfm")).unwrap()
}

#[test]
fn an_object_that_is_baked_is_traced_with_its_lamp_and_a_replay_needs_no_file_of_it() {
    let place = Place::new();
    let truths = truths(&place);
    let session = &mut walk(&place, &of_scene());
    wait_to_see(&place, session, &truths, false);
    session.write_line(&ADD.replace("{}", &place.text("")));
    wait_for_carried(&place, 1);
    session.write_line("object bake the cube");
    session.wait_for_error("goes on with the edited scene");
    wait_to_see(&place, session, &truths, true);
    wait_for_carried(&place, 0);
    // Its lamp is a lamp of the scene. The scene is read again with it, and without its file.
    for name in ["cube.obj", "cube.mtl"] {
        std::fs::remove_file(place.path(name)).unwrap();
    }
    std::fs::remove_dir_all(place.path("a.objects")).unwrap();
    assert_eq!(info(&place)["generation"], 1);
    session.write_line("lamp the cube/light 0");
    wait_until("the generation of the dimmed lamp", || {
        (info(&place)["generation"] == 2).then_some(())
    });
    session.write_line("lamp the cube/light 1");
    wait_until("the generation of the lit lamp", || {
        (info(&place)["generation"] == 3).then_some(())
    });
    wait_to_see(&place, session, &truths, true);
    // The session also shows light of the generation before. A replay needs enough of this one.
    wait_until("samples of this generation", || {
        (info(&place)["samples"].as_u64()? > 200_000).then_some(())
    });
    session.write_line("quit");
    wait_until("the session to end", || (!session.is_running()).then_some(()));
    assert!(truths.is(&replayed(&place), true));
    // A fill by the scene's own file goes on with the object, and so does a copy of the file.
    let fill = ["fill", "-o", "{}/a.holo", "--json", "--samples"];
    let scene = of_scene();
    place.run(&[&fill[..], &["1k"], &scene[..6]].concat()).ok();
    place.run(&["optimize", "{}/a.holo"]).ok();
    assert!(truths.is(&replayed(&place), true));

    // A closed file.
    let bake = |words: &[&str]| place.run(&[&["bake", "{}/a.holo"], words].concat());
    bake(&["the cube"]).failed(1, &["there is no object `the cube`"]);
    bake(&["--take-out", "a chair"]).failed(1, &["no object `a chair`", "there are the cube"]);
    assert_eq!(info(&place)["generation"], 3);
    bake(&["--take-out", "the cube"]).ok();
    assert_eq!(info(&place)["generation"], 4);
    place.run(&[&fill[..], &["300k"], &scene[..6]].concat()).ok();
    assert!(truths.is(&replayed(&place), false));
}

#[test]
fn an_object_that_moves_while_it_is_baked_is_baked_where_it_is_in_the_end() {
    let place = Place::new();
    let truths = truths(&place);
    let session = &mut walk(&place, &of_scene());
    wait_to_see(&place, session, &truths, false);
    session.write_line(&ADD_ELSEWHERE.replace("{}", &place.text("")));
    wait_for_carried(&place, 1);
    session.write_line(&format!("object bake the cube\n{MOVE}"));
    session.wait_for_error("goes on with the edited scene");
    wait_to_see(&place, session, &truths, true);
    wait_for_carried(&place, 0);
    assert_eq!(info(&place)["generation"], 1);
    session.write_line("object remove the cube");
    // A picture that is ordered before would not be drawn to its end.
    wait_until("the scene without the cube", || (info(&place)["generation"] == 2).then_some(()));
    wait_to_see(&place, session, &truths, false);
    // One that is taken away meanwhile does not become part of the scene.
    session.write_line(&ADD.replace("{}", &place.text("")));
    wait_for_carried(&place, 1);
    session.write_line("object bake the cube\nobject remove the cube");
    wait_for_carried(&place, 0);
    // If the scene was read before the second line came, that takes it out of the scene again.
    let is_out = || ["2", "4"].contains(&info(&place)["generation"].to_string().as_str());
    wait_until("the scene without the cube", || is_out().then_some(()));
    session.write_line("quit");
    wait_until("the session to end", || (!session.is_running()).then_some(()));
    assert!(is_out());
}

#[test]
fn a_script_bakes_an_object_and_takes_it_out_and_a_replay_does_neither() {
    let place = Place::new();
    let truths = truths(&place);
    let words = ["view", "--headless", "--script", "-", "--json", "--threads", "1"];
    let mut script = place.start(&[&words[..], &of_scene(), &VIEW].concat());
    let see = |script: &mut Process, is_baked: bool| {
        wait_until(&format!("the picture of the script, baked: {is_baked}"), || {
            let picture = taken(&place, |path| {
                script.write_line(&format!("picture {path}"));
                script.wait_for_line(&format!("{{\"picture\":\"{path}\""));
            });
            truths.is(&picture, is_baked).then_some(())
        });
    };
    script.write_line(&ADD.replace("{}", &place.text("")));
    script.write_line("object bake the cube");
    script.wait_for_error("goes on with the edited scene");
    see(&mut script, true);
    script.write_line("object remove the cube");
    see(&mut script, false);
    script.write_line("object bake the cube");
    script.wait().failed(1, &["there is no object `the cube`, and no other one"]);
    assert_eq!(info(&place)["generation"], 2);

    let replay = ["replay", "{}/a.holo", "--headless", "--script", "-"];
    let mut replay = place.start(&[&replay[..], &VIEW].concat());
    replay.write_line(&ADD.replace("{}", &place.text("")));
    replay.write_line("object bake the cube");
    replay.wait().failed(1, &["a replay only reads the holodeck", "holodeck bake FILE.holo"]);
}

#[test]
fn a_baked_object_that_is_moved_is_at_its_new_place_at_once_in_the_render_cache_and_leaves_no_ghost()
 {
    let place = Place::new();
    let empty_and_before = truths(&place);
    let there = [3.7, 1.7, 1.2];
    let moved = Truths { white: empty_and_before.painted, painted: joined(&place, there) };
    let words = ["view", "--headless", "--script", "-", "--json", "--threads", "1"];
    let driver = ["--driver", "pointimage"];
    let mut script = place.start(&[&words[..], &driver, &of_scene(), &VIEW].concat());
    let now = |script: &mut Process| {
        taken(&place, |path| {
            script.write_line(&format!("picture {path}"));
            script.wait_for_line(&format!("{{\"picture\":\"{path}\""));
        })
    };
    script.write_line(&ADD.replace("{}", &place.text("")));
    script.write_line("object bake the cube");
    script.wait_for_error("goes on with the edited scene");
    wait_until("the picture of the cube where it was baked", || {
        moved.is(&now(&mut script), false).then_some(())
    });
    let before = now(&mut script);
    script.write_line("object move the cube by 0.92 0 0");
    script.wait_for_error("goes on with the edited scene");
    // The points have moved with the cube, before anything was traced of it. Its front is black.
    let shown = now(&mut script);
    let (only_before, only_now) = (44..62, 6..26);
    let black = [&before, &shown]
        .map(|picture| [&only_before, &only_now].map(|columns| black_share(picture, columns)));
    println!("black where it was, and where it is: {black:.2?}");
    let [[was, _], [ghost, is]] = black;
    assert!(was > 0.8 && is > 0.8 && ghost < 0.1, "{black:?}");
    wait_until("the picture of the cube where it went", || {
        moved.is(&now(&mut script), true).then_some(())
    });
    script.write_line("object turn the chair by 5");
    script.wait().failed(1, &["there is no object `the chair`"]);
    assert_eq!(info(&place)["generation"], 2);
    assert!(moved.is(&replayed(&place), true), "the file has it where it went");

    // The same by a line of a walk.
    let session = &mut walk(&place, &["{}/a.holo"]);
    session.write_line("object move the cube to 2.78 1.7 1.2");
    session.wait_for_error("goes on with the edited scene");
    wait_to_see(&place, session, &moved, false);
}
