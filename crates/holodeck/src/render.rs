//! `holodeck render`: a picture straight from the tracer, with which holodecks are compared.

use std::{
    path::PathBuf,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU32, Ordering},
    },
    time::{Duration, Instant},
};

use anyhow::Result;
use holo_net::Shutdown;
use holo_picture::{Picture, View, ViewSpec};
use holo_progress::Meter;
use holo_proto::control::Engine;
use holo_tracer::{Settings, Tracer};
use holo_view::{LookArgs, ViewArgs};

use crate::{
    arguments::picture_path,
    loading,
    scene_args::{SceneArgs, Usage, settings},
};

/// Make a picture straight from the tracer
#[derive(clap::Args)]
#[command(after_help = "Example:\n  \
    holodeck render room.obj --vp 1,2,1.6 --vd 0,1,0 --vh 60 --spp 256 -o truth.pfm")]
pub struct Args {
    /// The scene
    #[arg(value_name = "SCENE.obj")]
    scene: Option<PathBuf>,
    /// The picture (.exr .hdr .pfm .png)
    #[arg(short, value_name = "FILE", value_parser = picture_path)]
    output: PathBuf,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    look: LookArgs,
    /// Paths per pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// As many paths as fit into this time, such as 60s; loading does not count
    #[arg(long, value_name = "TIME", value_parser = holo_server::parse_time, conflicts_with = "spp")]
    time: Option<Duration>,
    /// Also write every pixel's standard error to this file, as if its paths were independent
    #[arg(long, value_name = "FILE", value_parser = picture_path)]
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

/// Rows that a thread takes at a time.
const ROWS: u32 = 4;

/// Paths per pixel in one pass: so many that passes cost nothing, so few that `--time` is kept.
const PASS: u32 = 4;

/// See [`Args`].
pub async fn run(args: Args) -> Result<()> {
    let config = args.scene_args.resolve(args.scene.as_ref())?;
    if args.spp.is_none() && args.time.is_none() {
        return Err(Usage("how many paths? Say --spp 256 or --time 60s".into()).into());
    }
    args.look.check(&args.output).map_err(Usage)?;
    let named: Vec<_> =
        config.view.iter().map(|view| (view.name.clone(), view.to_options())).collect();
    let mut spec = ViewSpec { vu: config.up.map(glam::DVec3::from_array), ..ViewSpec::default() };
    if let Some((_, first)) = named.first() {
        spec.apply_line(first)?;
    }
    let (view, size) = spec.overridden_by(&args.view.spec(&named)?).resolve(args.view.size)?;
    let scene = loading::load(&config, args.quiet)?;
    let settings = settings(&config, Engine::Path);
    let tracer = Tracer::new(
        Arc::new(scene),
        Settings { bounces: settings.bounces, ..Settings::default() },
    )?;
    let tracer = match settings.engine {
        Engine::Path => tracer,
        Engine::Cached => tracer.with_cache(settings.accuracy, settings.seed),
    };
    let threads = args.threads.or(config.threads).map_or_else(cores, usize::from).max(1);
    let shutdown = Shutdown::new();
    shutdown.on_signals(false)?;
    let job = Job {
        tracer,
        view,
        size,
        seed: settings.seed,
        spp: args.spp,
        time: args.time,
        threads,
        quiet: args.quiet,
    };
    let rendered = tokio::task::spawn_blocking(move || job.run(&shutdown)).await?;
    rendered.write(&args)
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

struct Job {
    tracer: Tracer,
    view: View,
    size: (u32, u32),
    seed: u64,
    spp: Option<u32>,
    time: Option<Duration>,
    threads: usize,
    quiet: bool,
}

/// Sums over a pixel's paths, for each channel.
#[derive(Clone, Copy, Default)]
struct Sums {
    first: [f64; 3],
    second: [f64; 3],
}

struct Rendered {
    view: View,
    size: (u32, u32),
    sums: Vec<Sums>,
    spp: u32,
    seconds: f64,
    nonfinite: u64,
}

impl Job {
    /// Traces passes until there are enough paths, the time is up, or Ctrl-C.
    fn run(self, shutdown: &Shutdown) -> Rendered {
        let pixels = self.size.0 as usize * self.size.1 as usize;
        let sums = Mutex::new(vec![Sums::default(); pixels]);
        let start = Instant::now();
        let mut meter = Meter::new(self.quiet);
        let mut spp = 0;
        while self.spp.is_none_or(|wanted| spp < wanted) && !shutdown.is_triggered() {
            // A pass that would end after the time is not begun.
            let elapsed = start.elapsed();
            let next = elapsed + elapsed.checked_div(spp.div_ceil(PASS)).unwrap_or_default() / 2;
            if self.time.is_some_and(|time| next >= time) {
                break;
            }
            let count = self.spp.map_or(PASS, |wanted| PASS.min(wanted - spp));
            self.pass(&sums, spp, count);
            spp += count;
            let share = match (self.spp, self.time) {
                (Some(wanted), _) => f64::from(spp) / f64::from(wanted),
                (None, Some(time)) => start.elapsed().as_secs_f64() / time.as_secs_f64(),
                (None, None) => 1.0,
            };
            let seconds = start.elapsed().as_secs_f64();
            let rate = pixels as f64 * f64::from(spp) / seconds / 1e6;
            meter.show(share, &format!("{spp} paths per pixel, {rate:.2} M/s"));
        }
        meter.finish();
        Rendered {
            view: self.view,
            size: self.size,
            sums: sums.into_inner().unwrap_or_else(PoisonError::into_inner),
            spp,
            seconds: start.elapsed().as_secs_f64(),
            nonfinite: self.tracer.nonfinite_paths(),
        }
    }

    fn pass(&self, sums: &Mutex<Vec<Sums>>, first: u32, count: u32) {
        let next = AtomicU32::new(0);
        std::thread::scope(|scope| {
            for _ in 0..self.threads {
                scope.spawn(|| {
                    let width = self.size.0 as usize;
                    let mut rows = vec![Sums::default(); width * ROWS as usize];
                    loop {
                        let row = next.fetch_add(ROWS, Ordering::Relaxed);
                        if row >= self.size.1 {
                            return;
                        }
                        let end = (row + ROWS).min(self.size.1);
                        rows.fill(Sums::default());
                        for (offset, row) in (row..end).enumerate() {
                            self.row(
                                row,
                                first,
                                count,
                                &mut rows[offset * width..(offset + 1) * width],
                            );
                        }
                        let mut all = sums.lock().unwrap_or_else(PoisonError::into_inner);
                        for (sum, new) in
                            all[row as usize * width..end as usize * width].iter_mut().zip(&rows)
                        {
                            for channel in 0..3 {
                                sum.first[channel] += new.first[channel];
                                sum.second[channel] += new.second[channel];
                            }
                        }
                    }
                });
            }
        });
    }

    fn row(&self, row: u32, first: u32, count: u32, sums: &mut [Sums]) {
        for (column, sums) in (0u32..).zip(sums) {
            let pixel = u64::from(row) << 32 | u64::from(column);
            let turn = mix(pixel ^ self.seed.rotate_left(17));
            for path in first..first + count {
                let [dx, dy] = jitter(path, turn);
                let x = (f64::from(column) + dx) / f64::from(self.size.0);
                let y = 1.0 - (f64::from(row) + dy) / f64::from(self.size.1);
                // Corners of fisheyes have no direction: they are black.
                let Some((origin, direction, reach)) = self.view.clipped_ray(x, y) else {
                    continue;
                };
                let traced = self.tracer.trace_path(origin, direction, turn, u64::from(path));
                if reach.is_finite() && traced.distance > reach {
                    // Beyond the aft clipping surface everything is black.
                    continue;
                }
                let radiance = traced.radiance;
                for (channel, value) in radiance.into_iter().enumerate() {
                    sums.first[channel] += f64::from(value);
                    sums.second[channel] += f64::from(value) * f64::from(value);
                }
            }
        }
    }
}

/// Returns where in the pixel path `index` goes: the R2 sequence (Roberts 2018), shifted by the
/// pixel's own offset. Any number of paths is well spread over the box filter.
fn jitter(index: u32, turn: u64) -> [f64; 2] {
    /// Powers of the plastic number ρ: 1/ρ and 1/ρ².
    const STEP: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
    let offset = [(turn >> 32) as f64, f64::from(turn as u32)].map(|bits| bits / 4_294_967_296.0);
    [0, 1].map(|axis| (offset[axis] + STEP[axis] * f64::from(index)).fract())
}

/// The finaliser of SplitMix64 (Steele, Lea & Flood 2014).
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

impl Rendered {
    fn write(&self, args: &Args) -> Result<()> {
        let n = f64::from(self.spp.max(1));
        let mut picture = Picture::new(self.size.0, self.size.1);
        picture.view = Some(self.view);
        for (pixel, sums) in picture.pixels.iter_mut().zip(&self.sums) {
            *pixel = sums.first.map(|sum| (sum / n) as f32);
        }
        args.look.write(&picture, &args.output)?;
        if let Some(path) = &args.se {
            let mut errors = Picture::new(self.size.0, self.size.1);
            for (pixel, sums) in errors.pixels.iter_mut().zip(&self.sums) {
                for (channel, error) in pixel.iter_mut().enumerate() {
                    let mean = sums.first[channel] / n;
                    let variance =
                        (sums.second[channel] / n - mean * mean).max(0.0) / (n - 1.0).max(1.0);
                    *error = variance.sqrt() as f32;
                }
            }
            errors.write(path)?;
        }
        if self.nonfinite > 0 {
            eprintln!("{} paths were not finite and count as black", self.nonfinite);
        }
        let paths = n * self.sums.len() as f64;
        if args.json {
            let report = serde_json::json!({
                "picture": args.output, "spp": self.spp, "seconds": self.seconds,
                "paths_per_second": paths / self.seconds, "nonfinite_paths": self.nonfinite,
            });
            println!("{report}");
        } else if !args.quiet {
            let rate = paths / self.seconds / 1e6;
            println!(
                "{}: {} paths per pixel in {:.1} s, {rate:.2} M/s",
                args.output.display(),
                self.spp,
                self.seconds
            );
        }
        Ok(())
    }
}
