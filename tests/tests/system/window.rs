//! A walk in a real window, on a desktop without a screen.

use holo_picture::{Exposure, Look, Picture};
use holo_tests::{CORNELL_SMALL_SECTION, Desktop, Place, wait_until};
use rustix::process::Signal;

const VIEW: [&str; 6] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60"];

/// Symbols of keys that write no letter.
const ESCAPE: u32 = 0xff1b;
const CONTROL: u32 = 0xffe3;

fn letter(letter: char) -> u32 {
    u32::from(letter)
}

/// The views that a walk has recorded, each with its eye.
fn recorded(place: &Place) -> Vec<[f64; 3]> {
    let script = std::fs::read_to_string(place.path("w.txt")).unwrap_or_default();
    let eye = |line: &str| {
        let numbers = line.split_once("-vp ")?.1.split(' ').take(3);
        numbers.map(|number| number.parse().ok()).collect::<Option<Vec<f64>>>()?.try_into().ok()
    };
    script.lines().filter_map(eye).collect()
}

#[test]
fn a_window_shows_the_picture_and_one_walks_approaches_and_quits_in_it() {
    let place = Place::new();
    place.fill_small_with("a.holo", "200k", &["--bounces", "0"]);
    let more = ["--driver", "quadtree", "--size", "640x360"];
    let picture = ["picture", "{}/a.holo", "-o", "{}/p.pfm"];
    place.run(&[&picture[..], &VIEW, &more].concat()).ok();
    let picture = Picture::read(place.path("p.pfm")).unwrap();
    let shown = |false_color| {
        let exposure = Exposure::Factor(0.5);
        Look { exposure, false_color, ..Look::default() }.show(&picture).rgb
    };

    let desktop = Desktop::new();
    let words = ["replay", "{}/a.holo", "--window", "--exposure==0.5", "--record", "{}/w.txt"];
    let session = place.start_on(&desktop.name, &[&words[..], &VIEW, &more].concat());
    let window = desktop.window();
    // Without text over it, the window shows what `picture` makes of the same view.
    desktop.write("i");
    let wait_for_picture = || {
        desktop.wait_for_pixels("the whole picture", window, |pixels| pixels == shown(false));
    };
    wait_for_picture();

    // The keys lie over the picture until they are closed.
    desktop.write("?");
    desktop.wait_for_pixels("the keys", window, |pixels| {
        pixels[..300] != shown(false)[..300] && pixels.len() == 3 * 640 * 360
    });
    desktop.press(ESCAPE);
    wait_for_picture();

    // Luminance as colours; the legend is on the left.
    desktop.write("j");
    let (colors, right) = (shown(true), 3 * 320..3 * 640);
    desktop.wait_for_pixels("false colours", window, |pixels| {
        pixels[right.clone()] == colors[right.clone()]
    });
    desktop.write("j");
    wait_for_picture();

    // A key that is held walks until it is released.
    let home = [2.78, 2.73, -2.0];
    desktop.key(letter('w'), true);
    wait_until("a step ahead", || {
        recorded(&place).last().is_some_and(|eye| eye[2] > -1.9).then_some(())
    });
    desktop.key(letter('w'), false);
    let eyes = recorded(&place);
    assert!(eyes.iter().all(|eye| eye[..2] == home[..2]), "{eyes:?}");
    desktop.write("h");
    wait_for_picture();

    // The wheel approaches what is under the cursor.
    desktop.move_to((420, 180));
    desktop.button(4, true);
    desktop.button(4, false);
    wait_until("an approach", || {
        recorded(&place).last().is_some_and(|eye| eye[0] != home[0]).then_some(())
    });
    desktop.write("h");
    wait_for_picture();

    desktop.key(CONTROL, true);
    desktop.press(letter('q'));
    desktop.key(CONTROL, false);
    session.wait().ok();
    let script = std::fs::read_to_string(place.path("w.txt")).unwrap();
    assert!(script.ends_with(" quit\n"), "{script}");
}

#[test]
fn a_window_gets_clearer_while_rays_are_traced_and_closes_when_the_program_is_asked_to_end() {
    let place = Place::new();
    let desktop = Desktop::new();
    let words = ["view", "--config", "{}/cornell.toml", "--section", CORNELL_SMALL_SECTION];
    let more = ["--threads", "1", "--window", "--size", "320x180"];
    let session = place.start_on(&desktop.name, &[&words[..], &VIEW, &more].concat());
    let window = desktop.window();
    desktop.write("i");
    let mean = |pixels: &[u8]| {
        pixels.iter().map(|&byte| u64::from(byte)).sum::<u64>() / pixels.len() as u64
    };
    desktop.wait_for_pixels("a lit picture", window, |pixels| mean(pixels) > 40);
    session.end(Signal::TERM).ok();
}

#[test]
fn without_a_desktop_a_window_says_what_to_do_instead() {
    let place = Place::new();
    place.fill_small_with("a.holo", "10k", &["--bounces", "0"]);
    for desktop in ["", ":no-such-desktop"] {
        let session = place.start_on(desktop, &["replay", "{}/a.holo", "--window"]);
        session.wait().failed(1, &["no window can be opened", "--http", "--headless"]);
    }
}
