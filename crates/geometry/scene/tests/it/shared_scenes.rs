//! Scenes that others modelled. They lie in `../shared`, beside the project.

#![allow(clippy::unwrap_used)]

use glam::DVec3;
use holo_scene::{LoadOptions, Loaded, Scene};
use std::path::{Path, PathBuf};

fn shared(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../../shared/scenes").join(path)
}

fn load(path: &str) -> Loaded {
    holo_scene::load(&shared(path), &LoadOptions::default()).unwrap()
}

fn close(bounds: (DVec3, DVec3), low: [f64; 3], high: [f64; 3]) -> bool {
    // f32 around the centre, coordinates of at most 32: half a unit is 2⁻²⁰.
    let near =
        |a: DVec3, b: [f64; 3]| (a - DVec3::from_array(b)).abs().max_element() <= 2f64.powi(-20);
    near(bounds.0, low) && near(bounds.1, high)
}

#[test]
#[ignore = "needs ../shared"]
fn the_cornell_box_is_loaded_completely() {
    let loaded = load("cornell/cornell.obj");
    let scene = loaded.scene;
    assert_eq!(loaded.warnings, []);
    assert_eq!((scene.triangles().len(), scene.materials.len()), (32, 4));
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
#[ignore = "needs ../shared"]
fn the_cabin_is_loaded_completely() {
    let scene = load("cabin/cabin.obj").scene;
    assert_eq!(scene.materials.len(), 26);
    assert_eq!(scene.triangles().len(), 298_947);
    let features = scene.features();
    assert!(features.diffuse && features.mirror && features.thin_glass && !features.coated);
    assert_eq!(Scene::unpack(&scene.pack()).unwrap(), scene);
    // The bounds are those of the text, within the rounding of f32.
    let text = std::fs::read_to_string(shared("cabin/cabin.obj")).unwrap();
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
}
