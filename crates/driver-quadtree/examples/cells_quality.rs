//! Cells and the quadtree on the same samples, without a scene: `cargo run --release -p holo-driver-quadtree --example cells_quality`.
//!
//! For each kind of samples of a room that is known in closed form: the error of each driver's picture (display PSNR as `holodeck compare`
//! has it, dB), and how long a whole picture takes on one core.

#[path = "../tests/common/mod.rs"]
mod common;

use common::*;
use holo_driver_quadtree::{Cells, Filling, QuadtreeParams};
use holo_picture::Picture;
use std::sync::Arc;
use std::time::{Duration, Instant};

const SIZE: (u32, u32) = (320, 240);

/// Time this process has had a core, where Linux tells, else time passed.
fn processor_time(start: Instant) -> Duration {
    let text = std::fs::read_to_string("/proc/self/schedstat").ok();
    let first =
        text.and_then(|text| text.split_whitespace().next().and_then(|first| first.parse().ok()));
    first.map_or_else(|| start.elapsed(), Duration::from_nanos)
}

fn main() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let reference = Picture { pixels: truth(room, &view, SIZE, 8), ..Picture::new(SIZE.0, SIZE.1) };
    println!("samples        a pixel  quadtree      constant      smooth");
    for kind in ["through the eye", "batch"] {
        for (name, noise) in
            [("clean", clean as Noise), ("16 paths", some_paths), ("1 path", one_path)]
        {
            for density in [0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0] {
                let count = (f64::from(SIZE.0 * SIZE.1) * density) as usize;
                let stored = match kind {
                    "batch" => batch_samples(room, &section, &view, SIZE, count, 1, noise),
                    _ => near_samples(room, &section, &view, count, 1, noise),
                };
                let tree = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &stored);
                let mut line = format!("{kind:15} {name:9} {density:5}");
                let mut show = |draw: &dyn Fn() -> holo_display::Frame| {
                    let (start, before) = (Instant::now(), Instant::now());
                    let first = processor_time(before);
                    let frame = draw();
                    let time = processor_time(start) - first;
                    let decibels = holo_picture::compare(&frame.picture, &reference)
                        .map_or(f64::NAN, |measures| measures.psnr_disp);
                    line += &format!("  {decibels:5.2} {:4.0} ms", time.as_secs_f64() * 1e3);
                };
                show(&|| tree.draw());
                for filling in [Filling::Constant, Filling::Smooth] {
                    let mut cells = Cells::new(
                        Arc::from([section.clone()]),
                        view,
                        SIZE,
                        filling,
                        QuadtreeParams::default(),
                    );
                    stored.iter().for_each(|(beam, sample)| {
                        cells.insert(0, *beam, 1, std::slice::from_ref(sample))
                    });
                    show(&|| cells.draw());
                }
                println!("{line}");
            }
        }
    }
}
