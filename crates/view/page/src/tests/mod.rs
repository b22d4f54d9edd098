//! Tests of the page's protocol over real sockets. The test takes the stage's place.

mod outside;
mod wall;

use std::{
    sync::{Arc, mpsc},
    time::{Duration, Instant},
};

use futures_util::{SinkExt, StreamExt};
use glam::DVec3;
use holo_display::Frame;
use holo_net::Shutdown;
use holo_picture::View;
use holo_stage::{Front, Input, Inputs, Numbered, PublishedFrame, StagePhase, State};
use holo_walk::Controls;
use serde_json::{Value, json};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    time::timeout,
};
use tokio_tungstenite::{
    WebSocketStream, client_async,
    tungstenite::{Error, Message, client::IntoClientRequest},
};

use super::{door::PageSocket, hub::Hub, serve};

/// Longest wait in a test.
const LIMIT: Duration = Duration::from_secs(20);

const SIZE: (u32, u32) = (320, 180);

/// A served page whose stage is the test.
struct Server {
    front: Front,
    inputs: mpsc::Receiver<Numbered>,
    url: String,
    port: u16,
    ending: Shutdown,
    served: tokio::task::JoinHandle<anyhow::Result<()>>,
    frames: u64,
}

impl Server {
    async fn start() -> Server {
        Server::behind(PageSocket::open("127.0.0.1:0", None).await.unwrap())
    }

    /// Serves the screens of a wall.
    async fn with_screens(names: &[&str]) -> Server {
        let door = PageSocket::open("127.0.0.1:0", None).await.unwrap();
        Server::of(door, names.iter().map(|&name| name.to_owned()).collect())
    }

    fn behind(door: PageSocket) -> Server {
        Server::of(door, Vec::new())
    }

    fn of(door: PageSocket, screens: Vec<String>) -> Server {
        let url = door.url().unwrap();
        let port = url.split(['/', ':']).nth(4).unwrap().parse().unwrap();
        let (inputs, receiver) = Inputs::new(Arc::new(|| {}));
        let front = Front { inputs, frames: Arc::default(), state: Arc::default() };
        let ending = Shutdown::new();
        let served = tokio::spawn(serve(door, Hub::new(front.clone(), screens), ending.clone()));
        Server { front, inputs: receiver, url, port, ending, served, frames: 0 }
    }

    /// Publishes a frame of uniform radiance that shows an input.
    fn publish(&mut self, radiance: f32, input: (u32, u64)) -> u64 {
        self.frames += 1;
        let view = View::new(DVec3::ZERO, DVec3::Y, DVec3::Z, Some(60.0), None, SIZE).unwrap();
        let mut frame = Frame::black(SIZE);
        frame.picture.pixels.fill([radiance; 3]);
        frame.depth.fill(2.0);
        let shown = PublishedFrame {
            number: self.frames,
            input,
            view,
            options: "-vtv".into(),
            frame: Arc::new(frame),
            is_at_rest: true,
            took: [0.0; 2],
            done: Instant::now(),
        };
        self.front.frames.send_replace(Some(Arc::new(shown)));
        self.frames
    }

    fn change_state(&self, change: impl FnOnce(&mut State)) {
        self.front.state.send_modify(|state| change(Arc::make_mut(state)));
    }

    async fn connect(&self, host: &str, origin: Option<&str>) -> Result<Page, Error> {
        let mut request = format!("ws://{host}/session").into_client_request().unwrap();
        if let Some(origin) = origin {
            request.headers_mut().insert("origin", origin.parse().unwrap());
        }
        let stream = TcpStream::connect(("127.0.0.1", self.port)).await.unwrap();
        let (socket, _) = client_async(request, stream).await?;
        Ok(Page { socket, client: 0, key: String::new(), number: 0 })
    }

    async fn page(&self) -> Page {
        let here = format!("127.0.0.1:{}", self.port);
        let mut page = self.connect(&here, Some(&format!("http://{here}"))).await.unwrap();
        let hello = page.told("hello").await;
        page.client = hello["client"].as_u64().unwrap() as u32;
        page.key = hello["key"].as_str().unwrap().to_owned();
        page
    }

    /// Returns the next input that the stage receives.
    fn input(&self) -> Numbered {
        self.inputs.recv_timeout(LIMIT).unwrap()
    }

    async fn end(self) {
        self.ending.trigger();
        timeout(LIMIT, self.served).await.unwrap().unwrap().unwrap();
    }

    /// Returns the answer to a plain HTTP request.
    async fn get(&self, path: &str, host: &str) -> String {
        String::from_utf8_lossy(&self.bytes(path, host).await).into_owned()
    }

    /// Sends a file as the page of this origin does, and returns the answer.
    async fn put(&self, path: &str, key: &str, file: &[u8], origin: Option<&str>) -> String {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).await.unwrap();
        let origin = origin.map(|origin| format!("Origin: {origin}\r\n")).unwrap_or_default();
        let head = format!(
            "PUT {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n{origin}Content-Length: {}\r\n\
             Authorization: Bearer {key}\r\n\
             Connection: close\r\n\r\n",
            self.port,
            file.len()
        );
        stream.write_all(head.as_bytes()).await.unwrap();
        stream.write_all(file).await.unwrap();
        let mut answer = Vec::new();
        timeout(LIMIT, stream.read_to_end(&mut answer)).await.unwrap().unwrap();
        String::from_utf8_lossy(&answer).into_owned()
    }

    async fn bytes(&self, path: &str, host: &str) -> Vec<u8> {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).await.unwrap();
        let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = Vec::new();
        timeout(LIMIT, stream.read_to_end(&mut answer)).await.unwrap().unwrap();
        answer
    }
}

/// Decodes a PNG into its size and bytes.
fn decoded(png: &[u8]) -> ((u32, u32), Vec<u8>) {
    let mut png = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut pixels = vec![0; png.output_buffer_size().unwrap()];
    png.next_frame(&mut pixels).unwrap();
    ((png.info().width, png.info().height), pixels)
}

/// The page's end of a connection.
struct Page {
    socket: WebSocketStream<TcpStream>,
    client: u32,
    key: String,
    number: u64,
}

/// A received update.
struct Update {
    header: Value,
    parts: Vec<Vec<u8>>,
}

impl Page {
    async fn say(&mut self, what: Value) -> u64 {
        self.number += 1;
        let text = json!({ "n": self.number, "say": what }).to_string();
        self.socket.send(Message::Text(text.into())).await.unwrap();
        self.number
    }

    async fn next(&mut self) -> Option<Message> {
        timeout(LIMIT, self.socket.next()).await.unwrap().and_then(Result::ok)
    }

    /// Returns the next text message of a kind.
    async fn told(&mut self, kind: &str) -> Value {
        loop {
            if let Message::Text(text) = self.next().await.unwrap() {
                let value: Value = serde_json::from_str(&text).unwrap();
                if value["is"] == kind {
                    return value;
                }
            }
        }
    }

    /// Returns the next update, and does not report it as shown.
    async fn update(&mut self) -> Update {
        loop {
            if let Message::Binary(bytes) = self.next().await.unwrap() {
                let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
                let header: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
                let mut rest = &bytes[4 + length..];
                let mut parts = Vec::new();
                for part in header["parts"].as_array().unwrap() {
                    let (part, others) = rest.split_at(part[4].as_u64().unwrap() as usize);
                    parts.push(part.to_vec());
                    rest = others;
                }
                assert!(rest.is_empty());
                return Update { header, parts };
            }
        }
    }

    /// Returns the next update that is exact and whole.
    async fn exact(&mut self) -> Update {
        loop {
            let update = self.update().await;
            self.shown(&update).await;
            if update.header["exact"] == true {
                return update;
            }
        }
    }

    async fn shown(&mut self, update: &Update) {
        self.say(json!({ "do": "shown", "update": update.header["update"] })).await;
    }

    /// Waits until the server closes the connection.
    async fn is_left(&mut self) {
        while let Some(message) = self.next().await {
            if matches!(message, Message::Close(_)) {
                return;
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frame_comes_at_once_then_exactly_and_names_the_input_that_it_shows() {
    let mut server = Server::start().await;
    let mut page = server.page().await;
    let number = page.say(json!({ "do": "wheel", "steps": 2 })).await;
    assert_eq!(server.input().from, (page.client, number));
    let frame = server.publish(0.5, (page.client, number));
    let first = page.update().await;
    assert_eq!(first.header["frame"], frame);
    assert_eq!(first.header["input"], number);
    assert_eq!(first.header["type"], "image/jpeg");
    assert_eq!(first.parts[0][..2], [0xff, 0xd8]);
    page.shown(&first).await;
    let exact = page.update().await;
    assert_eq!(exact.header["type"], "image/png");
    assert_eq!(exact.header["exact"], true);
    let (_, pixels) = decoded(&exact.parts[0]);
    // The exposure maps the mean to a grey card of 18 %, which is 117.6 in sRGB (IEC 61966-2-1).
    assert!(pixels.iter().all(|byte| byte.abs_diff(118) <= 1), "{}", pixels[0]);
    page.shown(&exact).await;
    // A brighter display of the same frame needs no new frame from the stage.
    page.say(json!({ "do": "display", "locked": 0.1, "stops": 0 })).await;
    let darker = page.update().await;
    assert_eq!(darker.header["frame"], frame);
    assert!((darker.header["exposure"].as_f64().unwrap() - 0.1).abs() < 1e-6);
    server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn each_page_has_its_own_look_of_one_frame_and_saves_what_it_sees() {
    let mut server = Server::start().await;
    let (mut first, mut second) = (server.page().await, server.page().await);
    let frame = server.publish(1.0, (0, 0));
    let plain = first.exact().await;
    assert!(plain.header["legend"].is_null() && plain.header["exposure"].is_number());
    second.exact().await;
    let colours = json!({ "do": "display", "locked": null, "stops": 0, "false_color": true,
        "range": [0, 358], "tone": "camera" });
    first.say(colours).await;
    let coloured = first.exact().await;
    assert_eq!(coloured.header["frame"], frame, "the stage draws nothing anew");
    assert!(server.inputs.try_recv().is_err(), "the stage hears nothing of it");
    assert!(coloured.header["exposure"].is_null());
    let legend = &coloured.header["legend"];
    assert_eq!((&legend["range"], &legend["log"]), (&json!([0.0, 358.0]), &json!(false)));
    // White of radiance 1 has 179 cd/m², the middle of the scale.
    let (_, pixels) = decoded(&coloured.parts[0]);
    let [red, green, blue] = [pixels[0], pixels[1], pixels[2]];
    assert_eq!(legend["colours"][16], format!("#{red:02x}{green:02x}{blue:02x}"));
    let tick = &legend["ticks"][2];
    assert_eq!(tick["label"], "100");
    assert!((tick["place"].as_f64().unwrap() - 100.0 / 358.0).abs() < 1e-6);

    // A saved picture is the page's own, with the legend beside it.
    let here = format!("127.0.0.1:{}", server.port);
    let mut saved = Vec::new();
    for client in [first.client, second.client] {
        let answer = server.bytes(&format!("/picture.png?client={client}"), &here).await;
        let begin = answer.windows(4).position(|bytes| bytes == b"\x89PNG").unwrap();
        saved.push(decoded(&answer[begin..]));
    }
    let [(coloured, with_legend), (plain, grey)] = &saved[..] else { unreachable!() };
    assert!(coloured.0 > SIZE.0 && coloured.1 == SIZE.1);
    assert_eq!(with_legend[..3], [red, green, blue]);
    assert_eq!(*plain, SIZE);
    assert!(grey.iter().all(|byte| byte.abs_diff(118) <= 1), "{}", grey[0]);
    server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn eyes_adapt_to_a_frame_that_stays() {
    let mut server = Server::start().await;
    let mut page = server.page().await;
    server.publish(0.05, (0, 0));
    page.exact().await;
    let frame = server.publish(1.0, (0, 0));
    // At first the frame is too bright. Then the eyes adapt to it, without another frame, until it
    // is a grey card of 18 %.
    loop {
        let update = page.exact().await;
        if update.header["frame"] == frame {
            let last = decoded(update.parts.last().unwrap()).1;
            if last.iter().all(|byte| byte.abs_diff(118) <= 1) {
                break;
            }
        }
    }
    server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_look_with_garbage_numbers_changes_nothing() {
    let mut server = Server::start().await;
    let mut page = server.page().await;
    server.publish(1.0, (0, 0));
    page.exact().await;
    for (range, log) in [(json!([10, 1]), false), (json!([0, 1]), true), (json!([0, 1e300]), false)]
    {
        page.say(json!({ "do": "display", "locked": null, "stops": 0, "false_color": true,
            "log": log, "range": range }))
            .await;
        page.told("error").await;
    }
    page.say(json!({ "do": "display", "locked": null, "stops": 0, "contours": true })).await;
    let next = page.update().await;
    let [least, most] = [0, 1].map(|end| next.header["legend"]["range"][end].as_f64().unwrap());
    assert!(least == 0.0 && (179.0..=500.0).contains(&most), "{least} {most}");
    assert!(next.header["exposure"].is_number(), "contours lie over tones");
    server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_that_has_not_shown_a_frame_gets_no_other_and_then_the_latest() {
    let mut server = Server::start().await;
    let (mut stalled, mut quick) = (server.page().await, server.page().await);
    server.publish(0.1, (0, 0));
    let first = stalled.update().await;
    for step in 2..=5_u16 {
        let update = quick.update().await;
        quick.shown(&update).await;
        let frame = server.publish(0.1 * f32::from(step), (0, 0));
        // Meanwhile the quick client continues, and may receive the exact last frame before the
        // next one.
        loop {
            let update = quick.update().await;
            let number = update.header["frame"].as_u64().unwrap();
            if number == frame {
                quick.shown(&update).await;
                break;
            }
            quick.shown(&update).await;
        }
        server.publish(0.1 * f32::from(step) + 0.05, (0, 0));
    }
    stalled.shown(&first).await;
    let next = stalled.update().await;
    assert_eq!(next.header["frame"], server.frames, "the latest, and none between");
    server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_drives_others_watch_and_may_take_over() {
    let mut server = Server::start().await;
    let mut first = server.page().await;
    assert_eq!(first.told("roles").await["drives"], true);
    let mut second = server.page().await;
    assert_eq!(second.told("roles").await["drives"], false);
    server.publish(1.0, (0, 0));
    // A watcher's inputs move nothing, but the watcher learns what its cursor points at.
    second.say(json!({ "do": "command", "line": "home" })).await;
    second.say(json!({ "do": "cursor", "at": [0.5, 0.5] })).await;
    let under = second.told("under").await["under"].clone();
    assert!((under["luminance"].as_f64().unwrap() - 179.0).abs() < 0.1, "{under}");
    assert_eq!(under["distance"], 2.0);
    first.say(json!({ "do": "hold", "ahead": 1 })).await;
    assert!(matches!(server.input().input, Input::Hold(controls) if controls.ahead == 1.0));
    second.say(json!({ "do": "take_over" })).await;
    // The controls that the first client held are released.
    assert_eq!(server.input().input, Input::Hold(Controls::default()));
    assert_eq!(server.input().input, Input::Cursor(None));
    assert_eq!(second.told("roles").await["drives"], true);
    let number = second.say(json!({ "do": "command", "line": "home" })).await;
    let input = server.input();
    assert_eq!((input.from, input.input), ((second.client, number), Input::Home));
    // When the driver leaves, the earliest client drives, and held controls are released.
    drop(second);
    assert_eq!(server.input().input, Input::Hold(Controls::default()));
    loop {
        let roles = first.told("roles").await;
        if roles["clients"] == 1 {
            assert_eq!(roles["drives"], true);
            break;
        }
    }
    server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_model_that_is_dropped_on_the_page_that_drives_is_stored_with_what_it_names() {
    let server = Server::start().await;
    let (mut drives, watches) = (server.page().await, server.page().await);
    let own = format!("http://127.0.0.1:{}", server.port);
    let path = |client: u32, name: &str| format!("/dropped/{client}/1/{name}");
    let of_driver = path(drives.client, "a%20chair.obj");
    assert!(
        server.put(&of_driver, &drives.key, b"v 0 0 0", None).await.contains(" 403 "),
        "no page"
    );
    let other = Some("http://elsewhere.example");
    assert!(
        server.put(&of_driver, &drives.key, b"v 0 0 0", other).await.contains(" 403 "),
        "another site"
    );
    let watcher = path(watches.client, "a%20chair.obj");
    let answer = server.put(&watcher, &watches.key, b"v 0 0 0", Some(&own)).await;
    assert!(answer.contains(" 409 ") && answer.contains("take over"), "{answer}");
    // The number of the client that drives is no secret.
    let answer = server.put(&of_driver, &watches.key, b"v 0 0 0", Some(&own)).await;
    assert!(answer.contains(" 403 "), "{answer}");
    let above = path(drives.client, "..%2Fchair.obj");
    assert!(server.put(&above, &drives.key, b"v 0 0 0", Some(&own)).await.contains(" 400 "));
    assert!(server.put(&of_driver, &drives.key, b"v 0 0 0", Some(&own)).await.contains(" 204 "));
    let named = path(drives.client, "chair.mtl");
    assert!(server.put(&named, &drives.key, b"newmtl a", Some(&own)).await.contains(" 204 "));
    let dropped = |name: &str| json!({ "do": "drop", "number": 1, "name": name, "at": [0.25, 2] });
    let number = drives.say(dropped("a chair.obj")).await;
    let input = server.input();
    let Input::Drop(stored, at) = input.input else { panic!("{:?}", input.input) };
    assert_eq!((input.from, at), ((drives.client, number), [0.25, 1.0]));
    assert_eq!(std::fs::read(&stored).unwrap(), b"v 0 0 0");
    assert_eq!(std::fs::read(stored.with_file_name("chair.mtl")).unwrap(), b"newmtl a");
    drives.say(dropped("table.obj")).await;
    assert!(drives.told("error").await["text"].as_str().unwrap().contains("did not arrive"));
    drop((drives, watches));
    server.end().await;
    assert!(!stored.exists(), "it goes with the session");
}

#[tokio::test(flavor = "multi_thread")]
async fn garbage_ends_its_own_connection_and_no_other() {
    let mut server = Server::start().await;
    let (mut good, mut bad) = (server.page().await, server.page().await);
    bad.say(json!({ "do": "explode" })).await;
    assert!(bad.told("error").await["text"].as_str().unwrap().contains("unknown variant"));
    for _ in 0..20 {
        // The connection may close before all messages are sent.
        let _ = bad.socket.send(Message::Binary(vec![0; 100].into())).await;
    }
    bad.is_left().await;
    let mut large = server.page().await;
    let _ = large.socket.send(Message::Text("x".repeat(1 << 20).into())).await;
    large.is_left().await;
    server.publish(0.3, (0, 0));
    assert_eq!(good.update().await.header["frame"], 1);
    server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_of_other_origins_and_other_names_get_nothing() {
    let mut server = Server::start().await;
    server.publish(0.3, (0, 0));
    let here = format!("127.0.0.1:{}", server.port);
    for (host, origin) in [
        (here.as_str(), Some("http://evil.example")),
        (here.as_str(), None),
        ("evil.example", Some("http://evil.example")),
    ] {
        match server.connect(host, origin).await {
            Err(Error::Http(answer)) => assert_eq!(answer.status(), 403),
            Err(other) => panic!("{host} {origin:?}: {other}"),
            Ok(_) => panic!("{host} {origin:?} was let in"),
        }
    }
    assert!(server.get("/", "evil.example").await.starts_with("HTTP/1.1 403"));
    let page = server.get("/", &here).await;
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("content-security-policy"));
    assert!(page.contains("x-frame-options: DENY"), "{page}");
    let saved = server.get("/picture.hdr", &here).await;
    assert!(saved.contains("#?RADIANCE"), "{}", &saved[..200.min(saved.len())]);
    server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn twenty_watchers_one_of_them_stalled_all_see_the_last_frame() {
    let mut server = Server::start().await;
    let stalled = server.page().await;
    let mut pages = Vec::new();
    for _ in 0..19 {
        pages.push(server.page().await);
    }
    let last = (1..=10_u16).map(|i| server.publish(0.05 * f32::from(i), (0, 0))).last();
    for page in &mut pages {
        loop {
            let update = page.update().await;
            page.shown(&update).await;
            if update.header["frame"].as_u64() == last && update.header["exact"] == true {
                break;
            }
        }
    }
    drop(stalled);
    server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn everyone_is_told_why_the_session_has_ended() {
    let server = Server::start().await;
    let mut page = server.page().await;
    server.change_state(|state| state.phase = StagePhase::Ended("lost the server".into()));
    loop {
        let state = page.told("state").await;
        if state["phase"] == "ended" {
            assert_eq!(state["text"], "lost the server");
            break;
        }
    }
    page.is_left().await;
    server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_that_read_nothing_give_way_to_those_that_do() {
    let server = Server::start().await;
    let here = format!("127.0.0.1:{}", server.port);
    let origin = format!("http://{here}");
    let mut deaf = Vec::new();
    for _ in 0..64 {
        deaf.push(server.connect(&here, Some(&origin)).await.unwrap());
    }
    let enters = async {
        loop {
            let mut page = server.connect(&here, Some(&origin)).await.unwrap();
            let first = page.socket.next().await.unwrap().unwrap();
            let told: Value = serde_json::from_str(first.to_text().unwrap()).unwrap();
            if told["is"] == "hello" {
                return;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    timeout(LIMIT, enters).await.unwrap();
    drop(deaf);
    server.end().await;
}
