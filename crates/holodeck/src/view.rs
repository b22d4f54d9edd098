//! `holodeck view`, `replay` and `picture`: a viewer, with a server and workers as far as they are needed.

use std::{ffi::OsString, path::PathBuf};

use anyhow::{Context, Result};
use holo_net::Shutdown;
use holo_view::{DriverArgs, PointArgs, ViewArgs};
use tokio::sync::oneshot;

use crate::{
    prepare,
    processes::Server,
    scene_args::{SceneArgs, Usage},
};

/// How a session is shown and followed.
#[derive(clap::Args, Clone)]
pub struct SessionArgs {
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    driver: DriverArgs,
    #[command(flatten)]
    points: PointArgs,
    /// Without a window: follow a script and write pictures
    #[arg(long)]
    headless: bool,
    /// Follow this file's lines, each `SECONDS COMMAND` (`-`: standard input). Commands: view, picture FILE,
    /// with PART,…, without PART,… (of the render cache), quit
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// Without a script: stay for so long, such as 20s
    #[arg(long, value_name = "TIME", default_value = "0", value_parser = holo_view::parse_seconds)]
    time: f64,
    /// Report every picture as a line of JSON
    #[arg(long)]
    json: bool,
    /// Say less
    #[arg(short, long)]
    quiet: bool,
}

impl SessionArgs {
    fn viewer(&self, address: std::net::SocketAddr, output: Option<PathBuf>) -> holo_view::Config {
        holo_view::Config {
            connect: address.to_string(),
            view: self.view.clone(),
            driver: self.driver,
            points: self.points.clone(),
            script: self.script.clone(),
            time: self.time,
            output,
            json: self.json,
            quiet: self.quiet,
            with_parent: false,
        }
    }

    fn check(&self) -> Result<()> {
        self.driver.check().map_err(Usage)?;
        if self.headless {
            return Ok(());
        }
        Err(Usage(
            "there is no window yet: say --headless, with --script FILE or --time TIME".into(),
        )
        .into())
    }
}

/// Walk through a scene or a holodeck: server, workers and viewer on this machine.
///
/// Example: holodeck view room.obj --headless --script walk.txt --size 640x480
#[derive(clap::Args)]
pub struct ViewCommand {
    /// The scene, or a holodeck to go on with
    #[arg(value_name = "SCENE.obj|FILE.holo")]
    what: Option<PathBuf>,
    /// Keep the samples here [default for a scene: forget them at the end]
    #[arg(long, value_name = "FILE.holo")]
    keep: Option<PathBuf>,
    /// At the end, once everything under way has arrived, write the picture here
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    session: SessionArgs,
    #[command(flatten)]
    scene_args: SceneArgs,
    /// Threads that trace [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
    /// Memory for beams kept at hand, MiB [default: 256]
    #[arg(long, value_name = "MIB")]
    cache: Option<u64>,
}

/// See [`ViewCommand`].
pub async fn view(args: ViewCommand) -> Result<()> {
    args.session.check()?;
    let is_holodeck =
        args.what.as_ref().is_some_and(|path| path.extension().is_some_and(|end| end == "holo"));
    if let Some(file) = args.what.as_ref().filter(|_| is_holodeck) {
        let session = LiveSession { file: file.clone(), threads: args.threads, cache: args.cache };
        return session.run(|address| args.session.viewer(address, args.output.clone())).await;
    }
    let config = args.scene_args.resolve(args.what.as_ref())?;
    // Without a name, samples live only as long as the session.
    let temporary = args
        .keep
        .is_none()
        .then(tempfile::tempdir)
        .transpose()
        .context("making a temporary folder")?;
    let file = match (&args.keep, &temporary) {
        (Some(file), _) => file.clone(),
        (None, Some(folder)) => folder.path().join("session.holo"),
        (None, None) => PathBuf::from("session.holo"),
    };
    drop(prepare::make(&file, &config)?);
    let threads = args.threads.or(config.threads);
    let session = LiveSession { file, threads, cache: args.cache.or(config.cache) };
    session.run(|address| args.session.viewer(address, args.output.clone())).await
}

/// Server and worker processes around a viewer in this one.
pub struct LiveSession {
    /// The holodeck.
    pub file: PathBuf,
    /// Threads that trace.
    pub threads: Option<u16>,
    /// Memory for beams, MiB.
    pub cache: Option<u64>,
}

impl LiveSession {
    /// Starts both, runs the viewer that `viewer` makes for the server's address, and ends both.
    ///
    /// # Errors
    /// Whatever failed first.
    pub async fn run(
        self,
        viewer: impl FnOnce(std::net::SocketAddr) -> holo_view::Config,
    ) -> Result<()> {
        let mut arguments: Vec<OsString> = vec![self.file.into(), "--quiet".into()];
        if let Some(cache) = self.cache {
            arguments.extend(["--cache".into(), cache.to_string().into()]);
        }
        let shutdown = Shutdown::new();
        shutdown.on_signals(false)?;
        let server = Server::start(arguments).await?;
        let mut worker = server.worker(self.threads, true)?;
        let viewing = holo_view::run(viewer(server.address), shutdown);
        tokio::pin!(viewing);
        let result = tokio::select! {
            result = &mut viewing => result,
            // Without its only worker the session would wait for ever; the worker has said why on standard error.
            Err(error) = worker.wait() => Err(error),
        };
        let ended = server.process.end().await;
        // It leaves with the server; its own trouble, if any, has been named.
        let left = worker.end().await;
        result.and(ended).and(left)
    }
}

/// Walk through a holodeck without tracing anything.
///
/// Example: holodeck replay room.holo --headless --script walk.txt
#[derive(clap::Args)]
pub struct ReplayCommand {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// At the end, once everything stored has arrived, write the picture here
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    session: SessionArgs,
}

/// See [`ReplayCommand`].
pub async fn replay(args: ReplayCommand) -> Result<()> {
    args.session.check()?;
    show_stored(args.file, |address| args.session.viewer(address, args.output.clone())).await
}

/// A picture from a holodeck, from what is stored.
///
/// Example: holodeck picture room.holo --vp 12.5,0.5,5 --vd 0.707,0.707,0 --vh 60 --size 640x480 -o view.png
#[derive(clap::Args)]
pub struct PictureCommand {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// The picture (.exr .hdr .pfm .png)
    #[arg(short, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    driver: DriverArgs,
    #[command(flatten)]
    points: PointArgs,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Say less
    #[arg(short, long)]
    quiet: bool,
}

/// See [`PictureCommand`].
pub async fn picture(args: PictureCommand) -> Result<()> {
    args.driver.check().map_err(Usage)?;
    show_stored(args.file, |address| holo_view::Config {
        connect: address.to_string(),
        view: args.view,
        driver: args.driver,
        points: args.points,
        script: None,
        time: 0.0,
        output: Some(args.output),
        json: args.json,
        quiet: args.quiet,
        with_parent: false,
    })
    .await
}

/// A display-only server and a viewer, both within this process: there is nothing to be kept apart.
async fn show_stored(
    file: PathBuf,
    viewer: impl FnOnce(std::net::SocketAddr) -> holo_view::Config,
) -> Result<()> {
    let config = holo_server::Config { display_only: true, ..holo_server::Config::new(file) };
    let shutdown = Shutdown::new();
    shutdown.on_signals(false)?;
    let ending = Shutdown::new();
    let (sender, address) = oneshot::channel();
    let server = tokio::spawn(holo_server::run(config, ending.clone(), |address| {
        // The receiver waits right below.
        let _ = sender.send(address);
    }));
    let Ok(address) = address.await else {
        return server.await?.map(|_| ());
    };
    let result = holo_view::run(viewer(address), shutdown).await;
    ending.trigger();
    server.await??;
    result
}
