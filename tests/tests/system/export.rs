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
