//! Tests that aiming at secondary sources changes the error and not the expectation.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};

use crate::engine::PathEngine;
use crate::path::{Start, first_hit};
use crate::sampler::Sampler;
use crate::weighting::Direct;

/// A floor that receives the light of a lamp only after a small plate above it has reflected it.
fn scene(floor: Bsdf, plate: Bsdf) -> Arc<Raycaster> {
    let quad =
        |z: f64, h: f64| [[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]].map(DVec3::from_array);
    let positions = [quad(0.0, 8.0), quad(1.0, 0.05), quad(1.2, 0.2)].concat();
    let triangles: Vec<[u32; 3]> = (0..3)
        .flat_map(|q| [[4 * q, 4 * q + 1, 4 * q + 2], [4 * q, 4 * q + 2, 4 * q + 3]])
        .collect();
    let material = |bsdf, emission| Material { bsdf, emission, ..Material::grey("m") };
    let black = Bsdf::Diffuse { kd: [0.0; 3] };
    let materials =
        vec![material(floor, [0.0; 3]), material(black, [50.0; 3]), material(plate, [0.0; 3])];
    let scene = Scene::from_world(&positions, &triangles, &[0, 0, 1, 1, 2, 2], materials, [0.0; 3])
        .expect("valid")
        .0;
    Arc::new(Raycaster::build(Arc::new(scene)).expect("built"))
}

/// Eye and direction of the estimates in this file.
const EYE: (DVec3, DVec3) = (DVec3::new(1.4, 0.2, 0.7), DVec3::new(-0.6, 0.1, -1.0));

/// Returns mean and variance of the green channel of single paths from an eye in a direction.
pub(crate) fn estimate(
    engine: &PathEngine,
    raycaster: &Raycaster,
    (eye, direction): (DVec3, DVec3),
    paths: u64,
) -> (f64, f64) {
    let direction = direction.normalize();
    let (hit, _) = first_hit(raycaster, eye, direction);
    let start = Start::eye(hit, direction.as_vec3(), engine.inside(raycaster, eye));
    let (mut sum, mut squares) = (0.0, 0.0);
    for seed in 0..paths {
        let x = f64::from(engine.radiance(raycaster, start, &mut Sampler::new(seed, 0)).y);
        sum += x;
        squares += x * x;
    }
    let mean = sum / paths as f64;
    (mean, (squares / paths as f64 - mean * mean).max(0.0))
}

#[test]
fn aimed_and_plain_samples_have_one_expectation_and_aimed_samples_less_variance() {
    let mut seen = Vec::new();
    for floor in [
        Bsdf::Diffuse { kd: [0.7; 3] },
        Bsdf::Coated { kd: [0.5; 3], ks: [1.0; 3], ior: 1.5, alpha: 0.3 },
    ] {
        for plate in [
            Bsdf::Diffuse { kd: [0.8; 3] },
            Bsdf::Mirror { ks: [0.9; 3] },
            Bsdf::Conductor { ks: [0.9; 3], alpha: 0.2 },
        ] {
            let raycaster = scene(floor, plate);
            let mut engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
            assert!(engine.secondary.is_some(), "{plate:?}");
            // They would find the plate's image of the lamp, too.
            engine.caustics = None;
            let n = 200_000;
            let aimed = estimate(&engine, &raycaster, EYE, n);
            engine.secondary = None;
            let plain = estimate(&engine, &raycaster, EYE, n);
            // 6 comparisons at 4.5 sigma: by chance once in 25,000 sets of seeds.
            let error = ((aimed.1 + plain.1) / n as f64).sqrt();
            assert!(
                (aimed.0 - plain.0).abs() < 4.5 * error,
                "{floor:?} {plate:?}: {aimed:?} {plain:?}"
            );
            assert!(
                aimed.0 > 0.0 && error < 0.1 * aimed.0,
                "{floor:?} {plate:?}: {aimed:?} {plain:?}"
            );
            seen.push(plain.1 / aimed.1);
        }
    }
    println!("variance of plain paths over that of aimed ones: {seen:.1?}");
    assert!(seen.iter().all(|&gain| gain > 2.0), "{seen:?}");
}

/// The same plate, but much of the light comes from a ceiling that is no source, and a glowing disc
/// hides part of the plate.
#[test]
fn light_from_elsewhere_and_hidden_sources_change_no_expectation() {
    let quad = |x: f64, z: f64, h: f64| {
        [[x - h, -h, z], [x + h, -h, z], [x + h, h, z], [x - h, h, z]].map(DVec3::from_array)
    };
    let positions = [
        quad(0.0, 0.0, 8.0),
        quad(0.0, 1.0, 0.05),
        quad(0.0, 1.2, 0.2),
        quad(0.0, 2.0, 8.0),
        quad(0.1, 0.8, 0.1),
    ]
    .concat();
    let triangles: Vec<[u32; 3]> = (0..5)
        .flat_map(|q| [[4 * q, 4 * q + 1, 4 * q + 2], [4 * q, 4 * q + 2, 4 * q + 3]])
        .collect();
    let material = |kd: f32, emission: f32| Material {
        bsdf: Bsdf::Diffuse { kd: [kd; 3] },
        emission: [emission; 3],
        two_sided_emission: emission == 5.0,
        ..Material::grey("m")
    };
    let materials = vec![
        material(0.7, 0.0),
        material(0.0, 50.0),
        material(0.8, 0.0),
        material(0.9, 0.0),
        material(0.0, 5.0),
    ];
    let ids = [0, 0, 1, 1, 2, 2, 3, 3, 4, 4];
    let scene =
        Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).expect("valid").0;
    let raycaster = Arc::new(Raycaster::build(Arc::new(scene)).expect("built"));
    // With `Materials`, emission that an aimed sample meets counts in full.
    for direct in [Direct::Both, Direct::Materials] {
        let mut engine = PathEngine::new(&raycaster, None, direct, 1);
        assert!(engine.secondary.is_some());
        let n = 400_000;
        let aimed = estimate(&engine, &raycaster, EYE, n);
        engine.secondary = None;
        let plain = estimate(&engine, &raycaster, EYE, n);
        let error = ((aimed.1 + plain.1) / n as f64).sqrt();
        println!("{direct:?}: {aimed:?} {plain:?}");
        assert!((aimed.0 - plain.0).abs() < 4.5 * error, "{direct:?}: {aimed:?} {plain:?}");
        assert!(error < 0.05 * plain.0, "{direct:?}: {aimed:?} {plain:?}");
    }
}

#[test]
fn a_scene_with_evenly_spread_light_has_no_sources() {
    // The plate is as large as the floor.
    let quad =
        |z: f64, h: f64| [[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]].map(DVec3::from_array);
    let positions = [quad(0.0, 4.0), quad(1.9, 0.5), quad(2.0, 4.0)].concat();
    let triangles: Vec<[u32; 3]> = (0..3)
        .flat_map(|q| [[4 * q, 4 * q + 2, 4 * q + 1], [4 * q, 4 * q + 3, 4 * q + 2]])
        .collect();
    let materials =
        vec![Material::grey("wall"), Material { emission: [5.0; 3], ..Material::grey("lamp") }];
    let scene = Scene::from_world(&positions, &triangles, &[0, 0, 1, 1, 0, 0], materials, [0.0; 3])
        .expect("valid")
        .0;
    let raycaster = Arc::new(Raycaster::build(Arc::new(scene)).expect("built"));
    assert!(PathEngine::new(&raycaster, None, Direct::Both, 1).secondary.is_none());
}

/// A plate between a strong lamp below it and one of a fiftieth of its power above it.
#[test]
fn a_source_is_a_source_on_its_dimmer_side_too() {
    let quad = |z: f64, h: f64, up: bool| {
        let corners = [[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]].map(DVec3::from_array);
        if up { corners } else { [corners[0], corners[3], corners[2], corners[1]] }
    };
    let positions = [
        quad(0.0, 8.0, true),
        quad(1.0, 0.05, true),
        quad(1.2, 0.2, true),
        quad(1.4, 0.05, false),
        quad(3.0, 8.0, false),
    ]
    .concat();
    let triangles: Vec<[u32; 3]> = (0..5)
        .flat_map(|q| [[4 * q, 4 * q + 1, 4 * q + 2], [4 * q, 4 * q + 2, 4 * q + 3]])
        .collect();
    let lamp = |emission: f32| Material { emission: [emission; 3], ..Material::grey("lamp") };
    let materials = vec![Material::grey("wall"), lamp(50.0), lamp(1.0)];
    let ids = [0, 0, 1, 1, 0, 0, 2, 2, 0, 0];
    let scene =
        Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).expect("valid").0;
    let raycaster = Arc::new(Raycaster::build(Arc::new(scene)).expect("built"));
    let engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
    let sources = engine.secondary.as_ref().expect("the plate is a source");
    for (eye, normal) in
        [(DVec3::new(1.0, 0.5, 0.1), Vec3::Z), (DVec3::new(1.0, 0.5, 2.9), Vec3::NEG_Z)]
    {
        let towards = (DVec3::new(0.15, 0.02, 1.2) - eye).normalize();
        let hit = first_hit(&raycaster, eye, towards).0.expect("the plate");
        assert!([4, 5].contains(&hit.triangle), "{hit:?}");
        // A point of a wall that only the dimmer side lights.
        let down = first_hit(&raycaster, eye, -normal.as_dvec3()).0.expect("a wall");
        let point = raycaster.surface(down.triangle, down.u, down.v);
        let density = sources.aimed_from(&point, normal).density(&raycaster, &hit);
        assert!(density > 0.0, "{eye}: {density}");
    }
}
