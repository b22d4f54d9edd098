//! The crew of a live session: a server and a worker, and the orders that a person gives them.

use std::{
    ffi::OsString,
    net::SocketAddr,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use holo_server::{Holodeck, Outside};
use holo_view::{CrewMailbox, CrewOrder, Restarted};
use tokio::{sync::oneshot, task::JoinHandle};

use crate::{
    config::HolodeckConfig,
    listening::ListenOptions,
    prepare::{Edited, stated_for},
    processes::LocalServer,
    worker::KeptWorker,
};

/// Most times that a server is started again within [`FEW_ENDS_IN`].
const MOST_ENDS: usize = 3;

/// See [`MOST_ENDS`].
const FEW_ENDS_IN: Duration = Duration::from_secs(60);

/// The processes of a live session.
pub struct SessionProcesses {
    /// The program that contains server and worker.
    program: PathBuf,
    /// The holodeck.
    file: PathBuf,
    /// How its scene can be read again. `None`: as the file says.
    scene: Option<HolodeckConfig>,
    /// The scene that is being read again, and who wants it.
    reading: Option<(JoinHandle<Result<Edited>>, Answer)>,
    /// The scene that was read again.
    edited: Option<Edited>,
    /// Where the server listens.
    listen: ListenOptions,
    /// Further arguments of the server.
    arguments: Vec<OsString>,
    how: WorkerArgs,
    server: LocalServer,
    worker: KeptWorker,
    /// When the server has ended by itself.
    ends: Vec<Instant>,
    mailbox: CrewMailbox,
    giver: holo_view::Crew,
}

/// Takes the answer to whoever wants a scene to be read again.
type Answer = oneshot::Sender<Result<()>>;

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

impl SessionProcesses {
    /// Starts server and worker: both are `program`. The server gets `arguments` as well.
    ///
    /// # Errors
    /// If one of them cannot be started.
    pub async fn start(
        program: PathBuf,
        file: PathBuf,
        scene: Option<HolodeckConfig>,
        mut listen: ListenOptions,
        arguments: Vec<OsString>,
        how: WorkerArgs,
    ) -> Result<SessionProcesses> {
        let (server, worker) = begin(&program, &file, &listen, &arguments, how).await?;
        // Whoever joins expects a server that starts again at the same address.
        listen.stay_at(server.outside.as_ref().map_or(server.address, |outside| outside.address));
        let (giver, mailbox) = holo_view::crew();
        mailbox.stated.send_replace(Arc::new(stated_for(&file)?));
        let (reading, edited) = (None, None);
        Ok(SessionProcesses {
            program,
            file,
            scene,
            reading,
            edited,
            listen,
            arguments,
            how,
            server,
            worker,
            ends: Vec::new(),
            mailbox,
            giver,
        })
    }

    /// Returns where the server listens.
    pub fn address(&self) -> SocketAddr {
        self.server.address
    }

    /// Returns where other machines join, if they may.
    pub fn outside(&self) -> Option<&Outside> {
        self.server.outside.as_ref()
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
                Err(error) = self.server.process.wait() => self.start_server_again(error).await?,
                read = finished(&mut self.reading) => self.take_scene(read),
                Some(order) = self.mailbox.orders.recv() => self.follow(order).await?,
            }
        }
    }

    async fn follow(&mut self, order: CrewOrder) -> Result<()> {
        match order {
            CrewOrder::KillWorkers => self.worker.kill().await,
            CrewOrder::RestartWorkers => self.worker.restart().await,
            CrewOrder::ReadScene(change, answer) => {
                let (file, scene) = (self.file.clone(), self.scene.clone());
                let read = tokio::task::spawn_blocking(move || {
                    Edited::read(&file, scene.as_ref(), &change)
                });
                // Whoever asked before gets no answer.
                (self.reading, self.edited) = (Some((read, answer)), None);
                Ok(())
            }
            CrewOrder::ForgetScene => {
                (self.reading, self.edited) = (None, None);
                Ok(())
            }
            CrewOrder::Restart(answer) => {
                let restarted = self.restart().await?;
                let _ = answer.send(Ok(restarted));
                Ok(())
            }
            CrewOrder::StartOver(answer) => {
                self.start_over().await?;
                // A session that has ended meanwhile needs no answer.
                let _ = answer.send(Ok(self.server.address));
                Ok(())
            }
        }
    }

    /// Keeps a scene that was read again, and says that it can be used; or why not.
    fn take_scene(&mut self, (read, answer): (Result<Edited>, Answer)) {
        let read = read.map(|edited| self.edited = Some(edited));
        let read = read.context("the scene stays as it is");
        let words = read.as_ref().err().map(|error| format!("{error:#}"));
        // A session that has ended meanwhile needs no answer. One that goes on has it before the
        // words are read, and takes the next restart.
        let _ = answer.send(read);
        words.iter().for_each(|words| eprintln!("{words}"));
    }

    /// Goes on with the scene that was read again.
    async fn restart(&mut self) -> Result<Restarted> {
        let nothing = |address, trouble| {
            let (baked, moved) = (Vec::new(), Vec::new());
            Restarted { address, trouble, baked, moved }
        };
        let Some(edited) = self.edited.take() else {
            return Ok(nothing(self.server.address, None));
        };
        self.worker.kill().await?;
        self.server.process.end_to_start_again().await?;
        let file = self.file.clone();
        let restarting = move || edited.restart(&file).map(|trouble| (trouble, edited));
        let restarted = match tokio::task::spawn_blocking(restarting).await? {
            Ok((trouble, edited)) => {
                self.mailbox.stated.send_replace(Arc::new(edited.stated()));
                // Without a configuration, the file says it.
                self.scene = self.scene.as_ref().map(|_| edited.config().clone());
                let (baked, moved) = (edited.baked().to_vec(), edited.moved().to_vec());
                Restarted { trouble, baked, moved, ..nothing(self.server.address, None) }
            }
            Err(error) => {
                let words = format!("the scene stays as it is: {error:#}");
                eprintln!("{words}");
                nothing(self.server.address, Some(words))
            }
        };
        self.begin().await?;
        Ok(Restarted { address: self.server.address, ..restarted })
    }

    async fn start_over(&mut self) -> Result<()> {
        self.worker.kill().await?;
        self.server.process.end_to_start_again().await?;
        let file = self.file.clone();
        tokio::task::spawn_blocking(move || Holodeck::start_over(&file)).await??;
        self.begin().await
    }

    /// Starts server and worker again after the server has ended by itself, unless that happens too
    /// often.
    async fn start_server_again(&mut self, error: anyhow::Error) -> Result<()> {
        self.ends.retain(|end| end.elapsed() < FEW_ENDS_IN);
        if self.ends.len() >= MOST_ENDS {
            return Err(error).context("the server ends again and again");
        }
        self.ends.push(Instant::now());
        eprintln!("{error:#}; it is started again");
        self.worker.kill().await?;
        self.begin().await
    }

    /// Starts server and worker again.
    async fn begin(&mut self) -> Result<()> {
        (self.server, self.worker) =
            begin(&self.program, &self.file, &self.listen, &self.arguments, self.how).await?;
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

/// Returns the scene that is being read, once it is; never if none is.
async fn finished(
    reading: &mut Option<(JoinHandle<Result<Edited>>, Answer)>,
) -> (Result<Edited>, Answer) {
    let Some((read, _)) = reading else { return std::future::pending().await };
    let read = read.await.map_err(anyhow::Error::from).flatten();
    match reading.take() {
        Some((_, answer)) => (read, answer),
        None => std::future::pending().await,
    }
}

async fn begin(
    program: &Path,
    file: &Path,
    listen: &ListenOptions,
    arguments: &[OsString],
    how: WorkerArgs,
) -> Result<(LocalServer, KeptWorker)> {
    let mut all: Vec<OsString> = vec![file.into()];
    all.extend(listen.arguments());
    all.extend_from_slice(arguments);
    let server = LocalServer::start(program, &all).await?;
    let worker = KeptWorker::start(program, server.address, how.threads, how.nice, how.quiet)?;
    Ok((server, worker))
}
