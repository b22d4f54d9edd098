//! Direct light found by lights alone, by materials alone and by both has the same expectation.

use std::sync::Arc;

use glam::DVec3;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};

use crate::path::Direct;
use crate::{Settings, Tracer};

/// A floor of the given material, a large near lamp, a small one seen from behind, and a sky.
fn scene(floor: Bsdf, sky: [f32; 3]) -> Arc<Scene> {
    let quad =
        |z: f64, x: f64, h: f64| [[x - h, -h, z], [x - h, h, z], [x + h, h, z], [x + h, -h, z]].map(DVec3::from_array);
    // Seen from above these run clockwise: fronts are downwards.
    let positions: Vec<DVec3> = [quad(0.0, 0.0, 10.0), quad(1.0, 0.8, 0.7), quad(2.0, -2.0, 0.3)].concat();
    let triangles: Vec<[u32; 3]> =
        (0..3).flat_map(|q| [[4 * q, 4 * q + 1, 4 * q + 2], [4 * q, 4 * q + 2, 4 * q + 3]]).collect();
    let material =
        |name: &str, bsdf, emission| Material { name: name.into(), bsdf, emission, two_sided_emission: false };
    let black = Bsdf::Diffuse { kd: [0.0; 3] };
    let materials = vec![
        material("floor", floor, [0.0; 3]),
        material("near", black, [1.0, 2.0, 3.0]),
        material("far", black, [30.0, 20.0, 10.0]),
    ];
    let (scene, _) =
        Scene::from_world(&positions, &triangles, &[0, 0, 1, 1, 2, 2], materials, sky).expect("a valid scene");
    Arc::new(scene)
}

fn mean(raycaster: &Arc<Raycaster>, direct: Direct, paths: u64) -> [(f64, f64); 3] {
    let settings = Settings { bounces: Some(0), paths: 1 };
    let tracer = Tracer::with_direct(raycaster.clone(), settings, direct).expect("a tracer");
    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
    for seed in 0..paths {
        let r = tracer.trace(DVec3::new(-1.5, 0.2, 0.8), DVec3::new(1.5, 0.0, -0.8).normalize(), seed).radiance;
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
            let results = [Direct::Lights, Direct::Materials, Direct::Both].map(|d| mean(&raycaster, d, 40_000));
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
                // What the combination is for: never much worse than the better of the two.
                let best = results[0][c].1.min(results[1][c].1);
                assert!(results[2][c].1 < 2.5 * best, "{floor:?} sky {sky:?} channel {c}: {results:?}");
            }
        }
    }
}
