#![allow(missing_docs)]
mod common;
use common::*;
use glam::DVec3;
use holo_display::*;
use holo_section::ViewClass;
fn disc(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let to_disc = (2.5 - origin.x) / direction.x;
    let p = origin + direction * to_disc;
    if to_disc > 0.0 && (p.y * p.y + p.z * p.z) < 0.16 || (to_disc > 0.0 && (p.y-0.55).abs()<0.02) {
        return ([1.0, 0.8, 0.1], to_disc);
    }
    let to_wall = (20.0 - origin.x) / direction.x;
    if to_wall > 0.0 { ([0.05, 0.1, 0.2], to_wall) } else { ([0.0; 3], f64::INFINITY) }
}
#[test]
fn hidden() {
    let size = (160, 120);
    for grid in [4, 8, 16] {
    let section = section([-1.0; 3], [2.0; 3], [grid; 3], ViewClass::Interior, true);
    let seen = view([0.1, 0.2, -0.1], [6.0, 0.0, 0.0], 40.0, size);
    let reference = truth(disc, &seen, size, 8);
    for density in [0.1, 0.3, 1.0, 3.0, 10.0] {
        let stored = batch_samples(disc, &section, &seen, size, (19200.0 * density) as usize, 3, clean);
        let frame = quadtree(&section, &seen, size, QuadtreeParams::default(), &stored).draw();
        println!("grid {grid} density {density}: error {:.4}, bias {:+.3}", relative_error(&frame, &reference), bias(&frame, &reference));
        if density==0.3 || density == 1.0 { frame.picture.write(format!("/tmp/hidden_{grid}_{density}.png")).unwrap(); }
    }}
}
