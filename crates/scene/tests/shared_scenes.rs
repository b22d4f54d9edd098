//! Scenes that no one here modelled, where they lie beside the project.

#![allow(clippy::unwrap_used)]

mod common;

use common::shared;
use glam::DVec3;
use holo_scene::{LoadOptions, Scene, load_obj};
use std::time::{Duration, Instant};

fn close(bounds: (DVec3, DVec3), low: [f64; 3], high: [f64; 3]) -> bool {
    // f32 around the centre, coordinates of at most 32: half a unit is 2⁻²⁰.
    let near =
        |a: DVec3, b: [f64; 3]| (a - DVec3::from_array(b)).abs().max_element() <= 2f64.powi(-20);
    near(bounds.0, low) && near(bounds.1, high)
}

#[test]
fn the_cornell_box_is_all_there() {
    let Some(shared) = shared() else { return };
    let loaded =
        load_obj(&shared.join("scenes/cornell/cornell.obj"), &LoadOptions::default()).unwrap();
    let scene = loaded.scene;
    assert_eq!(loaded.warnings, []);
    assert_eq!((scene.triangles.len(), scene.materials.len()), (32, 4));
    let features = scene.features();
    assert!(features.diffuse && !features.mirror && !features.sky);
    assert_eq!(features.emitters, 2);
    let emitter = scene.emitters().next().unwrap();
    assert_eq!(scene.material(emitter).emission, [17.0, 12.0, 4.0]);
    assert!(scene.normal(emitter).y < -0.999, "the lamp shines down");
    // The section of the baselines: the blocks reach into it.
    let axes = [DVec3::X * 4.3, DVec3::Y * 4.2, DVec3::Z * 5.0];
    assert!(scene.geometry_inside(DVec3::new(0.6, 0.6, -4.0), axes));
    assert!(!scene.geometry_inside(DVec3::new(0.6, 0.6, -5.5), axes));
}

#[test]
fn the_cabin_is_all_there_and_loads_quickly() {
    let Some(shared) = shared() else { return };
    let path = shared.join("scenes/cabin/cabin.obj");
    let start = Instant::now();
    let loaded = load_obj(&path, &LoadOptions::default()).unwrap();
    let took = start.elapsed();
    let scene = loaded.scene;
    println!("loaded in {took:?}; {} warnings", loaded.warnings.len());
    assert_eq!(scene.materials.len(), 26);
    assert_eq!(scene.triangles.len(), 298_947);
    let features = scene.features();
    assert!(features.diffuse && features.mirror && features.thin_glass && !features.coated);
    let start = Instant::now();
    let packed = scene.pack();
    assert_eq!(Scene::unpack(&packed).unwrap(), scene);
    println!("packed ({} bytes) and unpacked in {:?}", packed.len(), start.elapsed());
    // Nothing of the file is lost but what f32 cannot hold: bounds as the text has them.
    let text = std::fs::read_to_string(&path).unwrap();
    let numbers =
        |line: &str| -> Vec<f64> { line.split(' ').skip(1).map(|t| t.parse().unwrap()).collect() };
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for vertex in text.lines().filter(|l| l.starts_with("v ")).map(numbers) {
        for axis in 0..3 {
            low[axis] = low[axis].min(vertex[axis]);
            high[axis] = high[axis].max(vertex[axis]);
        }
    }
    assert!(close(scene.bounds(), low, high), "{:?} {low:?} {high:?}", scene.bounds());
    // Measured 0.2 s of one core; the limit leaves room for a busy machine.
    assert!(took < Duration::from_secs(2), "{took:?}");
}
