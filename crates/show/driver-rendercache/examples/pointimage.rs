//! Times the render cache stage by stage, as Table 1 of its second paper does.
//!
//! `cargo run --release -p holo-driver-rendercache --example pointimage`
//!
//! Arguments, all optional: sides of pictures or WIDTHxHEIGHT, `--threads N`, `--samples N` a frame
//! (8000), `--frames N`, and `--json` for one line a size. The camera walks and turns. Times are
//! medians over frames, and those of the shortest frame, which are more accurate on a busy machine.

#[path = "../tests/it/scenes/mod.rs"]
mod scenes;

use std::collections::BTreeMap;
use std::error::Error;
use std::time::{Duration, Instant};

use glam::DVec3;
use holo_driver_rendercache::{Moment, PointImage, PointImageError, PointImageParams, Stage};
use scenes::{answer, room, view};

/// Frames that fill the cache before measurements begin.
const WARM_UP: usize = 24;

/// Median and shortest time, milliseconds.
struct Time {
    median: f64,
    least: f64,
}

impl Time {
    fn of(mut times: Vec<Duration>) -> Self {
        times.sort();
        let ms = |at: usize| times.get(at).map_or(0.0, |time| 1e3 * time.as_secs_f64());
        Self { median: ms(times.len() / 2), least: ms(0) }
    }
}

/// Returns the time of each stage, and of whole frames.
fn measure(
    size: (u32, u32),
    samples: usize,
    frames: usize,
) -> Result<(Vec<(Stage, Time)>, Time), PointImageError> {
    let mut cache = PointImage::new(size, PointImageParams::default())?;
    // A walk at 1.5 m/s that turns by 30 degrees a second, 30 frames a second.
    let at = |frame: f64| {
        view(DVec3::new(-2.0 + 0.01 * frame, -2.0 + 0.005 * frame, 0.0), frame - 20.0, size)
    };
    let pixels = (size.0 * size.1) as usize;
    let mut results = Vec::new();
    let mut times: BTreeMap<Stage, Vec<Duration>> = BTreeMap::new();
    let mut totals = Vec::new();
    for frame in 0..WARM_UP + frames {
        // Until the cache is warm the camera moves slowly, with many samples.
        let warm = frame >= WARM_UP;
        let step = if warm { (frame - WARM_UP) as f64 * 0.5 } else { frame as f64 * 0.1 };
        let moment = Moment {
            view: at(step),
            predicted: Some(at(step + 1.0)),
            samples: &results,
            wanted: if warm { samples } else { pixels / 8 },
        };
        let start = Instant::now();
        let mut last = start;
        let shown = cache.frame_watched(&moment, &mut |stage| {
            let now = Instant::now();
            if warm {
                times.entry(stage).or_default().push(now - last);
            }
            last = now;
        });
        if warm {
            totals.push(start.elapsed());
        }
        results = answer(&shown, &room);
    }
    let stages = times.into_iter().map(|(stage, times)| (stage, Time::of(times))).collect();
    Ok((stages, Time::of(totals)))
}

fn print_table(size: (u32, u32), stages: &[(Stage, Time)], total: &Time) {
    println!("\n{}x{}", size.0, size.1);
    println!("{:24}{:>10}{:>10}{:>8}", "Stage", "ms", "least", "%");
    for (stage, Time { median, least }) in stages {
        let share = 100.0 * least / total.least;
        println!("{:24}{median:>10.3}{least:>10.3}{share:>8.1}", stage.name());
    }
    println!("{:24}{:>10.3}{:>10.3}{:>8}", "Total", total.median, total.least, 100);
}

fn print_json(size: (u32, u32), stages: &[(Stage, Time)], total: &Time) {
    let stage = |(stage, Time { median, least }): &(Stage, Time)| {
        format!("{{\"stage\":\"{}\",\"ms\":{median},\"least_ms\":{least}}}", stage.name())
    };
    let stages: Vec<String> = stages.iter().map(stage).collect();
    let ns_per_pixel = 1e6 * total.median / (f64::from(size.0) * f64::from(size.1));
    println!(
        "{{\"width\":{},\"height\":{},\"ms\":{},\"least_ms\":{},\"ns_per_pixel\":{ns_per_pixel},\
         \"stages\":[{}]}}",
        size.0,
        size.1,
        total.median,
        total.least,
        stages.join(",")
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (mut samples, mut frames, mut threads, mut json) = (8000, 120, 1, false);
    let mut sizes = Vec::new();
    while let Some(argument) = arguments.next() {
        let mut number = || -> Result<usize, Box<dyn Error>> {
            Ok(arguments.next().ok_or("a number is missing")?.parse()?)
        };
        match argument.as_str() {
            "--threads" => threads = number()?,
            "--samples" => samples = number()?,
            "--frames" => frames = number()?,
            "--json" => json = true,
            size => {
                let (width, height) = size.split_once('x').unwrap_or((size, size));
                sizes.push((width.parse()?, height.parse()?));
            }
        }
    }
    if sizes.is_empty() {
        sizes = vec![(256, 256), (512, 512), (1024, 1024), (1920, 1080), (2048, 2048)];
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    for size in sizes {
        let (stages, total) = pool.install(|| measure(size, samples, frames))?;
        if json { print_json(size, &stages, &total) } else { print_table(size, &stages, &total) }
    }
    Ok(())
}
