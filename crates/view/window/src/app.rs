//! The window's event loop: passes events to the model, and carries out the model's effects.

use std::{num::NonZeroU32, path::PathBuf, rc::Rc, sync::Arc, time::Instant};

use anyhow::{Context as _, Result, anyhow};
use holo_picture::Look;
use holo_stage::{Front, Input};
use softbuffer::{Context, Surface};
use tokio::sync::{oneshot, watch};
use winit::{
    application::ApplicationHandler,
    dpi::{LogicalSize, PhysicalPosition},
    event::{
        DeviceEvent, DeviceId, ElementState, KeyEvent, MouseButton, MouseScrollDelta, Touch,
        TouchPhase, WindowEvent,
    },
    event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy, OwnedDisplayHandle},
    keyboard::PhysicalKey,
    window::{CursorGrabMode, CursorIcon, Fullscreen, Window, WindowId},
};

use super::{
    canvas::Canvas,
    hand::Drag,
    model::{Effect, Modifiers, WindowModel},
    overlay, saved,
    seen::DisplayedFrame,
};

/// This window's number as a sender of inputs.
const SENDER: u32 = 1;

/// Pixels that a touchpad scrolls for one step of a wheel.
const STEP_PIXELS: f64 = 100.0;

/// A message from another thread to the event loop.
#[derive(Debug)]
pub enum Event {
    /// There is a new frame or state.
    News,
    /// The session is over, with the reason if it failed.
    Over(Option<String>),
    /// A picture was saved, or could not be.
    Saved(Result<PathBuf>),
    /// The program has to end.
    Leave,
}

/// Everything that a window needs to open.
pub struct Opening {
    /// The stage.
    pub front: Front,
    /// Frames in display colours.
    pub seen: watch::Receiver<Option<Arc<DisplayedFrame>>>,
    /// The look of frames.
    pub looks: watch::Sender<Look>,
    /// First width and height, in pixels of a usual screen.
    pub size: (u32, u32),
    /// Receives access to the event loop once the window is open, or the reason why it cannot be
    /// opened.
    pub opened: oneshot::Sender<Result<EventLoopProxy<Event>>>,
    /// Called when the window is closed.
    pub closed: Box<dyn FnOnce() + Send>,
}

/// Shows a window until it is closed. Call it on the main thread, because some systems require
/// that.
pub fn show(opening: Opening) {
    let event_loop = match EventLoop::<Event>::with_user_event().build() {
        Ok(event_loop) => event_loop,
        Err(error) => {
            // The receiver may have gone.
            let _ = opening.opened.send(Err(error.into()));
            return;
        }
    };
    let look = *opening.looks.borrow();
    let mut app = App {
        front: opening.front,
        seen: opening.seen,
        looks: opening.looks,
        model: WindowModel::new(look, opening.size, 1.0),
        desk: None,
        proxy: event_loop.create_proxy(),
        opened: Some(opening.opened),
        number: 0,
        failed: None,
    };
    let ended = event_loop.run_app(&mut app).map_err(anyhow::Error::from);
    if let Some(error) = app.failed.or(ended.err()) {
        eprintln!("holodeck: the window: {error:#}");
    }
    (opening.closed)();
}

/// An open window.
struct OpenWindow {
    window: Rc<Window>,
    surface: Surface<OwnedDisplayHandle, Rc<Window>>,
}

struct App {
    front: Front,
    seen: watch::Receiver<Option<Arc<DisplayedFrame>>>,
    looks: watch::Sender<Look>,
    model: WindowModel,
    desk: Option<OpenWindow>,
    proxy: EventLoopProxy<Event>,
    opened: Option<oneshot::Sender<Result<EventLoopProxy<Event>>>>,
    /// Number of the last input.
    number: u64,
    /// Why the window must close, if it can no longer be shown.
    failed: Option<anyhow::Error>,
}

impl OpenWindow {
    fn open(event_loop: &ActiveEventLoop, (width, height): (u32, u32)) -> Result<OpenWindow> {
        let attributes = Window::default_attributes()
            .with_title("Holodeck")
            .with_inner_size(LogicalSize::new(width, height));
        let window = Rc::new(event_loop.create_window(attributes)?);
        window.set_cursor(CursorIcon::Crosshair);
        let failed = |error: softbuffer::SoftBufferError| anyhow!("{error}");
        let context = Context::new(event_loop.owned_display_handle()).map_err(failed)?;
        let surface = Surface::new(&context, Rc::clone(&window)).map_err(failed)?;
        Ok(OpenWindow { window, surface })
    }

    /// Draws the model and puts it on the screen.
    fn draw(&mut self, model: &WindowModel) -> Result<()> {
        let size = self.window.inner_size();
        let (Some(width), Some(height)) =
            (NonZeroU32::new(size.width), NonZeroU32::new(size.height))
        else {
            return Ok(());
        };
        let failed = |error: softbuffer::SoftBufferError| anyhow!("drawing: {error}");
        self.surface.resize(width, height).map_err(failed)?;
        let mut buffer = self.surface.buffer_mut().map_err(failed)?;
        let mut canvas = Canvas::new(&mut buffer, (size.width, size.height))
            .context("drawing: the window has another size than its pixels")?;
        overlay::draw(&mut canvas, model, Instant::now());
        self.window.pre_present_notify();
        buffer.present().map_err(failed)
    }

    /// Switches between a mouse that only moves the eye and a visible cursor.
    fn grab(&self, grabs: bool) -> Result<()> {
        self.window.set_cursor_visible(!grabs);
        if !grabs {
            return Ok(self.window.set_cursor_grab(CursorGrabMode::None)?);
        }
        let locked = self.window.set_cursor_grab(CursorGrabMode::Locked);
        Ok(locked.or_else(|_| self.window.set_cursor_grab(CursorGrabMode::Confined))?)
    }
}

impl App {
    fn perform(&mut self, event_loop: &ActiveEventLoop, effects: Vec<Effect>) {
        for effect in effects {
            match effect {
                Effect::Send(input) => self.send(input),
                Effect::Look(look) => _ = self.looks.send_replace(look),
                Effect::Leave => event_loop.exit(),
                Effect::Save(kind) => self.save(kind),
                Effect::FullScreen(full) => {
                    if let Some(desk) = &self.desk {
                        let screen = full.then_some(Fullscreen::Borderless(None));
                        desk.window.set_fullscreen(screen);
                    }
                }
                Effect::Grab(grabs) => {
                    let grabbed = self.desk.as_ref().map(|desk| desk.grab(grabs));
                    if let Some(Err(error)) = grabbed {
                        self.model
                            .tell(format!("The mouse cannot be held: {error}"), Instant::now());
                    }
                }
            }
        }
    }

    fn send(&mut self, input: Input) {
        let now = Instant::now();
        self.number += 1;
        if moves(&input) {
            self.model.pace.sent(self.number, now);
        }
        if !self.front.inputs.send(SENDER, self.number, input) {
            self.model.tell("Too many inputs at once: some were lost.", now);
        }
    }

    /// Saves the latest frame, on a separate thread.
    fn save(&mut self, kind: saved::SaveFormat) {
        let Some(seen) = self.model.seen.clone() else { return };
        let proxy = self.proxy.clone();
        std::thread::spawn(move || {
            let saved = std::env::current_dir()
                .context("finding the current folder")
                .and_then(|folder| saved::save(&seen, kind, &folder));
            // The window may have been closed meanwhile.
            let _ = proxy.send_event(Event::Saved(saved));
        });
    }

    fn resize(&mut self) {
        let Some(desk) = &self.desk else { return };
        let (size, scale) = (desk.window.inner_size(), desk.window.scale_factor());
        self.model.resize((size.width, size.height), scale, Instant::now());
    }

    fn key(&mut self, event: &KeyEvent) -> Vec<Effect> {
        let PhysicalKey::Code(code) = event.physical_key else { return Vec::new() };
        // Debug output of a key code is its W3C name.
        let name = format!("{code:?}");
        // Enter and similar keys write control characters, which are not text.
        let sign = event.text.as_deref().filter(|text| !text.contains(char::is_control));
        let sign = sign.unwrap_or_default();
        match event.state {
            ElementState::Pressed => self.model.press(&name, sign, event.repeat, Instant::now()),
            ElementState::Released => self.model.release(&name),
        }
    }

    fn button(&mut self, state: ElementState, button: MouseButton) -> Vec<Effect> {
        let drag = match button {
            MouseButton::Left => Drag::Turn,
            MouseButton::Right => Drag::Orbit,
            MouseButton::Middle => Drag::Slide,
            _ => return Vec::new(),
        };
        let effects = match state {
            ElementState::Pressed => self.model.button(drag),
            ElementState::Released => self.model.button_up(drag),
        };
        if let Some(desk) = &self.desk {
            let icon = match self.model.is_dragging() {
                true => CursorIcon::Grabbing,
                false => CursorIcon::Crosshair,
            };
            desk.window.set_cursor(icon);
        }
        effects
    }

    fn touch(&mut self, touch: &Touch) -> Vec<Effect> {
        let at = (touch.location.x, touch.location.y);
        match touch.phase {
            TouchPhase::Started | TouchPhase::Moved => self.model.finger(touch.id, at),
            TouchPhase::Ended | TouchPhase::Cancelled => {
                self.model.lift(touch.id);
                Vec::new()
            }
        }
    }

    fn wheel(&mut self, delta: MouseScrollDelta) -> Vec<Effect> {
        let steps = match delta {
            MouseScrollDelta::LineDelta(_, lines) => f64::from(lines),
            MouseScrollDelta::PixelDelta(PhysicalPosition { y, .. }) => {
                y / STEP_PIXELS / self.model.scale.max(0.1)
            }
        };
        self.model.wheel(steps)
    }

    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        let Some(desk) = &mut self.desk else { return };
        match desk.draw(&self.model) {
            Ok(()) => self.model.presented(Instant::now()),
            Err(error) => {
                self.failed = Some(error);
                event_loop.exit();
            }
        }
    }
}

/// Returns whether an input moves the eye at once, so that latency can be measured.
fn moves(input: &Input) -> bool {
    match input {
        Input::Hold(controls) => controls.moves(),
        Input::Cursor(_) | Input::Size(..) | Input::Pause(_) | Input::LockHeight(_) => false,
        Input::Focus(_) | Input::Cancel | Input::Keep(_) | Input::Picture(..) => false,
        _ => true,
    }
}

impl ApplicationHandler<Event> for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.desk.is_some() {
            return;
        }
        let opened = OpenWindow::open(event_loop, self.model.size).map(|desk| {
            self.desk = Some(desk);
            self.resize();
            self.proxy.clone()
        });
        if opened.is_err() {
            event_loop.exit();
        }
        if let Some(sender) = self.opened.take() {
            // The receiver may have gone; then the end of this window is on its way too.
            let _ = sender.send(opened);
        }
        self.send(self.model.wanted_size());
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, event: Event) {
        let now = Instant::now();
        match event {
            Event::News => {
                self.model.set_state(self.front.state.borrow().clone());
                let seen = self.seen.borrow_and_update().clone();
                if let Some(seen) = seen {
                    self.model.set_seen(seen);
                }
            }
            Event::Over(reason) => {
                let effects = self.model.end(reason);
                self.perform(event_loop, effects);
            }
            Event::Saved(Ok(path)) => self.model.tell(format!("Saved {}", path.display()), now),
            Event::Saved(Err(error)) => {
                self.model.tell(format!("The picture is not saved: {error:#}"), now);
            }
            Event::Leave => event_loop.exit(),
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let effects = match event {
            WindowEvent::CloseRequested => vec![Effect::Leave],
            WindowEvent::RedrawRequested => {
                self.draw(event_loop);
                Vec::new()
            }
            WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. } => {
                self.resize();
                Vec::new()
            }
            WindowEvent::Focused(false) => self.model.lose_focus(),
            WindowEvent::ModifiersChanged(modifiers) => {
                let state = modifiers.state();
                let other = state.alt_key() || state.super_key();
                let (ctrl, shift) = (state.control_key(), state.shift_key());
                self.model.set_modifiers(Modifiers { ctrl, shift, other });
                Vec::new()
            }
            // The system repeats presses of held keys when the window gets the focus.
            WindowEvent::KeyboardInput { is_synthetic: true, event, .. }
                if event.state == ElementState::Pressed =>
            {
                Vec::new()
            }
            WindowEvent::KeyboardInput { event, .. } => self.key(&event),
            WindowEvent::CursorMoved { position, .. } => {
                self.model.move_to((position.x, position.y))
            }
            WindowEvent::CursorLeft { .. } => self.model.leave(),
            WindowEvent::MouseInput { state, button, .. } => self.button(state, button),
            WindowEvent::MouseWheel { delta, .. } => self.wheel(delta),
            WindowEvent::Touch(touch) => self.touch(&touch),
            WindowEvent::DroppedFile(path) => self.model.drop_model(path),
            _ => Vec::new(),
        };
        self.perform(event_loop, effects);
    }

    fn device_event(&mut self, event_loop: &ActiveEventLoop, _: DeviceId, event: DeviceEvent) {
        if let DeviceEvent::MouseMotion { delta: (right, down) } = event {
            let effects = self.model.move_by(right, down);
            self.perform(event_loop, effects);
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let effects = self.model.wake(Instant::now());
        self.perform(event_loop, effects);
        if self.model.take_stale()
            && let Some(desk) = &self.desk
        {
            desk.window.request_redraw();
        }
        event_loop.set_control_flow(match self.model.next_change() {
            Some(at) => ControlFlow::WaitUntil(at),
            None => ControlFlow::Wait,
        });
    }
}
