//! An exported holodeck, as a browser shows it without this program.

use std::{
    fs,
    io::{BufRead, BufReader, Write},
    net::{TcpListener, TcpStream},
    path::{Path, PathBuf},
};

use holo_picture::{Picture, luminance};
use holo_tests::{Chromium, Place};

/// WebGL without a graphics card.
pub const FLAGS: [&str; 2] = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];

/// Serves a folder's files until the test's process ends. Returns its address.
pub fn serve(folder: PathBuf) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        // A browser closes connections that it did not need.
        listener.incoming().flatten().for_each(|stream| drop(answer(&folder, &stream)));
    });
    address
}

/// Answers one request, as any server of files does: whole files.
fn answer(folder: &Path, mut stream: &TcpStream) -> std::io::Result<()> {
    let mut lines = BufReader::new(stream).lines();
    let first = lines.next().transpose()?.unwrap_or_default();
    while lines.next().transpose()?.is_some_and(|line| !line.is_empty()) {}
    let name = first.split(' ').nth(1).unwrap_or("/").trim_start_matches('/');
    let name = if name.is_empty() { "index.html" } else { name };
    let kind = match name.rsplit('.').next() {
        Some("html") => "text/html",
        Some("css") => "text/css",
        Some("js") => "text/javascript",
        _ => "application/octet-stream",
    };
    let (status, bytes) = match fs::read(folder.join(name)) {
        Ok(bytes) => ("200 OK", bytes),
        Err(_) => ("404 Not Found", Vec::new()),
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        bytes.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(&bytes)
}

fn open(address: &str) -> Chromium {
    Chromium::open_with(address, &FLAGS.map(str::to_owned))
}

/// Returns the sentence that a page shows in place of the scene.
fn sentence(address: &str) -> String {
    let browser = &mut open(address);
    browser.wait("document.body.dataset.failed");
    assert_eq!(browser.value("document.getElementById('notice').hidden"), false);
    browser.value("document.getElementById('notice').textContent").as_str().unwrap().to_owned()
}

/// Exports a small file. Returns the folder's path.
pub fn exported(place: &Place) -> PathBuf {
    place.fill_small_with("a.holo", "400k", &["--bounces", "1"]);
    place.run(&["export", "{}/a.holo", "-o", "{}/site", "-q"]).ok();
    place.path("site")
}

#[test]
fn an_exported_folder_is_walked_with_true_luminances_and_no_server_of_ours() {
    let place = Place::new();
    let folder = exported(&place);
    let size = ["--size", "1280x720", "-q"];
    place.run(&["splats", "{}/a.holo", "-q"]).ok();
    let words = ["picture", "{}/a.holo", "--driver", "splats", "-o", "{}/p.pfm"];
    place.run(&[&words[..], &size].concat()).ok();
    let picture = Picture::read(place.path("p.pfm")).unwrap();

    let browser = &mut open(&serve(folder));
    browser.wait("document.body.dataset.complete && document.body.dataset.moving === 'no'");
    browser.wait("holodeck.facts.wasMoving === false && holodeck.facts.frame > 0");
    // Luminances of the page are those of the program's picture.
    for (x, y) in [(0.5, 0.5), (0.4, 0.7), (0.6, 0.3)] {
        let of_page = browser.value(&format!("holodeck.probe({x}, {y}).luminance"));
        let (of_page, half) = (of_page.as_f64().unwrap(), 4);
        let (column, row) = ((x * 1280.0) as usize, (y * 720.0) as usize);
        let near: Vec<f64> = (row - half..row + half)
            .flat_map(|row| (column - half..column + half).map(move |column| row * 1280 + column))
            .map(|at| f64::from(luminance(picture.pixels[at])))
            .collect();
        let of_program = near.iter().sum::<f64>() / near.len() as f64;
        assert!((of_page / of_program - 1.0).abs() < 0.1, "{of_page} {of_program} at {x} {y}");
        let error = browser.value(&format!("holodeck.probe({x}, {y}).error"));
        assert!((0.0..of_page).contains(&error.as_f64().unwrap()), "{error}");
    }
    assert_eq!(browser.value("document.getElementById('b-headset').hidden"), true, "none is here");
    // W walks ahead, and a wall stops the eye.
    let eye = |browser: &mut Chromium| -> Vec<f64> {
        serde_json::from_value(browser.value("holodeck.eye.at")).unwrap()
    };
    let before = eye(browser);
    browser.key("KeyW", "w", true);
    browser.wait(&format!("Math.abs(holodeck.eye.at[2] - {}) > 0.2", before[2]));
    browser.key("KeyW", "w", false);
    assert!(browser.value("performance.getEntriesByType('resource').length").as_u64().unwrap() > 2);
    let elsewhere = "performance.getEntriesByType('resource').every((one) => \
         new URL(one.name).host === location.host)";
    assert_eq!(browser.value(elsewhere), true);
    browser.press("KeyJ", "j");
    browser.wait("!document.getElementById('legend').hidden");
}

#[test]
fn a_single_file_opens_without_any_server() {
    let place = Place::new();
    place.fill_small_with("a.holo", "200k", &["--bounces", "0"]);
    place.run(&["export", "{}/a.holo", "--single", "-o", "{}/a.html", "-q"]).ok();
    let browser = &mut open(&format!("file://{}", place.path("a.html").display()));
    browser.wait("document.body.dataset.complete && document.body.dataset.frames > 0");
    assert!(browser.value("holodeck.probe(.5, .5).luminance").as_f64().unwrap() > 0.0);
}

#[test]
fn damaged_exports_say_so_and_show_no_blank_page() {
    let place = Place::new();
    let folder = exported(&place);
    let piece = folder.join("data/00000.bin");
    let whole = fs::read(&piece).unwrap();
    let address = serve(folder.clone());
    fs::write(&piece, &whole[..whole.len() / 2]).unwrap();
    assert!(sentence(&address).contains("is damaged"));
    let mut changed = whole.clone();
    changed[100] ^= 1;
    fs::write(&piece, changed).unwrap();
    assert!(sentence(&address).contains("is damaged"));
    fs::remove_file(&piece).unwrap();
    assert!(sentence(&address).contains("is missing"));
    let page = folder.join("index.html");
    let text = fs::read_to_string(&page).unwrap();
    for (from, to) in [("\"nodes\":", "\"nodes\":9"), ("\"levels\":[0,", "\"levels\":[0,0,")] {
        assert!(text.contains(from));
        fs::write(&page, text.replace(from, to)).unwrap();
        assert!(sentence(&address).contains("is damaged"));
    }
    fs::write(&page, text.replace("\"format\":1", "\"format\":")).unwrap();
    assert!(sentence(&address).contains("is damaged"));
}

/// Goes to a view and waits for its picture at rest.
fn rest_at(browser: &mut Chromium, view: &str) {
    let frames = browser.value("holodeck.facts.frames");
    browser.value(&format!("holodeck.goTo({view})"));
    browser.wait(&format!(
        "holodeck.facts.frames > {frames} && document.body.dataset.moving === 'no' && \
         !holodeck.facts.wasMoving"
    ));
}

/// Luminances of the page in cd/m², in rows from the top, at every `step`th pixel of every `step`th
/// row.
fn luminances(browser: &mut Chromium, step: usize) -> (usize, Vec<f64>) {
    let script = format!(
        "(() => {{ const {{ width, height, rgb }} = holodeck.pixels(), all = []; \
         for (let y = 0; y < height; y += {step}) for (let x = 0; x < width; x += {step}) {{ \
         const at = 3 * (y * width + x); \
         all.push(179 * (.2126 * rgb[at] + .7152 * rgb[at + 1] + .0722 * rgb[at + 2])); }} \
         return [width, all]; }})()"
    );
    serde_json::from_value(browser.value(&script)).unwrap()
}

#[test]
fn surfaces_of_a_known_scene_are_as_sharp_and_as_bright_as_the_programs() {
    let place = Place::new();
    let folder = exported(&place);
    let browser = &mut open(&serve(folder));
    browser.wait("document.body.dataset.complete");
    rest_at(browser, "holodeck.site.views[0]");
    let step = 4;
    let (width, of_page) = luminances(browser, step);
    let height = of_page.len() / width.div_ceil(step) * step;
    let size = format!("{width}x{height}");
    place.run(&["picture", "{}/a.holo", "--size", &size, "-o", "{}/p.pfm", "-q"]).ok();
    let picture = Picture::read(place.path("p.pfm")).unwrap();
    let rows = (0..height).step_by(step);
    let of_program = rows.flat_map(|y| (0..width).step_by(step).map(move |x| y * width + x));
    let ratios = of_program.zip(&of_page).filter_map(|(at, of_page)| {
        let of_program = f64::from(luminance(picture.pixels[at]));
        (of_program > 0.0).then(|| of_page / of_program)
    });
    let mut ratios: Vec<f64> = ratios.collect();
    ratios.sort_by(f64::total_cmp);
    let quantile = |share: f64| ratios[(share * (ratios.len() - 1) as f64) as usize];
    let quantiles = [0.1, 0.25, 0.5, 0.75, 0.9].map(quantile);
    assert!((quantiles[2] - 1.0).abs() < 0.02, "{quantiles:?}");
    assert!(quantiles[1] > 0.94 && quantiles[3] < 1.06, "{quantiles:?}");
    assert!(quantiles[0] > 0.85 && quantiles[4] < 1.15, "{quantiles:?}");
    // A whole picture came with the first requests.
    let first = browser.value("holodeck.facts.first");
    let bytes = first["bytes"].as_u64().unwrap();
    assert!((100_000..1_000_000).contains(&bytes), "{first}");
}

#[test]
fn a_flat_mirror_shows_the_mirrored_room() {
    let place = Place::new();
    // A dim room from 0 to 4 with a lamp on the wall x = 0, and a mirror in its place at x = 4.
    place.write(
        "room.obj",
        "mtllib room.mtl\n\
         v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 0 0 4\nv 4 0 4\nv 4 4 4\nv 0 4 4\n\
         v 0.01 2.5 2.5\nv 0.01 3.5 2.5\nv 0.01 3.5 3.5\nv 0.01 2.5 3.5\n\
         usemtl wall\nf 1 2 3 4\nf 5 8 7 6\nf 1 4 8 5\nf 1 5 6 2\nf 4 3 7 8\n\
         usemtl mirror\nf 2 6 7 3\nusemtl lamp\nf 9 10 11 12\n",
    );
    place.write(
        "room.mtl",
        "newmtl wall\nKd 0.2 0.2 0.2\nnewmtl mirror\nillum 3\nKs 0.9 0.9 0.9\n\
         newmtl lamp\nKd 0 0 0\nKe 5 5 5\n",
    );
    let section = "0.5,0.5,0.5 3,0,0 0,3,0 0,0,3 4,4,4";
    let words = ["--section", section, "--samples", "200k", "--bounces", "1", "-o", "{}/a.holo"];
    let fill = ["fill", "{}/room.obj", "--up", "z", "--unit", "m"];
    place.run(&[&fill[..], &words[..]].concat()).ok();
    let made = place.run(&["export", "{}/a.holo", "-o", "{}/site", "--json"]).ok().whole_json();
    let notes = made["notes"].to_string();
    assert!(notes.contains("One flat mirror shows the mirrored room"), "{notes}");
    let browser = &mut open(&serve(place.path("site")));
    browser.wait("document.body.dataset.complete");
    rest_at(browser, "{ vp: [2, 2, 2], vd: [1, 0, 0], vh: 60 }");
    // The lamp's image is 6 m away, half a metre to a metre and a half left and above.
    let lens = 30_f64.to_radians().tan();
    let aspect = browser.value("innerHeight / innerWidth").as_f64().unwrap();
    let mut probe = |left: f64, above: f64| {
        let x = 0.5 - 0.5 * left / 5.99 / lens;
        let y = 0.5 - 0.5 * above / 5.99 / (lens * aspect);
        browser.value(&format!("holodeck.probe({x}, {y}).luminance")).as_f64().unwrap()
    };
    let lamp = 5.0 * 0.9 * 179.0;
    for (left, above) in [(1.0, 1.0), (0.6, 1.0), (1.4, 1.0), (1.0, 0.6), (1.0, 1.4)] {
        let found = probe(left, above);
        assert!((found / lamp - 1.0).abs() < 0.03, "{found} at {left} {above}");
    }
    for (left, above) in [(-1.0, 1.0), (0.1, 1.0), (1.9, 1.0), (1.0, 0.1), (1.0, 1.8)] {
        let found = probe(left, above);
        assert!(found < 0.3 * lamp, "{found} at {left} {above}");
    }
}
