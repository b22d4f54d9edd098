//! The stage: moves the eye of a session, for front ends with a person.
//!
//! Front ends send inputs and receive frames. They see neither the session nor each other. What
//! several of them need is here: the table of actions and command lines ([`commands`]), the state,
//! and the colours of a screen ([`Viewer`]).
//!
//! Two threads share the work. The hand receives inputs, and shows what is known from where the eye
//! is. The painter owns the session and draws.
//!
//! Invariants:
//! - An input never waits for a server, a disk, a driver or a front end.
//! - Front ends read the latest frame from a shared place. Slow front ends miss some frames.
//! - Nothing is drawn unless something is new.
//! - A frame names the last input that it shows.

pub mod commands;
mod hand;
mod input;
mod painter;
mod picture_file;
mod picture_job;
mod picture_order;
mod record;
mod screen;
mod shown;
mod signal;
mod wall_plan;
mod warp;
mod wishes;
mod world;

#[cfg(test)]
mod tests;

use std::{
    sync::{Arc, mpsc},
    thread,
    time::Duration,
};

use anyhow::{Context, Result, anyhow};
use holo_session::{Again, Connected, Crew, Session, Waker, is_lost};

pub use holo_session::{DriverArg, LightChange, ObjectOrder};
pub use input::{Input, Inputs, Named, Numbered};
pub use picture_file::{encode_picture, format_refusal};
pub use picture_order::{PictureNews, PictureOrder};
pub use screen::{Viewer, on_screen_threads};
pub use shown::{Front, PublishedFrame, SceneLight, StagePhase, State};
pub use wall_plan::{StoreyWalls, WallPlan};
pub use wishes::Wishes;

use hand::{Hand, HandEnding};
use painter::Painter;
use shown::{FrameAudience, Publisher};
use signal::ThreadSignal;

/// Pause between two tries to connect to a server that is started again, and most tries.
const TRY_AGAIN: Duration = Duration::from_millis(200);
const MOST_TRIES: u32 = 100;

/// A stage that has not begun.
pub struct Stage {
    connected: Connected,
    wishes: Wishes,
    inputs: mpsc::Receiver<Numbered>,
    signal: Arc<ThreadSignal>,
    front: Front,
}

/// Returns a stage and a front end's access to it.
pub fn stage(connected: Connected, wishes: Wishes) -> (Stage, Front) {
    let signal = Arc::<ThreadSignal>::default();
    let raising = Arc::clone(&signal);
    let (inputs, receiver) = Inputs::new(Arc::new(move || raising.raise()));
    let front = Front { inputs, frames: Arc::default(), state: Arc::default() };
    (Stage { connected, wishes, inputs: receiver, signal, front: front.clone() }, front)
}

impl Stage {
    /// Runs until the user quits. Blocks, so call it on a thread of its own.
    ///
    /// # Errors
    /// If the server is lost, or there is no first view. Front ends receive the reason too.
    pub fn run(self) -> Result<()> {
        let state = Arc::clone(&self.front.state);
        let ended = self.play();
        let reason = match &ended {
            Ok(()) => "The session has ended.".to_owned(),
            Err(error) => format!("{error:#}"),
        };
        state.send_modify(|state| Arc::make_mut(state).phase = StagePhase::Ended(reason));
        ended
    }

    fn play(self) -> Result<()> {
        let Stage { connected, wishes, inputs, signal, front } = self;
        let watched = FrameAudience(Arc::clone(&front.frames));
        let publisher = Publisher::new(front.clone());
        let loading = |text: &str| {
            let phase = StagePhase::Loading(text.to_owned());
            front.state.send_modify(|state| Arc::make_mut(state).phase = phase);
        };
        let again = connected.again();
        let Some((session, waker)) = begin(connected, loading)? else { return Ok(()) };
        let stated = wishes.view.spec(session.named_views())?;
        let first = session.first_view()?.overridden_by(&stated);
        let (unit, ringing) = (session.unit(), Arc::clone(&signal));
        let objects = again.objects().clone();
        let mut hand = Hand::new(first, unit, &wishes, objects, inputs, ringing, publisher)?;
        let mut next = Some((session, waker));
        while let Some((session, waker)) = next.take() {
            let facts = facts(&session);
            let signal = Arc::clone(&signal);
            let (painter, desk) = Painter::new(session, waker, signal, watched.clone());
            let painter = thread::Builder::new().name("painter".into()).spawn(|| painter.run());
            let painter = painter.context("starting a thread")?;
            let played = hand.play(desk, facts);
            let painted = painter.join().map_err(|_| anyhow!("drawing failed: see above"))?;
            next = match (painted, played?, &wishes.crew) {
                (Ok(()), Some(HandEnding::StartOver), Some(crew)) => {
                    loading("starting over");
                    begin(again.connect(crew.start_over()?)?, loading)?
                }
                (Ok(()), Some(HandEnding::Restart), Some(crew)) => {
                    loading("going on with the scene as it is now");
                    hand.settle_scene();
                    let restarted = crew.restart()?;
                    restarted.trouble.iter().for_each(|trouble| hand.refuse(trouble.clone()));
                    begin(again.follow(&restarted)?, loading)?
                }
                (Err(error), None, Some(crew)) if is_lost(&error) => {
                    loading("the server has ended; it is started again");
                    begin_again(&again, crew, error, loading)?
                }
                // A server that this program has not started may come back.
                (Err(error), None, None) if is_lost(&error) => {
                    loading(&format!("{error:#}; trying to reach it again"));
                    reach(&again, loading)?
                }
                (painted, ..) => {
                    painted?;
                    None
                }
            };
        }
        hand.end()
    }
}

/// Begins a session. Returns `None` if the user ends the wait for its scene.
fn begin(connected: Connected, loading: impl Fn(&str)) -> Result<Option<(Session, Waker)>> {
    let waker = connected.waker();
    Ok(connected.begin(loading)?.map(|session| (session, waker)))
}

/// Begins a session with the server that the crew starts after one that has ended. The crew notices
/// the end later than the session.
///
/// # Errors
/// `lost`, if the crew starts none.
fn begin_again(
    again: &Again,
    crew: &Crew,
    lost: anyhow::Error,
    loading: impl Fn(&str),
) -> Result<Option<(Session, Waker)>> {
    for _ in 0..MOST_TRIES {
        let Ok(restarted) = crew.restart() else { return Err(lost) };
        match again.follow(&restarted).and_then(|connected| begin(connected, &loading)) {
            Err(error) if is_lost(&error) => thread::sleep(TRY_AGAIN),
            begun => return begun,
        }
    }
    Err(lost)
}

/// Begins a session with a server that was lost, once it is back. Returns `None` if the user ends
/// the wait.
fn reach(again: &Again, loading: impl Fn(&str)) -> Result<Option<(Session, Waker)>> {
    loop {
        let Some(connected) = again.reach(Duration::MAX, &loading)? else { return Ok(None) };
        match begin(connected, &loading) {
            Err(error) if is_lost(&error) => {}
            begun => return begun,
        }
    }
}

/// Returns the part of the state that is constant during a session.
fn facts(session: &Session) -> State {
    State {
        phase: StagePhase::Running,
        traces: session.traces(),
        sections: Arc::new(session.sections().iter().map(|s| s.spec().clone()).collect()),
        plan: Arc::new(WallPlan::new(session)),
        up: session.up().to_array(),
        unit: session.unit(),
        ..State::default()
    }
}
