//! The crew of a session: the part of the program that started the server and the workers. The
//! stage sends it orders.

use std::net::SocketAddr;

use anyhow::{Context, Result};
use tokio::sync::{mpsc, oneshot};

/// An order to the crew.
#[derive(Debug)]
pub enum CrewOrder {
    /// Ends the workers, and starts no others.
    KillWorkers,
    /// Ends the workers, if any run, and starts new ones.
    RestartWorkers,
    /// Forgets all samples. The answer is the address of a server without samples.
    StartOver(oneshot::Sender<Result<SocketAddr>>),
    /// Reads the scene's file again, while everything goes on. Answers once the scene is known to
    /// differ and to be usable.
    ReadScene(oneshot::Sender<Result<()>>),
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
}

/// Gives orders to a crew.
#[derive(Clone, Debug)]
pub struct Crew(mpsc::UnboundedSender<CrewOrder>);

/// Returns the two ends of the channel to a crew: where orders go in, and where they come out.
pub fn crew() -> (Crew, mpsc::UnboundedReceiver<CrewOrder>) {
    let (sender, orders) = mpsc::unbounded_channel();
    (Crew(sender), orders)
}

impl Crew {
    /// Ends the workers.
    pub fn kill_workers(&self) {
        // If the crew has ended, the order has no effect.
        let _ = self.0.send(CrewOrder::KillWorkers);
    }

    /// Starts the workers again.
    pub fn restart_workers(&self) {
        let _ = self.0.send(CrewOrder::RestartWorkers);
    }

    /// Forgets all samples, and waits until a server without samples runs. Blocks.
    ///
    /// # Errors
    /// If the file cannot be created again, or the server cannot be started.
    pub fn start_over(&self) -> Result<SocketAddr> {
        let (sender, answer) = oneshot::channel();
        let _ = self.0.send(CrewOrder::StartOver(sender));
        answer.blocking_recv().context("nobody is there to start over")?
    }

    /// Reads the scene's file again, while everything goes on. The answer comes once that is done;
    /// an error is for people.
    pub fn read_scene(&self) -> oneshot::Receiver<Result<()>> {
        let (sender, answer) = oneshot::channel();
        let _ = self.0.send(CrewOrder::ReadScene(sender));
        answer
    }

    /// Goes on with the scene that was [read](Self::read_scene), and waits until a server is there
    /// that has it. Blocks.
    ///
    /// # Errors
    /// If no server can be started.
    pub fn restart(&self) -> Result<Restarted> {
        let (sender, answer) = oneshot::channel();
        let _ = self.0.send(CrewOrder::Restart(sender));
        answer.blocking_recv().context("nobody is there to restart")?
    }
}
