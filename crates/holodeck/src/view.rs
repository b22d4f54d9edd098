//! `holodeck view`, `replay` and `picture`: run a viewer, with a server and workers as needed.

use std::{ffi::OsString, net::SocketAddr, path::PathBuf};

use anyhow::{Context, Result};
use holo_net::Shutdown;
use holo_server::Holodeck;
use holo_view::{BrowserArgs, DriverArgs, LookArgs, PointArgs, Screen, ViewArgs};
use tokio::sync::oneshot;

use crate::{
    arguments::picture_path,
    config::HolodeckConfig,
    crew::{SessionProcesses, WorkerArgs},
    joining::ListenArgs,
    prepare::{self, Edited, OtherScene, SMALL_CACHE},
    scene_args::{SceneArgs, Usage},
    worker::NICE_BESIDE_DISPLAY,
};

/// Options for showing and following a session.
#[derive(clap::Args, Clone)]
pub struct SessionArgs {
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    driver: DriverArgs,
    #[command(flatten)]
    points: PointArgs,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    browser: BrowserArgs,
    /// Open a window, and serve no page
    #[arg(long, conflicts_with_all = ["http", "http_cert", "no_open"])]
    window: bool,
    /// Show nothing: follow a script and write pictures
    #[arg(long, conflicts_with_all = ["http", "http_cert", "no_open", "record", "window"])]
    headless: bool,
    /// Follow the lines of this file, each `SECONDS COMMAND` (`-`: standard input). Commands: view,
    /// picture FILE, with PART,…, without PART,… (of the render cache), quit
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// Without a script: end after this time, such as 20s
    #[arg(long, value_name = "TIME", default_value = "0", value_parser = holo_view::parse_seconds)]
    time: f64,
    /// Write a picture to this file at the end (.exr .hdr .pfm .png)
    #[arg(short, value_name = "FILE", value_parser = picture_path())]
    output: Option<PathBuf>,
    /// Report every picture as a line of JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

impl SessionArgs {
    /// Returns the viewer's options, for a server's address or the string to join it.
    fn viewer(&self, server: impl ToString) -> holo_view::Config {
        holo_view::Config {
            connect: server.to_string(),
            view: self.view.clone(),
            driver: self.driver.clone(),
            points: self.points.clone(),
            look: self.look,
            script: self.script.clone(),
            time: self.time,
            output: self.output.clone(),
            json: self.json,
            quiet: self.quiet,
            with_parent: false,
            crew: None,
        }
    }

    /// Refuses options without any effect. `keeps` is true if traced samples go to a file that
    /// stays, and `example` is a command that has an effect.
    fn check(&self, keeps: bool, example: &str) -> Result<(), Usage> {
        self.driver.check().map_err(Usage)?;
        self.look.look().map_err(Usage)?;
        if !self.headless {
            return self.check_walk(example);
        }
        let fills = keeps && self.time > 0.0;
        if self.script.is_none() && self.output.is_none() && !fills {
            return Err(Usage(format!(
                "this would write nothing: say -o FILE or --script FILE, as in\n  {example}"
            )));
        }
        Ok(())
    }

    /// Refuses options that do not apply to a session in which a person walks.
    fn check_walk(&self, example: &str) -> Result<(), Usage> {
        let said = [
            ("--script", self.script.is_some()),
            ("--time", self.time > 0.0),
            ("-o", self.output.is_some()),
            ("--json", self.json),
        ];
        match said.into_iter().find(|(_, is_said)| *is_said) {
            None => Ok(()),
            Some((option, _)) => Err(Usage(format!(
                "{option} is for sessions in which nobody walks: add --headless, as in\n  {example}"
            ))),
        }
    }

    /// Returns the front end of the session.
    ///
    /// # Errors
    /// If it cannot run here.
    fn front_end(&self, screen: Screen) -> Result<FrontEnd> {
        let front_end = if self.headless {
            FrontEnd::Script
        } else if self.window {
            FrontEnd::Window { record: self.browser.record.clone(), screen }
        } else {
            FrontEnd::Browser(self.browser.clone())
        };
        front_end.check()?;
        Ok(front_end)
    }
}

/// The front end of a session.
pub enum FrontEnd {
    /// A page in a browser.
    Browser(BrowserArgs),
    /// A window.
    Window {
        /// The file in which the walk is recorded, as a script.
        record: Option<PathBuf>,
        /// Connection to the thread that windows belong to.
        screen: Screen,
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
    async fn show(
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

/// Walk through a scene or a holodeck in a browser or a window, with everything on this machine
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck view room.obj\n  \
    holodeck view room.obj --window\n  \
    holodeck view room.obj --listen 0.0.0.0:7070\n  \
    holodeck view --join holodeck://192.0.2.7:7070/FINGERPRINT/TOKEN\n  \
    holodeck view room.obj --headless --time 20s -o view.png\n  holodeck view room.holo --headless --script walk.txt --size 640x480")]
pub struct ViewCommand {
    /// The scene, or a holodeck to go on with
    #[arg(value_name = "MODEL|FILE.holo")]
    what: Option<PathBuf>,
    /// Keep the samples in this file [default for a scene: forget them at the end]
    #[arg(long, value_name = "FILE.holo")]
    keep: Option<PathBuf>,
    /// Walk through what another machine serves: the string that its server prints
    #[arg(long, value_name = "STRING", conflicts_with_all = ["what", "keep", "listen", "threads", "cache"])]
    join: Option<String>,
    #[command(flatten)]
    listen: ListenArgs,
    #[command(flatten)]
    session: SessionArgs,
    #[command(flatten)]
    scene_args: SceneArgs,
    /// If the file was made of the scene before an edit: go on with the scene as it is now
    #[arg(long, conflicts_with = "join")]
    restart: bool,
    /// Threads that trace [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
    /// Memory for beams that are kept at hand, MiB [default: 256]
    #[arg(long, value_name = "MIB", value_parser = holo_server::parse_memory)]
    cache: Option<u64>,
}

/// See [`ViewCommand`].
pub async fn view(args: ViewCommand, screen: Screen) -> Result<()> {
    let is_holodeck =
        args.what.as_ref().is_some_and(|path| path.extension().is_some_and(|end| end == "holo"));
    args.session.check(
        is_holodeck || args.keep.is_some() || args.join.is_some(),
        "holodeck view room.obj --headless --time 20s -o view.png",
    )?;
    let front_end = args.session.front_end(screen)?;
    if let Some(server) = &args.join {
        let shutdown = Shutdown::new();
        shutdown.on_signals(false)?;
        let config = args.session.viewer(server);
        return front_end.show(config, shutdown, holo_view::at_once()).await;
    }
    let quiet = args.session.quiet || args.session.json;
    let listen = args.listen;
    if let Some(file) = args.what.as_ref().filter(|_| is_holodeck) {
        let (threads, cache) = (args.threads, args.cache);
        let file = file.clone();
        if args.restart {
            let again = file.clone();
            tokio::task::spawn_blocking(move || Edited::read(&again, None)?.restart(&again))
                .await??;
        }
        let scene = None;
        let session = LiveSession { file, scene, threads, cache, quiet, listen, front_end };
        return session.run(|address| args.session.viewer(address)).await;
    }
    let config = args.scene_args.resolve(args.what.as_ref())?;
    // Without a name, samples exist only as long as the session.
    let temporary = tempfile::tempdir().context("making a temporary folder")?;
    let file = args.keep.clone().unwrap_or_else(|| temporary.path().join("session.holo"));
    let (other_scene, shutdown) = (OtherScene::of_option(args.restart), Shutdown::new());
    shutdown.on_signals(false)?;
    prepare::make_unless_ended(&file, &config, other_scene, quiet, &shutdown).await?;
    let (threads, cache) = (args.threads.or(config.threads), args.cache.or(config.cache));
    let scene = Some(config);
    let session = LiveSession { file, scene, threads, cache, quiet, listen, front_end };
    session.run(|address| args.session.viewer(address)).await
}

/// A viewer in this process, with a server and a worker in other processes.
pub struct LiveSession {
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
    pub listen: ListenArgs,
    /// The front end of the session.
    pub front_end: FrontEnd,
}

impl LiveSession {
    /// Starts server and worker, runs a viewer, and ends all of them. `viewer` makes the viewer's
    /// options for the server's address.
    ///
    /// The viewer prepares the scene while the worker does. Its script starts once the worker is
    /// ready, so that its seconds are seconds of tracing. A page or window opens at once.
    ///
    /// # Errors
    /// The first failure.
    pub async fn run(self, viewer: impl FnOnce(SocketAddr) -> holo_view::Config) -> Result<()> {
        let mut arguments: Vec<OsString> = vec!["--quiet".into()];
        if let Some(cache) = self.cache {
            arguments.extend(["--cache".into(), cache.to_string().into()]);
        }
        let shutdown = Shutdown::new();
        shutdown.on_signals(false)?;
        let (threads, nice, quiet) = (self.threads, NICE_BESIDE_DISPLAY, self.quiet);
        let how = WorkerArgs { threads, nice, quiet };
        let mut crew =
            SessionProcesses::start(self.file, self.scene, self.listen, arguments, how).await?;
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
        let config = holo_view::Config { crew: Some(crew.orders()), ..viewer(crew.address()) };
        let viewing = self.front_end.show(config, shutdown.clone(), ready);
        let result = crew.keep(viewing).await;
        result.and(crew.end().await)
    }
}

/// Walk through a holodeck without tracing anything
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck replay room.holo\n  \
    holodeck replay room.holo --headless --script walk.txt")]
pub struct ReplayCommand {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    #[command(flatten)]
    session: SessionArgs,
}

/// See [`ReplayCommand`].
pub async fn replay(args: ReplayCommand, screen: Screen) -> Result<()> {
    args.session.check(false, "holodeck replay room.holo --headless -o view.png")?;
    let front_end = args.session.front_end(screen)?;
    show_stored(args.file, front_end, |address| args.session.viewer(address)).await
}

/// Make a picture from what a holodeck holds, without tracing anything
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck picture room.holo --view bedroom -o view.png\n  \
    holodeck picture room.holo --vp 12.5,0.5,5 --vd 0.7,0.7,0 --vh 60 --size 640x480 -o view.exr\n  \
    holodeck picture room.holo --falsecolor=1:1000 --log --contours -o luminance.png")]
pub struct PictureCommand {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// The picture (.exr .hdr .pfm .png)
    #[arg(short, value_name = "FILE", value_parser = picture_path())]
    output: PathBuf,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    driver: DriverArgs,
    #[command(flatten)]
    points: PointArgs,
    #[command(flatten)]
    look: LookArgs,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

/// See [`PictureCommand`].
pub async fn picture(args: PictureCommand) -> Result<()> {
    args.driver.check().map_err(Usage)?;
    args.look.check(&args.output).map_err(Usage)?;
    let kept = Holodeck::open_read_only(&args.file, SMALL_CACHE)?.about.exposure;
    let look = args.look.with_kept_exposure(kept);
    show_stored(args.file, FrontEnd::Script, |address| holo_view::Config {
        connect: address.to_string(),
        view: args.view,
        driver: args.driver,
        points: args.points,
        look,
        script: None,
        time: 0.0,
        output: Some(args.output),
        json: args.json,
        quiet: args.quiet,
        with_parent: false,
        crew: None,
    })
    .await
}

/// Runs a display-only server and a viewer, both in this process.
async fn show_stored(
    file: PathBuf,
    front_end: FrontEnd,
    viewer: impl FnOnce(SocketAddr) -> holo_view::Config,
) -> Result<()> {
    let config = holo_server::Config { display_only: true, ..holo_server::Config::new(file) };
    let shutdown = Shutdown::new();
    shutdown.on_signals(false)?;
    let ending = Shutdown::new();
    let (sender, address) = oneshot::channel();
    let server = tokio::spawn(holo_server::run(config, ending.clone(), |ready| {
        // The receiver waits right below.
        let _ = sender.send(ready.address);
    }));
    let Ok(address) = address.await else {
        return server.await?.map(|_| ());
    };
    let config = viewer(address);
    let result = front_end.show(config, shutdown, holo_view::at_once()).await;
    ending.trigger();
    server.await??;
    result
}
