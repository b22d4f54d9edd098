//! What people do, and its way to the stage.

use std::sync::{Arc, mpsc};

use glam::DVec3;
use holo_picture::ViewSpec;
use holo_walk::Controls;

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
    /// Width and height of the picture, pixels.
    Size(u32, u32),
    /// End the session.
    Quit,
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
