//! Shows a recorded walk through a scene with every driver, tracing a fixed number of samples per
//! frame. Measures how close each driver's frames are to the truth.
//!
//! `cargo run --release -p holo-drivers --example walk -- SCENE.obj WALK --truths FOLDER --out
//! FOLDER` `[--drivers A,B] [--ratio R] [--paths N] [--bounces N] [--frames FIRST..END] [--every
//! N]` `[--truth-paths N] [--truths-only]`. In each frame a driver receives pixels / R new samples
//! of N paths each. The output is one line of JSON per driver: frames judged, and PSNR (dB) and
//! structural similarity of each. `FOLDER/strip.png` shows the truth and then each driver, at five
//! moments.

mod drivers;
mod live;
mod measure;
mod path;
mod tracing;

use drivers::{Driver, Making};
use holo_picture::Picture;
use holo_raycast::Raycaster;
use holo_scene::LoadOptions;
use holo_section::Section;
use holo_tracer::{Settings, Tracer};
use path::Walk;
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use tracing::Engine;

/// Pixels of every picture.
pub const SIZE: (u32, u32) = (320, 240);
/// Pictures in a strip.
const STRIP: usize = 5;

struct Arguments {
    scene: PathBuf,
    walk: PathBuf,
    truths: PathBuf,
    out: PathBuf,
    drivers: Vec<String>,
    ratio: usize,
    paths: u32,
    bounces: Option<u32>,
    frames: (usize, usize),
    every: usize,
    truth_paths: u32,
    truths_only: bool,
}

fn parse() -> Result<Arguments, Box<dyn Error>> {
    let mut found = Arguments {
        scene: PathBuf::new(),
        walk: PathBuf::new(),
        truths: PathBuf::from("."),
        out: PathBuf::from("."),
        drivers: ["pointimage", "1999", "frameless", "quadtree", "surfaces"]
            .map(String::from)
            .to_vec(),
        ratio: 64,
        paths: 1,
        bounces: None,
        frames: (0, usize::MAX),
        every: 10,
        truth_paths: 1024,
        truths_only: false,
    };
    let mut plain = Vec::new();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(format!("{word} takes a value"));
        match word.as_str() {
            "--truths" => found.truths = value()?.into(),
            "--out" => found.out = value()?.into(),
            "--drivers" => found.drivers = value()?.split(',').map(String::from).collect(),
            "--ratio" => found.ratio = value()?.parse::<usize>()?.max(1),
            "--paths" => found.paths = value()?.parse()?,
            "--bounces" => found.bounces = Some(value()?.parse()?),
            "--every" => found.every = value()?.parse::<usize>()?.max(1),
            "--frames" => {
                let range = value()?;
                let (first, end) = range.split_once("..").ok_or("--frames takes FIRST..END")?;
                found.frames = (first.parse()?, end.parse()?);
            }
            "--truth-paths" => found.truth_paths = value()?.parse()?,
            "--truths-only" => found.truths_only = true,
            _ if word.starts_with("--") => return Err(format!("`{word}` is not an option").into()),
            _ => plain.push(word),
        }
    }
    let [scene, walk] = plain.try_into().map_err(|_| "two arguments are wanted: SCENE.obj WALK")?;
    (found.scene, found.walk) = (scene.into(), walk.into());
    Ok(found)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = parse()?;
    let walk = Walk::parse(&std::fs::read_to_string(&arguments.walk)?)?;
    std::fs::create_dir_all(&arguments.truths)?;
    std::fs::create_dir_all(&arguments.out)?;
    let options = LoadOptions { sky: walk.sky, ..LoadOptions::default() };
    let raycaster =
        Arc::new(Raycaster::build(Arc::new(holo_scene::load(&arguments.scene, &options)?.scene))?);
    let settings = Settings { bounces: arguments.bounces, paths: arguments.paths };
    let first = walk.view(arguments.frames.0, SIZE)?;
    let tracer = Tracer::with_raycaster(Arc::clone(&raycaster), settings)?;
    let engine = Engine::new(tracer, arguments.paths, &first);
    let end = walk.frames().min(arguments.frames.1);
    // The first frame of each group shows nothing yet, so the last one is judged.
    let judged: Vec<usize> = (arguments.frames.0..end)
        .filter(|frame| frame % arguments.every == arguments.every - 1)
        .collect();
    let mut truths: Vec<Picture> = Vec::new();
    let mut before = None;
    for &frame in &judged {
        let view = walk.view(frame, SIZE)?;
        // Frames of an eye at rest have one truth.
        let truth = match truths.last().filter(|_| before == Some(view)) {
            Some(truth) => truth.clone(),
            None => {
                let file = arguments.truths.join(format!("{frame:04}.pfm"));
                measure::truth(&engine, &view, &file, arguments.truth_paths)?
            }
        };
        truths.push(truth);
        before = Some(view);
    }
    if arguments.truths_only {
        return Ok(());
    }
    let apart = judged.len().div_ceil(STRIP).max(1);
    let mut strips = vec![truths.iter().step_by(apart).cloned().collect::<Vec<Picture>>()];
    let sections: Arc<[Section]> = walk.sections.clone().into();
    let sky = walk.sky;
    for name in &arguments.drivers {
        let paths = arguments.paths.min(1024) as u16;
        let making =
            Making { size: SIZE, first, sections: &sections, raycaster: &raycaster, paths, sky };
        let mut driver = Driver::new(name, &making)?;
        let wanted = (SIZE.0 * SIZE.1) as usize / arguments.ratio;
        let (mut likeness, mut shown) = (Vec::new(), Vec::new());
        for frame in arguments.frames.0..end {
            let number = judged.iter().position(|&judged| judged == frame);
            let (view, next) = (walk.view(frame, SIZE)?, walk.view(frame + 1, SIZE)?);
            let (rays, picture) = driver.frame(view, next, wanted, number.is_some())?;
            if let Some((number, picture)) = number.zip(picture) {
                likeness.push(measure::likeness(&picture, &truths[number])?);
                if number.is_multiple_of(apart) {
                    shown.push(picture);
                }
            }
            driver.take(&rays, &engine.answer(&rays, frame));
        }
        strips.push(shown);
        let list = |values: Vec<String>| values.join(", ");
        println!(
            "{{\"driver\": \"{name}\", \"ratio\": {}, \"paths\": {}, \"frames\": [{}], \"psnr\": [{}], \"ssim\": [{}]}}",
            arguments.ratio,
            arguments.paths,
            list(judged.iter().map(usize::to_string).collect()),
            list(likeness.iter().map(|pair| format!("{:.2}", pair.0)).collect()),
            list(likeness.iter().map(|pair| format!("{:.4}", pair.1)).collect()),
        );
    }
    measure::strip(&strips, &arguments.out.join("strip.png"))
}
