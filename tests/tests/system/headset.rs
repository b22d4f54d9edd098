//! An exported page in a headset, as the WebXR emulator `iwer` shows it in Chromium.
//!
//! `scripts/test` installs the emulator. Without it, these tests say so and check nothing.

use std::{fs, path::Path};

use holo_tests::{Chromium, Place};
use serde_json::{Value, json};

use super::export::{FLAGS, exported, serve};

/// The emulator, where `scripts/test` puts it.
const EMULATOR: &str = concat!(env!("CARGO_TARGET_TMPDIR"), "/iwer-2.5.0.min.js");

/// Metres per unit of the scene.
const UNIT: f64 = 0.5;

/// Distance from the eye to the disc, metres.
const DISTANCE: f64 = 2.5;

/// Distance between splats, units. It is so small that the disc's middle is where it is seen.
const SPACING: f64 = 0.06;

/// Pixels of each eye's picture: half of Chromium's page.
const EYE: (f64, f64) = (640.0, 720.0);

/// Pixels at a tangent of 1: each eye sees 90° from top to bottom.
const FOCAL: f64 = EYE.1 / 2.0;

/// Distance between the emulator's eyes, metres.
const EYES: f64 = 0.063;

/// Puts the emulator on, before the page's own scripts.
const PUT_ON: &str = "window.device = new IWER.XRDevice(IWER.metaQuest3,
      { stereoEnabled: true, visibilityMask: null });
    device.installRuntime({ forceInstall: true });";

/// Measures the light in each eye's picture of the next frame: its middle in pixels from the left
/// and the top, and the number of lit pixels.
const MEASURE: &str = "new Promise((done) => device.activeSession.requestAnimationFrame(() => {
  const gl = document.getElementById('picture').getContext('webgl2');
  const [width, height] = [gl.drawingBufferWidth / 2, gl.drawingBufferHeight];
  const bytes = new Uint8Array(width * height * 4);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  done([0, width].map((left) => {
    gl.readPixels(left, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    let [x, y, count] = [0, 0, 0];
    for (let at = 0; at < width * height; at++) if (bytes[at * 4] > 127) {
      [x, y, count] = [x + at % width + .5, y + height - Math.floor(at / width) - .5, count + 1];
    }
    return [x / count, y / count, count];
  }));
}))";

/// Opens a page with the emulator; `None` if it is not installed.
fn open(address: &str, put_on: &str) -> Option<Chromium> {
    let Ok(emulator) = fs::read_to_string(EMULATOR) else {
        eprintln!("skipped: {EMULATOR} is not here; scripts/test installs it");
        return None;
    };
    let mut browser = Chromium::open_with("about:blank", &FLAGS.map(str::to_owned));
    let source = json!({ "source": format!("{emulator};{put_on}") });
    browser.call("Page.enable", json!({}));
    browser.call("Page.addScriptToEvaluateOnNewDocument", source);
    browser.go_to(address, "document.body && document.body.dataset.complete");
    browser.wait("!document.getElementById('b-headset').hidden");
    Some(browser)
}

/// CRC-32, as in a manifest.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 * (crc & 1)))
    })
}

/// Replaces the scene of an export by a white disc ahead of the eye, and a black one behind it.
fn show_a_disc(folder: &Path) {
    const BLACK_BEHIND: u64 = 15 | 15 << 10 | 15 << 21;
    let root = 15 | 15 << 5 | 15 << 10 | 7 << 15 | 1 << 18 | 15 << 21 | 3 << 31;
    let ahead = 15 | 30 << 5 | 15 << 10 | 7 << 15 | 15 << 21 | 4095 << 33 | 42 << 45 | 42 << 52;
    let data: Vec<u8> =
        [root, ahead, BLACK_BEHIND].into_iter().flat_map(u64::to_le_bytes).collect();
    let page = folder.join("index.html");
    let text = fs::read_to_string(&page).unwrap();
    let (start, end) = (text.find("{\"format\"").unwrap(), text.find("}</script>").unwrap() + 1);
    let mut manifest: Value = serde_json::from_str(&text[start..end]).unwrap();
    let distance = DISTANCE / UNIT;
    let changes = json!({
        "nodes": 3, "levels": [0, 1], "origin": [10, 20, 30], "centre": [0, 0, 0], "radius": 3,
        "peak": 0, "spacing": SPACING, "unit": UNIT, "up": [0, 0, 1], "sky": [0, 0, 0],
        "exposure": 1, "surfaces": null,
        "pieces": [{ "file": "data/00000.bin", "bytes": data.len(), "crc": crc32(&data) }],
        "views": [{ "name": "ahead", "vp": [10, 23.0 - distance, 30], "vd": [0, 1, 0], "vh": 60 }],
    });
    let changes = changes.as_object().unwrap().clone();
    manifest.as_object_mut().unwrap().extend(changes);
    fs::write(folder.join("data/00000.bin"), data).unwrap();
    fs::write(&page, format!("{}{manifest}{}", &text[..start], &text[end..])).unwrap();
}

/// Returns where an eye's picture has the disc, pixels: for a head that is `right` and `ahead` of
/// the page's eye, metres, and turned to the left. `side` is -1 for the left eye.
fn expected(side: f64, right: f64, ahead: f64, turned: f64) -> f64 {
    let (sine, cosine) = turned.to_radians().sin_cos();
    let offset = side * EYES / 2.0;
    let (x, y) = (-right - offset * cosine, DISTANCE - ahead - offset * sine);
    // The head's own axes.
    EYE.0 / 2.0 + FOCAL * (x * cosine + y * sine) / (y * cosine - x * sine)
}

/// Compares the next frame with a head's place. Returns the numbers of lit pixels.
#[track_caller]
fn check(browser: &mut Chromium, right: f64, ahead: f64, turned: f64) -> [f64; 2] {
    let eyes: [[f64; 3]; 2] = serde_json::from_value(browser.value(MEASURE)).unwrap();
    let wanted = [-1.0, 1.0].map(|side| expected(side, right, ahead, turned));
    for ([x, y, _], wanted) in eyes.iter().zip(wanted) {
        assert!((x - wanted).abs() < 0.5, "{eyes:?} {wanted}");
        assert!((y - EYE.1 / 2.0).abs() < 0.5, "{eyes:?}");
    }
    let disparity = eyes[0][0] - eyes[1][0];
    assert!((disparity - (wanted[0] - wanted[1])).abs() < 0.5, "{disparity} {wanted:?}");
    eyes.map(|eye| eye[2])
}

fn eye(browser: &mut Chromium) -> [f64; 4] {
    let eye = "[...holodeck.eye.at, holodeck.eye.turn]";
    serde_json::from_value(browser.value(eye)).unwrap()
}

#[test]
fn a_headset_shows_two_eyes_that_follow_the_head_in_metres() {
    let place = Place::new();
    let folder = exported(&place);
    show_a_disc(&folder);
    let Some(browser) = &mut open(&serve(folder), PUT_ON) else { return };
    browser.wait("document.body.dataset.moving === 'no'");
    let before = eye(browser);
    browser.value("document.getElementById('b-headset').click()");
    browser.wait("document.body.dataset.worn");

    // The head is where the page's eye was, and looks where it looked.
    let near = check(browser, 0.0, 0.0, 0.0);
    let radius = FOCAL * SPACING * 0.15 * 3.5_f64.exp2() * UNIT / DISTANCE;
    let area = std::f64::consts::PI * radius * radius;
    assert!(near.iter().all(|lit| (lit / area - 1.0).abs() < 0.1), "{near:?} {area}");
    // The next frame shows each movement.
    browser.value("device.position.set(.3, 1.6, 0)");
    check(browser, 0.3, 0.0, 0.0);
    browser.value("device.position.set(.3, 1.6, -1)");
    let nearer = check(browser, 0.3, 1.0, 0.0);
    assert!(nearer[0] > 2.0 * near[0], "{near:?} {nearer:?}");
    let half: f64 = 5_f64.to_radians();
    browser.value(&format!("device.quaternion.set(0, {}, 0, {})", half.sin(), half.cos()));
    check(browser, 0.3, 1.0, 10.0);

    // It ends, and the page goes on where the head was.
    let frames = browser.value("holodeck.facts.frames");
    browser.value("document.getElementById('b-headset').click()");
    browser.wait("!document.body.dataset.worn && document.body.dataset.moving === 'no'");
    browser.wait(&format!("holodeck.facts.frames > {frames} + 1"));
    let after = eye(browser);
    let moved: Vec<f64> = after.iter().zip(before).map(|(after, before)| after - before).collect();
    for (moved, wanted) in moved.iter().zip([0.3 / UNIT, 1.0 / UNIT, 0.0, -2.0 * half]) {
        assert!((moved - wanted).abs() < 1e-4, "{moved} {wanted}");
    }
    assert_eq!(browser.value("document.getElementById('picture').width"), 1280);
}

#[test]
fn in_a_headset_sticks_and_triggers_walk_and_turn() {
    let place = Place::new();
    let folder = exported(&place);
    show_a_disc(&folder);
    let Some(browser) = &mut open(&serve(folder), PUT_ON) else { return };
    browser.value("document.getElementById('b-headset').click()");
    browser.wait("document.body.dataset.worn");
    let start = eye(browser);
    let stick = |hand: &str, x: i32, y: i32| {
        format!("device.controllers.{hand}.updateAxes('thumbstick', {x}, {y})")
    };
    // The left stick walks where the head looks.
    browser.value(&stick("left", 0, -1));
    browser.wait(&format!("holodeck.eye.at[1] > {} + .2", start[1]));
    browser.value(&stick("left", 0, 0));
    check_still(browser);
    let walked = eye(browser);
    assert!((walked[0] - start[0]).abs() < 1e-6 && (walked[2] - start[2]).abs() < 1e-6);
    check(browser, 0.0, (walked[1] - start[1]) * UNIT, 0.0);
    // The right one turns in one step of 30° for each push, on the spot.
    browser.value(&stick("right", 1, 0));
    browser.wait(&format!("holodeck.eye.turn > {}", walked[3] + 0.5));
    check_still(browser);
    let turned = eye(browser);
    assert!((turned[3] - walked[3] - 30_f64.to_radians()).abs() < 1e-6, "{turned:?}");
    check(browser, 0.0, (turned[1] - start[1]) * UNIT, -30.0);
    // It also raises and lowers the person.
    browser.value(&stick("right", 0, -1));
    browser.wait(&format!("holodeck.eye.at[2] > {} + .1", start[2]));
    browser.value(&stick("right", 0, 0));
    check_still(browser);
    // A trigger walks where it points: here to the right of the head's new heading, by 90°.
    let before = eye(browser);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    browser.value(&format!("device.controllers.right.quaternion.set(0, {}, 0, {half})", -half));
    browser.value("device.controllers.right.updateButtonValue('trigger', 1)");
    browser.wait(&format!("holodeck.eye.at[0] > {} + .1", before[0]));
    browser.value("device.controllers.right.updateButtonValue('trigger', 0)");
    check_still(browser);
    let pointed = eye(browser);
    let (x, y) = (pointed[0] - before[0], pointed[1] - before[1]);
    assert!((y / x + 30_f64.to_radians().tan()).abs() < 1e-3, "{x} {y}");
}

/// Waits until the head has stayed at a place for some frames.
#[track_caller]
fn check_still(browser: &mut Chromium) {
    let still = "new Promise((done) => {
      let [last, count] = ['', 0];
      const look = () => {
        const now = JSON.stringify(holodeck.eye);
        [last, count] = [now, now === last ? count + 1 : 0];
        if (count === 3) done(true); else device.activeSession.requestAnimationFrame(look);
      };
      look();
    })";
    assert_eq!(browser.value(still), true);
}

#[test]
fn a_headset_that_refuses_leaves_the_page_as_it_is() {
    let place = Place::new();
    let folder = exported(&place);
    let refuses = format!(
        "{PUT_ON} navigator.xr.requestSession = () => Promise.reject(new Error('it is busy'));"
    );
    let Some(browser) = &mut open(&serve(folder), &refuses) else { return };
    browser.value("document.getElementById('b-headset').click()");
    browser.wait("!document.getElementById('headset-note').hidden");
    let sentence = browser.value("document.getElementById('headset-note').textContent");
    assert_eq!(sentence, "The headset cannot be used: it is busy");
    assert_eq!(browser.value("document.body.dataset.failed ?? null"), Value::Null);
    let frames = browser.value("holodeck.facts.frames");
    browser.press("KeyH", "h");
    browser.wait(&format!("holodeck.facts.frames > {frames}"));
}
