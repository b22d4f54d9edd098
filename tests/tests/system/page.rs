//! The page of a walk: saving, shapes, keys, walls, hidden tabs.

use std::{
    io::{Read, Write},
    net::TcpStream,
};

use holo_tests::{Chromium, Place, Process, wait_until};

const VIEW: [&str; 6] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60"];

/// Starts a replay of a small file. Returns it with the page's address.
#[track_caller]
fn replay(place: &Place) -> (Process, String) {
    place.fill_small_with("a.holo", "100k", &["--bounces", "0"]);
    let words = ["replay", "{}/a.holo", "--no-open"];
    let mut session = place.start(&[&words[..], &VIEW].concat());
    let address = format!("http:{}", session.wait_for_line("http:"));
    (session, address)
}

#[track_caller]
fn wait_for_rest(browser: &mut Chromium) {
    browser.wait("document.body.dataset.rest === 'true' && document.body.dataset.exact === 'true'");
}

/// Returns the status of an answer to a request with these further headers.
fn status(address: &str, path: &str, headers: &str) -> String {
    let host = address.trim_start_matches("http://").trim_end_matches('/');
    let mut stream = TcpStream::connect(host).unwrap();
    let request =
        format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{headers}\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut start = [0; 12];
    stream.read_exact(&mut start).unwrap();
    String::from_utf8_lossy(&start[9..]).into_owned()
}

/// Returns the eye's place in the latest frame.
fn eye(browser: &mut Chromium) -> [f64; 3] {
    serde_json::from_value(browser.value("header.view.eye")).unwrap()
}

#[test]
fn a_large_picture_is_drawn_beside_the_walk_and_only_for_the_page() {
    let place = Place::new();
    let (session, address) = replay(&place);
    let large = "/picture.png?size=8192x8192";
    assert_eq!(status(&address, large, ""), "403");
    let own = format!("Origin: {}\r\n", address.trim_end_matches('/'));
    let cross = "Sec-Fetch-Site: cross-site\r\n";
    assert_eq!(status(&address, large, &format!("{own}{cross}")), "403");
    assert_eq!(status(&address, "/picture.png", cross), "403");

    let browser = &mut Chromium::open(&address);
    wait_for_rest(browser);
    // What cannot be a size is refused where it is typed.
    let typed = |browser: &mut Chromium, size: &str| {
        browser.value(&format!("$('t-size').value = '{size}'; pictureLinks()"));
        browser.value("$('t-size').getAttribute('aria-invalid') === 'true'")
    };
    for (size, is_wrong) in
        [("99999x99999", true), ("0x5", true), ("12", true), ("640x480", false), ("", false)]
    {
        assert_eq!(typed(browser, size), is_wrong, "{size}");
    }
    // The eye turns while a picture is drawn, and a second picture waits for nobody.
    browser.value(
        "window.stop = new AbortController(); \
         window.saved = fetch('picture.hdr?size=8192x8192', { method: 'POST', signal: stop.signal }) \
             .then(answer => answer.blob()).then(blob => blob.size, error => error.name); 0",
    );
    browser.wait("state.saving !== null && state.saving > 0");
    assert_eq!(status(&address, large, &own), "409");
    let before = browser.value("document.body.dataset.options");
    browser.drag((640, 360), (700, 380), 1);
    browser.wait(&format!("document.body.dataset.options !== {before}"));
    wait_for_rest(browser);
    assert_eq!(browser.value("state.saving !== null"), true, "it goes on");
    // The drawing ends with its client, and the next one can begin.
    browser.value("stop.abort()");
    browser.wait("state.saving === null");
    assert_eq!(browser.value("saved"), "AbortError");
    let small = "fetch('picture.hdr?size=300x200').then(answer => answer.blob()).then(b => b.size)";
    assert!(browser.value(small).as_u64().unwrap() > 10_000);
    let peak = std::fs::read_to_string(format!("/proc/{}/status", session.id())).unwrap();
    let peak = peak.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    let peak: u64 = peak.trim().trim_end_matches(" kB").parse().unwrap();
    assert!(peak < 1_000_000, "{peak} kB");
    // Another picture is under way, and the session ends all the same.
    browser.value("fetch('picture.exr?size=8192x8192', { method: 'POST' }).catch(() => 0); 0");
    browser.wait("state.saving !== null");
    browser.value("command('quit')");
    session.wait().ok();
}

#[test]
fn a_picture_that_is_drawn_in_parts_is_that_of_the_whole_view() {
    let place = Place::new();
    let (mut session, address) = replay(&place);
    let browser = &mut Chromium::open(&address);
    wait_for_rest(browser);
    // The size of one part, and of several.
    for size in ["320x180", "900x506"] {
        let file = format!("{}/{size}.pfm", place.path("").display());
        session.write_line(&format!("picture {file} {size}"));
        session.wait_for_error(&format!("{size}.pfm"));
        let words = ["picture", "{}/a.holo", "-o", "{}/whole.pfm", "--size", size];
        place.run(&[&words[..], &VIEW].concat()).ok();
        let read = |path| holo_picture::Picture::read(path).unwrap();
        let (parts, whole) = (read(file.into()), read(place.path("whole.pfm")));
        assert_eq!(parts.size(), whole.size());
        let mean = |picture: &holo_picture::Picture| {
            let sum: f64 = picture.pixels.iter().flatten().map(|c| f64::from(*c)).sum();
            sum / picture.pixels.len() as f64
        };
        let far = parts.pixels.iter().zip(&whole.pixels).filter(|(a, b)| {
            let [a, b] = [a, b].map(|rgb| holo_picture::luminance(**rgb));
            (a - b).abs() > 0.1 * a.max(b) + 1e-3
        });
        let (far, all) = (far.count(), whole.pixels.len());
        assert!((mean(&parts) / mean(&whole) - 1.0).abs() < 0.02, "{size}");
        assert!(far < all / 20, "{size}: {far} of {all} pixels differ");
    }
    session.write_line("quit");
    session.wait().ok();
}

#[test]
fn every_frame_has_the_shape_of_its_view_while_the_window_changes() {
    let place = Place::new();
    let (mut session, address) = replay(&place);
    let browser = &mut Chromium::open(&address);
    wait_for_rest(browser);
    let watch = "window.wrong = []; const drawn = draw; draw = (next, parts) => { \
        const [w, h] = next.size, [a, b] = next.view.extent; \
        if (Math.abs(a * h / (b * w) - 1) > .02) wrong.push([w, h, a / b]); \
        return drawn(next, parts); }; 0";
    browser.value(watch);
    browser.key("KeyQ", "q", true);
    browser.wait("document.body.dataset.rest === 'false'");
    for (width, height) in [(500, 900), (1200, 400), (700, 700)] {
        let size = serde_json::json!({ "width": width, "height": height,
            "deviceScaleFactor": 1, "mobile": false });
        browser.call("Emulation.setDeviceMetricsOverride", size);
        browser
            .wait(&format!("Math.abs(header.size[0] / header.size[1] - {width} / {height}) < .02"));
    }
    browser.key("KeyQ", "q", false);
    browser.wait("document.body.dataset.rest === 'true' && header.size.join() === '700,700'");
    assert_eq!(browser.value("JSON.stringify(wrong)"), "[]");
    session.write_line("quit");
    session.wait().ok();
}

#[test]
fn commands_are_by_letter_and_motions_by_place() {
    let place = Place::new();
    let (mut session, address) = replay(&place);
    let browser = &mut Chromium::open(&address);
    wait_for_rest(browser);
    for (code, key, named) in [
        // German: Z and Y are exchanged, and `-` and `?` are elsewhere.
        ("KeyY", "z", "KeyZ"),
        ("KeyZ", "y", "KeyY"),
        ("Slash", "-", "-"),
        ("Minus", "?", "?"),
        ("Minus", "ß", ""),
        // French: motions stay where the hand is, and `?` takes no mouse.
        ("KeyW", "z", "KeyW"),
        ("KeyA", "q", "KeyA"),
        ("KeyM", "?", "?"),
        ("KeyM", ",", "Comma"),
        ("Semicolon", "m", "KeyM"),
        ("Comma", ".", "Period"),
        ("Digit1", "&", "Digit1"),
        ("Digit6", "-", "-"),
        // A script without Latin letters.
        ("KeyH", "р", "KeyH"),
        ("ArrowUp", "ArrowUp", "ArrowUp"),
        ("Escape", "Escape", "Escape"),
    ] {
        let of = format!("keyOf({{ code: '{code}', key: '{key}' }})");
        assert_eq!(browser.value(&of), named, "{code} {key}");
    }
    browser.press("KeyM", "?");
    browser.wait("document.getElementById('help').open && !document.pointerLockElement");
    session.write_line("quit");
    session.wait().ok();
}

#[test]
fn the_wheel_stops_at_the_wall_and_a_hidden_page_gets_no_frames() {
    let place = Place::new();
    let (mut session, address) = replay(&place);
    let browser = &mut Chromium::open(&address);
    wait_for_rest(browser);
    browser.wait("state.solid");
    for _ in 0..40 {
        browser.wheel((640, 360), -400);
    }
    wait_for_rest(browser);
    // The wall behind the boxes is at 5.59.
    let near = eye(browser);
    assert!(near[2] > -1.0 && near[2] < 5.5, "{near:?}");
    // Back returns to where the eye has stayed.
    browser.press("Comma", ",");
    wait_until("the view before", || (eye(browser)[2] < -1.9).then_some(()));
    wait_for_rest(browser);

    browser.value("say('hidden', { hidden: true }); 0");
    let frame = browser.value("header.frame");
    browser.value("command('go 2.78 2.73 -3'); 0");
    browser.wait("state.pose[0][2] < -2.9");
    assert_eq!(browser.value("header.frame"), frame);
    browser.value("say('hidden', { hidden: false }); 0");
    wait_until("the new view", || (eye(browser)[2] < -2.9).then_some(()));
    session.write_line("quit");
    session.wait().ok();
}
