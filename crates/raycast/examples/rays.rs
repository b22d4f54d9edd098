//! Rays per second of one core on an OBJ scene: incoherent nearest hits between random points in the scene's bounds.
//! Seconds are those that the thread ran, where the system tells (Linux): other programs do not count.
//!
//! `cargo run --release -p holo-raycast --example rays -- SCENE.obj`

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use holo_raycast::{Quality, Ray, Raycaster};

/// Seconds that this thread has run; the time since `start` where the system does not tell.
fn seconds(start: Instant) -> f64 {
    let ran = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = ran.and_then(|text| text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()));
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = PathBuf::from(std::env::args_os().nth(1).ok_or("usage: rays SCENE.obj")?);
    let scene = Arc::new(holo_scene::load_obj(&path, &Default::default())?.scene);
    let (low, high) = scene.bounds();
    let size = (high - low).as_vec3();
    let mut state = 1_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32 - 0.5
    };
    let mut point = || Vec3::new(unit(), unit(), unit()) * size;
    let rays: Vec<Ray> = (0..1_000_000)
        .map(|_| {
            let (from, to) = (point(), point());
            Ray::new(from, (to - from).normalize())
        })
        .collect();
    let clock = Instant::now();
    for quality in [Quality::Fast, Quality::Fine] {
        let start = seconds(clock);
        let raycaster = Raycaster::build_with(scene.clone(), quality)?;
        let built = seconds(clock) - start;
        let start = seconds(clock);
        let hits = rays.iter().filter(|ray| raycaster.nearest(ray).is_some()).count();
        let nearest = rays.len() as f64 / (seconds(clock) - start) / 1e6;
        let start = seconds(clock);
        let blocked = rays.iter().filter(|ray| raycaster.occluded(&Ray { t_max: 1.0, ..**ray })).count();
        let occluded = rays.len() as f64 / (seconds(clock) - start) / 1e6;
        println!(
            "{quality:?}: built in {built:.2} s; nearest {nearest:.2} M rays/s ({hits} hits); within 1 unit {occluded:.2} M rays/s ({blocked} blocked)"
        );
    }
    Ok(())
}
