//! Times cells, on one core alone behind `taskset -c 0`.
//!
//! `cargo run --release -p holo-driver-quadtree --example cells_speed`
//!
//! For each kind of samples of 512 × 512 pixels: insertions and whole pictures, beside the
//! quadtree's. Processor time of all threads in ms, the mean of some rounds.

mod clock;
#[path = "../tests/it/common/mod.rs"]
mod common;

use common::*;
use holo_driver_quadtree::{Filling, QuadtreeParams, ViewCells};
use std::sync::Arc;

const SIZE: (u32, u32) = (512, 512);
const SAMPLES: usize = 200_000;
const ROUNDS: u32 = 10;

/// Returns the mean processor time of `work`, ms.
fn mean_time(mut work: impl FnMut()) -> f64 {
    let start = clock::now();
    (0..ROUNDS).for_each(|_| work());
    (clock::now() - start) / f64::from(ROUNDS)
}

fn main() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let params = QuadtreeParams::default();
    for kind in ["through the eye", "batch"] {
        for (name, noise) in [("clean", clean as Noise), ("1 path", one_path)] {
            let mut stored = match kind {
                "batch" => batch_samples(room, &section, &view, SIZE, 3 * SAMPLES, 1, noise),
                _ => near_samples(room, &section, &view, SAMPLES, 1, noise),
            };
            stored.truncate(2 * SAMPLES);
            stored.sort_by_key(|&(beam, _)| beam);
            let tree = quadtree(&section, &view, SIZE, params.clone(), &stored);
            let used = tree.draw().samples_used;
            let drawn = mean_time(|| drop(tree.draw()));
            println!("{kind}, {name}: {used} samples land; quadtree {drawn:.1}");
            for filling in [Filling::Constant, Filling::Smooth] {
                let sections = Arc::from([section.clone()]);
                let mut cells = ViewCells::new(sections, view, SIZE, filling, params.clone());
                let start = clock::now();
                stored.chunk_by(|a, b| a.0 == b.0).for_each(|same| {
                    let samples: Vec<_> = same.iter().map(|stored| stored.1).collect();
                    cells.insert(key(0, same[0].0), 1, &samples);
                });
                let inserted = clock::now() - start;
                let drawn = mean_time(|| drop(cells.draw()));
                println!("  {filling:?}: insert {inserted:.1}, picture {drawn:.1}");
            }
        }
    }
}
