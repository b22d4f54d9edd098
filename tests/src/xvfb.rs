//! A desktop without a screen: an X server in memory, with its keys and pixels.

use std::{
    io::{BufRead, BufReader},
    process::{Child, Command, Stdio},
};

use x11rb::{
    connection::Connection,
    protocol::{
        xproto::{self, ConnectionExt as _, ImageFormat, InputFocus, Window},
        xtest::ConnectionExt as _,
    },
    rust_connection::RustConnection,
};

use crate::wait_until;

/// Symbol of the key Shift.
const SHIFT: u32 = 0xffe1;

/// Size of the desktop's screen.
const SCREEN: &str = "1280x720x24";

/// An empty desktop for a test.
pub struct Desktop {
    server: Child,
    connection: RustConnection,
    root: Window,
    /// The desktop's name, for the variable `DISPLAY`.
    pub name: String,
}

impl Default for Desktop {
    fn default() -> Desktop {
        Desktop::new()
    }
}

impl Desktop {
    /// Starts a desktop that only this machine can reach.
    ///
    /// # Panics
    /// If Xvfb is missing or does not start.
    #[track_caller]
    pub fn new() -> Desktop {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", SCREEN, "-nolisten", "tcp", "-noreset"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb is installed, as by `apt-get install xvfb`");
        let mut number = String::new();
        let stdout = server.stdout.take().expect("it is piped");
        BufReader::new(stdout).read_line(&mut number).expect("Xvfb says its number");
        let name = format!(":{}", number.trim());
        let (connection, screen) =
            x11rb::connect(Some(&name)).expect("Xvfb takes connections once it has said so");
        let root = connection.setup().roots[screen].root;
        Desktop { server, connection, root, name }
    }

    /// Waits for a program's window, and gives it the keyboard focus.
    #[track_caller]
    pub fn window(&self) -> Window {
        let window = wait_until("a window", || {
            let windows = self.connection.query_tree(self.root).unwrap().reply().unwrap().children;
            windows.into_iter().find(|&window| {
                let attributes = self.connection.get_window_attributes(window).unwrap().reply();
                // Programs also make windows that are never visible.
                attributes.is_ok_and(|it| it.map_state == xproto::MapState::VIEWABLE)
            })
        });
        let parent = InputFocus::PARENT;
        self.connection.set_input_focus(parent, window, x11rb::CURRENT_TIME).unwrap();
        self.connection.flush().unwrap();
        window
    }

    /// Returns a window's pixels, three bytes for each, in rows from the top.
    #[track_caller]
    pub fn pixels(&self, window: Window) -> Vec<u8> {
        let size = self.connection.get_geometry(window).unwrap().reply().unwrap();
        let format = ImageFormat::Z_PIXMAP;
        let (width, height) = (size.width, size.height);
        let image =
            self.connection.get_image(format, window, 0, 0, width, height, u32::MAX).unwrap();
        let bytes = image.reply().expect("the window is on the screen").data;
        bytes.chunks_exact(4).flat_map(|pixel| [pixel[2], pixel[1], pixel[0]]).collect()
    }

    /// Waits until `wanted` is true for a window's pixels.
    #[track_caller]
    pub fn wait_for_pixels(&self, what: &str, window: Window, wanted: impl Fn(&[u8]) -> bool) {
        wait_until(what, || wanted(&self.pixels(window)).then_some(()));
    }

    /// Presses or releases a key, by its symbol.
    #[track_caller]
    pub fn key(&self, symbol: u32, down: bool) {
        let kind = if down { xproto::KEY_PRESS_EVENT } else { xproto::KEY_RELEASE_EVENT };
        self.fake(kind, self.code(symbol).0, (0, 0));
    }

    /// Presses and releases a key.
    #[track_caller]
    pub fn press(&self, symbol: u32) {
        self.key(symbol, true);
        self.key(symbol, false);
    }

    /// Types a text.
    #[track_caller]
    pub fn write(&self, text: &str) {
        for symbol in text.chars().map(u32::from) {
            let (_, is_shifted) = self.code(symbol);
            if is_shifted {
                self.key(SHIFT, true);
            }
            self.press(symbol);
            if is_shifted {
                self.key(SHIFT, false);
            }
        }
    }

    /// Moves the mouse to a place on the screen.
    #[track_caller]
    pub fn move_to(&self, place: (i16, i16)) {
        self.fake(xproto::MOTION_NOTIFY_EVENT, 0, place);
    }

    /// Presses or releases a mouse button: 1 is the left one, 4 turns the wheel away.
    #[track_caller]
    pub fn button(&self, button: u8, down: bool) {
        let kind = if down { xproto::BUTTON_PRESS_EVENT } else { xproto::BUTTON_RELEASE_EVENT };
        self.fake(kind, button, (0, 0));
    }

    #[track_caller]
    fn fake(&self, kind: u8, detail: u8, (x, y): (i16, i16)) {
        let fake = self.connection.xtest_fake_input(kind, detail, 0, self.root, x, y, 0);
        fake.unwrap().check().expect("the server takes synthesised input");
    }

    /// Returns the key that writes a symbol, and true if it needs Shift.
    #[track_caller]
    fn code(&self, symbol: u32) -> (u8, bool) {
        let setup = self.connection.setup();
        let (least, most) = (setup.min_keycode, setup.max_keycode);
        let keys = self.connection.get_keyboard_mapping(least, most - least + 1).unwrap();
        let keys = keys.reply().unwrap();
        let columns = usize::from(keys.keysyms_per_keycode);
        let index = keys.keysyms.iter().position(|&other| other == symbol);
        let index = index.expect("the keyboard has the key");
        // The first column is without Shift, the second one with it.
        (least + (index / columns) as u8, index % columns == 1)
    }
}

impl Drop for Desktop {
    fn drop(&mut self) {
        // If the server has ended already, both calls fail harmlessly.
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}
