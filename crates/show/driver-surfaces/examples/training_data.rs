//! Writes examples that the filter's network learns from, for `scripts/train-filter`.
//!
//! `training_data FILE.holo VIEW OTHERS OUT LIVE...` filters the view from the file's samples and
//! each number of additional live samples, in rising order, at its size and at half of it. OUT
//! receives the examples of `Gathered::examples` as floats. Their true light comes from OTHERS:
//! another file of the same scene, or a number of live samples.

#![allow(clippy::unwrap_used, clippy::panic, dead_code)]

mod filled;
mod stored;

use filled::{live, place_all};
use holo_driver_surfaces::{Gathered, LightStore, Materials, Placer, SurfaceView};
use holo_tracer::{Settings, Tracer};
use std::io::Write;
use std::sync::Arc;
use stored::Stored;

/// Most examples of a picture.
const MOST: usize = 120_000;

/// The first of the other live samples: their paths are independent of the view's own.
const FIRST_OTHER: u64 = 1 << 32;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let [_, file, name, others, out, counts @ ..] = &args[..] else { panic!("see the source") };
    let stored = Stored::read(file, name);
    let raycaster = Arc::clone(&stored.raycaster);
    let scene = raycaster.scene();
    let materials = Arc::new(Materials::new(scene));
    let placer = Placer::new(&raycaster, &materials);
    let tracer = Tracer::with_raycaster(raycaster.clone(), Settings::default()).unwrap();
    let (low, high) = scene.bounds();
    let new_store = || LightStore::new((1e-5 * low.distance(high)) as f32, 4 << 30);
    let trace = |store: &mut LightStore, numbers| {
        let mut placed = Vec::new();
        placer.place_rays(&live(&tracer, &stored.view, numbers), &mut placed);
        store.add(&placed);
    };
    let mut truth = new_store();
    match others.parse::<u64>() {
        Ok(count) => trace(&mut truth, FIRST_OTHER..FIRST_OTHER + count),
        Err(_) => place_all(&mut truth, &Stored::read(others, name), &placer),
    }
    let mut store = new_store();
    place_all(&mut store, &stored, &placer);
    let mut out = std::io::BufWriter::new(std::fs::File::create(out).unwrap());
    let mut traced = 0;
    for count in counts {
        let count = count.parse().unwrap();
        trace(&mut store, traced..count);
        traced = count;
        for size in [stored.size, (stored.size.0 / 2, stored.size.1 / 2)] {
            let raycaster = Arc::clone(&raycaster);
            let view = SurfaceView::new(raycaster, Arc::clone(&materials), &stored.view, size);
            let [gathered, others] = [&mut store, &mut truth].map(|store| {
                store.begin_round();
                Gathered::new(&view, store)
            });
            let every = view.seen.len().div_ceil(MOST);
            for value in gathered.examples((&view, &store), &others, every) {
                out.write_all(&value.to_le_bytes()).unwrap();
            }
        }
    }
}
