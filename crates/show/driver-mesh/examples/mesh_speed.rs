//! Times the mesh, on one core alone behind `taskset -c 0`.
//!
//! `cargo run --release -p holo-driver-mesh --example mesh_speed`
//!
//! First the triangulation alone: random directions into a part of the sphere as large as a view,
//! and out again. Then the driver: samples of a known room, the first picture, and one more.
//! Processor time of all threads in ms, the least of some rounds. With `--json`, one line for each.

#![allow(clippy::unwrap_used, reason = "a measurement of known scenes")]

mod clock;
#[path = "../tests/it/common/mod.rs"]
mod common;
#[path = "../../display/tests/common/viewer.rs"]
mod viewer;

use common::*;
use holo_display::FrameRequest;
use holo_driver_mesh::{BASE, GridDirection, SphereTriangulation, mesh_driver};
use std::sync::Arc;

const ROUNDS: usize = 4;

/// Runs `work`. Keeps the least processor time that it took, ms.
fn timed<T>(least: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = clock::now();
    let result = work();
    *least = least.min(clock::now() - start);
    result
}

fn triangulation(json: bool) {
    let view = room_view((512, 512));
    for count in [1_000, 10_000, 100_000, 300_000] {
        let mut random = Random(1);
        let mut direction = || GridDirection::nearest(view.ray(random.unit(), random.unit()).1);
        let directions: Vec<GridDirection> = (0..count).filter_map(|_| direction()).collect();
        let [mut insert, mut remove, mut swaps] = [f64::INFINITY, f64::INFINITY, 0.0];
        for _ in 0..ROUNDS {
            let mut mesh = SphereTriangulation::new();
            let mut vertices: Vec<u32> = timed(&mut insert, || {
                directions.iter().map(|&direction| mesh.insert(direction)).collect()
            });
            swaps = mesh.swaps as f64 / (mesh.vertex_count() as f64 - f64::from(BASE));
            vertices.sort_unstable();
            vertices.dedup();
            timed(&mut remove, || vertices.iter().for_each(|&vertex| mesh.remove(vertex)));
        }
        let [inserted, removed] = [insert, remove].map(|time| 1e-3 * f64::from(count) / time);
        if json {
            println!(
                "{{\"vertices\": {count}, \"swaps\": {swaps:.3}, \
                 \"insert_m_per_s\": {inserted:.3}, \"remove_m_per_s\": {removed:.3}}}"
            );
        } else {
            println!(
                "{count:7} vertices: {swaps:.2} swaps each, insert {inserted:.2} M/s, \
                 remove {removed:.2} M/s"
            );
        }
    }
}

fn pictures(json: bool) {
    for size in [(256, 256), (512, 512)] {
        let (section, view) = (room_section(8), room_view(size));
        for density in [0.25, 1.0, 4.0] {
            let count = (f64::from(size.0 * size.1) * density) as usize;
            let stored = near_samples(room, &section, &view, count, 1, clean);
            let [mut insert, mut first, mut second] = [f64::INFINITY; 3];
            for _ in 0..ROUNDS {
                let sections = Arc::from([section.clone()]);
                let mut viewer = viewer::TestViewer::new(mesh_driver(sections, [0.0; 3]));
                viewer.look(&FrameRequest { view, size, is_moving: false }).unwrap();
                timed(&mut insert, || {
                    stored.iter().for_each(|(beam, sample)| {
                        viewer.insert(key(0, *beam), 1, std::slice::from_ref(sample));
                    });
                });
                timed(&mut first, || viewer.draw());
                timed(&mut second, || viewer.draw());
            }
            let (width, height) = size;
            let speed = 1e-3 * count as f64 / insert;
            if json {
                println!(
                    "{{\"size\": \"{width}x{height}\", \"a_pixel\": {density}, \
                     \"sort_m_per_s\": {speed:.2}, \"first_ms\": {first:.1}, \
                     \"again_ms\": {second:.1}}}"
                );
            } else {
                println!(
                    "{width}x{height}, {density} a pixel: sort {speed:.1} M/s, first picture \
                     {first:.1} ms, then {second:.1}"
                );
            }
        }
    }
}

fn main() {
    let json = std::env::args().skip(1).any(|argument| argument == "--json");
    triangulation(json);
    pictures(json);
}
