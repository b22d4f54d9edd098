//! `holodeck render`: traces a picture directly, as a reference for holodecks.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{RecvTimeoutError, channel},
    },
    time::{Duration, Instant},
};

use anyhow::Result;
use holo_net::Shutdown;
use holo_picture::{Picture, View, ViewSpec};
use holo_progress::Meter;
use holo_proto::control::Engine;
use holo_raycast::Raycaster;
use holo_tracer::{Settings, Tracer};
use holo_view::{DenoiseArg, Denoiser, LookArgs, Quality, ViewArgs, denoise};

use crate::{
    arguments::picture_path,
    config::HolodeckConfig,
    opening::{OpenedScene, OpeningRequest, open},
    passes::{TraceJob, WorkLimit},
    scene_args::{SceneArgs, Usage, check_units, scene_path, settings},
    sums::{PictureSums, TracedPicture},
};

/// Make a picture straight from the tracer
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck render room.obj\n  \
    holodeck render room.obj --vp 1,2,1.6 --vd 0,1,0 --vh 60 --spp 256 -o truth.pfm")]
pub struct RenderArgs {
    /// The scene
    #[arg(value_name = "MODEL")]
    scene: Option<PathBuf>,
    /// The picture (.exr .hdr .pfm .png)
    /// [default: the scene's name with .png, in this folder]
    #[arg(short, value_name = "FILE", value_parser = picture_path())]
    output: Option<PathBuf>,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    look: LookArgs,
    /// Paths per pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Trace for this time, such as 60s, with as many paths as fit; loading does not count
    /// [default: 10s]
    #[arg(long, value_name = "TIME", value_parser = holo_server::parse_time, conflicts_with = "spp")]
    time: Option<Duration>,
    /// Denoise the picture by Open Image Denoise. `auto`: if it is installed; `off`; or the file of
    /// its library. The bias of denoised pictures is unknown
    #[arg(long, value_name = "auto|off|FILE", default_value = "off")]
    denoise: DenoiseArg,
    /// Also write every pixel's standard error to this file, as if its paths were independent
    #[arg(long, value_name = "FILE", value_parser = picture_path())]
    se: Option<PathBuf>,
    #[command(flatten)]
    scene_args: SceneArgs,
    /// Threads that trace [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

/// The time that a picture is traced by default.
const DEFAULT_TIME: Duration = Duration::from_secs(10);

/// Time that a denoiser still has once the process is to end.
const DENOISE_AT_END: Duration = Duration::from_secs(1);

/// Time between two looks at whether the process is to end.
const ASK_EVERY: Duration = Duration::from_millis(50);

/// See [`RenderArgs`].
pub async fn run(args: RenderArgs) -> Result<()> {
    let config = args.scene_args.resolve(args.scene.as_ref())?;
    check_units(&config)?;
    let limit = match (args.spp, args.time) {
        (Some(paths), _) => WorkLimit::Paths(paths),
        (None, time) => WorkLimit::Time(time.unwrap_or(DEFAULT_TIME)),
    };
    let output = match &args.output {
        Some(output) => output.clone(),
        None => scene_path(&config)?.with_extension("png").file_name().unwrap_or_default().into(),
    };
    args.look.check(&output).map_err(Usage)?;
    // Load it first, because tracing may take hours.
    let denoiser = args.denoise.load(Quality::High)?;
    let (mut opened, view, size) = open_view(&args, &config)?;
    let settings = settings(&config, Engine::Path);
    let raycaster = opened.raycaster()?;
    let tracer = Tracer::with_raycaster(
        Arc::clone(&raycaster),
        Settings { bounces: settings.bounces, ..Settings::default() },
    )?;
    let tracer = match settings.engine {
        Engine::Path => tracer,
        Engine::Cached => tracer.with_cache(settings.accuracy, settings.seed),
        Engine::Gather => tracer.with_gather(),
    };
    let threads = args.threads.or(config.threads).map_or_else(cores, usize::from).max(1);
    let shutdown = Shutdown::new();
    shutdown.on_signals(false)?;
    let (seed, has_errors) = (settings.seed, args.se.is_some());
    let job = TraceJob { tracer, view, size, seed, threads, limit, has_errors };
    let (quiet, until) = (args.quiet, shutdown.clone());
    let rendered = tokio::task::spawn_blocking(move || render(&job, quiet, &until)).await?;
    let denoised = denoiser.and_then(|denoiser| rendered.denoised(denoiser, raycaster, &shutdown));
    rendered.write(&args, denoised.transpose()?, &output)
}

/// Opens the scene, and returns it with the view and the size of the picture. If the view is stated
/// in full, no other is needed.
fn open_view(
    args: &RenderArgs,
    config: &HolodeckConfig,
) -> Result<(OpenedScene, View, (u32, u32))> {
    let stated = args.view.spec(&config.views()).ok();
    let is_whole = stated.is_some_and(|view| view.vp.is_some() && view.vd.is_some());
    let mut config = config.clone();
    if is_whole && config.views().is_empty() {
        // A stated view makes the search for views unnecessary.
        config.named_views = vec![("stated".to_owned(), String::new())];
    }
    let opened = open(&config, OpeningRequest::View, args.quiet)?;
    if !args.quiet {
        opened.say(&config)?;
    }
    let up = Some(glam::DVec3::from_array(opened.up));
    let mut spec = ViewSpec { vu: up, ..ViewSpec::default() };
    if let Some((_, first)) = opened.views.first() {
        spec.apply_line(first)?;
    }
    let stated = args.view.spec(&opened.views)?;
    // The first view's place does not suit another direction, nor its up vector another place.
    if stated.vp.is_some() {
        spec.vu = up;
    }
    let (view, size) = spec.overridden_by(&stated).resolve(args.view.size())?;
    Ok((opened, view, size))
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// A traced picture.
struct Rendered {
    view: View,
    traced: TracedPicture,
    seconds: f64,
    nonfinite: u64,
}

/// Traces until there are enough paths, the time is up, or Ctrl-C is pressed.
fn render(job: &TraceJob, quiet: bool, shutdown: &Shutdown) -> Rendered {
    let start = Instant::now();
    let mut meter = Meter::new(quiet);
    let pixels = f64::from(job.size.0) * f64::from(job.size.1);
    let traced = job.run(
        || start.elapsed(),
        || shutdown.is_triggered(),
        |paths| {
            let (seconds, per_pixel) = (start.elapsed().as_secs_f64(), paths as f64 / pixels);
            let share = match job.limit {
                WorkLimit::Paths(wanted) => per_pixel / f64::from(wanted),
                WorkLimit::Time(time) => seconds / time.as_secs_f64(),
            };
            let rate = paths as f64 / seconds / 1e6;
            meter.show(share, &format!("{per_pixel:.1} paths per pixel, {rate:.2} M/s"));
        },
    );
    let seconds = start.elapsed().as_secs_f64();
    meter.finish();
    let nonfinite = job.tracer.nonfinite_paths();
    Rendered { view: job.view, traced, seconds, nonfinite }
}

impl Rendered {
    fn picture_of(&self, sums: &[PictureSums], size: (u32, u32)) -> Picture {
        let mut picture = Picture::new(size.0, size.1);
        picture.view = Some(self.view);
        picture.pixels = sums.iter().map(PictureSums::mean).collect();
        picture
    }

    /// Returns the denoised picture, or `None` if the process is to end before it is ready. If the
    /// first pass was not whole, squares of pixels are denoised: a denoiser takes what is the same
    /// in several pixels for detail.
    fn denoised(
        &self,
        mut denoiser: Denoiser,
        raycaster: Arc<Raycaster>,
        shutdown: &Shutdown,
    ) -> Option<Result<Picture>> {
        let step = self.traced.finest_whole_grid();
        let (size, squares) = self.traced.reduced(step);
        let mut small = self.picture_of(&squares, size);
        let (sender, receiver) = channel();
        // The thread ends with the process if nobody waits for it any more.
        std::thread::spawn(move || {
            let done = denoise(&mut denoiser, raycaster, &mut small).map(|()| small);
            let _ = sender.send(done);
        });
        let mut patience = DENOISE_AT_END;
        let small = loop {
            match receiver.recv_timeout(ASK_EVERY) {
                Ok(Ok(small)) => break small,
                Ok(Err(error)) => return Some(Err(error)),
                Err(RecvTimeoutError::Timeout) if !shutdown.is_triggered() => {}
                Err(RecvTimeoutError::Timeout) if patience > Duration::ZERO => {
                    patience = patience.saturating_sub(ASK_EVERY);
                }
                Err(_) => {
                    eprintln!("the picture is written without being denoised, so as to end soon");
                    return None;
                }
            }
        };
        let mut picture = Picture::new(self.traced.size.0, self.traced.size.1);
        picture.view = small.view;
        let width = self.traced.size.0;
        for (pixel, shown) in (0..).zip(&mut picture.pixels) {
            let (column, row): (u32, u32) = (pixel % width, pixel / width);
            *shown = small.pixels[(row / step * size.0 + column / step) as usize];
        }
        Some(Ok(picture))
    }

    fn write(mut self, args: &RenderArgs, denoised: Option<Picture>, path: &Path) -> Result<()> {
        let all = || self.traced.sums.iter().map(|sums| sums.paths);
        let paths: f64 = all().map(f64::from).sum();
        let (least, most) = (all().min().unwrap_or(0), all().max().unwrap_or(0));
        let pixels = self.traced.sums.len();
        let untraced = self.traced.fill();
        let size = self.traced.size;
        let picture = denoised.unwrap_or_else(|| self.picture_of(&self.traced.sums, size));
        let errors = args.se.is_some().then(|| self.traced.standard_errors());
        // A large picture's sums take gigabytes.
        self.traced.sums = Vec::new();
        let exposure = args.look.write(&picture, path)?;
        if let (Some(path), Some(pixels)) = (&args.se, errors) {
            Picture { pixels, ..Picture::new(size.0, size.1) }.write(path)?;
        }
        if untraced > 0 {
            eprintln!(
                "{}: {:.1} % of the pixels were traced before the end; each of the others copies one \
                 to its left or above it",
                path.display(),
                100.0 * (pixels - untraced) as f64 / pixels as f64
            );
        }
        if self.nonfinite > 0 {
            eprintln!("{} paths were not finite and count as black", self.nonfinite);
        }
        let (rate, seconds) = (paths / self.seconds, self.seconds);
        if args.json {
            let report = serde_json::json!({
                "picture": path, "spp": least, "paths": paths, "seconds": seconds,
                "paths_per_second": rate, "nonfinite_paths": self.nonfinite,
                "untraced_pixels": untraced, "exposure": exposure,
            });
            holo_progress::print_line!("{report}");
        } else if !args.quiet {
            let count = if least == most { most.to_string() } else { format!("{least} to {most}") };
            let (output, rate) = (path.display(), rate / 1e6);
            holo_progress::print_line!(
                "{output}: {count} paths per pixel in {seconds:.1} s, {rate:.2} M/s"
            );
            if let Some(factor) = exposure {
                holo_progress::print_line!(
                    "{output}: radiance times {factor:.4} (--exposure ={factor:.4})"
                );
            }
        }
        Ok(())
    }
}
