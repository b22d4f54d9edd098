//! Times the render cache stage by stage, as Table 1 of its papers: `cargo run --release -p holo-display --example pointimage`.
//!
//! Arguments, all optional: side of the picture or WIDTHxHEIGHT (several), `--threads N`, `--samples N` a frame (8000), `--frames N`,
//! `--portable` or `--avx2`, `--json` (a line for each size). The camera walks and turns; times are medians over frames, and the least of them. "moved" is how long it takes to copy as many bytes
//! as the stage reads and writes at least, measured beside it. With several threads a stage's time is that of the first.

#[path = "../tests/pointimage_scenes/mod.rs"]
mod pointimage_scenes;

use glam::DVec3;
use holo_driver_rendercache::{Instructions, Moment, PointImage, PointImageParams, Stage};
use pointimage_scenes::{answer, room, view};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Bytes that a stage moves at least, per point of the cache and per pixel.
fn bytes(stage: Stage) -> Option<(usize, usize)> {
    match stage {
        // Age and flags both ways, mapped pixel.
        Stage::UpdatePoints => Some((8, 0)),
        // Position and age.
        Stage::PredictedProjection => Some((13, 0)),
        // Depth, colour both ways.
        Stage::DepthCull => Some((0, 12)),
        // Colour, three channels.
        Stage::Prefilter => Some((0, 16)),
        // Colour, depth, age, three channels, priority.
        Stage::Interpolate => Some((0, 22)),
        // Scatters, gathers, and chains.
        _ => None,
    }
}

fn median(times: &mut [Duration]) -> Duration {
    times.sort();
    times.get(times.len() / 2).copied().unwrap_or_default()
}

/// Time to copy half of `bytes`: it reads that much and writes that much.
fn copying(bytes: usize, frames: usize) -> Duration {
    let from = vec![1_u8; bytes / 2];
    let mut to = vec![0_u8; bytes / 2];
    let mut times: Vec<_> = (0..frames.min(30))
        .map(|_| {
            let start = Instant::now();
            to.copy_from_slice(std::hint::black_box(&from));
            std::hint::black_box(&to);
            start.elapsed()
        })
        .collect();
    median(&mut times)
}

/// What was found of one stage.
struct Row {
    stage: Stage,
    median: f64,
    least: f64,
    /// Times that copying its data takes.
    times_moved: Option<f64>,
}

fn measure(size: (u32, u32), samples: usize, frames: usize, params: &PointImageParams, json: bool) {
    let Ok(mut cache) = PointImage::new(size, params.clone()) else {
        return eprintln!("{size:?}: not possible");
    };
    // A walk at 1.5 m/s that turns by 30 degrees a second, 30 frames a second.
    let at = |frame: f64| {
        view(DVec3::new(-2.0 + 0.01 * frame, -2.0 + 0.005 * frame, 0.0), frame - 20.0, size)
    };
    let pixels = (size.0 * size.1) as usize;
    let mut results = Vec::new();
    let mut times: BTreeMap<Stage, Vec<Duration>> = BTreeMap::new();
    let mut totals = Vec::new();
    let warm_up = 24;
    for frame in 0..warm_up + frames {
        // Until the cache is warm the path is walked back and forth slowly, with many samples.
        let warm = frame >= warm_up;
        let step = if warm { (frame - warm_up) as f64 * 0.5 } else { frame as f64 * 0.1 };
        let moment = Moment {
            view: at(step),
            predicted: Some(at(step + 1.0)),
            samples: &results,
            wanted: if warm { samples } else { pixels / 8 },
        };
        let start = Instant::now();
        let mut last = start;
        // A stage may run in portions.
        let mut spent: BTreeMap<Stage, Duration> = BTreeMap::new();
        let shown = cache.frame_watched(&moment, &mut |stage| {
            let now = Instant::now();
            *spent.entry(stage).or_default() += now - last;
            last = now;
        });
        if warm {
            totals.push(start.elapsed());
            spent.into_iter().for_each(|(stage, time)| times.entry(stage).or_default().push(time));
        }
        results = answer(&shown, &room);
    }
    let row = |stage: Stage| {
        let times = times.get_mut(&stage)?;
        let median = median(times).as_secs_f64();
        let times_moved = bytes(stage).map(|(point, pixel)| {
            median / copying(point * cache.capacity() + pixel * pixels, frames).as_secs_f64()
        });
        Some(Row { stage, median, least: times[0].as_secs_f64(), times_moved })
    };
    let rows: Vec<Row> = Stage::ALL.into_iter().filter_map(row).collect();
    let total = median(&mut totals).as_secs_f64();
    let least = totals.first().copied().unwrap_or_default().as_secs_f64();
    if json {
        print_json(size, &rows, total, least)
    } else {
        print_table(size, samples, params, &rows, total, least)
    }
}

fn per_pixel(seconds: f64, (width, height): (u32, u32)) -> f64 {
    seconds * 1e9 / (f64::from(width) * f64::from(height))
}

fn print_table(
    size: (u32, u32),
    samples: usize,
    params: &PointImageParams,
    rows: &[Row],
    total: f64,
    least_total: f64,
) {
    println!(
        "\n{}x{}, {samples} samples a frame, {:?}, {} thread(s)",
        size.0, size.1, params.instructions, params.threads
    );
    println!(
        "{:24}{:>10}{:>10}{:>8}{:>12}{:>14}",
        "Stage", "ms", "least", "%", "ns/pixel", "times moved"
    );
    for Row { stage, median, least, times_moved } in rows {
        let ratio = times_moved.map_or(String::from("-"), |ratio| format!("{ratio:.1}"));
        let (share, each) = (100.0 * median / total, per_pixel(*median, size));
        let [median, least] = [median, least].map(|time| time * 1e3);
        println!(
            "{:24}{median:>10.3}{least:>10.3}{share:>8.1}{each:>12.2}{ratio:>14}",
            stage.name()
        );
    }
    let each = per_pixel(total, size);
    println!(
        "{:24}{:>10.3}{:>10.3}{:>8}{each:>12.2}",
        "Total",
        total * 1e3,
        least_total * 1e3,
        100
    );
}

fn print_json(size: (u32, u32), rows: &[Row], total: f64, least: f64) {
    let stages: Vec<String> = rows
        .iter()
        .map(|Row { stage, median, least, times_moved }| {
            let moved = times_moved.map_or(String::from("null"), |ratio| ratio.to_string());
            let (stage, ms, least) = (stage.name(), median * 1e3, least * 1e3);
            format!(
                "{{\"stage\":\"{stage}\",\"ms\":{ms},\"least_ms\":{least},\"times_moved\":{moved}}}"
            )
        })
        .collect();
    println!(
        "{{\"width\":{},\"height\":{},\"ms\":{},\"least_ms\":{},\"ns_per_pixel\":{},\"stages\":[{}]}}",
        size.0,
        size.1,
        total * 1e3,
        least * 1e3,
        per_pixel(total, size),
        stages.join(",")
    );
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (mut samples, mut frames, mut sizes, mut json) = (8000, 120, Vec::new(), false);
    let mut params = PointImageParams::default();
    while let Some(argument) = arguments.next() {
        let mut number = || arguments.next().and_then(|number| number.parse().ok()).unwrap_or(1);
        match argument.as_str() {
            "--threads" => params.threads = number(),
            "--samples" => samples = number(),
            "--frames" => frames = number(),
            "--json" => json = true,
            "--portable" => params.instructions = Instructions::Portable,
            "--avx2" => params.instructions = Instructions::Avx2,
            size => {
                let (width, height) = size.split_once('x').unwrap_or((size, size));
                match (width.parse(), height.parse()) {
                    (Ok(width), Ok(height)) => sizes.push((width, height)),
                    _ => {
                        return eprintln!(
                            "`{size}` is neither an option nor a size such as 512 or 1920x1080"
                        );
                    }
                }
            }
        }
    }
    if sizes.is_empty() {
        sizes = vec![(256, 256), (512, 512), (1024, 1024), (1920, 1080), (2048, 2048)];
    }
    sizes.iter().for_each(|&size| measure(size, samples, frames, &params, json));
}
