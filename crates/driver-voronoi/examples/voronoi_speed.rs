//! Times the geometry-guided driver: `cargo run --release -p holo-driver-voronoi --example voronoi_speed -- SCENE.obj`, by default
//! the cabin beside the project.

use glam::DVec3;
use holo_display::{Resolution, Search};
use holo_driver_voronoi::Voronoi;
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_scene::{LoadOptions, load};
use holo_section::{BeamId, BeamKey, Sample, Section, SectionSpec, ViewClass};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Processor time of all threads, where Linux tells, in its clock's ticks of 10 ms.
fn processor_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let mut fields = text.rsplit_once(')')?.1.split_whitespace().skip(11);
    let ticks: u64 = fields.next()?.parse::<u64>().ok()? + fields.next()?.parse::<u64>().ok()?;
    Some(Duration::from_millis(10 * ticks))
}

/// Mean time passed and processor time of several runs.
fn timed<T>(name: &str, runs: u32, mut work: impl FnMut() -> T) -> T {
    let mut result = work();
    let (start, before) = (Instant::now(), processor_time());
    (0..runs).for_each(|_| result = work());
    let used =
        processor_time().zip(before).map_or(Duration::ZERO, |(now, before)| (now - before) / runs);
    println!("{name}: {:?} passed, {used:?} of processors", start.elapsed() / runs);
    result
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let default =
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes/cabin/cabin.obj");
    let path = std::env::args_os().nth(1).map_or_else(default, PathBuf::from);
    let scene = Arc::new(load(&path, &LoadOptions::default())?.scene);
    let raycaster = Arc::new(Raycaster::build(Arc::clone(&scene))?);
    let spec = SectionSpec {
        origin: [14.0, 1.0, 3.0],
        axes: [[10.0, 0.0, 0.0], [0.0, 14.0, 0.0], [0.0, 0.0, 4.0]],
        grid: [10, 13, 4],
        class: ViewClass::Interior,
        obstructions: false,
    };
    let section = Section::new(spec)?;
    let size = (1280, 720);
    let view = View::new(
        DVec3::new(12.5, 0.5, 5.0),
        DVec3::new(1.0, 1.0, 0.0),
        DVec3::Z,
        Some(60.0),
        None,
        size,
    )?;
    let canvas = |resolution| {
        Voronoi::at_resolution(
            Arc::from([section.clone()]),
            Arc::clone(&raycaster),
            None,
            view,
            size,
            resolution,
        )
    };
    let mut half = timed("surfaces, half of 1280x720", 20, || canvas(Resolution::Half));
    let mut canvas = timed("surfaces, 1280x720", 20, || canvas(Resolution::Full));
    let beams = timed("beams of what is seen", 3, || {
        canvas.surface_beams(Search::Thorough).map_or_else(Vec::new, |search| search())
    });
    // Rays that see what is there, all equally bright: where they land is what takes time.
    let packets: Vec<(BeamId, Vec<Sample>)> = beams
        .iter()
        .map(|&(BeamKey { beam, .. }, _)| (beam, rays(&section, beam, &raycaster)))
        .collect();
    let count: usize = packets.iter().map(|(_, samples)| samples.len()).sum();
    timed(&format!("insert {count} samples"), 3, || {
        packets.iter().for_each(|(beam, samples)| {
            canvas.insert(BeamKey { section: 0, beam: *beam }, 1, samples)
        });
    });
    timed("the same at half resolution", 3, || {
        packets.iter().for_each(|(beam, samples)| {
            half.insert(BeamKey { section: 0, beam: *beam }, 1, samples)
        });
    });
    timed("draw with all beams' new samples, half resolution", 10, || {
        packets.iter().for_each(|(beam, samples)| {
            half.insert(BeamKey { section: 0, beam: *beam }, 1, &samples[..samples.len().min(1)])
        });
        half.draw()
    });
    let mut beams = packets.iter().cycle();
    timed("draw with a beam's new samples", 10, || {
        if let Some((beam, samples)) = beams.next() {
            canvas.insert(BeamKey { section: 0, beam: *beam }, 1, samples);
        }
        canvas.draw()
    });
    timed("draw with all beams' new samples", 5, || {
        packets.iter().for_each(|(beam, samples)| {
            canvas.insert(BeamKey { section: 0, beam: *beam }, 1, &samples[..samples.len().min(1)])
        });
        canvas.draw()
    });
    timed("draw with nothing new", 10, || canvas.draw());
    Ok(())
}

fn rays(section: &Section, beam: BeamId, raycaster: &Raycaster) -> Vec<Sample> {
    let Some(sampler) = section.beam_sampler(0, beam, None) else { return Vec::new() };
    let sample = |number| {
        let coords = sampler.coords(number);
        let ray = sampler.ray(coords);
        let start = section.trace_start(&ray);
        let hit = raycaster.localize(ray.origin + ray.direction * start, ray.direction).and_then(
            |(local, skipped)| Some(start + skipped + f64::from(raycaster.nearest(&local)?.t)),
        );
        Sample::encode(coords, [0.5; 3], hit.unwrap_or(f64::INFINITY), section.diagonal(), number)
    };
    (0..14).map(sample).collect()
}
