//! What people do, and its way to the stage.

use std::{
    path::PathBuf,
    sync::{Arc, mpsc},
};

use glam::DVec3;
use holo_display::Frame;
use holo_picture::ViewSpec;
use holo_walk::Controls;

use crate::args::DriverArg;

/// Inputs that may wait. The stage takes all of them with every frame, so more is a flood.
const MOST_WAITING: usize = 4096;

/// Something that a person did.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// What is held down from now on.
    Hold(Controls),
    /// Where the cursor is: shares of the picture from its left and from its top. `None`: outside.
    Cursor(Option<(f64, f64)>),
    /// Turn in place: radians to the right and upwards.
    Turn(f64, f64),
    /// Move around the point under the cursor: radians to the right and upwards.
    Orbit(f64, f64),
    /// Steps of a wheel towards the point under the cursor.
    Wheel(f64),
    /// Move the picture: shares of it to the right and upwards, at the distance of the point under
    /// the cursor.
    Slide(f64, f64),
    /// Go to a view. What it does not say stays.
    View(Box<ViewSpec>),
    /// Go to a place, and keep the direction.
    GoTo(DVec3),
    /// Go to where one began.
    Home,
    /// Go to the view before.
    Back,
    /// Go to the view that one came back from.
    Forward,
    /// Lock the eye's height, or unlock it.
    LockHeight(bool),
    /// Pause tracing, or resume it.
    Pause(bool),
    /// End the worker processes, and start no others.
    KillWorkers,
    /// Start the worker processes again.
    RestartWorkers,
    /// Forget all samples. The first time, the stage asks ([`State::question`](super::State)); the
    /// second one is the answer.
    StartOver,
    /// Go on with the scene as its file is now. The first time, the stage asks, as for
    /// [`StartOver`](Self::StartOver).
    Restart,
    /// Not to do what the stage asked about.
    Cancel,
    /// Draw with another driver.
    Driver(DriverArg),
    /// Go to a view that the holodeck knows.
    Recall(Named),
    /// Keep the current view in the holodeck by this name.
    Keep(String),
    /// Remove a named view from the holodeck.
    Forget(String),
    /// Write a picture of the current view to a file, of this size if one is given. Its shape is
    /// the view's.
    Picture(PathBuf, Option<(u32, u32)>),
    /// Draw the current view in a picture of at most this size, for whoever waits for it.
    Render((u32, u32), Reply),
    /// Trace a part of the picture first: shares of it from its left and top to its right and
    /// bottom. `None`: all of it alike.
    Focus(Option<[f64; 4]>),
    /// Width and height of the picture, pixels.
    Size(u32, u32),
    /// End the session.
    Quit,
}

/// Takes a picture that somebody asked for.
#[derive(Clone)]
pub struct Reply(Arc<dyn Fn(Arc<Frame>) + Send + Sync>);

impl Reply {
    /// Has `take` called with the picture.
    pub fn new(take: impl Fn(Arc<Frame>) + Send + Sync + 'static) -> Reply {
        Reply(Arc::new(take))
    }

    /// Gives the picture.
    pub fn give(&self, frame: Arc<Frame>) {
        (self.0)(frame);
    }
}

impl std::fmt::Debug for Reply {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Reply")
    }
}

impl PartialEq for Reply {
    fn eq(&self, other: &Reply) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// A view that the holodeck knows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Named {
    /// By its number in the list, from 1.
    Number(usize),
    /// By its name.
    Name(String),
}

/// An input with its sender and its number there.
#[derive(Clone, Debug)]
pub struct Numbered {
    /// The front end's number of who sent it, and that one's number of the input.
    pub from: (u32, u64),
    /// What it is.
    pub input: Input,
}

/// Takes inputs for a stage.
#[derive(Clone)]
pub struct Inputs {
    sender: mpsc::SyncSender<Numbered>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Inputs {
    /// Returns the two ends of the way. `wake` is called after every input.
    pub fn new(wake: Arc<dyn Fn() + Send + Sync>) -> (Inputs, mpsc::Receiver<Numbered>) {
        let (sender, receiver) = mpsc::sync_channel(MOST_WAITING);
        (Inputs { sender, wake }, receiver)
    }

    /// Sends an input, the `number`th of `sender`. Returns whether there was room for it.
    pub fn send(&self, sender: u32, number: u64, input: Input) -> bool {
        let sent = self.sender.try_send(Numbered { from: (sender, number), input }).is_ok();
        (self.wake)();
        sent
    }
}
