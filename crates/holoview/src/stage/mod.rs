//! The stage: a thread that owns a session and moves its eye, for front ends that people use.
//!
//! Front ends send inputs and take frames; they meet neither the session nor each other.
//!
//! What always holds:
//! - An input never waits for the server, a disk or a front end: only for the frame under way.
//! - Front ends take frames from a place that holds the latest one. Whoever is slow misses some.
//! - With nothing new, nothing is drawn.
//! - A frame names the last input that it shows.

mod detail;
mod input;
mod record;
mod run;
mod shown;

use std::sync::{Arc, mpsc};

use anyhow::Result;
use tokio::sync::watch;

pub use input::{Input, Inputs, Named, Numbered};
pub use shown::{Phase, Shown, State};

use crate::session::Connected;
use record::Record;
use shown::Publisher;

/// Options of a stage.
pub struct Wishes {
    /// The first view and the size, as on the command line.
    pub view: crate::ViewArgs,
    /// Metres per scene unit.
    pub unit: f64,
    /// The file that the walk is recorded in, as a script.
    pub record: Option<std::path::PathBuf>,
}

/// A front end's access to a stage.
#[derive(Clone)]
pub struct Front {
    /// Takes inputs.
    pub inputs: Inputs,
    /// The latest frame.
    pub frames: Arc<watch::Sender<Option<Arc<Shown>>>>,
    /// How things are.
    pub state: Arc<watch::Sender<Arc<State>>>,
}

/// A stage that has not begun.
pub struct Stage {
    connected: Connected,
    wishes: Wishes,
    inputs: mpsc::Receiver<Numbered>,
    front: Front,
}

/// Returns a stage, and what front ends need of it.
pub fn stage(connected: Connected, wishes: Wishes) -> (Stage, Front) {
    let waker = connected.waker();
    let (inputs, receiver) = Inputs::new(Arc::new(move || waker.wake()));
    let front = Front { inputs, frames: Arc::default(), state: Arc::default() };
    (Stage { connected, wishes, inputs: receiver, front: front.clone() }, front)
}

impl Stage {
    /// Runs until somebody quits. Blocks: to be called on a thread of its own.
    ///
    /// # Errors
    /// If the server is lost, or there is no view to begin with. Front ends are told as well.
    pub fn run(self) -> Result<()> {
        let state = Arc::clone(&self.front.state);
        let ended = self.play();
        let reason = match &ended {
            Ok(()) => "The session has ended.".to_owned(),
            Err(error) => format!("{error:#}"),
        };
        state.send_modify(|state| Arc::make_mut(state).phase = Phase::Ended(reason));
        ended
    }

    fn play(self) -> Result<()> {
        let publisher = Publisher::new(self.front);
        let loading = |text: &str| publisher.phase(Phase::Loading(text.to_owned()));
        let Some(session) = self.connected.begin(loading)? else { return Ok(()) };
        let record = self.wishes.record.as_deref().map(Record::create).transpose()?;
        let stated = self.wishes.view.spec(session.named_views())?;
        let first = session.first_view()?.overridden_by(&stated);
        let size = self.wishes.view.size;
        run::Player::new(session, first, self.wishes.unit, size, self.inputs, publisher, record)?
            .play()
    }
}
