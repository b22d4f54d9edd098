//! Tests that direct light found by lights alone, by materials alone and by both has the same
//! expectation.

use std::sync::Arc;

use glam::DVec3;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};

use crate::engine::PathEngine;
use crate::sampler::Sampler;
use crate::weighting::Direct;
use crate::{Settings, Tracer};

/// A floor of the given material, a large lamp nearby, a small one seen from behind, and a sky.
fn scene(floor: Bsdf, sky: [f32; 3]) -> Arc<Scene> {
    let quad = |z: f64, x: f64, h: f64| {
        [[x - h, -h, z], [x - h, h, z], [x + h, h, z], [x + h, -h, z]].map(DVec3::from_array)
    };
    // Seen from above they run clockwise: fronts face down.
    let positions: Vec<DVec3> =
        [quad(0.0, 0.0, 10.0), quad(1.0, 0.8, 0.7), quad(2.0, -2.0, 0.3)].concat();
    let triangles: Vec<[u32; 3]> = (0..3)
        .flat_map(|q| [[4 * q, 4 * q + 1, 4 * q + 2], [4 * q, 4 * q + 2, 4 * q + 3]])
        .collect();
    let material = |name: &str, bsdf, emission| Material {
        name: name.into(),
        bsdf,
        emission,
        two_sided_emission: false,
    };
    let black = Bsdf::Diffuse { kd: [0.0; 3] };
    let materials = vec![
        material("floor", floor, [0.0; 3]),
        material("near", black, [1.0, 2.0, 3.0]),
        material("far", black, [30.0, 20.0, 10.0]),
    ];
    let (scene, _) = Scene::from_world(&positions, &triangles, &[0, 0, 1, 1, 2, 2], materials, sky)
        .expect("a valid scene");
    Arc::new(scene)
}

/// The same floor under two tinted panes, one of them tilted, that cover most of both lamps. A
/// solid plate of glass lies beside them.
fn glazed(floor: Bsdf, sky: [f32; 3]) -> Arc<Scene> {
    let open = scene(floor, sky);
    let mut positions: Vec<DVec3> = open.points().map(|p| p.as_dvec3() + open.origin).collect();
    let mut triangles: Vec<[u32; 3]> = open.own().triangles.to_vec();
    let mut ids: Vec<u32> = open.own().material_ids.to_vec();
    let mut materials = open.materials.clone();
    let mut quad = |corners: [[f64; 3]; 4], id: u32| {
        let base = positions.len() as u32;
        positions.extend(corners.map(DVec3::from_array));
        triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        ids.extend([id, id]);
    };
    let glass = materials.len() as u32;
    quad([[-2.5, -2.0, 0.6], [0.6, -2.0, 0.6], [0.6, 2.0, 0.6], [-2.5, 2.0, 0.6]], glass);
    quad([[-3.0, -2.0, 0.9], [0.9, -2.0, 0.7], [0.9, 2.0, 0.7], [-3.0, 2.0, 0.9]], glass + 1);
    for z in [0.5, 0.55] {
        quad([[0.8, -0.2, z], [1.2, -0.2, z], [1.2, 0.2, z], [0.8, 0.2, z]], glass + 2);
    }
    for bsdf in [
        Bsdf::ThinGlass { ior: 1.5, transmittance: [0.9, 0.6, 0.3] },
        Bsdf::ThinGlass { ior: 2.0, transmittance: [0.5, 1.0, 0.8] },
        Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.0 },
    ] {
        materials.push(Material {
            name: "glass".into(),
            bsdf,
            emission: [0.0; 3],
            two_sided_emission: false,
        });
    }
    Arc::new(
        Scene::from_world(&positions, &triangles, &ids, materials, sky).expect("a valid scene").0,
    )
}

#[test]
fn lights_and_materials_find_the_same_light_through_panes() {
    for (floor, sky) in [
        (Bsdf::Diffuse { kd: [0.7; 3] }, [0.0; 3]),
        (Bsdf::Diffuse { kd: [0.7; 3] }, [0.3, 0.6, 0.1]),
        (Bsdf::Conductor { ks: [0.9; 3], alpha: 0.3 }, [0.0; 3]),
    ] {
        let raycaster = Arc::new(Raycaster::build(glazed(floor, sky)).expect("built"));
        let results = [(Direct::Materials, 1), (Direct::Both, 1), (Direct::Both, 4)]
            .map(|(d, samples)| mean(&raycaster, d, samples, 100_000));
        for c in 0..3 {
            for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                let ((ma, va), (mb, vb)) = (results[a][c], results[b][c]);
                // 27 comparisons at 4.5 sigma: by chance once in 5,000 sets of seeds.
                assert!(
                    (ma - mb).abs() <= 4.5 * (va + vb).sqrt(),
                    "{floor:?} {sky:?} channel {c}: {results:?}"
                );
            }
            assert!(
                results[1][c].1 < results[0][c].1,
                "{floor:?} {sky:?} channel {c}: {results:?}"
            );
        }
    }
}

/// With one lamp and diffuse surfaces, direct light needs no ray but those to the lamp.
#[test]
fn one_lamp_alone_gives_the_direct_light_of_a_diffuse_room_without_samples_of_its_materials() {
    let lit_by_one = |floor| {
        let scene = scene(floor, [0.0; 3]);
        let mut materials = scene.materials.clone();
        materials[2].emission = [0.0; 3];
        let positions: Vec<DVec3> = scene.points().map(|p| p.as_dvec3() + scene.origin).collect();
        let (scene, _) = Scene::from_world(
            &positions,
            scene.own().triangles,
            scene.own().material_ids,
            materials,
            [0.0; 3],
        )
        .expect("valid");
        Arc::new(Raycaster::build(Arc::new(scene)).expect("built"))
    };
    let engine = |raycaster, direct| PathEngine::new(raycaster, Some(0), direct, 1);
    let raycaster = lit_by_one(Bsdf::Diffuse { kd: [0.7; 3] });
    assert!(engine(&raycaster, Direct::Both).lights_find_all);
    let [alone, both] = [Direct::Both, Direct::Materials].map(|d| mean(&raycaster, d, 1, 100_000));
    for ((a, va), (b, vb)) in alone.into_iter().zip(both) {
        // 3 comparisons at 4.5 sigma: by chance once in 50,000 sets of seeds.
        assert!((a - b).abs() <= 4.5 * (va + vb).sqrt() && va < vb, "{alone:?} {both:?}");
    }
    let mirrored = lit_by_one(Bsdf::Mirror { ks: [0.9; 3] });
    assert!(!engine(&mirrored, Direct::Both).lights_find_all);
    let many =
        Arc::new(Raycaster::build(scene(Bsdf::Diffuse { kd: [0.7; 3] }, [0.0; 3])).expect("built"));
    assert!(!engine(&many, Direct::Both).lights_find_all);
}

fn mean(raycaster: &Arc<Raycaster>, direct: Direct, samples: u32, paths: u64) -> [(f64, f64); 3] {
    let settings = Settings { bounces: Some(0), paths: 1 };
    let tracer =
        Tracer::with_direct(raycaster.clone(), settings, direct, samples).expect("a tracer");
    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
    for seed in 0..paths {
        let r = tracer
            .trace(DVec3::new(-1.5, 0.2, 0.8), DVec3::new(1.5, 0.0, -0.8).normalize(), seed)
            .radiance;
        for c in 0..3 {
            sum[c] += f64::from(r[c]);
            squares[c] += f64::from(r[c]).powi(2);
        }
    }
    assert_eq!(tracer.nonfinite_paths(), 0);
    let n = paths as f64;
    [0, 1, 2].map(|c| (sum[c] / n, (squares[c] / n - (sum[c] / n).powi(2)).max(0.0) / n))
}

#[test]
fn lights_alone_materials_alone_and_both_agree() {
    for floor in [
        Bsdf::Diffuse { kd: [0.7; 3] },
        Bsdf::Conductor { ks: [0.9; 3], alpha: 0.3 },
        Bsdf::Coated { kd: [0.5; 3], ks: [1.0; 3], ior: 1.5, alpha: 0.2 },
        Bsdf::Dielectric { ior: 1.5, transmittance: [0.9; 3], alpha: 0.4 },
    ] {
        for sky in [[0.0; 3], [0.3, 0.6, 0.1]] {
            let raycaster = Arc::new(Raycaster::build(scene(floor, sky)).expect("built"));
            let results = [Direct::Lights, Direct::Materials, Direct::Both]
                .map(|d| mean(&raycaster, d, 1, 40_000));
            for c in 0..3 {
                for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                    let ((ma, va), (mb, vb)) = (results[a][c], results[b][c]);
                    // 72 comparisons at 4.5 sigma: by chance once in 2,000 sets of seeds.
                    assert!(
                        (ma - mb).abs() <= 4.5 * (va + vb).sqrt(),
                        "{floor:?} sky {sky:?} channel {c}: {results:?}"
                    );
                }
                assert!(results[2][c].0 > 0.0);
                // The combination must never be much worse than the better of the two.
                let best = results[0][c].1.min(results[1][c].1);
                assert!(
                    results[2][c].1 < 2.5 * best,
                    "{floor:?} sky {sky:?} channel {c}: {results:?}"
                );
            }
        }
    }
}

/// A floor under thousands of emitters: a swarm of small ones with random orientation, large and
/// tiny ones, far ones, backs, and one in the floor's own plane. Half of them are two-sided.
fn swarm(floor: Bsdf, sky: [f32; 3]) -> Arc<Scene> {
    let mut s = Sampler::new(77, 0);
    let mut positions = [[-30.0, -30.0], [30.0, -30.0], [30.0, 30.0], [-30.0, 30.0]]
        .map(|[x, y]| DVec3::new(x, y, 0.0))
        .to_vec();
    let mut triangles = vec![[0, 1, 2], [0, 2, 3]];
    let mut ids = vec![0, 0];
    let mut add = |corners: [DVec3; 3], id: u32| {
        let base = positions.len() as u32;
        positions.extend(corners);
        triangles.push([base, base + 1, base + 2]);
        ids.push(id);
    };
    let mut point = || DVec3::from_array([0, 1, 2].map(|_| f64::from(s.one()) - 0.5));
    for i in 0..3000 {
        let size = [0.02, 0.2, 0.002][i % 3];
        let center = point() * DVec3::new(8.0, 8.0, 2.0) + DVec3::new(0.0, 0.0, 1.6);
        add([point(), point(), point()].map(|p| center + p * size), 1 + i as u32 % 2);
    }
    for (size, height) in [(3.0, 4.0), (40.0, 90.0)] {
        add(
            [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]
                .map(|[x, y]| DVec3::new(x * size - 1.0, y * size, height)),
            3,
        );
    }
    // One in the floor's plane, and one that stands on it.
    add([DVec3::new(31.0, 0.0, 0.0), DVec3::new(33.0, 0.0, 0.0), DVec3::new(31.0, 2.0, 0.0)], 3);
    add([DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::new(1.0, 0.0, 0.5)], 3);
    let black = Bsdf::Diffuse { kd: [0.0; 3] };
    let material = |bsdf, emission, two_sided_emission| Material {
        name: "m".into(),
        bsdf,
        emission,
        two_sided_emission,
    };
    let materials = vec![
        material(floor, [0.0; 3], false),
        material(black, [40.0, 20.0, 30.0], false),
        material(black, [10.0, 30.0, 20.0], true),
        material(black, [1.0, 2.0, 1.5], false),
    ];
    let (scene, _) =
        Scene::from_world(&positions, &triangles, &ids, materials, sky).expect("a valid scene");
    Arc::new(scene)
}

#[test]
fn thousands_of_lights_lights_alone_materials_alone_and_both_agree() {
    for (floor, sky) in [
        (Bsdf::Diffuse { kd: [0.7; 3] }, [0.0; 3]),
        (Bsdf::Diffuse { kd: [0.7; 3] }, [0.5; 3]),
        (Bsdf::Dielectric { ior: 1.5, transmittance: [0.9; 3], alpha: 0.5 }, [0.5; 3]),
    ] {
        let raycaster = Arc::new(Raycaster::build(swarm(floor, sky)).expect("built"));
        let results = [
            (Direct::Lights, 1),
            (Direct::Lights, 4),
            (Direct::Materials, 1),
            (Direct::Both, 1),
            (Direct::Both, 4),
            (Direct::Both, 3),
        ]
        .map(|(d, samples)| mean(&raycaster, d, samples, 40_000));
        for c in 0..3 {
            for a in 0..results.len() {
                for b in 0..a {
                    let ((ma, va), (mb, vb)) = (results[a][c], results[b][c]);
                    // 135 comparisons at 4.5 sigma: by chance once in 1,000 sets of seeds.
                    assert!(
                        (ma - mb).abs() <= 4.5 * (va + vb).sqrt(),
                        "{floor:?} {sky:?} {a} {b} channel {c}: {results:?}"
                    );
                }
            }
            // Sampling both ways, and more light samples, must each lower the variance.
            assert!(
                results[3][c].1 < results[2][c].1 && results[4][c].1 < results[3][c].1,
                "{floor:?} {sky:?}: {results:?}"
            );
        }
    }
}
