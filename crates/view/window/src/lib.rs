//! The front end in a window: draws frames of a stage and text into a window, without a GPU.
//!
//! - `model` turns events into effects, and `overlay` draws the model on a `canvas`. Both are
//!   independent of the desktop.
//! - `app` is the event loop on the main thread, because some systems allow it nowhere else.
//! - `seen` turns radiance into colours on another thread.
//!
//! Invariants:
//! - The event loop waits for neither the stage nor a tone mapping nor a file.
//! - Nothing is drawn unless something is new.

mod app;
mod canvas;
mod display;
mod hand;
mod model;
mod overlay;
mod pace;
mod panel_layout;
mod saved;
mod seen;
mod text;

use std::sync::mpsc;

use anyhow::{Context, Result};
use holo_picture::Look;
use holo_stage::{Front, Stage, commands::follow_standard_input};
use tokio::sync::{oneshot, watch};
use winit::event_loop::EventLoopProxy;

use app::{Event, Opening};

/// Default size of a window, in pixels of a usual screen.
pub const SIZE: (u32, u32) = (1280, 720);

/// Advice if no window can be opened.
const INSTEAD: &str = "walk in a browser instead of --window: say --http 127.0.0.1:8080 --no-open \
                       and open that address, from elsewhere through a tunnel; or write pictures \
                       with --headless";

/// The main thread's end of the channel. The main thread shows windows, because some systems allow
/// that nowhere else.
pub struct WindowHost(mpsc::Receiver<Opening>);

/// The other end: requests a window from the main thread.
pub struct WindowRequest(mpsc::Sender<Opening>);

/// Returns the two ends of the channel to the main thread.
pub fn desk() -> (WindowRequest, WindowHost) {
    let (sender, receiver) = mpsc::channel();
    (WindowRequest(sender), WindowHost(receiver))
}

impl WindowHost {
    /// Shows windows until the [`WindowRequest`] is dropped. Call it on the main thread.
    pub fn serve(self) {
        self.0.into_iter().for_each(app::show);
    }
}

/// Checks that a desktop could show a window. It detects most obstacles early; opening the window
/// detects the others.
///
/// # Errors
/// Why no window can be opened, and what to do instead.
pub fn check_desktop() -> Result<()> {
    find_desktop().map_err(|reason| anyhow::anyhow!("no window can be opened: {reason}; {INSTEAD}"))
}

#[cfg(any(windows, target_os = "macos"))]
fn find_desktop() -> Result<(), &'static str> {
    Ok(())
}

#[cfg(not(any(windows, target_os = "macos")))]
fn find_desktop() -> Result<(), &'static str> {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let has_wayland = is_set("WAYLAND_DISPLAY") || is_set("WAYLAND_SOCKET");
    if !has_wayland && !is_set("DISPLAY") {
        return Err("there is no desktop here (neither WAYLAND_DISPLAY nor DISPLAY is set)");
    }
    if xkbcommon_dl::xkbcommon_option().is_none() {
        return Err("the library libxkbcommon.so.0 is missing (Debian's package libxkbcommon0)");
    }
    if !has_wayland && xkbcommon_dl::x11::xkbcommon_x11_option().is_none() {
        return Err("the library libxkbcommon-x11.so.0 is missing (Debian's package \
                    libxkbcommon-x11-0)");
    }
    Ok(())
}

/// Shows a stage in a window until the window is closed or `ended` completes. Calls `closed` when
/// the window is closed. `size` is the window's, in pixels of a usual screen.
///
/// If the stage fails, the window shows the reason and stays until it is closed.
///
/// # Errors
/// If no window can be opened, or the stage's errors.
pub async fn run(
    (stage, front): (Stage, Front),
    look: Look,
    size: (u32, u32),
    closed: Box<dyn FnOnce() + Send>,
    ended: impl Future<Output = ()> + Send + 'static,
    screen: WindowRequest,
) -> Result<()> {
    let (looks, wanted) = watch::channel(look);
    let (sender, seen) = watch::channel(None);
    let (opened, opening) = oneshot::channel();
    let window = Opening { front: front.clone(), seen, looks, size, opened, closed };
    screen.0.send(window).ok().context("the main thread has ended")?;
    let opened = opening.await.context("the window was closed at once")?;
    let proxy = opened.with_context(|| format!("no window can be opened; {INSTEAD}"))?;
    follow_standard_input(front.inputs.clone());
    let mut ending = EndNotice {
        proxy: proxy.clone(),
        reason: Some("The session has ended: the terminal says why.".to_owned()),
    };
    tokio::spawn(seen::see(front, wanted, sender, {
        let proxy = proxy.clone();
        // If the window has been closed, the message has no effect.
        move || _ = proxy.send_event(Event::News)
    }));
    tokio::spawn(async move {
        ended.await;
        let _ = proxy.send_event(Event::Leave);
    });
    // Drawing keeps its thread busy, and sockets must not wait for it.
    let played = tokio::task::spawn_blocking(move || stage.run()).await?;
    ending.reason = played.as_ref().err().map(|error| format!("{error:#}."));
    played
}

/// Reports the end of the session to the window, however the session ends.
struct EndNotice {
    proxy: EventLoopProxy<Event>,
    /// The reason, if the session failed.
    reason: Option<String>,
}

impl Drop for EndNotice {
    fn drop(&mut self) {
        // If the window has been closed, the message has no effect.
        let _ = self.proxy.send_event(Event::Over(self.reason.take()));
    }
}

#[cfg(test)]
mod tests;
