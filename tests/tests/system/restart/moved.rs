//! An object of the scene is moved.

use holo_picture::{Picture, luminance};
use holo_tests::{Place, Process, wait_until};

use super::{VIEW, of_scene, restart, shown, taken, truth, walk};

/// A red block before the back wall, where the lamp shines on it, at this x.
fn with_block(model: &str, x: f64) -> String {
    let vertices = model.lines().filter(|line| line.starts_with("v ")).count();
    let mut text = format!("{model}o block\nusemtl red\n");
    for corner in 0..8 {
        let end = |axis: u32, low: f64, high: f64| if corner >> axis & 1 == 0 { low } else { high };
        let (x, y, z) = (end(0, x, x + 1.0), end(1, 3.7, 5.1), end(2, 4.6, 5.2));
        text += &format!("v {x} {y} {z}\n");
    }
    for face in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]]
    {
        let corners = face.map(|corner| (vertices + corner).to_string());
        text += &format!("f {}\n", corners.join(" "));
    }
    text
}

/// Whether a pixel shows red paint: in the light of the lamp, no other paint reflects so little
/// green.
fn is_red(pixel: [f32; 3]) -> bool {
    pixel[0] > 0.02 && pixel[1] < 0.3 * pixel[0]
}

/// Where the block is before it is moved, and after.
const BEFORE: f64 = 1.0;
const AFTER: f64 = 3.2;

/// Two pictures of the scene, between which the block has moved.
struct Places {
    /// The scene without the block.
    model: String,
    before: Picture,
    after: Picture,
}

impl Places {
    /// Traces both. The block is at its place before afterwards.
    fn of(place: &Place) -> Places {
        let model = std::fs::read_to_string(place.path("cornell.obj")).unwrap();
        let traced = |x| {
            place.write("cornell.obj", &with_block(&model, x));
            truth(place, "truth.pfm")
        };
        let (after, before) = (traced(AFTER), traced(BEFORE));
        let places = Places { model, before, after };
        assert!(places.pixels().iter().all(|pixels| pixels.len() > 100));
        let unlike = places.unlike(&places.before, &places.after);
        assert_eq!(unlike[0], 1.0, "the pixels are of two places");
        places
    }

    /// Puts the block at this x.
    fn put(&self, place: &Place, x: f64) {
        place.write("cornell.obj", &with_block(&self.model, x));
    }

    /// The pixels that show the block in only one of the two pictures: in that before, and in that
    /// after.
    fn pixels(&self) -> [Vec<usize>; 2] {
        let pairs = || self.before.pixels.iter().zip(&self.after.pixels).enumerate();
        let only = |shows: fn(bool, bool) -> bool| {
            let found = pairs().filter(|(_, (a, b))| shows(is_red(**a), is_red(**b)));
            found.map(|(at, _)| at).collect::<Vec<_>>()
        };
        [only(|before, after| before && !after), only(|before, after| after && !before)]
    }

    /// Compares two pictures at the two places of the block. Returns the larger share of pixels
    /// that show red in only one picture, and the larger relative difference of light.
    fn unlike(&self, picture: &Picture, truth: &Picture) -> [f64; 2] {
        let mut most = [0.0f64; 2];
        for place in self.pixels() {
            let other = |at: &&usize| is_red(picture.pixels[**at]) != is_red(truth.pixels[**at]);
            let red = place.iter().filter(other).count() as f64 / place.len() as f64;
            let light = |picture: &Picture| -> f64 {
                place.iter().map(|&at| f64::from(luminance(picture.pixels[at]))).sum()
            };
            most = [most[0].max(red), most[1].max((light(picture) / light(truth) - 1.0).abs())];
        }
        most
    }
}

/// Moves the block in a session. Waits until pictures show it at its new place, and no longer at
/// the earlier one. `except` is the share of its pixels, and of its light, that may still be wrong.
fn moves(driver: &str, except: [f64; 2]) {
    let place = Place::new();
    let places = Places::of(&place);
    let mut session = walk(&place, &[&of_scene()[..], &["--driver", driver]].concat());
    let wait_for = |truth: &Picture, session: &mut Process| {
        wait_until(&format!("the block at its place, with the driver {driver}"), || {
            let unlike = places.unlike(&shown(&place, session), truth);
            (unlike[0] <= except[0] && unlike[1] <= except[1]).then_some(())
        });
    };
    wait_for(&places.before, &mut session);
    places.put(&place, AFTER);
    restart(&mut session);
    session.wait_for_error("goes on with the edited scene");
    wait_for(&places.after, &mut session);
}

#[test]
fn surfaces_show_an_object_where_it_was_moved_and_nothing_where_it_was() {
    moves("surfaces", [0.02, 0.05]);
}

#[test]
fn a_quadtree_shows_an_object_where_it_was_moved_and_little_where_it_was() {
    moves("quadtree", [0.1, 0.1]);
}

#[test]
fn a_replay_after_a_move_shows_new_samples_alone_once_enough_have_come() {
    let place = Place::new();
    let places = Places::of(&place);
    let fill = |samples: &str, more: &[&str]| {
        place.fill_small_with("a.holo", samples, &[&["--bounces", "0"], more].concat());
    };
    let unlike = |driver: &str| {
        let picture = taken(&place, |path| {
            let words = ["picture", "{}/a.holo", "-q", "-o", path, "--driver", driver];
            place.run(&[&words[..], &VIEW].concat()).ok();
        });
        places.unlike(&picture, &places.after)
    };
    fill("1M", &[]);
    places.put(&place, AFTER);
    fill("5k", &["--restart"]);
    // Samples of the scene before are still shown: by a quadtree at their own places, and by
    // surfaces as the light of what is there now.
    let [red, _] = unlike("quadtree");
    assert!(red > 0.8, "{red}");
    let [_, light] = unlike("surfaces");
    assert!(light > 0.2, "{light}");
    // As many new ones as old ones: no old one is left.
    fill("1M", &[]);
    let [red, light] = unlike("quadtree");
    assert!(red < 0.05 && light < 0.05, "{red} {light}");
    let [red, light] = unlike("surfaces");
    assert!(red < 0.02 && light < 0.03, "{red} {light}");
}
