//! The crew of a session: whoever has started its server and its workers, and what a person at the
//! stage orders them to do.

use std::net::SocketAddr;

use anyhow::{Context, Result};
use tokio::sync::{mpsc, oneshot};

/// What the crew is ordered to do.
#[derive(Debug)]
pub enum CrewOrder {
    /// Ends the workers, and starts no others.
    KillWorkers,
    /// Ends the workers if there are any, and starts others.
    RestartWorkers,
    /// Forgets all samples. Answers with the address of a server that has none.
    StartOver(oneshot::Sender<Result<SocketAddr>>),
}

/// Gives orders to a crew.
#[derive(Clone, Debug)]
pub struct Crew(mpsc::UnboundedSender<CrewOrder>);

/// Returns the two ends of the way to a crew.
pub fn crew() -> (Crew, mpsc::UnboundedReceiver<CrewOrder>) {
    let (sender, orders) = mpsc::unbounded_channel();
    (Crew(sender), orders)
}

impl Crew {
    /// Ends the workers.
    pub fn kill_workers(&self) {
        // A crew that has left needs no orders.
        let _ = self.0.send(CrewOrder::KillWorkers);
    }

    /// Starts the workers again.
    pub fn restart_workers(&self) {
        let _ = self.0.send(CrewOrder::RestartWorkers);
    }

    /// Forgets all samples, and waits until a server is there that has none. Blocks.
    ///
    /// # Errors
    /// If the file cannot be made anew, or no server be started.
    pub fn start_over(&self) -> Result<SocketAddr> {
        let (sender, answer) = oneshot::channel();
        let _ = self.0.send(CrewOrder::StartOver(sender));
        answer.blocking_recv().context("nobody is there to start over")?
    }
}
