//! A real Chromium without a window, driven over its DevTools protocol.

use std::{
    net::TcpStream,
    path::Path,
    process::{Child, Command, Stdio},
    time::Duration,
};

use serde_json::{Value, json};
use tempfile::TempDir;
use tokio_tungstenite::tungstenite::{Message, WebSocket, client};

use crate::{LIMIT, wait_until};

/// Names of the program on different systems.
const PROGRAMS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// No window, no sandbox (tests may run as root), no traffic of its own.
const FLAGS: [&str; 9] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--remote-debugging-port=0",
];

/// A key that is held while the mouse is used, as the DevTools protocol numbers it.
#[derive(Clone, Copy, Debug)]
pub enum Modifier {
    /// Ctrl.
    Control = 2,
    /// Shift.
    Shift = 8,
}

/// A browser with one page.
pub struct Chromium {
    child: Child,
    page: WebSocket<TcpStream>,
    number: u64,
    /// Removed after the browser has ended.
    _profile: TempDir,
}

impl Chromium {
    /// Opens `address` in a fresh browser of 1280 × 720 pixels.
    ///
    /// # Panics
    /// If there is no Chromium, or it does not start.
    #[track_caller]
    pub fn open(address: &str) -> Chromium {
        Chromium::open_with(address, &[])
    }

    /// Opens `address` as [`open`](Chromium::open) does, with more flags.
    ///
    /// # Panics
    /// As [`Chromium::open`].
    #[track_caller]
    pub fn open_with(address: &str, flags: &[String]) -> Chromium {
        let profile = tempfile::tempdir().expect("a temporary folder can be made");
        let child = PROGRAMS.iter().find_map(|program| {
            Command::new(program)
                .args(FLAGS)
                .args(flags)
                .arg(format!("--user-data-dir={}", profile.path().display()))
                .arg("--window-size=1280,720")
                .arg(address)
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .ok()
        });
        let child = child.expect("Chromium is installed, as by `apt-get install chromium`");
        let port_file = profile.path().join("DevToolsActivePort");
        let (port, browser) = wait_until("Chromium to listen", || devtools(&port_file));
        let mut browser = connect(port, &browser);
        let page = wait_until("a page", || {
            let targets = call(&mut browser, 1, "Target.getTargets", json!({}));
            let targets = targets["targetInfos"].as_array()?.clone();
            let page = targets.into_iter().find(|target| target["type"] == "page")?;
            Some(page["targetId"].as_str()?.to_owned())
        });
        let page = connect(port, &format!("/devtools/page/{page}"));
        let mut chromium = Chromium { child, page, number: 0, _profile: profile };
        let size = json!({ "width": 1280, "height": 720, "deviceScaleFactor": 1, "mobile": false });
        chromium.call("Emulation.setDeviceMetricsOverride", size);
        // Scripts that wait for the document have run by then.
        chromium
            .wait(&format!("location.href === {address:?} && document.readyState === 'complete'"));
        chromium
    }

    /// Calls a method of the DevTools protocol for the page.
    #[track_caller]
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.number += 1;
        call(&mut self.page, self.number, method, parameters)
    }

    /// Evaluates an expression in the page; waits for its value if it is a promise.
    #[track_caller]
    pub fn value(&mut self, expression: &str) -> Value {
        let evaluate =
            json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let result = self.call("Runtime.evaluate", evaluate);
        assert!(result.get("exceptionDetails").is_none(), "{expression}: {result}");
        result["result"]["value"].clone()
    }

    /// Loads the page again, and waits until an expression is true in the new one.
    #[track_caller]
    pub fn reload_until(&mut self, expression: &str) {
        self.value("window.isOld = true");
        self.call("Page.reload", json!({}));
        self.wait_in_next(&format!("!window.isOld && {expression}"));
    }

    /// Goes to another address, and waits until an expression is true in its page.
    #[track_caller]
    pub fn go_to(&mut self, address: &str, expression: &str) {
        self.call("Page.navigate", json!({ "url": address }));
        self.wait_in_next(expression);
    }

    /// Waits until an expression is true. It need not have a value in the page that is there.
    #[track_caller]
    fn wait_in_next(&mut self, expression: &str) {
        wait_until(expression, || {
            self.number += 1;
            // While one page replaces the other, Chromium evaluates nothing.
            let parameters =
                json!({ "expression": format!("Boolean({expression})"), "returnByValue": true });
            let answer = answer(&mut self.page, self.number, "Runtime.evaluate", parameters);
            (answer["result"]["result"]["value"] == true).then_some(())
        });
    }

    /// Waits until an expression is true in the page.
    ///
    /// # Panics
    /// After [`LIMIT`], with the page's content in the message.
    #[track_caller]
    pub fn wait(&mut self, expression: &str) {
        let start = std::time::Instant::now();
        while self.value(&format!("Boolean({expression})")) != true {
            if start.elapsed() > LIMIT {
                let page =
                    self.value("document.body.innerText + JSON.stringify(document.body.dataset)");
                panic!("`{expression}` does not become true: {page}");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Presses or releases a key.
    #[track_caller]
    pub fn key(&mut self, code: &str, key: &str, down: bool) {
        let kind = if down { "keyDown" } else { "keyUp" };
        self.call("Input.dispatchKeyEvent", json!({ "type": kind, "code": code, "key": key }));
    }

    /// Presses and releases a key.
    #[track_caller]
    pub fn press(&mut self, code: &str, key: &str) {
        self.key(code, key, true);
        self.key(code, key, false);
    }

    /// Sends an event of the mouse; `buttons` is 1 for the left one, 2 for the right one.
    #[track_caller]
    pub fn mouse(&mut self, kind: &str, (x, y): (u32, u32), buttons: u32) {
        let button = ["none", "left", "right"][buttons as usize];
        let event = json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": buttons });
        self.call("Input.dispatchMouseEvent", event);
    }

    /// Drags from one place to another.
    #[track_caller]
    pub fn drag(&mut self, from: (u32, u32), to: (u32, u32), buttons: u32) {
        self.mouse("mousePressed", from, buttons);
        self.mouse("mouseMoved", to, buttons);
        self.mouse("mouseReleased", to, buttons);
    }

    /// Drags from one place to another while a key is held.
    #[track_caller]
    pub fn drag_with(&mut self, held: Modifier, from: (u32, u32), to: (u32, u32)) {
        let steps = [("mousePressed", from, 1), ("mouseMoved", to, 1), ("mouseReleased", to, 0)];
        for (kind, (x, y), buttons) in steps {
            let event = json!({ "type": kind, "x": x, "y": y, "button": "left",
                "buttons": buttons, "modifiers": held as u32 });
            self.call("Input.dispatchMouseEvent", event);
        }
    }

    /// Turns the wheel at a place, `down` pixels.
    #[track_caller]
    pub fn wheel(&mut self, place: (u32, u32), down: i32) {
        self.wheel_with(0, place, down);
    }

    /// Turns the wheel at a place, `down` pixels, while the shift key is held.
    #[track_caller]
    pub fn wheel_with_shift(&mut self, place: (u32, u32), down: i32) {
        self.wheel_with(Modifier::Shift as u32, place, down);
    }

    #[track_caller]
    fn wheel_with(&mut self, modifiers: u32, (x, y): (u32, u32), down: i32) {
        let event = json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": down,
            "modifiers": modifiers });
        self.call("Input.dispatchMouseEvent", event);
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        // If the browser has ended already, both calls fail harmlessly.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The port and the browser's path, once Chromium has written them.
fn devtools(file: &Path) -> Option<(u16, String)> {
    let text = std::fs::read_to_string(file).ok()?;
    let (port, path) = text.trim_end().split_once('\n')?;
    Some((port.parse().ok()?, path.to_owned()))
}

#[track_caller]
fn connect(port: u16, path: &str) -> WebSocket<TcpStream> {
    let stream = TcpStream::connect(("127.0.0.1", port)).expect("Chromium listens");
    stream.set_read_timeout(Some(LIMIT)).expect("a time-out can be set");
    client(format!("ws://127.0.0.1:{port}{path}"), stream).expect("Chromium takes connections").0
}

/// Calls a method, and returns its whole answer. Events before the answer are skipped.
#[track_caller]
fn answer(
    socket: &mut WebSocket<TcpStream>,
    number: u64,
    method: &str,
    parameters: Value,
) -> Value {
    let text = json!({ "id": number, "method": method, "params": parameters }).to_string();
    socket.send(Message::Text(text.into())).expect("Chromium takes a message");
    loop {
        let Message::Text(text) = socket.read().expect("Chromium answers") else { continue };
        let answer: Value = serde_json::from_str(&text).expect("Chromium speaks JSON");
        if answer["id"] == number {
            return answer;
        }
    }
}

/// Calls a method, and returns its result.
#[track_caller]
fn call(socket: &mut WebSocket<TcpStream>, number: u64, method: &str, parameters: Value) -> Value {
    let answer = answer(socket, number, method, parameters);
    assert!(answer.get("error").is_none(), "{method}: {answer}");
    answer["result"].clone()
}
