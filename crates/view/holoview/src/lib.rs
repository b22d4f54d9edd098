//! The display process (Larson & Simmons 1999, §2.4): a session with a server, and front ends that
//! draw from it.
//!
//! - `session` holds the connection, asks for samples, and feeds a driver. It knows no front end.
//! - A front end (`script`, or `browser` on a `stage`) gives the session the view to show. It knows
//!   no socket and no driver.
//! - `commands` is the one list of what a person can do, for all front ends.
//! - `drivers` is the one list of drivers.
//!
//! Invariants:
//! - The server learns which beams are wanted, and sends samples. It never learns what a picture
//!   looks like; that is decided here.
//! - A sample counts once in a picture, however often it arrives.

pub mod args;
mod browser;
pub mod commands;
mod crew;
mod denoised;
mod drivers;
mod report;
mod screen;
mod script;
mod session;
mod stage;
mod window;

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use holo_net::{Destination, Shutdown};
use tokio::sync::oneshot;

pub use args::{
    CellsArg, DenoiseArg, DriverArg, DriverArgs, EmptyArg, LookArgs, PointArgs, Range,
    SmoothingArg, ToneArg, ViewArgs, parse_size,
};
pub use browser::{BrowserArgs, run as run_in_browser};
pub use crew::{Crew, CrewOrder, Restarted, crew};
pub use denoised::denoise;
pub use holo_denoise::{Denoiser, Quality};
pub use report::{PictureReport, StageTime};
pub use script::{Command, Script, Step, parse_seconds};
pub use session::default_view;
pub use window::{Desk, Screen, check_desktop, desk, run as run_in_window};

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
    /// How .png pictures look
    #[command(flatten)]
    pub look: LookArgs,
    /// Follow this file's lines, each `SECONDS COMMAND` (`-` is standard input). Commands: view,
    /// picture FILE, probe COLUMN ROW, with PART,…, without PART,… (of the render cache), quit
    #[arg(long, value_name = "FILE")]
    pub script: Option<PathBuf>,
    /// How long to run without a script
    #[arg(long, value_name = "TIME", value_parser = script::parse_seconds, default_value = "0")]
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
    let server = Destination::parse(&config.connect)?;
    let steps = match &config.script {
        Some(path) => Script::open(path)?,
        None => Script::wait(config.time),
    };
    let (driver, points) = (config.driver.clone(), config.points.clone());
    let connected = session::Connected::new(server, driver, points, shutdown).await?;
    // Drawing keeps its thread busy, and sockets must not wait for it.
    tokio::task::spawn_blocking(move || script::play(connected, config, steps, ready)).await?
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
