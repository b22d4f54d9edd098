//! Measures pictures of a file's samples and of live ones traced besides, and what they take.
//!
//! `quality FILE.holo VIEW OUT [LIVE...]` writes OUT-LIVE-1280.pfm for each number of live samples,
//! in rising order, and the same at half resolution. 0 is the file alone. The variable `OIDN` may
//! name the library of Open Image Denoise. Times are of the processor, all threads together.

#![allow(clippy::unwrap_used, clippy::panic)]

use holo_beamfile::BeamFile;
use holo_denoise::Denoiser;
use holo_driver_surfaces::{Gathered, Materials, Placer, RaySample, Store, View};
use holo_picture::{Picture, View as Eye};
use holo_raycast::Raycaster;
use holo_scene::Scene;
use holo_section::{BeamKey, Section, SectionSpec};
use holo_tracer::{Settings, Tracer};
use rayon::prelude::*;
use rustix::time::{ClockId, clock_gettime};
use std::sync::Arc;

/// Beams that are placed together.
const BATCH: usize = 20_000;

#[derive(serde::Deserialize)]
struct About {
    sections: Vec<SectionSpec>,
    views: Vec<(String, String)>,
}

/// Seconds of the processor so far.
fn seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Adds all samples of the file.
fn fill(store: &mut Store, file: &BeamFile, sections: &[Section], placer: &Placer) {
    let mut keys: Vec<BeamKey> = Vec::new();
    file.for_each_beam(&mut |key, _| keys.push(key));
    let all: Vec<_> = keys.iter().map(|&key| (key, file.read(key).unwrap())).collect();
    let total: usize = all.iter().map(|(_, read)| read.samples.len()).sum();
    let (mut placing, mut adding) = (0.0, 0.0);
    for batch in all.chunks(BATCH) {
        let start = seconds();
        let place = |beams: &[(BeamKey, Arc<_>)]| {
            let mut placed = Vec::new();
            for (key, read) in beams {
                let read: &holo_beamfile::BeamSamples = read;
                let section = &sections[usize::from(key.section)];
                placer.place_beam(section, key.beam, 1, &read.samples, &mut placed);
            }
            placed
        };
        let placed: Vec<_> = batch.par_chunks(64).flat_map_iter(place).collect();
        let middle = seconds();
        store.add(&placed);
        (placing, adding) = (placing + middle - start, adding + seconds() - middle);
    }
    let each = |time: f64| time * 1e9 / total as f64;
    println!(
        "{total} samples, {} placed, {} kept; {:.0} + {:.0} ns each",
        store.samples(),
        store.kept(),
        each(placing),
        each(adding)
    );
}

/// Rays of the view, spread evenly over it (Roberts' R2 sequence), each of one path.
fn live(tracer: &Tracer, eye: &Eye, numbers: std::ops::Range<u64>) -> Vec<RaySample> {
    let trace = |n: u64| {
        let t = n as f64 + 0.5;
        let (x, y) = ((t * 0.754_877_666_246_692_8).fract(), (t * 0.569_840_290_998_053_3).fract());
        let (origin, direction) = eye.ray(x, y);
        let traced = tracer.trace(origin, direction, 0xABCD_0000_0000 + n);
        let (distance, radiance) = (traced.distance, traced.radiance);
        RaySample { origin, direction, distance, uncertainty: 0.0, radiance, paths: 1 }
    };
    numbers.into_par_iter().map(trace).collect()
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let [_, file, name, out, counts @ ..] = &args[..] else { panic!("see the source") };
    let file = BeamFile::open_read_only(file, 64 << 20).unwrap();
    let about: About = serde_json::from_slice(&file.blob("holodeck").unwrap().unwrap()).unwrap();
    let scene = Arc::new(Scene::unpack(&file.blob("scene").unwrap().unwrap()).unwrap());
    let raycaster = Arc::new(Raycaster::build(scene.clone()).unwrap());
    let sections: Vec<Section> =
        about.sections.into_iter().map(|spec| Section::new(spec).unwrap()).collect();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let (low, high) = scene.bounds();
    let mut store = Store::new((1e-5 * low.distance(high)) as f32, 1 << 30);
    fill(&mut store, &file, &sections, &placer);

    let (_, spec) = about.views.iter().find(|(known, _)| known == name).unwrap();
    let (eye, size) = Eye::parse_vf(spec).unwrap().resolve((1280, 720)).unwrap();
    let tracer = Tracer::with_raycaster(raycaster.clone(), Settings::default()).unwrap();
    let mut traced = 0;
    let library = std::env::var_os("OIDN");
    let mut denoiser = library.map(|path| Denoiser::load(Some(path.as_ref())).unwrap());
    for count in counts {
        let rays = live(&tracer, &eye, traced..count.parse().unwrap());
        traced += rays.len() as u64;
        let mut placed = Vec::new();
        placer.place_rays(&rays, &mut placed);
        store.add(&placed);
        for size in [(size.0 / 2, size.1 / 2), size] {
            let start = seconds();
            let mut view = View::new(Arc::clone(&raycaster), Arc::clone(&materials), &eye, size);
            if size.0 == 1280 {
                view.look_into_edges();
            }
            let middle = seconds();
            store.begin_round();
            let gathered = Gathered::new(&view, &store);
            let summed = seconds();
            let drawn = gathered.draw(&view, &store, denoiser.as_mut());
            let end = seconds();
            println!(
                "{count} live, {} x {}: cast {:.0} ms, gathered {:.0} ms, drawn {:.0} ms",
                size.0,
                size.1,
                (middle - start) * 1e3,
                (summed - middle) * 1e3,
                (end - summed) * 1e3
            );
            let picture = Picture::from_pixels(size.0, size.1, drawn.pixels).unwrap();
            picture.write(format!("{out}-{count}-{}.pfm", size.0)).unwrap();
            let errors = drawn.errors.iter().map(|&e| [e; 3]).collect();
            let errors = Picture::from_pixels(size.0, size.1, errors).unwrap();
            errors.write(format!("{out}-{count}-{}-se.pfm", size.0)).unwrap();
        }
    }
}
