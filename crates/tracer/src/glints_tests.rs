//! Tests that aiming at what mirrors show changes the error and not the expectation.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};

use crate::engine::PathEngine;
use crate::geometry::{Frame, cosine_hemisphere};
use crate::path::first_hit;
use crate::sampler::{Purpose, Sampler};
use crate::secondary_tests::estimate;
use crate::weighting::Direct;

/// A room with a lamp that faces a mirror, which throws its light onto the floor. A screen hides
/// part of the mirror. `turn` is the angle of the mirror to the wall.
fn scene(floor: Bsdf, lamp_is_two_sided: bool, turn: f64) -> Arc<Raycaster> {
    let (sin, cos) = turn.sin_cos();
    let upright = |x: f64, y: f64, z: f64, h: f64, sin: f64, cos: f64| {
        [[-h, -h], [h, -h], [h, h], [-h, h]]
            .map(|[a, b]| DVec3::new(x + a * sin, y + a * cos, z + b))
    };
    let level =
        |z: f64, h: f64| [[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]].map(DVec3::from_array);
    let positions = [
        level(0.0, 3.0),
        upright(1.0, 0.0, 1.0, 0.8, sin, cos),
        upright(-0.6, 0.3, 1.4, 0.1, 0.0, 1.0),
        upright(0.6, 0.4, 0.9, 0.25, 0.0, 1.0),
        level(3.0, 3.0),
    ]
    .concat();
    let triangles: Vec<[u32; 3]> = (0..5)
        .flat_map(|q| [[4 * q, 4 * q + 1, 4 * q + 2], [4 * q, 4 * q + 2, 4 * q + 3]])
        .collect();
    let material = |bsdf| Material { bsdf, ..Material::grey("m") };
    let black = Bsdf::Diffuse { kd: [0.0; 3] };
    let lamp =
        Material { emission: [20.0; 3], two_sided_emission: lamp_is_two_sided, ..material(black) };
    let mirror = Bsdf::Mirror { ks: [0.9; 3] };
    let grey = Bsdf::Diffuse { kd: [0.6; 3] };
    let materials = vec![material(floor), material(mirror), lamp, material(grey)];
    let ids = [0, 0, 1, 1, 2, 2, 3, 3, 3, 3];
    let scene =
        Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).expect("valid").0;
    Arc::new(Raycaster::build(Arc::new(scene)).expect("built"))
}

/// From where and in which direction the estimates look: at the floor.
const EYE: (DVec3, DVec3) = (DVec3::new(-1.0, -1.5, 2.0), DVec3::new(0.4, 1.0, -2.0));

#[test]
fn aimed_and_plain_samples_have_one_expectation_and_aimed_samples_less_variance() {
    let mut gains = Vec::new();
    for floor in [
        Bsdf::Diffuse { kd: [0.7; 3] },
        Bsdf::Coated { kd: [0.5; 3], ks: [1.0; 3], ior: 1.5, alpha: 0.3 },
    ] {
        for (is_two_sided, turn) in [(false, 0.0), (true, 0.3)] {
            let raycaster = scene(floor, is_two_sided, turn);
            let mut engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
            engine.secondary = None;
            assert!(engine.glints.is_some());
            // Paths that are not aimed find the light ten times less often.
            let (n, many) = (100_000, 2_000_000);
            let aimed = estimate(&engine, &raycaster, EYE, n);
            engine.glints = None;
            let plain = estimate(&engine, &raycaster, EYE, many);
            // 4 comparisons at 4.5 sigma: by chance once in 37,000 sets of seeds.
            let error = (aimed.1 / n as f64 + plain.1 / many as f64).sqrt();
            println!("{floor:?} {turn}: {aimed:?} {plain:?}");
            assert!((aimed.0 - plain.0).abs() < 4.5 * error, "{floor:?}: {aimed:?} {plain:?}");
            assert!(error < 0.05 * aimed.0, "{floor:?}: {aimed:?} {plain:?}");
            gains.push(plain.1 / aimed.1);
        }
    }
    assert!(gains.iter().all(|&gain| gain > 1.5), "{gains:?}");
}

#[test]
fn directions_have_the_stated_density() {
    // The mean of 1 / density over chosen directions is the solid angle that they cover, as far as
    // they meet the mirror. The same by directions of the hemisphere.
    let raycaster = scene(Bsdf::Diffuse { kd: [0.7; 3] }, true, 0.3);
    let engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
    let glints = engine.glints.as_ref().expect("a mirror");
    let point = raycaster.surface(0, 0.1, 0.4);
    let vertex = glints.seen_from(point.point, Vec3::Z);
    let density = |direction: Vec3| {
        let origin = point.point.as_dvec3() + raycaster.scene().origin;
        let (hit, _) = first_hit(&raycaster, origin + DVec3::Z * 1e-5, direction.as_dvec3());
        hit.map_or(0.0, |hit| vertex.density(direction, &hit))
    };
    let n = 100_000;
    let frame = Frame::new(Vec3::Z);
    let (mut by_choice, mut by_chance) = ([0.0_f64; 2], [0.0_f64; 2]);
    for seed in 0..n {
        let mut sampler = Sampler::new(seed, 0);
        sampler.turn(0, Purpose::Aim);
        let [first, second] = sampler.two();
        if let Some(direction) = vertex.choose(f64::from(first), second) {
            let d = f64::from(density(direction));
            let x = if d > 0.0 { 1.0 / d } else { 0.0 };
            by_choice = [by_choice[0] + x, by_choice[1] + x * x];
        }
        let direction = frame.to_world(cosine_hemisphere(sampler.two()));
        let is_met = density(direction) > 0.0;
        let x = if is_met { std::f64::consts::PI / f64::from(direction.z) } else { 0.0 };
        by_chance = [by_chance[0] + x, by_chance[1] + x * x];
    }
    let mean = |[sum, squares]: [f64; 2]| {
        let mean = sum / n as f64;
        (mean, (squares / n as f64 - mean * mean) / n as f64)
    };
    let ((chosen, a), (covered, b)) = (mean(by_choice), mean(by_chance));
    assert!(covered > 0.0 && (chosen - covered).abs() < 4.5 * (a + b).sqrt(), "{chosen} {covered}");
}

#[test]
fn a_scene_without_mirrors_has_no_glints() {
    let raycaster = scene(Bsdf::Diffuse { kd: [0.7; 3] }, false, 0.0);
    let mut plain = Scene::clone(raycaster.scene());
    plain.materials[1] = Material::grey("wall");
    let raycaster = Arc::new(Raycaster::build(Arc::new(plain)).expect("built"));
    assert!(PathEngine::new(&raycaster, None, Direct::Both, 1).glints.is_none());
}
