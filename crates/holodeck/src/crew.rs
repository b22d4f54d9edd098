//! The crew of a live session: a server and a worker, and the orders that a person gives them.

use std::{ffi::OsString, net::SocketAddr, path::PathBuf};

use anyhow::Result;
use holo_server::Holodeck;
use holo_view::CrewOrder;
use tokio::sync::mpsc::UnboundedReceiver;

use crate::{processes::Server, worker::KeptWorker};

/// The processes of a live session.
pub struct Crew {
    /// The holodeck.
    file: PathBuf,
    /// Further arguments of the server.
    arguments: Vec<OsString>,
    how: WorkerArgs,
    server: Server,
    worker: KeptWorker,
    orders: UnboundedReceiver<CrewOrder>,
    giver: holo_view::Crew,
}

/// Options of the worker.
#[derive(Clone, Copy)]
pub struct WorkerArgs {
    /// Threads that trace; all cores if `None`.
    pub threads: Option<u16>,
    /// Priority that the worker yields to other programs (`nice`).
    pub nice: u8,
    /// Hides the worker's progress of loading.
    pub quiet: bool,
}

impl Crew {
    /// Starts server and worker. The server gets `arguments` as well.
    ///
    /// # Errors
    /// If one of them cannot be started.
    pub async fn start(file: PathBuf, arguments: Vec<OsString>, how: WorkerArgs) -> Result<Crew> {
        let (server, worker) = begin(&file, &arguments, how).await?;
        let (giver, orders) = holo_view::crew();
        Ok(Crew { file, arguments, how, server, worker, orders, giver })
    }

    /// Returns where the server listens.
    pub fn address(&self) -> SocketAddr {
        self.server.address
    }

    /// Returns the sender of orders.
    pub fn orders(&self) -> holo_view::Crew {
        self.giver.clone()
    }

    /// Returns a future that ends once a worker is ready to trace.
    pub fn worker_is_ready(&self) -> impl Future<Output = ()> + use<> {
        self.worker.ready()
    }

    /// Keeps server and worker alive, and follows orders, until `session` ends.
    ///
    /// # Errors
    /// The first failure of either process or of `session`.
    pub async fn keep(&mut self, session: impl Future<Output = Result<()>>) -> Result<()> {
        tokio::pin!(session);
        loop {
            tokio::select! {
                result = &mut session => return result,
                error = self.worker.keep() => return Err(error),
                Err(error) = self.server.process.wait() => return Err(error),
                Some(order) = self.orders.recv() => self.follow(order).await?,
            }
        }
    }

    async fn follow(&mut self, order: CrewOrder) -> Result<()> {
        match order {
            CrewOrder::KillWorkers => self.worker.kill().await,
            CrewOrder::RestartWorkers => self.worker.restart().await,
            CrewOrder::StartOver(answer) => {
                self.start_over().await?;
                // A session that has ended meanwhile needs no answer.
                let _ = answer.send(Ok(self.server.address));
                Ok(())
            }
        }
    }

    async fn start_over(&mut self) -> Result<()> {
        self.worker.kill().await?;
        self.server.process.end().await?;
        let file = self.file.clone();
        tokio::task::spawn_blocking(move || Holodeck::start_over(&file)).await??;
        (self.server, self.worker) = begin(&self.file, &self.arguments, self.how).await?;
        Ok(())
    }

    /// Ends both processes. Everything traced is stored.
    ///
    /// # Errors
    /// If the server does not end in order.
    pub async fn end(mut self) -> Result<()> {
        let ended = self.server.process.end().await;
        self.worker.end().await;
        ended
    }
}

async fn begin(
    file: &PathBuf,
    arguments: &[OsString],
    how: WorkerArgs,
) -> Result<(Server, KeptWorker)> {
    let mut all: Vec<OsString> = vec![file.into()];
    all.extend_from_slice(arguments);
    let server = Server::start(all).await?;
    let worker = KeptWorker::start(server.address, how.threads, how.nice, how.quiet)?;
    Ok((server, worker))
}
