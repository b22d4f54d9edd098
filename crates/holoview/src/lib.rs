//! The display process: a driver and a front end (Larson & Simmons 1999, §2.4). So far one front end, without a window:
//! it follows a script and writes pictures.
//!
//! What always holds:
//! - the server and its file see only beams wanted and samples given: what a picture looks like is decided here;
//! - a sample counts once in a picture, however often it arrives.

mod canvas;
mod default_view;
mod incoming;
mod kept;
mod lights;
mod live;
mod point_args;
mod points;
mod received;
mod script;
mod session;
mod shown;
mod stand_ins;

use std::{net::SocketAddr, path::PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use holo_net::Shutdown;
use holo_picture::ViewSpec;
use serde::Serialize;

pub use default_view::default_view;
pub use point_args::{EmptyArg, Part, PointArgs, SmoothingArg};
pub use points::StageTime;
pub use script::{Command, Script, Step, parse_seconds};

/// Which view is shown: options as Radiance has them.
#[derive(Args, Clone, Debug, Default)]
pub struct ViewArgs {
    /// Type of the view: v perspective, l parallel, c cylindrical panorama, a angular fisheye, h hemispherical fisheye
    /// [default: v]
    #[arg(long, value_name = "v|l|c|a|h")]
    pub vt: Option<String>,
    /// Eye: where the view is seen from
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub vp: Option<String>,
    /// Direction of the view
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub vd: Option<String>,
    /// Up in the picture [default: the scene's up axis]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub vu: Option<String>,
    /// Horizontal angle, degrees; of a parallel view its width in scene units
    #[arg(long, value_name = "DEGREES")]
    pub vh: Option<String>,
    /// Vertical angle, degrees, or height [default: follows from --vh and the picture's shape]
    #[arg(long, value_name = "DEGREES")]
    pub vv: Option<String>,
    /// Shift of the picture to the right, in its widths [default: 0]
    #[arg(long, value_name = "WIDTHS", allow_hyphen_values = true)]
    pub vs: Option<String>,
    /// Lift of the picture, in its heights [default: 0]
    #[arg(long, value_name = "HEIGHTS", allow_hyphen_values = true)]
    pub vl: Option<String>,
    /// Fore clipping distance, scene units: what is nearer is not shown [default: 0, none]
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    pub vo: Option<String>,
    /// Aft clipping distance, scene units: what is farther is black [default: 0, none]
    #[arg(long, value_name = "LENGTH")]
    pub va: Option<String>,
    /// A Radiance view file; the other options override it
    #[arg(long, value_name = "FILE")]
    pub vf: Option<PathBuf>,
    /// A view that the holodeck knows by name
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    /// Size of the picture, pixels
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = parse_size)]
    pub size: (u32, u32),
}

impl ViewArgs {
    /// What was said of the view, over what the named views and a view file say.
    ///
    /// # Errors
    /// If an option is malformed, the file cannot be read, or the name is not known.
    pub fn spec(&self, named: &[(String, String)]) -> Result<ViewSpec> {
        let mut spec = ViewSpec::default();
        if let Some(name) = &self.view {
            let known =
                || named.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
            let view = named.iter().find(|(other, _)| other == name);
            let (_, line) =
                view.with_context(|| format!("no view is named `{name}` (known: {})", known()))?;
            spec.apply_line(line)?;
        }
        if let Some(path) = &self.vf {
            let text = std::fs::read_to_string(path)
                .with_context(|| format!("reading {}", path.display()))?;
            let view =
                holo_picture::View::parse_vf(&text).with_context(|| path.display().to_string())?;
            spec = spec.overridden_by(&view);
        }
        let mut said = ViewSpec::default();
        let (where_to, sides) = (
            [("vp", &self.vp), ("vd", &self.vd), ("vu", &self.vu)],
            [("vh", &self.vh), ("vv", &self.vv)],
        );
        let others = [
            ("vt", &self.vt),
            ("vs", &self.vs),
            ("vl", &self.vl),
            ("vo", &self.vo),
            ("va", &self.va),
        ];
        for (name, value) in where_to.into_iter().chain(sides).chain(others) {
            if let Some(value) = value {
                said.apply_option(name, value)?;
            }
        }
        Ok(spec.overridden_by(&said))
    }
}

/// A size such as `640x480`.
///
/// # Errors
/// A text for people, if it is none or no picture can be so large.
pub fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let size = text
        .split_once('x')
        .and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let (width, height) = size.ok_or_else(|| format!("`{text}` is not a size; write 640x480"))?;
    holo_picture::Picture::check_size(width, height).map_err(|error| error.to_string())?;
    Ok((width, height))
}

/// What turns samples into a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Driver {
    /// The same as `voronoi`, but that a scene which cannot be read is done without
    #[default]
    Auto,
    /// Edges from the scene itself, light from all samples on what is seen; where there is no scene, cells of the samples (`--cells`)
    Voronoi,
    /// Means over the leaves of a quadtree, as large as noise asks; needs no scene
    Quadtree,
    /// The render cache: what is known is projected into every view, gaps are filled; needs no scene
    Pointimage,
    /// Each pixel shows its newest rays; needs no scene
    Frameless,
}

/// Which driver, and what it is told.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct DriverArgs {
    /// What turns samples into a picture
    #[arg(long, value_enum, default_value_t)]
    pub driver: Driver,
    /// Of the driver `voronoi`: cells of samples alone, even where there is a scene, such as `--driver voronoi --cells constant`
    #[arg(long, value_enum, value_name = "FILLING")]
    pub cells: Option<CellsArg>,
}

impl DriverArgs {
    /// Refuses what would do nothing.
    ///
    /// # Errors
    /// A text for people, if cells are wanted of a driver that has none.
    pub fn check(&self) -> Result<(), String> {
        match (self.driver, self.cells) {
            (Driver::Auto | Driver::Voronoi, _) | (_, None) => Ok(()),
            (driver, Some(_)) => {
                let name = driver
                    .to_possible_value()
                    .map_or_else(String::new, |value| value.get_name().to_owned());
                Err(format!("--cells is for --driver voronoi; {name} has no cells"))
            }
        }
    }
}

/// What cells show: see [`holo_display::Filling`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CellsArg {
    /// Colours that go from sample to sample of a surface; means where a pixel has many [what is used where there is no scene]
    Smooth,
    /// Each the colour of its sample, as in the paper (Larson & Simmons 1999)
    Constant,
}

/// Options of `holoview`.
#[derive(Args, Clone, Debug)]
pub struct Config {
    /// The holoserver's address
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:7070")]
    pub connect: String,
    /// Which view is shown
    #[command(flatten)]
    pub view: ViewArgs,
    /// What turns samples into a picture
    #[command(flatten)]
    pub driver: DriverArgs,
    /// How the render cache works
    #[command(flatten)]
    pub points: PointArgs,
    /// Follow this file's lines, each `SECONDS COMMAND` (`-`: standard input). Commands: view, picture FILE,
    /// with PART,…, without PART,… (of the render cache), quit
    #[arg(long, value_name = "FILE")]
    pub script: Option<PathBuf>,
    /// Without a script: stay for so long
    #[arg(long, value_name = "TIME", value_parser = script::parse_seconds, default_value = "0")]
    pub time: f64,
    /// At the end, once everything under way has arrived, write the picture here (.exr .hdr .pfm .png)
    #[arg(short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Report every picture as a line of JSON
    #[arg(long)]
    pub json: bool,
    /// Say less
    #[arg(short, long)]
    pub quiet: bool,
    /// End when standard input ends (set by the program that starts this one)
    #[arg(long, hide = true)]
    pub with_parent: bool,
}

/// A picture written, for people (`Display`) and programs (JSON).
#[derive(Clone, Debug, Serialize)]
pub struct PictureReport {
    /// Where it is.
    pub picture: PathBuf,
    /// Seconds since the view was asked for.
    pub seconds: f64,
    /// Samples in the picture.
    pub samples: u64,
    /// Samples received for the view: from the file.
    pub stored: u64,
    /// And traced.
    pub traced: u64,
    /// Rays that no section covers, traced for the view alone.
    pub live: u64,
    /// Beams that the view crosses.
    pub beams: usize,
    /// Pixels that no section covers.
    pub uncovered_pixels: u64,
    /// Covered pixels filled from their neighbours.
    pub empty_pixels: u64,
    /// Pixels that show the sky because no ray of their beam can meet anything.
    pub unseen_pixels: u64,
    /// Pixels of whose surface nothing is known, shown as if the eye carried a lamp.
    pub guessed_pixels: u64,
    /// The driver that made it; `cells` if it was `voronoi` by samples alone.
    pub driver: &'static str,
    /// Seconds until the first samples were here; none yet if absent.
    pub first_samples: Option<f64>,
    /// How long each stage of the picture took; empty for drivers without stages.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<StageTime>,
}

/// Samples of which more than one would be seen if any could but by a gap between two surfaces.
const ENOUGH_TO_TELL: u64 = 10_000;

impl std::fmt::Display for PictureReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}: {:.1} s, {} samples ({} stored, {} traced)",
            self.picture.display(),
            self.seconds,
            self.samples,
            self.stored,
            self.traced
        )?;
        let came = self.stored + self.traced;
        if came >= ENOUGH_TO_TELL && self.samples <= came / ENOUGH_TO_TELL {
            write!(
                f,
                ": none of what the view shows is seen from the walls of its section, something stands between; give a section \
                 within the room, such as --section=\"X,Y,Z 10,0,0 0,8,0 0,0,3\""
            )?;
        }
        if self.uncovered_pixels > 0 {
            write!(f, ", {} pixels that no section covers", self.uncovered_pixels)?;
        }
        if self.live > 0 {
            write!(f, " (by {} rays traced for this view alone)", self.live)?;
        }
        if self.guessed_pixels > 0 {
            write!(f, ", {} pixels without light known, lit from the eye", self.guessed_pixels)?;
        }
        if !self.stages.is_empty() {
            let milliseconds: f64 = self.stages.iter().map(|stage| stage.milliseconds).sum();
            write!(f, ", made in {milliseconds:.1} ms")?;
        }
        Ok(())
    }
}

/// Shows a server's holodeck until the script, the time or the session ends, or `shutdown` is triggered.
///
/// # Errors
/// If the server cannot be reached, refuses or leaves before the end, the view cannot be seen, or a picture not be
/// written.
pub async fn run(config: Config, shutdown: Shutdown) -> Result<()> {
    config.driver.check().map_err(anyhow::Error::msg)?;
    let address: SocketAddr = holo_net::loopback(&config.connect)?;
    let steps = match &config.script {
        Some(path) => Script::open(path)?,
        None => Script::wait(config.time),
    };
    session::run(config, address, steps, shutdown).await
}

/// The whole program: [`run`] until a signal.
///
/// # Errors
/// As [`run`].
pub async fn run_until_signal(config: Config) -> Result<()> {
    let shutdown = Shutdown::new();
    shutdown.on_signals(config.with_parent)?;
    run(config, shutdown).await
}
