//! Compares cells with the quadtree on the same samples, without a scene.
//!
//! `cargo run --release -p holo-driver-quadtree --example cells_quality`
//!
//! Prints, for each kind of samples of a room in closed form, the error of each picture and the
//! processor time of drawing it. The error is display PSNR as `holodeck compare` computes it, dB.

mod clock;
#[path = "../tests/it/common/mod.rs"]
mod common;

use common::*;
use holo_display::Frame;
use holo_driver_quadtree::{Filling, QuadtreeParams, ViewCells};
use holo_picture::Picture;
use std::sync::Arc;

const SIZE: (u32, u32) = (320, 240);

fn main() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let reference = Picture { pixels: truth(room, &view, SIZE, 8), ..Picture::new(SIZE.0, SIZE.1) };
    println!("samples        a pixel  quadtree      constant      smooth");
    let noises = [("clean", clean as Noise), ("16 paths", some_paths), ("1 path", one_path)];
    let densities = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0];
    for kind in ["through the eye", "batch"] {
        for (name, noise) in noises {
            for density in densities {
                let count = (f64::from(SIZE.0 * SIZE.1) * density) as usize;
                let stored = match kind {
                    "batch" => batch_samples(room, &section, &view, SIZE, count, 1, noise),
                    _ => near_samples(room, &section, &view, count, 1, noise),
                };
                let mut line = format!("{kind:15} {name:9} {density:5}");
                let mut show = |draw: &dyn Fn() -> Frame| {
                    let start = clock::now();
                    let frame = draw();
                    let time = clock::now() - start;
                    let decibels = holo_picture::compare(&frame.picture, &reference)
                        .map_or(f64::NAN, |measures| measures.psnr_disp);
                    line += &format!("  {decibels:5.2} {time:4.0} ms");
                };
                let params = QuadtreeParams::default();
                let tree = quadtree(&section, &view, SIZE, params.clone(), &stored);
                show(&|| tree.draw());
                for filling in [Filling::Constant, Filling::Smooth] {
                    let sections = Arc::from([section.clone()]);
                    let mut cells = ViewCells::new(sections, view, SIZE, filling, params.clone());
                    stored.iter().for_each(|(beam, sample)| {
                        cells.insert(key(0, *beam), 1, std::slice::from_ref(sample));
                    });
                    show(&|| cells.draw());
                }
                println!("{line}");
            }
        }
    }
}
