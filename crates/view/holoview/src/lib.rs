//! Chooses how a server's holodeck is shown: by a script, on a page, or in a window. Each front end
//! is a package; here they meet with a session and its driver.
//!
//! Invariants:
//! - Wrong options are refused before anything is opened.
//! - A front end receives a session or a stage that is connected already. It never connects.

#[cfg(not(feature = "window"))]
mod no_window;
#[cfg(feature = "window")]
mod window;

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use holo_drivers::{DriverOptions, SWITCHES};
use holo_net::{Destination, Shutdown};
use holo_page::PageServer;
use holo_picture::Picture;
use holo_script::{Script, ScriptOptions};
pub use holo_session::ObjectFolder;
use holo_session::{Connected, ObjectOrder};
use holo_stage::{Front, Stage, Wishes, stage};
use tokio::sync::oneshot;

pub use holo_denoise::{Denoiser, Quality};
pub use holo_drivers::{DenoiseArg, DriverArgs, PointArgs, denoise};
pub use holo_options::{LookArgs, ViewArgs, parse_size};
pub use holo_page::BrowserArgs;
pub use holo_script::{PictureReport, parse_seconds};
pub use holo_session::{
    Crew, CrewMailbox, CrewOrder, DriverArg, LightChange, MovedObject, NONE, ObjectPose,
    PlacedModel, Restarted, SceneChange, StatedOptions, crew,
};
#[cfg(not(feature = "window"))]
pub use no_window::{WindowHost, WindowRequest, check_desktop, desk, run_in_window};
#[cfg(feature = "window")]
pub use window::{WindowHost, WindowRequest, check_desktop, desk, run_in_window};

/// Models that are carried into the scene.
#[derive(Args, Clone, Debug, Default)]
pub struct ObjectArgs {
    /// Carry a model into the scene, with the middle of its base at this place: chair.glb@1,2,0.
    /// TURN is in degrees around the scene's up axis; SCALE is a factor. May be given several times
    #[arg(
        long = "object",
        value_name = "FILE@X,Y,Z[,TURN[,SCALE]]",
        value_parser = ObjectOrder::parse_option
    )]
    pub objects: Vec<ObjectOrder>,
    /// The folder in which objects are kept.
    #[arg(skip)]
    pub folder: Option<ObjectFolder>,
}

/// Options of `holoview`.
#[derive(Args, Clone, Debug)]
pub struct Config {
    /// Where the holoserver is: an address on this machine, or the join string that it prints
    #[arg(
        long,
        visible_alias = "join",
        value_name = "HOST:PORT|STRING",
        default_value = "127.0.0.1:7070"
    )]
    pub connect: String,
    /// The view to show
    #[command(flatten)]
    pub view: ViewArgs,
    /// The driver: the method that turns samples into a picture
    #[command(flatten)]
    pub driver: DriverArgs,
    /// Options of the render cache
    #[command(flatten)]
    pub points: PointArgs,
    /// Models that are carried into the scene
    #[command(flatten)]
    pub objects: ObjectArgs,
    /// How .png pictures look
    #[command(flatten)]
    pub look: LookArgs,
    /// Follow this file's lines, each `SECONDS COMMAND` (`-` is standard input). Commands: view,
    /// picture FILE, probe COLUMN ROW, object …, sky …, lamp NAME FACTOR, with PART,…,
    /// without PART,… (of the render cache), quit
    #[arg(long, value_name = "FILE")]
    pub script: Option<PathBuf>,
    /// How long to run without a script
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, default_value = "0")]
    pub time: f64,
    /// At the end, once all requested samples have arrived, write the picture here (.exr .hdr .pfm
    /// .png)
    #[arg(short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Report every picture as a line of JSON
    #[arg(long)]
    pub json: bool,
    /// Print less
    #[arg(short, long)]
    pub quiet: bool,
    /// End when standard input ends (set by the program that starts this one)
    #[arg(long, hide = true)]
    pub with_parent: bool,
    /// The crew that started server and workers, if it takes orders.
    #[arg(skip)]
    pub crew: Option<Crew>,
}

impl Config {
    /// Refuses options that cannot be used, and names the filter of the session's pictures.
    fn check(&self) -> Result<()> {
        self.driver.check().map_err(anyhow::Error::msg)?;
        self.look.look().map_err(anyhow::Error::msg)?;
        if let Some(note) = self.driver.filter_note().filter(|_| !self.quiet) {
            eprintln!("{note}");
        }
        Ok(())
    }

    /// Connects to the server. `walks` is true if a person walks.
    async fn connect(&self, walks: bool, shutdown: Shutdown) -> Result<Connected> {
        let server = Destination::parse(&self.connect)?;
        let options = DriverOptions::open(self.driver.clone(), self.points.clone())?;
        let connected = Connected::new(server, Box::new(options), walks, shutdown).await?;
        let ObjectArgs { objects, folder } = self.objects.clone();
        Ok(connected.with_objects(folder, objects))
    }

    /// Connects to the server, and returns a stage for a person who walks.
    async fn stage(self, record: Option<PathBuf>, shutdown: Shutdown) -> Result<(Stage, Front)> {
        let connected = self.connect(true, shutdown).await?;
        Ok(stage(connected, Wishes { view: self.view, record, crew: self.crew }))
    }
}

/// Shows a server's holodeck until the script, the time or the session ends, or `shutdown` is
/// triggered.
///
/// Connects and prepares the scene at once. The script's seconds begin when `ready` says so; if
/// its sender is dropped, the call ends.
///
/// # Errors
/// If the server cannot be reached, refuses, or leaves before the end; if the view does not exist,
/// or a picture cannot be written.
pub async fn run(config: Config, shutdown: Shutdown, ready: oneshot::Receiver<()>) -> Result<()> {
    config.check()?;
    let steps = match &config.script {
        Some(path) => Script::open(path, SWITCHES)?,
        None => Script::wait(config.time),
    };
    let connected = config.connect(false, shutdown).await?;
    let Config { view, look, output, json, quiet, crew, .. } = config;
    let options = ScriptOptions { view, look, output, json, quiet, crew };
    // Drawing keeps its thread busy, and sockets must not wait for it.
    tokio::task::spawn_blocking(move || holo_script::play(connected, options, steps, ready)).await?
}

/// Returns the picture of a view with everything that a server sends for it, and the report on it
/// without a file. `None` if `shutdown` is triggered before. The script, the time and the output of
/// `config` are not used.
///
/// # Errors
/// If the server cannot be reached, refuses, or leaves before the end, or the view does not exist.
pub async fn picture(
    config: Config,
    shutdown: Shutdown,
) -> Result<Option<(Picture, PictureReport)>> {
    config.check()?;
    let connected = config.connect(false, shutdown).await?;
    let (view, quiet) = (config.view, config.quiet || config.json);
    tokio::task::spawn_blocking(move || holo_script::picture(connected, &view, quiet)).await?
}

/// Shows a server's holodeck in a browser until somebody quits or `shutdown` is triggered.
///
/// # Errors
/// If the page cannot be served, or the server cannot be reached or is lost.
pub async fn run_in_browser(config: Config, args: BrowserArgs, shutdown: Shutdown) -> Result<()> {
    config.check()?;
    let page = PageServer::open(&args).await?;
    let screens = config.driver.wall.names();
    let (stage, front) = config.stage(args.record, shutdown).await?;
    page.show(stage, front, screens).await
}

/// The whole program: [`run`] until a signal.
///
/// # Errors
/// As [`run`].
pub async fn run_until_signal(config: Config) -> Result<()> {
    let shutdown = Shutdown::new();
    shutdown.on_signals(config.with_parent)?;
    run(config, shutdown, at_once()).await
}

/// Returns a receiver whose value is ready.
pub fn at_once() -> oneshot::Receiver<()> {
    let (sender, receiver) = oneshot::channel();
    // The receiver still exists, so sending cannot fail.
    let _ = sender.send(());
    receiver
}
