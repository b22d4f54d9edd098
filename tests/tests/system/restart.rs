//! A scene is edited while somebody walks in it, or between two fills.

mod baked;
mod joined;
mod moved;

use std::{
    path::Path,
    sync::atomic::{AtomicU32, Ordering},
};

use holo_picture::Picture;
use holo_tests::{CORNELL_SMALL_SECTION, Place, Process, stored, wait_until};
use rustix::process::Signal;

const VIEW: [&str; 8] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60", "--size", "96x72"];
const SIZE: &str = "96x72";

/// The walls in another paint.
const WHITE: &str = "Kd 0.73 0.73 0.73";
const PAINTED: &str = "Kd 0.73 0.1 0.1";

/// Changes the materials.
fn edit(place: &Place, from: &str, to: &str) {
    let before = std::fs::read_to_string(place.path("cornell.mtl")).unwrap();
    assert!(before.contains(from), "{before}");
    place.write("cornell.mtl", &before.replacen(from, to, 1));
}

/// Traces the scene as it is, with direct light alone.
fn truth(place: &Place, name: &str) -> Picture {
    let output = place.text(name);
    let render =
        ["render", "--config", "{}/cornell.toml", "--bounces", "0", "--spp", "64", "-o", &output];
    place.run(&[&render[..], &VIEW].concat()).ok();
    Picture::read(Path::new(&output)).unwrap()
}

/// The mean difference of two pictures.
fn difference(one: &Picture, other: &Picture) -> f64 {
    let pixels = one.pixels.as_flattened().iter().zip(other.pixels.as_flattened());
    let sum: f64 = pixels.map(|(a, b)| f64::from((a - b).abs())).sum();
    sum / one.pixels.len() as f64
}

/// The section's walls and the light on them, in two paints.
struct Truths {
    white: Picture,
    painted: Picture,
}

impl Truths {
    /// Traces the scene in both paints. It is white afterwards.
    fn of(place: &Place) -> Truths {
        let white = truth(place, "white.pfm");
        edit(place, WHITE, PAINTED);
        let painted = truth(place, "painted.pfm");
        edit(place, PAINTED, WHITE);
        Truths { white, painted }
    }

    /// Whether a picture is clearly that of one paint: much nearer to it than the two are to each
    /// other.
    fn is(&self, picture: &Picture, painted: bool) -> bool {
        let truth = if painted { &self.painted } else { &self.white };
        difference(picture, truth) < difference(&self.white, &self.painted) / 8.0
    }
}

/// Starts a session in which somebody could walk.
fn walk(place: &Place, what: &[&str]) -> Process {
    let words = ["view", "--no-open", "--threads", "1"];
    let mut session = place.start(&[&words[..], what, &VIEW].concat());
    session.wait_for_line("http:");
    session
}

fn of_scene() -> [&'static str; 8] {
    let section = CORNELL_SMALL_SECTION;
    let config = "{}/cornell.toml";
    ["--config", config, "--section", section, "--bounces", "0", "--keep", "{}/a.holo"]
}

/// Waits until the session shows one of the paints.
fn wait_to_see(place: &Place, session: &mut Process, truths: &Truths, painted: bool) {
    wait_until(&format!("the picture of the scene, painted: {painted}"), || {
        truths.is(&shown(place, session), painted).then_some(())
    });
}

/// What the session shows now.
fn shown(place: &Place, session: &mut Process) -> Picture {
    taken(place, |path| {
        session.write_line(&format!("picture {path} {SIZE}"));
        session.wait_for_error(&format!("wrote {path}"));
    })
}

/// A picture that is written to a new file.
fn taken(place: &Place, write: impl FnOnce(&str)) -> Picture {
    /// Each picture has its own name, so that it is not taken for one before.
    static PICTURES: AtomicU32 = AtomicU32::new(0);
    let number = PICTURES.fetch_add(1, Ordering::Relaxed);
    let path = place.text(&format!("shown-{number}.pfm"));
    write(&path);
    let picture = Picture::read(Path::new(&path)).unwrap();
    std::fs::remove_file(&path).unwrap();
    picture
}

fn restart(session: &mut Process) {
    session.write_line("restart");
    session.write_line("restart");
}

#[test]
fn an_edited_scene_is_loaded_into_a_session_and_its_light_replaces_that_of_the_one_before() {
    let place = Place::new();
    let truths = Truths::of(&place);
    let session = &mut walk(&place, &of_scene());
    wait_to_see(&place, session, &truths, false);
    // A scene that is as before, and one that cannot be read: the session goes on.
    restart(session);
    session.wait_for_error("cornell.obj is as it was");
    wait_to_see(&place, session, &truths, false);
    edit(&place, WHITE, PAINTED);
    let model = std::fs::read_to_string(place.path("cornell.obj")).unwrap();
    // As a program leaves it that has begun to save.
    place.write("cornell.obj", "");
    restart(session);
    session.wait_for_error("cornell.obj: no triangle in it");
    wait_to_see(&place, session, &truths, false);
    let before = stored(&place.path("a.holo"));

    place.write("cornell.obj", &model);
    restart(session);
    session.wait_for_error("goes on with the edited scene: material `white` differs");
    wait_to_see(&place, session, &truths, true);
    // Nothing that was stored is lost, and what counts is of the present scene.
    let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    assert_eq!(info["generation"], 1);
    assert!(before.count() > 0 && info["earlier_samples"].as_u64().unwrap() >= before.count());
}

#[test]
fn a_session_that_is_killed_right_after_a_restart_goes_on_where_it_was() {
    let place = Place::new();
    place.fill_small_with("a.holo", "100k", &["--bounces", "0"]);
    let before = stored(&place.path("a.holo"));
    let truths = Truths::of(&place);
    edit(&place, WHITE, PAINTED);
    // The file says how its scene is read.
    let mut session = walk(&place, &["{}/a.holo"]);
    restart(&mut session);
    session.wait_for_error("goes on with the edited scene");
    // Its server and worker have ended, too: they share its standard error.
    session.end(Signal::KILL);
    place.run(&["verify", "{}/a.holo"]).ok();
    let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    assert_eq!(info["generation"], 1);
    assert!(info["earlier_samples"].as_u64().unwrap() >= before.count());
    let mut session = walk(&place, &["{}/a.holo"]);
    wait_to_see(&place, &mut session, &truths, true);
    session.write_line("quit");
    session.wait().ok();
    // Whoever replays the file sees the same scene.
    let picture = ["picture", "{}/a.holo", "-o", "{}/replayed.pfm", "-q"];
    place.run(&[&picture[..], &VIEW].concat()).ok();
    assert!(truths.is(&Picture::read(place.path("replayed.pfm")).unwrap(), true));
}

#[test]
fn a_file_of_the_scene_before_an_edit_goes_on_with_it_if_one_says_so() {
    let place = Place::new();
    let fill = |words: &[&str]| {
        let all = ["fill", "-o", "{}/a.holo", "--samples", "30k", "--json"];
        let scene = ["--config", "{}/cornell.toml", "--section", CORNELL_SMALL_SECTION];
        place.run(&[&all[..], &scene, words].concat())
    };
    fill(&[]).ok();
    edit(&place, WHITE, PAINTED);
    fill(&[]).failed(1, &["a.holo", "another scene", "material `white` differs", "--restart"]);
    let elsewhere = "0,0,-3 5,0,0 0,5,0 0,0,2 3,3,3";
    let sections = ["--restart", "--section", elsewhere];
    let other = ["fill", "-o", "{}/a.holo", "--config", "{}/cornell.toml"];
    place
        .run(&[&other[..], &sections].concat())
        .failed(1, &["a.holo cannot go on", "sections differ", "another file"]);
    let info = || place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    assert_eq!(
        (info()["generation"].clone(), info()["earlier_samples"].clone()),
        (0.into(), 0.into())
    );
    let before = info()["samples"].as_u64().unwrap();
    fill(&["--restart"]).ok();
    assert_eq!(
        (info()["generation"].clone(), info()["earlier_samples"].clone()),
        (1.into(), before.into())
    );
    // Said again, it changes nothing: the scene is the file's.
    fill(&["--restart"]).ok();
    assert_eq!(info()["generation"], 1);
    assert!(info()["samples"].as_u64().unwrap() >= 60_000);
}
