//! Times the quadtree, on one core alone behind `taskset -c 0`.
//!
//! `cargo run --release -p holo-driver-quadtree --example quadtree_speed`
//!
//! For each kind of samples: a new quadtree, insertions into it, the first picture and a second
//! one. Processor time of all threads in ms, the least of some rounds: other programs only add to
//! it. With `--json`, one line for each kind of samples.

mod clock;
#[path = "../tests/it/common/mod.rs"]
mod common;

use common::*;
use holo_display::{SelectOptions, select_beams};
use holo_driver_quadtree::{Quadtree, QuadtreeParams};
use holo_section::{BeamId, Sample};
use std::sync::Arc;

const ROUNDS: usize = 6;

/// Runs `work`. Keeps the least processor time that it took, ms.
fn timed<T>(least: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = clock::now();
    let result = work();
    *least = least.min(clock::now() - start);
    result
}

/// Groups samples by beam, as they come.
fn packets(mut stored: Vec<Stored>) -> Vec<(BeamId, Vec<Sample>)> {
    stored.sort_by_key(|&(beam, _)| beam);
    let packet = |same: &[Stored]| (same[0].0, same.iter().map(|stored| stored.1).collect());
    stored.chunk_by(|a, b| a.0 == b.0).map(packet).collect()
}

fn main() {
    let json = std::env::args().skip(1).any(|argument| argument == "--json");
    for size in [(256, 256), (512, 512)] {
        let (section, view) = (room_section(8), room_view(size));
        let mut select = f64::INFINITY;
        let sections = std::slice::from_ref(&section);
        timed(&mut select, || select_beams(sections, &view, size, &SelectOptions::default()));
        for (name, noise) in [("clean", clean as Noise), ("1 path", one_path)] {
            for density in [1.0, 4.0, 16.0] {
                let count = (f64::from(size.0 * size.1) * density) as usize;
                let stored = packets(near_samples(room, &section, &view, count, 1, noise));
                let [mut new, mut insert, mut first, mut second] = [f64::INFINITY; 4];
                for _ in 0..ROUNDS {
                    let sections = Arc::from([section.clone()]);
                    let params = QuadtreeParams::default();
                    let mut tree = timed(&mut new, || Quadtree::new(sections, view, size, params));
                    timed(&mut insert, || {
                        stored
                            .iter()
                            .for_each(|(beam, samples)| tree.insert(key(0, *beam), 1, samples));
                    });
                    timed(&mut first, || tree.draw());
                    timed(&mut second, || tree.draw());
                }
                let speed = 1e-3 * count as f64 / insert;
                let (width, height) = size;
                if json {
                    println!(
                        "{{\"size\": \"{width}x{height}\", \"samples\": \"{name}\", \
                         \"a_pixel\": {density}, \"insert_m_per_s\": {speed:.2}, \
                         \"whole_ms\": {second:.3}}}"
                    );
                } else {
                    println!(
                        "{width}x{height} {name:6} {density:2} a pixel: select {select:.1}, \
                         new {new:.2}, insert {speed:.1} M/s, picture {first:.2}, then {second:.2}"
                    );
                }
            }
        }
    }
}
