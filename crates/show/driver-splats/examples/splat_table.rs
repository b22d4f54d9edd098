//! The rows of QSplat's table for one view: `splat_table FILE.splats "VIEW OPTIONS" WIDTHxHEIGHT`.
//!
//! Prints a line of JSON. Times are of one thread, in milliseconds of the processor: of the second
//! frame, so that the file's pages are in memory.

use std::{error::Error, sync::Arc, time::Instant};

use holo_display::{Camera, FramePhase, FrameRequest, Interrupt};
use holo_driver_splats::{SplatCut, SplatShape, Traversal, splats_driver};
use holo_picture::{View, ViewSpec};
use holo_splats::SplatFile;

/// Times that are averaged.
const ROUNDS: u32 = 5;

/// Diameter of the finest splats at rest, pixels.
const AT_REST: f32 = 1.0;

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [path, options, size] = words.as_slice() else {
        return Err("usage: splat_table FILE.splats \"VIEW OPTIONS\" WIDTHxHEIGHT".into());
    };
    let (width, height) = size.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let size = (width.parse()?, height.parse()?);
    let start = Instant::now();
    let file = Arc::new(SplatFile::open(path.as_ref())?);
    let opening = start.elapsed().as_secs_f64();
    let mut spec = ViewSpec::default();
    spec.apply_line(options)?;
    let (view, size) = spec.resolve(size)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()?;
    pool.install(|| -> Result<(), Box<dyn Error + Send + Sync>> {
        let header = file.header();
        println!(
            "{{\"nodes\":{},\"surfels\":{},\"bytes\":{},\"open_seconds\":{opening:.4}}}",
            header.nodes,
            header.surfels,
            file.file_bytes()
        );
        let budget = f64::from(size.0) * f64::from(size.1) / 4.0;
        let camera = Camera::new(&view, size);
        let mut finest = AT_REST;
        row("static", &file, &camera, &view, size, finest)?;
        while cut(&file, &camera, size, finest).len() as f64 > budget {
            finest *= 1.25;
        }
        row("interactive", &file, &camera, &view, size, finest)
    })
}

fn cut(file: &SplatFile, camera: &Camera, size: (u32, u32), finest: f32) -> SplatCut {
    Traversal::new(file, camera, size, finest, false).cut()
}

/// Measures one kind of frame.
fn row(
    mode: &str,
    file: &Arc<SplatFile>,
    camera: &Camera,
    view: &View,
    size: (u32, u32),
    finest: f32,
) -> Result<(), Box<dyn Error + Send + Sync>> {
    let found = cut(file, camera, size, finest);
    let traversal = processor_time(|| {
        cut(file, camera, size, finest);
    })?;
    let mut driver = splats_driver(Some(Arc::clone(file)), SplatShape::Ellipse);
    let is_moving = mode == "interactive";
    driver.renderer.look(&FrameRequest { view: *view, size, is_moving })?;
    let phase = if is_moving { FramePhase::Moving } else { FramePhase::Rest };
    // The driver follows its budget from frame to frame.
    for _ in 0..if is_moving { 20 } else { 1 } {
        driver.renderer.draw(phase, &Interrupt::default(), &mut |_| {});
    }
    let total = processor_time(|| {
        driver.renderer.draw(phase, &Interrupt::default(), &mut |_| {});
    })?;
    let culled = found.culled;
    println!(
        "{{\"mode\":\"{mode}\",\"finest\":{finest:.2},\"traversal_ms\":{traversal:.1},\
         \"drawing_ms\":{:.1},\"total_ms\":{total:.1},\"points\":{},\"visited\":{},\"outside\":{},\
         \"facing_away\":{}}}",
        total - traversal,
        found.len(),
        culled.visited,
        culled.outside,
        culled.facing_away
    );
    Ok(())
}

/// Returns the processor's milliseconds for one call, on this thread.
fn processor_time(mut work: impl FnMut()) -> Result<f64, Box<dyn Error + Send + Sync>> {
    let now = || -> Result<f64, Box<dyn Error + Send + Sync>> {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat")?;
        let nanoseconds: f64 = text.split(' ').next().ok_or("no processor time")?.parse()?;
        Ok(nanoseconds / 1e6)
    };
    let start = now()?;
    (0..ROUNDS).for_each(|_| work());
    Ok((now()? - start) / f64::from(ROUNDS))
}
