//! Measures pictures from a file's samples and some seconds of live ones against a converged picture.
//!
//! `quality FILE.holo VIEW OUT [LIVE]`: writes OUT-*.npy for study.

#![allow(clippy::unwrap_used, missing_docs)]

use glam::DVec3;
use holo_beamfile::{BeamFile, BeamKey};
use holo_picture::{Picture, View as Eye};
use holo_raycast::Raycaster;
use holo_scene::Scene;
use holo_section::{Section, SectionSpec};
use holo_surfacelight::*;
use holo_tracer::{Settings, Tracer};
use rayon::prelude::*;
use std::io::Write;
use std::sync::Arc;
use std::time::Instant;

#[derive(serde::Deserialize)]
struct About {
    sections: Vec<SectionSpec>,
    views: Vec<(String, String)>,
}

fn npy(path: &str, shape: &[usize], data: &[f32]) {
    let shape: Vec<String> = shape.iter().map(|n| format!("{n},")).collect();
    let mut header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}), }}", shape.join(" "));
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut file = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
    file.write_all(b"\x93NUMPY\x01\x00").unwrap();
    file.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
    file.write_all(header.as_bytes()).unwrap();
    file.write_all(bytemuck::cast_slice(data)).unwrap();
}

fn beams(file: &BeamFile) -> Vec<BeamKey> {
    let mut keys = Vec::new();
    file.for_each_beam(&mut |key, _| keys.push(key));
    keys
}

/// Rays of the view, spread evenly over it (Roberts' R2 sequence), each of one path.
fn live(tracer: &Tracer, eye: &Eye, count: u64) -> Vec<RaySample> {
    let at = |n: u64| {
        let t = n as f64 + 0.5;
        ((t * 0.754_877_666_246_692_8).fract(), (t * 0.569_840_290_998_053_3).fract())
    };
    let trace = |n: u64| {
        let (x, y) = at(n);
        let (origin, direction) = eye.ray(x, y);
        let traced = tracer.trace(origin, direction, 0xABCD_0000_0000 + n);
        RaySample {
            origin,
            direction,
            distance: traced.distance,
            uncertainty: 0.0,
            radiance: traced.radiance,
        }
    };
    (0..count).into_par_iter().map(trace).collect()
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let file = BeamFile::open_read_only(&args[1], 64 << 20).unwrap();
    let about: About = serde_json::from_slice(&file.blob("holodeck").unwrap().unwrap()).unwrap();
    let scene = Arc::new(Scene::unpack(&file.blob("scene").unwrap().unwrap()).unwrap());
    let raycaster = Arc::new(Raycaster::build(scene.clone()).unwrap());
    let sections: Vec<Section> =
        about.sections.into_iter().map(|spec| Section::new(spec).unwrap()).collect();
    let materials = Materials::new(&scene);
    let placer = Placer::new(&raycaster, &materials);
    let finest: f32 = std::env::var("FINEST").map_or(0.01, |s| s.parse().unwrap());
    let mut store = Store::new(finest, 100_000_000);

    let all: Vec<_> = beams(&file).iter().map(|&key| (key, file.read(key).unwrap())).collect();
    let total: usize = all.iter().map(|(_, read)| read.samples.len()).sum();
    let clock = Instant::now();
    for batch in all.chunks(20_000) {
        let placed: Vec<_> = batch
            .par_chunks(64)
            .flat_map_iter(|beams| {
                let mut placed = Vec::new();
                for (key, read) in beams {
                    let section = &sections[usize::from(key.section)];
                    placer.place_beam(section, key.beam, &read.samples, &mut placed);
                }
                placed
            })
            .collect();
        store.add(&placed);
    }
    let seconds = clock.elapsed().as_secs_f64();
    println!(
        "{total} samples, {} placed, {:.2} M/s, {} cells",
        store.samples(),
        total as f64 / seconds / 1e6,
        store.cells()
    );

    let size = (1280, 720);
    let (_, spec) = about.views.iter().find(|(name, _)| *name == args[2]).unwrap();
    let (eye, size) = Eye::parse_vf(spec).unwrap()
        .resolve(size)
        .unwrap();
    if let Some(count) = args.get(4).map(|count| count.parse().unwrap()) {
        let tracer = Tracer::with_raycaster(raycaster.clone(), Settings::default()).unwrap();
        let rays = live(&tracer, &eye, count);
        let mut placed = Vec::new();
        placer.place_rays(&rays, &mut placed);
        println!("{count} live, {} placed", placed.len());
        store.add(&placed);
    }
    let clock = Instant::now();
    let view = View::new(&raycaster, &materials, &eye, size);
    println!("cast {:.1} ms", clock.elapsed().as_secs_f64() * 1e3);
    let clock = Instant::now();
    let view = { drop(view); View::new(&raycaster, &materials, &eye, size) };
    println!("cast {:.1} ms, {} ways", clock.elapsed().as_secs_f64() * 1e3, view.ways.len());
    plain(&store, &view, &args[3]);
    dump(&store, &view, &args[3]);
}

/// The picture of each pixel's first level with enough samples.
fn plain(store: &Store, view: &View, out: &str) {
    let light = |seen: &Seen| {
        let sums = view.first_with(store, seen, 8).or_else(|| view.first_with(store, seen, 1));
        let (scale, radiance) = view.paint(seen);
        let light = sums.map_or([0.0; 3], |sums| {
            sums.light.map(|c| c as f32 / sums.count as f32 * view.unit())
        });
        [0, 1, 2].map(|c| radiance[c] + scale[c] * light[c])
    };
    let mut pixels: Vec<[f32; 3]> = view.seen.par_iter().map(light).collect();
    for (pixel, seen) in &view.mirrored {
        let more = light(seen);
        (0..3).for_each(|c| pixels[*pixel as usize][c] += more[c]);
    }
    let size = (view.size.0 as u32, view.size.1 as u32);
    let picture = Picture::from_pixels(size.0, size.1, pixels).unwrap();
    picture.write(format!("{out}-plain.pfm")).unwrap();
}

/// For study: by pixel what is seen, and by square the sums.
fn dump(store: &Store, view: &View, out: &str) {
    let (width, height) = view.size;
    let full: Vec<f32> = view
        .seen
        .iter()
        .flat_map(|seen| {
            let (scale, radiance) = view.paint(seen);
            let material = if seen.is_surface() { seen.material as f32 } else { -1.0 };
            let p = seen.point;
            let n = seen.normal;
            let mut row = vec![p.x, p.y, p.z, n.x, n.y, n.z, seen.width, material];
            row.extend(scale);
            row.extend(radiance);
            row.push((seen.way > 0) as u8 as f32);
            row
        })
        .collect();
    npy(&format!("{out}-full.npy"), &[height, width, 15], &full);
    let extra: Vec<f32> = view
        .mirrored
        .iter()
        .flat_map(|(pixel, seen)| {
            let (scale, radiance) = view.paint(seen);
            let sums = seen.is_surface().then(|| view.first_with(store, seen, 16)).flatten();
            let light = sums.map_or([0.0; 3], |sums| {
                sums.light.map(|c| c as f32 / sums.count as f32 * view.unit())
            });
            let value = [0, 1, 2].map(|c| radiance[c] + scale[c] * light[c]);
            [*pixel as f32, value[0], value[1], value[2]]
        })
        .collect();
    npy(&format!("{out}-extra.npy"), &[view.mirrored.len(), 4], &extra);
    for step in [2, 4] {
        let size = (width / step, height / step);
        let mut rows = Vec::new();
        for y in 0..size.1 {
            for x in 0..size.0 {
                let seen = &view.seen[(y * step + step / 2) * width + x * step + step / 2];
                for shift in -1..=2 {
                    let wanted = (seen.width * step as f32 / store.finest()).log2().round();
                    let level = (wanted as i32 + shift).clamp(0, LEVELS as i32 - 1) as usize;
                    let sums =
                        seen.is_surface().then(|| view.sums(store, seen, level)).flatten();
                    let sums = sums.unwrap_or_default();
                    let unit = view.unit();
                    rows.push(sums.count as f32);
                    rows.extend(sums.light.map(|c| c as f32 * unit));
                    rows.push(sums.square as f32 * unit * unit);
                    let (most, of) = brightest_of(&sums);
                    rows.push(most * unit);
                    rows.extend(of.map(|c| c * unit));
                }
                let sums = seen.is_surface().then(|| view.first_with(store, seen, 16)).flatten();
                let sums = sums.unwrap_or_default();
                rows.push(sums.count as f32);
                rows.extend(sums.light.map(|c| c as f32 * view.unit()));
            }
        }
        npy(&format!("{out}-grid{step}.npy"), &[size.1, size.0, 40], &rows);
    }
    let _ = DVec3::ZERO;
}
