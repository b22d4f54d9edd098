//! Draws pictures of a file's samples and of additional live samples, and measures their cost.
//!
//! `quality FILE.holo VIEW OUT [LIVE...]` writes OUT-LIVE-1280.pfm for each number of live samples,
//! in rising order, and the same at half resolution. The number 0 means the file's samples alone.
//! The environment variable `OIDN` may name the library of Open Image Denoise. Times are processor
//! time of all threads.

#![allow(clippy::unwrap_used, clippy::panic)]

mod filled;
mod stored;

use filled::{live, place_all};
use holo_denoise::{Denoiser, Quality};
use holo_driver_surfaces::{Gathered, LightStore, Materials, Placer, SurfaceView};
use holo_picture::Picture;
use holo_tracer::{Settings, Tracer};
use std::sync::Arc;
use stored::{Stored, seconds};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let [_, file, name, out, counts @ ..] = &args[..] else { panic!("see the source") };
    let stored = Stored::read(file, name);
    let raycaster = Arc::clone(&stored.raycaster);
    let scene = raycaster.scene();
    let materials = Arc::new(Materials::new(scene));
    let placer = Placer::new(&raycaster, &materials);
    let (low, high) = scene.bounds();
    let mut store = LightStore::new((1e-5 * low.distance(high)) as f32, 1 << 30);
    place_all(&mut store, &stored, &placer);
    println!("{} samples placed, {} kept", store.samples(), store.kept());
    let (eye, size) = (stored.view, stored.size);
    let tracer = Tracer::with_raycaster(raycaster.clone(), Settings::default()).unwrap();
    let mut traced = 0;
    let library = std::env::var_os("OIDN");
    let mut denoiser =
        library.map(|path| Denoiser::load(Some(path.as_ref()), Quality::Balanced).unwrap());
    for count in counts {
        let rays = live(&tracer, &eye, traced..count.parse().unwrap());
        traced += rays.len() as u64;
        let mut placed = Vec::new();
        placer.place_rays(&rays, &mut placed);
        store.add(&placed);
        for size in [(size.0 / 2, size.1 / 2), size] {
            let start = seconds();
            let mut view =
                SurfaceView::new(Arc::clone(&raycaster), Arc::clone(&materials), &eye, size);
            if size == stored.size {
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
