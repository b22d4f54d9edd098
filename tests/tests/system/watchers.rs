//! Many who look at one session in browsers: one is stalled, one has a slow link, and one drives.

use std::{
    net::{SocketAddr, TcpStream},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
};

use holo_tests::{Chromium, LIMIT, Link, Place, Quality, wait_until};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::{Message, WebSocket, client, client::IntoClientRequest};

/// Watchers besides the stalled one and the two browsers: with these, 20 look on.
const WATCHERS: usize = 18;

/// Frames that the driving browser draws while it turns.
const FRAMES: u64 = 60;

/// Bytes per second of the slow link: less than a frame a second.
const SLOW: u64 = 8 << 10;

/// Notes in the page each frame that it draws from now on.
const NOTE_FRAMES: &str = "window.drawn = []; new MutationObserver(() => { \
    const frame = Number(document.body.dataset.frame); \
    if (frame !== window.drawn[window.drawn.length - 1]) window.drawn.push(frame); \
    }).observe(document.body, { attributeFilter: ['data-frame'] })";

/// The frames that a page has noted.
fn drawn(browser: &mut Chromium) -> Vec<u64> {
    let frames = browser.value("window.drawn");
    frames.as_array().unwrap().iter().map(|frame| frame.as_u64().unwrap()).collect()
}

fn connect(server: SocketAddr) -> WebSocket<TcpStream> {
    let mut request = format!("ws://{server}/session").into_client_request().unwrap();
    request.headers_mut().insert("origin", format!("http://{server}").parse().unwrap());
    let stream = TcpStream::connect(server).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    client(request, stream).unwrap().0
}

/// The header of the next update; `None` at the end of the session.
fn update(socket: &mut WebSocket<TcpStream>) -> Option<Value> {
    loop {
        match socket.read() {
            Ok(Message::Binary(bytes)) => {
                let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
                return Some(serde_json::from_slice(&bytes[4..4 + length]).unwrap());
            }
            Ok(Message::Close(_)) | Err(_) => return None,
            Ok(_) => {}
        }
    }
}

/// Watches until the session ends. Notes its latest frame among those of all watchers.
///
/// A watcher that has shown a frame gets the newest one next, never one that is older than what
/// others have by then.
fn watch(server: SocketAddr, all: &[AtomicU64], own: usize) {
    let mut socket = connect(server);
    let (mut floor, mut number) = (0, 0);
    while let Some(header) = update(&mut socket) {
        let frame = header["frame"].as_u64().unwrap();
        assert!(frame >= floor, "frame {frame} comes after {floor} is there");
        all[own].store(frame, Ordering::SeqCst);
        floor = all.iter().map(|latest| latest.load(Ordering::SeqCst)).max().unwrap_or(frame);
        number += 1;
        let shown = json!({ "n": number, "say": { "do": "shown", "update": header["update"] } });
        if socket.send(Message::Text(shown.to_string().into())).is_err() {
            return;
        }
    }
}

/// Reads nothing until `may_read` is set. Returns the number of updates that were sent to it.
fn stall(server: SocketAddr, may_read: &AtomicBool) -> usize {
    let mut socket = connect(server);
    wait_until("the end of the walk", || may_read.load(Ordering::SeqCst).then_some(()));
    std::iter::from_fn(|| update(&mut socket)).count()
}

#[test]
fn a_slow_link_gets_fewer_frames_and_a_stalled_watcher_delays_nobody() {
    let place = Place::new();
    place.fill_small_with("a.holo", "200k", &["--bounces", "0"]);
    let view = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60"];
    let words = ["replay", "{}/a.holo", "--no-open"];
    let mut session = place.start(&[&words[..], &view].concat());
    let at = session.wait_for_line("http://");
    let server: SocketAddr = at.trim_end_matches('/').parse().unwrap();
    let is_at_rest = "document.body.dataset.rest === 'true'";
    let driver = &mut Chromium::open(&format!("http://{server}/"));
    driver.wait(is_at_rest);

    // The slow browser calls the server by another name, which leads to the link.
    let link = Link::new(server);
    let rule = format!("--host-resolver-rules=MAP localhost:{} {}", server.port(), link.address());
    let slow = &mut Chromium::open_with(&format!("http://localhost:{}/", server.port()), &[rule]);
    slow.wait(is_at_rest);
    let latest: Arc<[AtomicU64]> = (0..WATCHERS).map(|_| AtomicU64::new(0)).collect();
    let watchers: Vec<_> = (0..WATCHERS)
        .map(|own| {
            let latest = Arc::clone(&latest);
            std::thread::spawn(move || watch(server, &latest, own))
        })
        .collect();
    let may_read = Arc::new(AtomicBool::new(false));
    let reading = Arc::clone(&may_read);
    let stalled = std::thread::spawn(move || stall(server, &reading));
    let words = format!("you drive, {} watch", WATCHERS + 2);
    driver.wait(&format!("document.getElementById('s-role').textContent === {words:?}"));

    link.set(Quality { rate: SLOW, ..Quality::default() });
    driver.value(NOTE_FRAMES);
    slow.value(NOTE_FRAMES);
    driver.key("KeyQ", "q", true);
    driver.wait(&format!("window.drawn.length >= {FRAMES}"));
    slow.wait("window.drawn.length >= 2");
    driver.key("KeyQ", "q", false);
    let (quick, few) = (drawn(driver).len(), drawn(slow).len());
    assert!(quick >= 2 * few, "{quick} and {few} frames");

    // All watchers end with the same frame.
    link.set(Quality::default());
    wait_until("the same frame everywhere", || {
        let frame = drawn(driver).pop();
        let is_same = |latest: &AtomicU64| Some(latest.load(Ordering::SeqCst)) == frame;
        (drawn(slow).pop() == frame && latest.iter().all(is_same)).then_some(())
    });
    for frames in [drawn(driver), drawn(slow)] {
        assert!(frames.is_sorted_by(|one, next| one < next), "{frames:?}");
    }
    driver.value("command('quit')");
    for watcher in watchers {
        watcher.join().unwrap();
    }
    may_read.store(true, Ordering::SeqCst);
    assert!(stalled.join().unwrap() <= 1, "one frame is under way at most");
    session.wait().ok();
}
