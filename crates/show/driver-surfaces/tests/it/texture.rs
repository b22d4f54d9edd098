//! Textures: stored light is divided by them, and pixels multiply by them.

#![allow(clippy::unwrap_used, missing_docs)]

use glam::DVec3;
use holo_driver_surfaces::{Gathered, LightStore, Materials, Placer, RaySample, SurfaceView};
use holo_picture::View as Eye;
use holo_raycast::Raycaster;
use holo_scene::LoadOptions;
use std::sync::Arc;

const LIGHT: f32 = 0.8;

/// A floor of 4 x 4 at height 0, with a texture of 16 x 16 dark and bright squares by turns. `map`
/// names the property that the texture scales.
fn floor(map: &str) -> Arc<Raycaster> {
    let folder = tempfile::tempdir().unwrap();
    let square = |x: u32, y: u32| if (x / 4 + y / 4).is_multiple_of(2) { 60 } else { 250 };
    let picture = image::GrayImage::from_fn(64, 64, |x, y| image::Luma([square(x, y)]));
    picture.save(folder.path().join("squares.png")).unwrap();
    std::fs::write(folder.path().join("floor.mtl"), format!("newmtl floor\n{map}\n")).unwrap();
    let obj = "mtllib floor.mtl\nv -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nvt 0 0\nvt 1 0\nvt 1 1\n\
               vt 0 1\nusemtl floor\nf 1/1 2/2 3/3 4/4\n";
    let path = folder.path().join("floor.obj");
    std::fs::write(&path, obj).unwrap();
    let scene = holo_scene::load(&path, &LoadOptions::default()).unwrap().scene;
    Arc::new(Raycaster::build(Arc::new(scene)).unwrap())
}

/// Returns the triangle that a ray straight down hits, and the place on it.
fn met(raycaster: &Raycaster, x: f64, y: f64) -> (u32, f32, f32) {
    let down = DVec3::new(0.0, 0.0, -1.0);
    let (ray, _) = raycaster.localize(DVec3::new(x, y, 3.0), down).unwrap();
    let hit = raycaster.nearest(&ray).unwrap();
    (hit.triangle, hit.u, hit.v)
}

fn drawn(
    raycaster: &Arc<Raycaster>,
    radiance: impl Fn(f64, f64) -> f32,
) -> (SurfaceView, Vec<[f32; 3]>) {
    let at = |n: u32| (f64::from(n) + 0.5) / 60.0 * 3.8 - 1.9;
    let places = (0..60).flat_map(|row| (0..60).map(move |column| (at(column), at(row))));
    let rays: Vec<RaySample> = places
        .map(|(x, y)| RaySample {
            origin: DVec3::new(x, y, 3.0),
            direction: DVec3::new(0.0, 0.0, -1.0),
            distance: 3.0,
            uncertainty: 0.0,
            radiance: [radiance(x, y); 3],
            paths: 1,
        })
        .collect();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let mut placed = Vec::new();
    Placer::new(raycaster, &materials).place_rays(&rays, &mut placed);
    let mut store = LightStore::new(0.001, 64 << 20);
    store.add(&placed);
    let (at, down) = (DVec3::new(0.0, 0.0, 3.0), DVec3::new(0.0, 0.0, -1.0));
    let eye = Eye::new(at, down, DVec3::Y, Some(55.0), None, (256, 256)).unwrap();
    let view = SurfaceView::new(Arc::clone(raycaster), materials, &eye, (256, 256));
    let pixels = Gathered::new(&view, &store).draw(&view, &store, None).pixels;
    (view, pixels)
}

#[test]
fn a_texture_is_as_sharp_as_its_pixels_from_few_samples() {
    let raycaster = floor("Kd 0.8 0.8 0.8\nmap_Kd squares.png");
    let reflectance = |x: f64, y: f64, width: f32| {
        let (triangle, u, v) = met(&raycaster, x, y);
        raycaster.scene().reflectance(triangle, u, v, width)[1]
    };
    let (view, pixels) = drawn(&raycaster, |x, y| LIGHT * reflectance(x, y, 0.0));
    // One sample for 18 pixels.
    let (mut least, mut most) = (f32::INFINITY, 0.0_f32);
    for (seen, pixel) in view.seen.iter().zip(&pixels) {
        let expected =
            LIGHT * reflectance(f64::from(seen.point.x), f64::from(seen.point.y), seen.width);
        assert!(
            (pixel[1] / expected - 1.0).abs() < 0.02,
            "{:?}: {pixel:?}, not {expected}",
            seen.point
        );
        (least, most) = (least.min(expected), most.max(expected));
    }
    assert!(most > 5.0 * least, "{least} to {most}");
}

#[test]
fn a_lamp_shines_by_its_texture() {
    let raycaster = floor("Kd 0 0 0\nKe 3 3 3\nmap_Ke squares.png");
    let (view, pixels) = drawn(&raycaster, |_, _| 0.0);
    let shown: Vec<f32> = pixels.iter().map(|pixel| pixel[1]).collect();
    let (least, most) =
        shown.iter().fold((f32::INFINITY, 0.0_f32), |(a, b), c| (a.min(*c), b.max(*c)));
    assert!(view.seen.iter().all(|seen| !seen.is_surface()));
    assert!(most > 2.5 && most < 3.1 && least < 0.3, "{least} to {most}");
}
