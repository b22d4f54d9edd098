//! A walk in a real browser, as a person would do it.

use holo_picture::{Picture, luminance};
use holo_tests::{CORNELL_SMALL_SECTION, Chromium, Modifier, Place, Process, wait_until};
use rustix::process::Signal;

const VIEW: [&str; 6] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60"];

/// The address that a session prints first.
#[track_caller]
fn address(session: &mut Process) -> String {
    format!("http:{}", session.wait_for_line("http:"))
}

/// Waits until the picture at rest is exact.
#[track_caller]
fn wait_for_rest(browser: &mut Chromium) {
    browser.wait("document.body.dataset.rest === 'true' && document.body.dataset.exact === 'true'");
}

/// Does something, then waits until the view is another and its picture at rest is exact.
#[track_caller]
fn changes_view(browser: &mut Chromium, action: impl FnOnce(&mut Chromium)) -> String {
    let before = options(browser);
    action(browser);
    browser.wait(&format!("document.body.dataset.options !== {before:?}"));
    wait_for_rest(browser);
    options(browser)
}

#[track_caller]
fn options(browser: &mut Chromium) -> String {
    browser.value("document.body.dataset.options").as_str().unwrap().to_owned()
}

/// The mean of the colours that the page shows, from 0 to 255.
#[track_caller]
fn brightness(browser: &mut Chromium) -> f64 {
    colour(browser).iter().sum::<f64>() / 3.0
}

/// The mean of red, green and blue that the page shows, from 0 to 255.
#[track_caller]
fn colour(browser: &mut Chromium) -> [f64; 3] {
    let mean = "(() => { const p = document.getElementById('picture'); \
        const d = p.getContext('2d').getImageData(0, 0, p.width, p.height).data; \
        const sum = [0, 0, 0]; \
        for (let i = 0; i < d.length; i++) if (i % 4 < 3) sum[i % 4] += d[i]; \
        return sum.map(sum => sum / d.length * 4); })()";
    serde_json::from_value(browser.value(mean)).unwrap()
}

#[test]
fn a_person_walks_orbits_approaches_reads_light_and_saves_in_a_browser() {
    let place = Place::new();
    place.fill_small_with("a.holo", "200k", &["--bounces", "0"]);
    let words = ["replay", "{}/a.holo", "--no-open", "--record", "{}/w.txt"];
    let mut session = place.start(&[&words[..], &VIEW].concat());
    let browser = &mut Chromium::open(&address(&mut session));
    wait_for_rest(browser);
    // The plan shows the four walls of the box, whose open side is in front.
    let walls = browser.value("document.getElementById('walls').getAttribute('d')");
    assert!(walls.as_str().unwrap().matches('M').count() >= 6, "{walls}");
    // Once all stored samples have arrived, the value under the cursor equals that of `picture` for
    // the same view.
    browser.mouse("mouseMoved", (640, 360), 0);
    let picture = ["picture", "{}/a.holo", "-o", "{}/p.pfm", "--size", "1280x720"];
    place.run(&[&picture[..], &VIEW].concat()).ok();
    let truth = luminance(Picture::read(place.path("p.pfm")).unwrap().get(640, 360).unwrap());
    let shown = "parseFloat(document.getElementById('p-luminance').textContent)";
    browser.wait(&format!("Math.abs({shown} / {truth} - 1) < 0.01"));

    let home = options(browser);
    let turned = changes_view(browser, |browser| browser.drag((640, 360), (700, 380), 1));
    assert_eq!(turned.split(" -vd").next(), home.split(" -vd").next(), "a drag turns in place");
    changes_view(browser, |browser| browser.drag((640, 360), (700, 360), 2));
    changes_view(browser, |browser| browser.wheel((640, 360), -100));
    changes_view(browser, |browser| browser.press("Comma", ","));
    let back = changes_view(browser, |browser| browser.press("KeyH", "h"));
    assert_eq!(back, home);

    // A key that is held walks until it is released.
    browser.key("KeyW", "w", true);
    browser.wait("document.body.dataset.rest === 'false'");
    browser.key("KeyW", "w", false);
    wait_for_rest(browser);
    assert_ne!(options(browser), home);

    // A replay stores no views, and says so.
    browser.press("KeyV", "v");
    let views = browser.value("state.views");
    browser.value("command('keep here')");
    browser.wait("document.getElementById('notice').textContent.includes('only reads')");
    assert_eq!(browser.value("state.views"), views);
    // The view is left through the field.
    changes_view(browser, |browser| {
        browser.value("document.getElementById('t-view').value = '-vp 2.78 2.73 -2 -vd .1 0 1'");
        browser.value("document.getElementById('f-view').requestSubmit()");
    });

    // Two stops brighter, without a new frame. The frame with the view's edges may come meanwhile,
    // but not every time.
    let (before, frame) = (brightness(browser), "document.body.dataset.frame");
    let stays = (0..5).any(|_| {
        browser.value("stops(0)");
        wait_until("the picture as before", || (brightness(browser) < 1.1 * before).then_some(()));
        let frame_before = browser.value(frame);
        browser.value("stops(2)");
        let stops = "Number(document.getElementById('o-stops').textContent)";
        browser.wait(&format!("header.exact && Math.abs({stops} - 2) < .1"));
        wait_until("a brighter picture", || (brightness(browser) > 1.2 * before).then_some(()));
        browser.value(frame) == frame_before
    });
    assert!(stays, "a new frame comes with every change of brightness");

    // False colours, with a legend. An invalid range changes nothing.
    let luminous = brightness(browser);
    browser.press("KeyJ", "j");
    browser.wait("header.exact && header.legend && !document.getElementById('legend').hidden");
    wait_until("other colours", || ((brightness(browser) - luminous).abs() > 1.0).then_some(()));
    browser.value("setScale(true, [0, 5])");
    assert_eq!(browser.value("display.log"), false);
    let fields = "for (const [id, end] of [['t-least', 1], ['t-most', 1000]]) \
        document.getElementById(id).value = end; \
        document.getElementById('b-log-on').click(); \
        document.getElementById('f-scale').requestSubmit()";
    browser.value(fields);
    browser.wait("header.exact && header.legend.log && header.legend.range.join() === '1,1000'");
    let labels = "document.getElementById('legend-ticks').textContent";
    browser.wait(&format!("{labels}.endsWith('1000')"));
    let width =
        "createImageBitmap(await (await fetch(document.getElementById('s-png').href)).blob())";
    let width = format!("(async () => (await {width}).width > header.size[0])()");
    assert_eq!(browser.value(&width), true, "the saved picture has the legend");
    browser.press("KeyN", "n");
    browser.press("KeyJ", "j");
    browser.wait("header.exact && header.legend && header.exposure > 0");

    let saved = browser.value("fetch('picture.hdr').then(r => r.text()).then(t => t.slice(0, 10))");
    assert_eq!(saved, "#?RADIANCE");
    let saved = "fetch('picture.exr?size=300x200').then(r => r.arrayBuffer()) \
        .then(b => new DataView(b).getUint32(0))";
    assert_eq!(browser.value(saved), 0x762f_3101);
    let saved = browser.value("fetch('picture.png').then(r => r.blob()).then(b => b.size)");
    assert!(saved.as_u64().unwrap() > 10_000, "{saved}");

    browser.value("command('quit')");
    session.wait().ok();
    // The recorded walk can be played.
    let script = std::fs::read_to_string(place.path("w.txt")).unwrap();
    assert!(script.lines().filter(|line| line.contains(" view ")).count() > 5, "{script}");
    let faster: Vec<String> = script.lines().map(ten_times_faster).collect();
    std::fs::write(place.path("w.txt"), faster.join("\n")).unwrap();
    let words = ["replay", "{}/a.holo", "--headless", "--script", "{}/w.txt", "--size", "64x36"];
    place.run(&words).ok();
}

#[test]
fn a_view_is_levelled_by_a_shift_and_its_middle_stays() {
    let place = Place::new();
    place.fill_small_with("a.holo", "100k", &["--bounces", "0"]);
    let words = ["replay", "{}/a.holo", "--no-open"];
    let mut session = place.start(&[&words[..], &VIEW].concat());
    let browser = &mut Chromium::open(&address(&mut session));
    wait_for_rest(browser);
    changes_view(browser, |browser| browser.drag((640, 360), (660, 440), 1));
    let rise = "dot(unit(header.view.direction), unit(facts.up))";
    let middle = "unit(plus(header.view.direction, header.view.up, \
        header.view.shift[1] * header.view.extent[1]))";
    let number = |browser: &mut Chromium, script: &str| browser.value(script).as_f64().unwrap();
    let vector = |browser: &mut Chromium| -> [f64; 3] {
        serde_json::from_value(browser.value(middle)).unwrap()
    };
    assert!(number(browser, rise).abs() > 0.05, "the drag has tilted the view");
    let before = vector(browser);
    changes_view(browser, |browser| {
        browser.value("document.getElementById('b-upright').click()");
    });
    assert!(number(browser, rise).abs() < 1e-6);
    let after = vector(browser);
    assert!(before.iter().zip(after).all(|(a, b)| (a - b).abs() < 1e-4), "{before:?} {after:?}");
    changes_view(browser, |browser| {
        let moves = "$('r-lift').value = 20; $('r-lift').oninput()";
        browser.value(moves);
    });
    assert!((number(browser, "header.view.shift[1]") - 0.2).abs() < 1e-9);
    session.write_line("quit");
    session.wait().ok();
}

/// Returns a line of a script with a tenth of its time.
fn ten_times_faster(line: &str) -> String {
    let timed =
        line.split_once(' ').and_then(|(time, rest)| Some((time.parse::<f64>().ok()?, rest)));
    timed.map_or_else(|| line.to_owned(), |(time, rest)| format!("{} {rest}", time / 10.0))
}

#[test]
fn a_picture_gets_clearer_and_the_page_reconnects_by_itself() {
    let place = Place::new();
    let words = [
        "view",
        "--config",
        "{}/cornell.toml",
        "--section",
        CORNELL_SMALL_SECTION,
        "--threads",
        "1",
        "--no-open",
    ];
    let start = |more: &[&str]| place.start(&[&words[..], &VIEW, more].concat());
    let mut session = start(&[]);
    let at = address(&mut session);
    let browser = &mut Chromium::open(&at);
    browser.wait("state && state.view_samples > 20000");
    wait_until("a lit picture", || (brightness(browser) > 20.0).then_some(()));
    // Paused, nothing more is traced; what was under way arrives.
    browser.press("KeyP", "p");
    browser.wait("state.paused && state.samples_per_second === 0");
    browser.press("KeyP", "p");
    browser.wait("!state.paused && state.samples_per_second > 0");
    let view = changes_view(browser, |browser| browser.drag((640, 360), (660, 360), 1));
    // The session is killed, without a message. The page keeps its picture until another one
    // arrives.
    session.signal(Signal::KILL);
    drop(session.wait());
    browser.wait("!document.getElementById('loading').hidden");
    assert!(brightness(browser) > 20.0, "the picture has gone");
    let http = at.trim_start_matches("http://").trim_end_matches('/').to_owned();
    let session = start(&["--http", &http]);
    browser.wait("document.getElementById('loading').hidden && drives");
    // The page returns to where the eye was.
    browser.wait(&format!("document.body.dataset.options === {view:?}"));
    wait_for_rest(browser);
    // A person ends the session while walking, and everything is stored all the same.
    browser.key("KeyE", "e", true);
    browser.wait("document.body.dataset.rest === 'false'");
    browser.value("command('quit')");
    session.wait().ok();
}

#[test]
fn buttons_keys_and_lines_command_a_session() {
    let place = Place::new();
    let words = [
        "view",
        "--config",
        "{}/cornell.toml",
        "--section",
        CORNELL_SMALL_SECTION,
        "--keep",
        "{}/a.holo",
        "--threads",
        "1",
        "--no-open",
    ];
    let mut session = place.start(&[&words[..], &VIEW].concat());
    let browser = &mut Chromium::open(&address(&mut session));
    browser.wait("state && state.workers === 1 && state.view_samples > 5000");
    // Workers, by a button and by a key.
    browser.value("document.getElementById('b-kill').click()");
    browser.wait("state.workers === 0");
    browser.press("Insert", "Insert");
    browser.wait("state.workers === 1 && state.samples_per_second > 0");
    // Drivers, and back.
    let driver = "const l = document.getElementById('l-driver'); \
        l.value = 'quadtree'; l.onchange()";
    browser.value(driver);
    browser.wait("state.driver === 'quadtree'");
    wait_for_rest(browser);
    // The parts of a driver's method have boxes, which follow what others switch.
    session.write_line("driver pointimage");
    browser.wait(
        "state.driver === 'pointimage' && document.querySelectorAll('#parts input').length === 9",
    );
    browser.value("document.querySelector('#parts [data-part=prefilter]').click()");
    browser.wait("state.parts.some(part => part.name === 'prefilter' && !part.on)");
    session.write_line("with prefilter");
    session.write_line("without dither");
    browser.wait(
        "document.querySelector('#parts [data-part=prefilter]').checked && \
         !document.querySelector('#parts [data-part=dither]').checked",
    );
    session.write_line("without glue");
    browser.wait("(state.trouble || '').includes('no part `glue`')");
    session.write_line("driver surfaces");
    browser.wait("state.driver === 'surfaces' && document.getElementById('parts').hidden");
    session.write_line("pause");
    browser.wait("state.paused");
    session.write_line("dance");
    session.wait_for_error("`dance` is no command");
    session.write_line("resume");
    // The light under the cursor has a standard error and a number of samples.
    browser.mouse("mouseMoved", (640, 600), 0);
    wait_for_rest(browser);
    browser.mouse("mouseMoved", (641, 600), 0);
    browser.wait("document.getElementById('p-luminance').textContent.includes('±')");
    browser.wait("Number(document.getElementById('p-samples').textContent) >= 0");
    // A rectangle is dragged out, and traced first until that is cancelled.
    browser.drag_with(Modifier::Control, (300, 200), (700, 500));
    browser.wait("state.focus !== null && !document.getElementById('focus').hidden");
    browser.press("Escape", "Escape");
    browser.wait("state.focus === null && document.getElementById('focus').hidden");
    // A view is stored in the file, left, and recalled by its number.
    wait_for_rest(browser);
    let home = options(browser);
    browser.value("document.getElementById('t-name').value = 'the corner'");
    browser.value("document.getElementById('f-name').requestSubmit()");
    browser.wait("state.views.some(view => view[0] === 'the corner')");
    changes_view(browser, |browser| browser.drag((640, 360), (700, 380), 1));
    let recalled = changes_view(browser, |browser| {
        browser.value("[...document.querySelectorAll('#views .name')].pop().click()");
    });
    assert_eq!(recalled, home);
    assert_eq!(browser.value("document.activeElement.id"), "stage", "keys walk again");
    // A view that was removed by mistake comes back.
    browser.value("[...document.querySelectorAll('#views .forget')].pop().click()");
    browser.wait("!state.views.some(view => view[0] === 'the corner')");
    browser.value("document.querySelector('#notice button').click()");
    browser.wait("state.views.some(view => view[0] === 'the corner')");
    // A person's choices stay when the page is loaded again.
    browser.value("stops(1)");
    browser.reload_until("document.readyState === 'complete' && hasPicture && display.stops === 1");
    browser.wait("drives && state.workers === 1");
    // A picture is written.
    session.write_line(&format!("picture {} 160x90", place.path("p.exr").display()));
    session.wait_for_error("wrote");
    assert_eq!(Picture::read(place.path("p.exr")).unwrap().size(), (160, 90));
    // Starting over needs a confirmation.
    browser.press("Backspace", "Backspace");
    browser.wait("document.getElementById('question').open");
    browser.value("document.querySelector('#question button[value=no]').click()");
    browser.wait("state.question === null");
    browser.press("Backspace", "Backspace");
    browser.wait("document.getElementById('question').open");
    let samples = browser.value("state.samples").as_u64().unwrap();
    browser.value("document.querySelector('#question button[value=yes]').click()");
    browser.wait("state.phase === 'loading'");
    browser.wait(&format!("state.phase === 'running' && state.samples < {samples}"));
    browser.wait("state.workers === 1 && state.view_samples > 1000");
    session.write_line("quit");
    session.wait().ok();
    let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    let views = info["views"].as_array().unwrap();
    assert_eq!(views.last().unwrap()[0], "the corner");
}

#[test]
fn the_page_s_button_loads_the_edited_scene() {
    let place = Place::new();
    let words = ["view", "--no-open", "--threads", "1", "--bounces", "0", "--config"];
    let scene = ["{}/cornell.toml", "--section", CORNELL_SMALL_SECTION];
    let mut session = place.start(&[&words[..], &scene, &VIEW].concat());
    let browser = &mut Chromium::open(&address(&mut session));
    browser.wait("state && state.workers === 1 && state.view_samples > 20000");
    wait_for_rest(browser);
    // The lamp's light is yellow, and most walls are white.
    let [red, _, blue] = colour(browser);
    assert!(red > 20.0 && red > 1.5 * blue, "{red} {blue}");
    // Somebody has left the first view, and chosen another driver.
    let view = changes_view(browser, |browser| browser.drag((640, 360), (660, 360), 1));
    session.write_line("driver quadtree");
    browser.wait("state.driver === 'quadtree'");

    // All paint is blue from now on.
    let before = std::fs::read_to_string(place.path("cornell.mtl")).unwrap();
    let lines = before.lines().map(|line| match line.starts_with("Kd ") {
        true => "Kd 0.02 0.02 0.8",
        false => line,
    });
    place.write("cornell.mtl", &lines.collect::<Vec<_>>().join("\n"));
    browser.value("document.getElementById('b-scene').click()");
    browser.wait("document.getElementById('question').open");
    browser.value("document.querySelector('#question button[value=yes]').click()");
    wait_until("a blue picture", || {
        let [red, _, blue] = colour(browser);
        (blue > 1.5 * red && blue > 20.0).then_some(())
    });
    browser.wait("state.phase === 'running' && state.workers === 1");
    browser.wait("state.driver === 'quadtree'");
    assert_eq!(options(browser), view);
    session.wait_for_error("goes on with the edited scene");
    session.write_line("quit");
    session.wait().ok();
}

#[test]
fn a_page_of_this_machine_alone_takes_no_certificate() {
    let place = Place::new();
    place.fill_small_with("a.holo", "10k", &["--bounces", "0"]);
    let words = ["replay", "{}/a.holo", "--http", "127.0.0.1:0", "--no-open"];
    let certificate = ["--http-cert", "{}/a.pem", "--http-key", "{}/b.pem"];
    place.run(&[&words[..], &certificate].concat()).failed(1, &["--http 0.0.0.0:0"]);
}
