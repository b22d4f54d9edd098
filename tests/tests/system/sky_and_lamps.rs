//! The light of a scene is changed during a session: on a page, and by a script.

use std::time::Duration;

use holo_picture::{Picture, luminance};
use holo_tests::{Chromium, Place, wait_until};
use serde_json::Value;

/// A view of the page's proportions: outside of it, light before a change stays.
const VIEW: [&str; 8] =
    ["--vp", "1.5,1.5,1.5", "--vd", "-0.8,-1,-0.3", "--vh", "60", "--size", "64x36"];

/// A room of 4 by 4 by 2.5 with a window in the south, and a panel under the ceiling.
const ROOM: &str = "mtllib room.mtl
v -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nv -2 -2 2.5\nv 2 -2 2.5\nv 2 2 2.5\nv -2 2 2.5
v -2 -2 0.8\nv 2 -2 0.8\nv -1 0.5 2.45\nv 1 0.5 2.45\nv 1 1 2.45\nv -1 1 2.45
usemtl wall\nf 1 2 3 4\nf 5 8 7 6\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\nf 1 9 10 2
usemtl panel\nf 11 14 13 12
";

const MATERIALS: &str = "newmtl wall\nKd 0.5 0.5 0.5\nnewmtl panel\nKd 0 0 0\nKe 20 20 20\n";

const SECTION: &str = "-1.9,-1.9,0.1 3.8,0,0 0,3.8,0 0,0,2.2 3,3,3";

const PLACE: [&str; 2] = ["--place", "52.37,4.90"];

const NOON: &str = "2026-03-21T12:40+01:00";

const EVENING: &str = "2026-03-21T17:30+01:00";

fn room() -> Place {
    let place = Place::new();
    place.write("room.obj", ROOM);
    place.write("room.mtl", MATERIALS);
    place
}

/// The mean luminance of the room as the tracer has it.
fn truth(place: &Place, light: &[&str]) -> f64 {
    let words = ["render", "{}/room.obj", "--up", "z", "--unit", "m", "--engine", "path"];
    let more = ["--bounces", "0", "--spp", "256", "--denoise", "off", "-o", "{}/truth.pfm"];
    place.run(&[&words[..], &more, &VIEW, light].concat()).ok();
    mean(place, "truth.pfm")
}

fn mean(place: &Place, name: &str) -> f64 {
    let picture = Picture::read(place.path(name)).unwrap();
    // The window is much brighter than the room, and its edge is where pixels differ.
    let row = |pixels: &[[f32; 3]]| -> f64 {
        pixels.iter().map(|pixel| f64::from(luminance(*pixel))).sum()
    };
    let below = &picture.pixels[picture.pixels.len() / 2..];
    row(below) / below.len() as f64
}

/// Words that start a session in the room, under the sun of noon.
fn session<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let scene = ["view", "{}/room.obj", "--up", "z", "--unit", "m", "--section", SECTION];
    let light = ["--at", NOON, "--engine", "path", "--bounces", "0", "--threads", "1"];
    [&scene[..], &PLACE, &light, &["--keep", "{}/a.holo"], &VIEW, more].concat()
}

/// Compares the file's picture with the truth.
fn assert_shows(place: &Place, light: &[&str]) {
    let words = ["picture", "{}/a.holo", "--denoise", "off", "-o", "{}/shown.pfm"];
    place.run(&[&words[..], &VIEW].concat()).ok();
    let (shown, truth) = (mean(place, "shown.pfm"), truth(place, light));
    assert!((shown / truth - 1.0).abs() < 0.1, "shown {shown}, truth {truth}");
}

fn light(browser: &mut Chromium) -> Value {
    browser.value("state.light")
}

#[test]
fn hour_and_lamps_are_changed_in_the_panel_of_a_page() {
    let place = room();
    let mut session = place.start(&session(&["--no-open"]));
    let address = format!("http:{}", session.wait_for_line("http:"));
    let browser = &mut Chromium::open(&address);
    browser.wait("state && state.light && state.view_samples > 1000");
    browser.value("togglePanel()");
    assert_eq!(light(browser)["lamps"], serde_json::json!([["panel", 1], ["sun", 1], ["sky", 1]]));
    let shown = "[!$('light-panel').hidden && !$('f-sky').hidden, $('l-sky').value, \
        $('t-place').value, $('t-date').value, $('t-zone').value, $('o-hour').textContent, \
        $('lamps').children.length].join(' ')";
    assert_eq!(browser.value(shown), "true clear 52.37,4.9 2026-03-21 +01:00 12:40 3");
    assert!(browser.value("$('light-words').textContent.includes('sun 37.9')").as_bool().unwrap());

    // North is ahead on the plan until it is turned.
    let north = "$('north').getAttribute('transform')";
    assert!(browser.value(&format!("{north}.endsWith('rotate(0)')")).as_bool().unwrap());

    // A slider shows its value at once, and acts once it is released.
    browser.value("$('r-hour').value = 1050; $('r-hour').dispatchEvent(new Event('input'))");
    assert_eq!(browser.value("$('o-hour').textContent"), "17:30");
    assert_eq!(light(browser)["options"]["at"], NOON);
    // Two changes at once are made together.
    browser.value("$('r-hour').dispatchEvent(new Event('change'))");
    browser.value("$('lamp-0').value = 0; $('lamp-0').dispatchEvent(new Event('change'))");
    browser.wait(&format!("state.light && state.light.options.at === '{EVENING}'"));
    browser.wait("state.light.lamps[0][1] === 0");
    browser.wait("$('lamps').children[0].textContent === 'panel off'");
    // A lamp that is off stays in the list, and the sky it shares the session with too.
    assert_eq!(light(browser)["lamps"].as_array().unwrap().len(), 3);
    let options = [&PLACE[..], &["--at", EVENING, "--lamp", "panel=0"]].concat();
    let truth = truth(&place, &options);
    let mut pictures = 0;
    wait_until("the light of the evening", || {
        // Each picture has its own name, so that it is not taken for one before.
        pictures += 1;
        let name = format!("shown-{pictures}.pfm");
        session.write_line(&format!("picture {} 64x36", place.text(&name)));
        session.wait_for_error(&name);
        ((mean(&place, &name) / truth - 1.0).abs() < 0.1).then_some(())
    });

    // What cannot be is refused with a reason, and changes nothing.
    let before = light(browser);
    for (line, reason) in [
        ("lamp lantern 0.5", "there is no such lamp; there are sun, sky"),
        ("sky cloudy", "cloudy"),
        ("sky at 2026-02-30T12:00", "no day 30"),
        (&*format!("sky at {EVENING}"), "the light is as it was"),
    ] {
        // A reason is shown for seconds, so on a busy machine the browser may miss it.
        wait_until(reason, || {
            browser.value(&format!("command('{line}')"));
            std::thread::sleep(Duration::from_millis(300));
            let is_said = format!("(state.trouble || '').includes('{reason}')");
            (browser.value(&is_said) == true).then_some(())
        });
    }
    browser.value("command('sky /etc/a.hdr')");
    browser.wait("$('notice').textContent.includes('names no files')");
    assert_eq!(light(browser), before);
    browser.value("command('quit')");
    session.wait().ok();
    let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    assert!((1..=2).contains(&info["generation"].as_u64().unwrap()), "{info}");
}

#[test]
fn a_script_changes_the_light_and_a_replay_has_no_light_to_change() {
    let place = room();
    place.write("walk.txt", "1 sky overcast\n1 lamp panel 0\n6 quit\n");
    place.run(&session(&["--headless", "--script", "{}/walk.txt"])).ok();
    let options = [&PLACE[..], &["--at", NOON, "--sky", "overcast", "--lamp", "panel=0"]].concat();
    assert_shows(&place, &options);
    // A wrong line ends the script with a reason.
    place.write("wrong.txt", "lamp lantern 0\n");
    let wrong = ["view", "{}/a.holo", "--headless", "--script", "{}/wrong.txt"];
    place.run(&wrong).failed(1, &["there is no such lamp"]);

    let words = ["replay", "{}/a.holo", "--no-open"];
    let mut session = place.start(&[&words[..], &VIEW].concat());
    let browser = &mut Chromium::open(&format!("http:{}", session.wait_for_line("http:")));
    browser.wait("document.body.dataset.rest === 'true'");
    browser.value("togglePanel()");
    assert_eq!(browser.value("$('light-panel').hidden && state.light === null"), true);
    browser.value("command('sky clear')");
    browser.wait("(state.trouble || '').includes('whoever has can')");
    session.write_line("quit");
    session.wait().ok();
}
