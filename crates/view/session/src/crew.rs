//! The crew of a session: the part of the program that started the server and the workers. Front
//! ends send it orders.

use std::{net::SocketAddr, sync::Arc};

use anyhow::{Context, Result};
use tokio::sync::{mpsc, oneshot, watch};

use super::{motion::MovedObject, scene_change::SceneChange};

/// An order to the crew.
#[derive(Debug)]
pub enum CrewOrder {
    /// Ends the workers, and starts no others.
    KillWorkers,
    /// Ends the workers, if any run, and starts new ones.
    RestartWorkers,
    /// Forgets all samples. The answer is the address of a server without samples.
    StartOver(oneshot::Sender<Result<SocketAddr>>),
    /// Reads the scene's file again, with a change, while everything goes on. Answers once the
    /// scene is known to differ and to be usable.
    ReadScene(SceneChange, oneshot::Sender<Result<()>>),
    /// Forgets the scene that was read.
    ForgetScene,
    /// Goes on with the scene that was read. Answers with the address of a server that has it.
    Restart(oneshot::Sender<Result<Restarted>>),
}

/// A server that was started again.
#[derive(Debug)]
pub struct Restarted {
    /// Where it listens.
    pub address: SocketAddr,
    /// Why it has the same scene as before, or what is odd of its scene, for people.
    pub trouble: Option<String>,
    /// Names of carried objects that are part of the scene from now on.
    pub baked: Vec<String>,
    /// Objects that were part of the scene, and were moved or taken out.
    pub moved: Vec<MovedObject>,
}

/// What was stated for a scene besides its file: its light, and objects that are part of it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StatedOptions {
    /// The options that state it, by their names as on the command line without `--`.
    pub options: Vec<(String, String)>,
    /// What was made of them, for people.
    pub words: Vec<String>,
    /// Names of objects that were carried in and are part of the scene.
    pub objects: Vec<String>,
}

/// Gives orders to a crew.
#[derive(Clone, Debug)]
pub struct Crew {
    orders: mpsc::UnboundedSender<CrewOrder>,
    stated: watch::Receiver<Arc<StatedOptions>>,
}

/// The crew's end of the channel.
#[derive(Debug)]
pub struct CrewMailbox {
    /// The orders.
    pub orders: mpsc::UnboundedReceiver<CrewOrder>,
    /// What is stated for the scene that the server has.
    pub stated: watch::Sender<Arc<StatedOptions>>,
}

/// Returns the two ends of the channel to a crew: where orders go in, and where they come out.
pub fn crew() -> (Crew, CrewMailbox) {
    let (sender, orders) = mpsc::unbounded_channel();
    let (stated, watched) = watch::channel(Arc::default());
    (Crew { orders: sender, stated: watched }, CrewMailbox { orders, stated })
}

impl Crew {
    /// Ends the workers.
    pub fn kill_workers(&self) {
        // If the crew has ended, the order has no effect.
        let _ = self.orders.send(CrewOrder::KillWorkers);
    }

    /// Starts the workers again.
    pub fn restart_workers(&self) {
        let _ = self.orders.send(CrewOrder::RestartWorkers);
    }

    /// Forgets all samples, and waits until a server without samples runs. Blocks.
    ///
    /// # Errors
    /// If the file cannot be created again, or the server cannot be started.
    pub fn start_over(&self) -> Result<SocketAddr> {
        let (sender, answer) = oneshot::channel();
        let _ = self.orders.send(CrewOrder::StartOver(sender));
        answer.blocking_recv().context("nobody is there to start over")?
    }

    /// Reads the scene's file again, with a change, while everything goes on. The answer comes once
    /// that is done; an error is for people. Whoever asked before gets none.
    pub fn read_scene(&self, change: SceneChange) -> oneshot::Receiver<Result<()>> {
        let (sender, answer) = oneshot::channel();
        let _ = self.orders.send(CrewOrder::ReadScene(change, sender));
        answer
    }

    /// Forgets the scene that was [read](Self::read_scene), because it is not wanted any more.
    pub fn forget_scene(&self) {
        let _ = self.orders.send(CrewOrder::ForgetScene);
    }

    /// Returns what is stated for the scene that the server has.
    pub fn stated(&self) -> Arc<StatedOptions> {
        Arc::clone(&self.stated.borrow())
    }

    /// Goes on with the scene that was [read](Self::read_scene), and waits until a server is there
    /// that has it. Blocks.
    ///
    /// # Errors
    /// If no server can be started.
    pub fn restart(&self) -> Result<Restarted> {
        let (sender, answer) = oneshot::channel();
        let _ = self.orders.send(CrewOrder::Restart(sender));
        answer.blocking_recv().context("nobody is there to restart")?
    }
}
