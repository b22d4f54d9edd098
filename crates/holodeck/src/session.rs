//! Sessions: a viewer, with a server and workers as needed.

use std::{ffi::OsString, net::SocketAddr, path::PathBuf};

use anyhow::{Result, bail};
use holo_net::Shutdown;
use holo_picture::Picture;
use holo_server::{Outside, Summary};
use holo_view::{
    BrowserArgs, DriverArgs, LookArgs, ObjectArgs, ObjectFolder, PictureReport, PointArgs,
    ViewArgs, WindowRequest,
};
use tokio::{sync::oneshot, task::JoinHandle};

use crate::{
    config::HolodeckConfig,
    crew::{SessionProcesses, WorkerArgs},
    listening::ListenOptions,
    worker::NICE_BESIDE_DISPLAY,
};

/// The front end of a session.
pub enum FrontEnd {
    /// A page in a browser.
    Browser(BrowserArgs),
    /// A window.
    Window {
        /// The file in which the walk is recorded, as a script.
        record: Option<PathBuf>,
        /// Connection to the thread that windows belong to.
        screen: WindowRequest,
    },
    /// Nothing is shown, and a script is followed.
    Script,
}

impl FrontEnd {
    /// Checks that this front end can run here, before the session is prepared.
    ///
    /// # Errors
    /// The reason why it cannot.
    pub fn check(&self) -> Result<()> {
        if let FrontEnd::Window { .. } = self { holo_view::check_desktop() } else { Ok(()) }
    }

    /// Shows a session until it ends. A script's time begins when `ready` completes.
    ///
    /// # Errors
    /// If the server cannot be reached or is lost, or nothing can be shown.
    pub async fn show(
        self,
        config: holo_view::Config,
        shutdown: Shutdown,
        ready: oneshot::Receiver<()>,
    ) -> Result<()> {
        match self {
            FrontEnd::Browser(browser) => {
                holo_view::run_in_browser(config, browser, shutdown).await
            }
            FrontEnd::Window { record, screen } => {
                holo_view::run_in_window(config, record, shutdown, screen).await
            }
            FrontEnd::Script => holo_view::run(config, shutdown, ready).await,
        }
    }
}

/// A viewer in this process, with a server and a worker in other processes.
pub struct LiveSession {
    /// The program that contains server and worker: `holodeck`.
    pub program: PathBuf,
    /// The holodeck's path.
    pub file: PathBuf,
    /// How the scene can be read again. `None`: as the file says.
    pub scene: Option<HolodeckConfig>,
    /// Threads that trace.
    pub threads: Option<u16>,
    /// Memory for beams, MiB.
    pub cache: Option<u64>,
    /// Hides the worker's progress of loading.
    pub quiet: bool,
    /// Options for workers and displays on other machines.
    pub listen: ListenOptions,
    /// The front end of the session.
    pub front_end: FrontEnd,
}

impl LiveSession {
    /// Starts server and worker, runs a viewer, and ends all of them. `viewer` makes the viewer's
    /// options for the server's address. Calls `invite` if other machines may join.
    ///
    /// The viewer prepares the scene while the worker does. Its script starts once the worker is
    /// ready, so that its seconds are seconds of tracing. A page or window opens at once.
    ///
    /// # Errors
    /// The first failure.
    pub async fn run(
        self,
        viewer: impl FnOnce(SocketAddr) -> holo_view::Config,
        invite: impl FnOnce(&Outside),
    ) -> Result<()> {
        let mut arguments: Vec<OsString> = vec!["--quiet".into()];
        if let Some(cache) = self.cache {
            arguments.extend(["--cache".into(), cache.to_string().into()]);
        }
        let shutdown = Shutdown::new();
        shutdown.on_signals(false)?;
        let (threads, nice, quiet) = (self.threads, NICE_BESIDE_DISPLAY, self.quiet);
        let how = WorkerArgs { threads, nice, quiet };
        let folder = ObjectFolder::beside(&self.file, true);
        let mut crew = SessionProcesses::start(
            self.program,
            self.file,
            self.scene,
            self.listen,
            arguments,
            how,
        )
        .await?;
        if let Some(outside) = crew.outside() {
            invite(outside);
        }
        let (sender, ready) = oneshot::channel();
        let (is_ready, shutdown_before) = (crew.worker_is_ready(), shutdown.clone());
        tokio::spawn(async move {
            tokio::select! {
                () = is_ready => {
                    // A viewer that has failed meanwhile no longer receives.
                    let _ = sender.send(());
                }
                () = shutdown_before.wait() => {}
            }
        });
        let mut config = holo_view::Config { crew: Some(crew.orders()), ..viewer(crew.address()) };
        config.objects.folder = Some(folder);
        let viewing = self.front_end.show(config, shutdown.clone(), ready);
        let result = crew.keep(viewing).await;
        result.and(crew.end().await)
    }
}

/// Shows what a holodeck holds until the session ends, without tracing anything. `viewer` makes the
/// viewer's options for the server's address. Server and viewer are in this process.
///
/// # Errors
/// If the file cannot be read, or it cannot be shown.
pub async fn replay(
    file: PathBuf,
    front_end: FrontEnd,
    viewer: impl FnOnce(SocketAddr) -> holo_view::Config,
) -> Result<()> {
    let shutdown = Shutdown::new();
    shutdown.on_signals(false)?;
    let folder = ObjectFolder::beside(&file, false);
    let server = StoredServer::start(file).await?;
    let mut config = viewer(server.address);
    config.objects.folder = Some(folder);
    let result = front_end.show(config, shutdown, holo_view::at_once()).await;
    server.end().await?;
    result
}

/// A picture of what a holodeck holds.
#[derive(Clone, Debug, Default)]
pub struct PictureRequest {
    /// The holodeck.
    pub file: PathBuf,
    /// The view, and the size of the picture.
    pub view: ViewArgs,
    /// The driver that draws it.
    pub driver: DriverArgs,
    /// Options of the render cache.
    pub points: PointArgs,
    /// Models that are carried into the scene.
    pub objects: ObjectArgs,
    /// True if progress is shown on standard error.
    pub has_progress: bool,
}

/// Returns a picture of what a holodeck holds, and the report on it, without tracing anything.
/// `None` if `shutdown` is triggered before.
///
/// # Errors
/// If the file cannot be read, or the view does not exist.
pub async fn picture(
    request: PictureRequest,
    shutdown: Shutdown,
) -> Result<Option<(Picture, PictureReport)>> {
    let PictureRequest { file, view, driver, points, objects, has_progress } = request;
    let folder = ObjectFolder::beside(&file, false);
    let objects = ObjectArgs { folder: Some(folder), ..objects };
    let server = StoredServer::start(file).await?;
    let config = holo_view::Config {
        connect: server.address.to_string(),
        view,
        driver,
        points,
        objects,
        look: LookArgs::default(),
        script: None,
        time: 0.0,
        output: None,
        json: false,
        quiet: !has_progress,
        with_parent: false,
        crew: None,
    };
    let picture = holo_view::picture(config, shutdown).await;
    server.end().await?;
    picture
}

/// A server in this process that traces nothing.
struct StoredServer {
    address: SocketAddr,
    ending: Shutdown,
    task: JoinHandle<Result<Summary>>,
}

impl StoredServer {
    /// Starts a server, and waits until it accepts connections.
    async fn start(file: PathBuf) -> Result<StoredServer> {
        let config = holo_server::Config { display_only: true, ..holo_server::Config::new(file) };
        let ending = Shutdown::new();
        let (sender, address) = oneshot::channel();
        let task = tokio::spawn(holo_server::run(config, ending.clone(), |ready| {
            // The receiver waits right below.
            let _ = sender.send(ready.address);
        }));
        match address.await {
            Ok(address) => Ok(StoredServer { address, ending, task }),
            Err(_) => {
                task.await??;
                bail!("the server ended before it listened")
            }
        }
    }

    async fn end(self) -> Result<()> {
        self.ending.trigger();
        self.task.await??;
        Ok(())
    }
}
