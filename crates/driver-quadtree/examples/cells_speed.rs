//! Times the driver of cells on one core, 512 × 512 pixels with 200,000 samples: `cargo run --release -p holo-driver-quadtree --example cells_speed`.
//!
//! For each kind of samples, beside the quadtree: insertions, and whole pictures. On Linux `taskset -c 0` keeps it to one core.

#[path = "../tests/common/mod.rs"]
mod common;

use common::*;
use holo_driver_quadtree::{Cells, Filling, QuadtreeParams};
use std::sync::Arc;
use std::time::{Duration, Instant};

const SIZE: (u32, u32) = (512, 512);
const SAMPLES: usize = 200_000;
/// Times are means of so many.
const ROUNDS: u32 = 10;

/// Time this process has had a core, where Linux tells (other programs then do not count), else time passed.
fn processor_time(start: Instant) -> Duration {
    let text = std::fs::read_to_string("/proc/self/schedstat").ok();
    let first =
        text.and_then(|text| text.split_whitespace().next().and_then(|first| first.parse().ok()));
    first.map_or_else(|| start.elapsed(), Duration::from_nanos)
}

fn mean_time(mut work: impl FnMut()) -> Duration {
    let start = Instant::now();
    let before = processor_time(start);
    (0..ROUNDS).for_each(|_| work());
    (processor_time(start) - before) / ROUNDS
}

fn main() {
    let (section, view) = (room_section(8), room_view(SIZE));
    for kind in ["through the eye", "batch"] {
        for (name, noise) in [("clean", clean as Noise), ("1 path", one_path)] {
            let mut stored = match kind {
                "batch" => batch_samples(room, &section, &view, SIZE, 3 * SAMPLES, 1, noise),
                _ => near_samples(room, &section, &view, SAMPLES, 1, noise),
            };
            stored.truncate(2 * SAMPLES);
            stored.sort_by_key(|&(beam, _)| beam);
            let tree = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &stored);
            let drawn = mean_time(|| drop(tree.draw()));
            println!(
                "{kind}, {name}: {} samples land; quadtree {drawn:?}",
                tree.draw().samples_used
            );
            for filling in [Filling::Constant, Filling::Smooth] {
                let mut cells = Cells::new(
                    Arc::from([section.clone()]),
                    view,
                    SIZE,
                    filling,
                    QuadtreeParams::default(),
                );
                let mut insert = || {
                    stored.chunk_by(|a, b| a.0 == b.0).for_each(|same| {
                        let samples: Vec<_> = same.iter().map(|stored| stored.1).collect();
                        cells.insert(0, same[0].0, 1, &samples);
                    });
                };
                let start = Instant::now();
                let before = processor_time(start);
                insert();
                let inserted = processor_time(start) - before;
                println!(
                    "  {filling:?}: insert {inserted:?}, picture {:?}",
                    mean_time(|| drop(cells.draw()))
                );
            }
        }
    }
}
