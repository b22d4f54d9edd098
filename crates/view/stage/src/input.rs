//! Inputs of people, and the queue to the stage.

use std::{
    path::PathBuf,
    sync::{Arc, mpsc},
};

use glam::DVec3;
use holo_picture::ViewSpec;
use holo_session::{DriverArg, LightChange, ObjectOrder};
use holo_walk::Controls;

use super::picture_order::PictureOrder;

/// Most inputs that wait. The stage processes all of them with every frame, so more can only be a
/// flood.
const MOST_WAITING: usize = 4096;

/// An action of a person.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// The controls that are held down from now on.
    Hold(Controls),
    /// Where the cursor is: shares of the picture from its left and from its top. `None` if it is
    /// outside.
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
    /// Go to a view. Options that are not given keep their values.
    View(Box<ViewSpec>),
    /// Go to a place, and keep the direction.
    GoTo(DVec3),
    /// Go to the first view.
    Home,
    /// Go to the previous view.
    Back,
    /// Undo [`Back`](Self::Back).
    Forward,
    /// Lock the eye's height, or unlock it.
    LockHeight(bool),
    /// Let walls and furniture stop the eye and floors carry it, or not.
    Solid(bool),
    /// Confirm that the eye may leave the house.
    Leave,
    /// Pause tracing, or resume it.
    Pause(bool),
    /// End the worker processes, and do not start others.
    KillWorkers,
    /// Start the worker processes again.
    RestartWorkers,
    /// Forget all samples. The first time, the stage asks for confirmation
    /// ([`State::question`](super::State)); the second time confirms.
    StartOver,
    /// Go on with the scene as its file is now. The first time, the stage asks, as for
    /// [`StartOver`](Self::StartOver).
    Restart,
    /// Answer the stage's question with no.
    Cancel,
    /// Draw with another driver.
    Driver(DriverArg),
    /// Switch parts of the driver's method on or off, by their names.
    Switch(Vec<String>, bool),
    /// Carry an object into the scene, or change one.
    Object(ObjectOrder),
    /// Carry this model into the scene, to where the picture shows this place, in shares of the
    /// picture from its left and top.
    Drop(PathBuf, [f64; 2]),
    /// Go on with the scene in another light.
    Light(LightChange),
    /// Go to a named view of the holodeck.
    Recall(Named),
    /// Store the current view in the holodeck under this name.
    Keep(String),
    /// Remove a named view from the holodeck.
    Forget(String),
    /// Store the view again that was removed last.
    RestoreView,
    /// Write a picture of the current view to a file, of this size if one is given. The picture has
    /// the view's proportions.
    Picture(PathBuf, Option<(u32, u32)>),
    /// Draw the current view in a picture beside the walk.
    Render(PictureOrder),
    /// Trace a part of the picture first: left, top, right and bottom, in shares of the picture.
    /// `None` for the whole picture.
    Focus(Option<[f64; 4]>),
    /// Width and height of the picture, pixels.
    Size(u32, u32),
    /// End the session.
    Quit,
}

/// A reference to a named view of the holodeck.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Named {
    /// By its number in the list, from 1.
    Number(usize),
    /// By its name.
    Name(String),
}

/// An input with its sender and the sender's number for it.
#[derive(Clone, Debug)]
pub struct Numbered {
    /// The sender, as numbered by the front end, and the sender's number for the input.
    pub from: (u32, u64),
    /// The input.
    pub input: Input,
}

/// Sends inputs to a stage.
#[derive(Clone)]
pub struct Inputs {
    sender: mpsc::SyncSender<Numbered>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Inputs {
    /// Returns the two ends of the queue. `wake` is called after every input.
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
