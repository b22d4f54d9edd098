//! Times the quadtree driver on one core: `cargo run --release -p holo-display --example quadtree_speed`.

#[path = "../tests/common/mod.rs"]
mod common;

use common::*;
use holo_display::{Quadtree, QuadtreeParams, SelectOptions, select_beams};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time this process has had a core, where Linux tells (other programs then do not count), else time passed.
fn processor_time(start: Instant) -> Duration {
    std::fs::read_to_string("/proc/self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next().and_then(|first| first.parse().ok()))
        .map_or_else(|| start.elapsed(), Duration::from_nanos)
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    let before = processor_time(start);
    let result = work();
    (result, processor_time(start) - before)
}

fn main() {
    for size in [(320, 240), (512, 512)] {
        let (section, view) = (room_section(8), room_view(size));
        let (selection, select) =
            timed(|| select_beams(std::slice::from_ref(&section), &view, size, &SelectOptions::default()));
        println!("{size:?}: select {} beams {select:?}", selection.beams.len());
        for (name, noise) in [("clean", clean as Noise), ("1 path", one_path)] {
            for density in [1.0, 4.0, 16.0] {
                let count = (f64::from(size.0 * size.1) * density) as usize;
                let mut stored = near_samples(room, &section, &view, count, 1, noise);
                stored.sort_by_key(|&(beam, _)| beam);
                let packets: Vec<_> = stored
                    .chunk_by(|a, b| a.0 == b.0)
                    .map(|same| (same[0].0, same.iter().map(|stored| stored.1).collect::<Vec<_>>()))
                    .collect();
                let (mut tree, new) =
                    timed(|| Quadtree::new(Arc::from([section.clone()]), view, size, QuadtreeParams::default()));
                let mut insert = || {
                    timed(|| packets.iter().for_each(|(beam, samples)| tree.insert(0, *beam, 1, samples))).1
                        / stored.len() as u32
                };
                let (first, again) = (insert(), insert());
                tree.reset(view);
                packets.iter().for_each(|(beam, samples)| tree.insert(0, *beam, 1, samples));
                let mut draws: Vec<_> = (0..5).map(|_| timed(|| tree.draw()).1).collect();
                draws.sort();
                let draw = draws[2];
                let frame = tree.draw();
                println!(
                    "  {name:6} {density:2} a pixel: new {new:?}, insert {first:?} then {again:?} a sample, draw {draw:?}, {} empty",
                    frame.empty_pixels
                );
            }
        }
    }
}
