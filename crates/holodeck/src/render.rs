//! A picture straight from the tracer, as a reference for holodecks.

use std::{
    sync::{
        Arc,
        mpsc::{RecvTimeoutError, channel},
    },
    time::{Duration, Instant},
};

use anyhow::{Result, bail};
use holo_net::Shutdown;
use holo_picture::{Picture, View, ViewSpec};
use holo_progress::Meter;
use holo_proto::control::Engine;
use holo_raycast::Raycaster;
use holo_tracer::{ReflectionSettings, Settings, Tracer};
use holo_view::{Denoiser, ViewArgs, denoise};

use crate::{
    config::HolodeckConfig,
    depths::depths,
    opening::{OpenedScene, OpeningRequest, open},
    passes::TraceJob,
    settings::settings,
    standard_errors::standard_errors,
    sums::{PictureSums, TracedPicture},
};

pub use crate::passes::WorkLimit;

/// Time that a denoiser still has once the process is to end.
const DENOISE_AT_END: Duration = Duration::from_secs(1);

/// Time between two looks at whether the process is to end.
const ASK_EVERY: Duration = Duration::from_millis(50);

/// A picture to be traced.
pub struct RenderRequest {
    /// The scene, and the settings of paths.
    pub config: HolodeckConfig,
    /// The view, and the size of the picture.
    pub view: ViewArgs,
    /// The end of the work.
    pub limit: WorkLimit,
    /// Whether rays that leave shiny objects end in reflection cubes (engine `path`). Such pictures
    /// have a bias.
    pub caches_reflections: bool,
    /// The denoiser of the picture, if any.
    pub denoiser: Option<Denoiser>,
    /// True if standard errors are wanted.
    pub has_errors: bool,
    /// True if the distance of what each pixel shows is wanted.
    pub has_depths: bool,
    /// Threads that trace. `None`: one per core.
    pub threads: Option<u16>,
    /// Hides progress and the choices about the scene.
    pub quiet: bool,
}

/// A picture from the tracer.
pub struct RenderedPicture {
    /// The picture.
    pub picture: Picture,
    /// The standard error of every pixel, if they were wanted. Paths count as independent. With the
    /// engine `gather`, the error of cells is included, but not the bias of their width.
    pub errors: Option<Picture>,
    /// The distances of what the middles of pixels show, scene units, if they were wanted. Infinite
    /// for the sky.
    pub depths: Option<Picture>,
    /// Number of paths of all pixels.
    pub paths: u64,
    /// Least and most paths of a pixel.
    pub spp: (u32, u32),
    /// Duration of tracing, seconds.
    pub seconds: f64,
    /// Paths that were not finite. They count as black.
    pub nonfinite: u64,
    /// Pixels without a path, each of which copies another pixel.
    pub untraced: usize,
}

/// Traces a picture until its limit, or until `shutdown` is triggered.
///
/// # Errors
/// If the scene cannot be opened or traced, or the view does not exist.
pub async fn render(request: RenderRequest, shutdown: &Shutdown) -> Result<RenderedPicture> {
    let (mut opened, view, size) = open_view(&request)?;
    let RenderRequest { config, limit, denoiser, has_errors, threads, quiet, .. } = request;
    let caches = request.caches_reflections;
    let settings = settings(&config, Engine::Path);
    let raycaster = opened.raycaster()?;
    let tracer = || -> Result<Tracer> {
        let tracer = Tracer::with_raycaster(
            Arc::clone(&raycaster),
            Settings { bounces: settings.bounces, ..Settings::default() },
        )?;
        Ok(match settings.engine {
            Engine::Path if caches => tracer.with_cached_reflections(ReflectionSettings::default()),
            Engine::Path => tracer,
            Engine::Gather if caches => {
                bail!("`--reflections cached` goes with `--engine path` only")
            }
            Engine::Gather => tracer.with_gather(),
            Engine::Captured => bail!("the engine `captured` traces nothing"),
        }
        .with_visible_sun())
    };
    let has_twin = has_errors && settings.engine == Engine::Gather;
    let depths = request.has_depths.then(|| depths(&raycaster, &view, size));
    let (tracer, twin) = (tracer()?, has_twin.then(tracer).transpose()?);
    let threads = threads.map_or_else(cores, usize::from).max(1);
    let seed = settings.seed;
    let job = TraceJob { tracer, twin, view, size, seed, threads, limit, has_errors };
    let until = shutdown.clone();
    let traced = tokio::task::spawn_blocking(move || trace(&job, quiet, &until)).await?;
    let denoised = denoiser.and_then(|denoiser| traced.denoised(denoiser, raycaster, shutdown));
    Ok(RenderedPicture { depths, ..traced.finish(has_errors, denoised.transpose()?) })
}

/// Opens the scene, and returns it with the view and the size of the picture. If the view is stated
/// in full, no other is needed.
fn open_view(request: &RenderRequest) -> Result<(OpenedScene, View, (u32, u32))> {
    let mut config = request.config.clone();
    let stated = request.view.spec(&config.views()).ok();
    let is_whole = stated.is_some_and(|view| view.vp.is_some() && view.vd.is_some());
    if is_whole && config.views().is_empty() {
        // A stated view makes the search for views unnecessary.
        config.named_views = vec![("stated".to_owned(), String::new())];
    }
    let opened = open(&config, OpeningRequest::View, request.quiet)?;
    if !request.quiet {
        opened.say(&config)?;
    }
    let up = Some(glam::DVec3::from_array(opened.up));
    let mut spec = ViewSpec { vu: up, ..ViewSpec::default() };
    if let Some((_, first)) = opened.views.first() {
        spec.apply_line(first)?;
    }
    let stated = request.view.spec(&opened.views)?;
    // The first view's place does not suit another direction, nor its up vector another place.
    if stated.vp.is_some() {
        spec.vu = up;
    }
    let (view, size) = spec.overridden_by(&stated).resolve(request.view.size())?;
    Ok((opened, view, size))
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// A traced view.
struct TracedView {
    view: View,
    traced: TracedPicture,
    seconds: f64,
    nonfinite: u64,
}

/// Traces until there are enough paths, the time is up, or Ctrl-C is pressed.
fn trace(job: &TraceJob, quiet: bool, shutdown: &Shutdown) -> TracedView {
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
    let of_twin = job.twin.as_ref().map_or(0, Tracer::nonfinite_paths);
    let nonfinite = job.tracer.nonfinite_paths() + of_twin;
    TracedView { view: job.view, traced, seconds, nonfinite }
}

impl TracedView {
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

    /// Returns the picture, which is the denoised one if there is one.
    fn finish(mut self, has_errors: bool, denoised: Option<Picture>) -> RenderedPicture {
        let all = || self.traced.sums.iter().map(|sums| sums.paths);
        let paths = all().map(u64::from).sum();
        let spp = (all().min().unwrap_or(0), all().max().unwrap_or(0));
        let untraced = self.traced.fill();
        let size = self.traced.size;
        let picture = denoised.unwrap_or_else(|| self.picture_of(&self.traced.sums, size));
        let errors = has_errors.then(|| {
            let pixels = standard_errors(&self.traced);
            Picture { pixels, ..Picture::new(size.0, size.1) }
        });
        let TracedView { seconds, nonfinite, .. } = self;
        let depths = None;
        RenderedPicture { picture, errors, depths, paths, spp, seconds, nonfinite, untraced }
    }
}
