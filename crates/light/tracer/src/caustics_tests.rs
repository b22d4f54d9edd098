//! Tests that aiming at caustics changes the error and not the expectation.

use std::f64::consts::FRAC_1_PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene, Sun};

use crate::engine::PathEngine;
use crate::geometry::{ShadingFrame, cosine_hemisphere};
use crate::path::first_hit;
use crate::sampler::{NumberPurpose, Sampler};
use crate::secondary_tests::estimate;
use crate::weighting::Direct;

const FLOOR: Bsdf = Bsdf::Diffuse { kd: [0.7; 3] };
const MIRROR: Bsdf = Bsdf::Mirror { ks: [0.9; 3] };

/// A room with a lamp, and a closed block that throws its light onto the floor. A screen hides part
/// of the block. `turn` is the angle of the block to the room.
fn scene(floor: Bsdf, block: Bsdf, lamp_is_two_sided: bool, turn: f64) -> Arc<Raycaster> {
    let (sin, cos) = turn.sin_cos();
    let mut positions = Vec::new();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    let mut ids = Vec::new();
    let mut quad = |material: u32, corners: [[f64; 3]; 4]| {
        let first = positions.len() as u32;
        positions.extend(corners.map(DVec3::from_array));
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        ids.extend([material; 2]);
    };
    let level = |z: f64, h: f64| [[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]];
    quad(0, level(0.0, 3.0));
    let ring = [[-0.3, -0.6], [0.3, -0.6], [0.3, 0.6], [-0.3, 0.6]]
        .map(|[x, y]| [0.9 + x * cos - y * sin, x * sin + y * cos]);
    let at = |i: usize, z: f64| [ring[i % 4][0], ring[i % 4][1], z];
    for i in 0..4 {
        quad(1, [at(i, 0.3), at(i + 1, 0.3), at(i + 1, 1.5), at(i, 1.5)]);
    }
    quad(1, [at(0, 1.5), at(1, 1.5), at(2, 1.5), at(3, 1.5)]);
    quad(1, [at(3, 0.3), at(2, 0.3), at(1, 0.3), at(0, 0.3)]);
    let upright = |x: f64, y: f64, z: f64, h: f64| {
        [[x, y - h, z - h], [x, y + h, z - h], [x, y + h, z + h], [x, y - h, z + h]]
    };
    quad(2, upright(-0.6, 0.3, 1.4, 0.1));
    quad(3, upright(0.2, 0.4, 0.9, 0.2));
    quad(3, level(3.0, 3.0));
    let material = |bsdf| Material { bsdf, ..Material::grey("m") };
    let black = Bsdf::Diffuse { kd: [0.0; 3] };
    let lamp =
        Material { emission: [20.0; 3], two_sided_emission: lamp_is_two_sided, ..material(black) };
    let grey = Bsdf::Diffuse { kd: [0.6; 3] };
    let materials = vec![material(floor), material(block), lamp, material(grey)];
    let scene =
        Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).expect("valid").0;
    Arc::new(Raycaster::build(Arc::new(scene)).expect("built"))
}

/// Eye and direction of the estimates: they look at the floor in front of the block, which reflects
/// light there.
const BEFORE: (DVec3, DVec3) = (DVec3::new(-1.0, -1.5, 2.0), DVec3::new(0.6, 1.1, -2.0));
/// The same behind the block, where only light arrives that went through it.
const BEHIND: (DVec3, DVec3) = (DVec3::new(2.0, -1.5, 2.0), DVec3::new(0.1, 1.6, -2.0));

#[test]
fn aimed_and_plain_samples_have_one_expectation_and_aimed_samples_less_variance() {
    let coated = Bsdf::Coated { kd: [0.5; 3], ks: [1.0; 3], ior: 1.5, alpha: 0.3 };
    let metal = Bsdf::Conductor { ks: [0.9; 3], alpha: 0.15 };
    let glass = Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.0 };
    let frosted = Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.1 };
    let pane = Bsdf::ThinGlass { ior: 1.5, transmittance: [0.9; 3] };
    let cases = [
        (FLOOR, MIRROR, 0.0, BEFORE, 1.5),
        (coated, MIRROR, 0.3, BEFORE, 1.5),
        (FLOOR, metal, 0.3, BEFORE, 1.5),
        (FLOOR, glass, 0.3, BEHIND, 1.5),
        (coated, glass, 0.0, BEHIND, 1.5),
        (FLOOR, frosted, 0.3, BEHIND, 1.5),
        (FLOOR, pane, 0.3, BEFORE, 1.5),
    ];
    for (floor, block, turn, eye, gain) in cases {
        let is_two_sided = turn > 0.0;
        let raycaster = scene(floor, block, is_two_sided, turn);
        let mut engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
        engine.secondary = None;
        assert!(engine.caustics.is_some());
        let (n, many) = (100_000, 1_000_000);
        let aimed = estimate(&engine, &raycaster, eye, n);
        engine.caustics = None;
        let plain = estimate(&engine, &raycaster, eye, many);
        // 7 comparisons at 4.5 sigma: by chance once in 21,000 sets of seeds.
        let error = (aimed.1 / n as f64 + plain.1 / many as f64).sqrt();
        println!("{block:?} {turn}: {aimed:?} {plain:?}, gain {:.2}", plain.1 / aimed.1);
        assert!((aimed.0 - plain.0).abs() < 4.5 * error, "{block:?}: {aimed:?} {plain:?}");
        assert!(error < 0.05 * aimed.0, "{block:?}: {aimed:?} {plain:?}");
        assert!(plain.1 > gain * aimed.1, "{block:?}: {aimed:?} {plain:?}");
    }
}

#[test]
fn directions_have_the_stated_density() {
    // The mean of 1 / density over chosen directions is the solid angle that they cover, as far as
    // they meet the block. The same by directions of the hemisphere.
    let raycaster = scene(FLOOR, MIRROR, true, 0.3);
    let engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
    let caustics = engine.caustics.as_ref().expect("a mirror");
    let point = raycaster.surface(0, 0.1, 0.4);
    let vertex = caustics.seen_from(point.point, Vec3::Z).expect("photons");
    let density = |direction: Vec3| {
        let origin = point.point.as_dvec3() + raycaster.scene().origin;
        let (hit, _) = first_hit(&raycaster, origin + DVec3::Z * 1e-5, direction.as_dvec3());
        hit.map_or(0.0, |hit| vertex.density(direction, &hit))
    };
    let n = 100_000;
    let frame = ShadingFrame::new(Vec3::Z);
    let (mut by_choice, mut by_chance) = ([0.0_f64; 2], [0.0_f64; 2]);
    for seed in 0..n {
        let mut sampler = Sampler::new(seed, 0);
        sampler.turn(0, NumberPurpose::Aim);
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
fn a_scene_without_casters_has_no_caustics() {
    let raycaster = scene(FLOOR, Bsdf::Conductor { ks: [0.9; 3], alpha: 0.5 }, false, 0.0);
    assert!(PathEngine::new(&raycaster, None, Direct::Both, 1).caustics.is_none());
}

#[test]
fn more_samples_are_aimed_where_a_caustic_is_brighter() {
    let share = |ks: f32| {
        let raycaster = scene(FLOOR, Bsdf::Mirror { ks: [ks; 3] }, true, 0.3);
        let engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
        let (hit, _) = first_hit(&raycaster, BEFORE.0, BEFORE.1.normalize());
        let hit = hit.expect("the floor");
        let point = raycaster.surface(hit.triangle, hit.u, hit.v);
        let caustics = engine.caustics.as_ref().expect("a mirror");
        caustics.seen_from(point.point, Vec3::Z).expect("photons").share()
    };
    // Photons are the same, only dimmer.
    let (dim, bright) = (share(0.01), share(0.02));
    assert!(dim > 0.0 && (bright / dim - 2.0).abs() < 0.05, "{dim} {bright}");
}

/// Reflectance of the floor under the sun.
const KD: f64 = 0.5;
/// Direction to the sun, not normalized, and its irradiance.
const TO_SUN: Vec3 = Vec3::new(0.3, 0.2, 1.0);
const SUNLIGHT: f64 = 50.0;

/// Returns a floor of 40 × 40 around the origin under a sun, and a body.
fn sunlit(bsdf: Bsdf, corners: &[[f64; 3]], faces: &[[u32; 4]], sky: f32) -> Arc<Raycaster> {
    let square = [[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]];
    let mut positions = square.map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec();
    positions.extend(corners.iter().map(|&corner| DVec3::from_array(corner)));
    let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    let mut triangles = halves([0, 1, 2, 3]).to_vec();
    triangles.extend(faces.iter().flat_map(|face| halves(face.map(|corner| corner + 4))));
    let ids: Vec<u32> = (0..triangles.len()).map(|t| u32::from(t > 1)).collect();
    let material = |bsdf| Material { bsdf, ..Material::grey("m") };
    let materials = vec![material(Bsdf::Diffuse { kd: [KD as f32; 3] }), material(bsdf)];
    let scene = Scene::from_world(&positions, &triangles, &ids, materials, [sky; 3]).unwrap().0;
    let towards = TO_SUN.normalize().to_array();
    let suns = match sky > 0.0 {
        true => Vec::new(),
        false => vec![Sun { towards, irradiance: [SUNLIGHT as f32; 3] }],
    };
    Arc::new(Raycaster::build(Arc::new(scene.with_suns(suns).unwrap())).unwrap())
}

/// Returns a level slab of this thickness at height 3, and of side 8.
fn slab(thickness: f64) -> (Vec<[f64; 3]>, [[u32; 4]; 6]) {
    let level = |z: f64| [[-4.0, -4.0, z], [4.0, -4.0, z], [4.0, 4.0, z], [-4.0, 4.0, z]];
    let sides = [0, 1, 2, 3].map(|i: u32| [i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4]);
    let [a, b, c, d] = sides;
    ([level(3.0), level(3.0 + thickness)].concat(), [[3, 2, 1, 0], [4, 5, 6, 7], a, b, c, d])
}

/// Reflectance of glass of index 1.5 for unpolarized light at a cosine.
fn fresnel(cosine: f64) -> f64 {
    let inner = (1.0 - (1.0 - cosine * cosine) / 2.25).sqrt();
    let across = (cosine - 1.5 * inner) / (cosine + 1.5 * inner);
    let along = (1.5 * cosine - inner) / (1.5 * cosine + inner);
    0.5 * (across * across + along * along)
}

/// The eye looks at the origin, from below the slab.
const AT_FLOOR: (DVec3, DVec3) = (DVec3::new(0.8, 0.3, 1.0), DVec3::new(-0.8, -0.3, -1.0));

/// Asserts that the floor has this radiance, and that the standard deviation of 64 paths is below
/// 0.3 of it.
fn assert_radiance(raycaster: &Arc<Raycaster>, eye: (DVec3, DVec3), expected: f64) {
    let engine = PathEngine::new(raycaster, Some(0), Direct::Both, 1);
    let n = 100_000;
    let (mean, variance) = estimate(&engine, raycaster, eye, n);
    let error = (variance / n as f64).sqrt();
    println!("{mean} ± {error}, {expected}, of 64 paths {}", (variance / 64.0).sqrt() / mean);
    assert!((mean - expected).abs() < 4.5 * error, "{mean} ± {error}, {expected}");
    assert!((variance / 64.0).sqrt() < 0.3 * mean, "{mean} {variance}");
}

#[test]
fn a_slab_of_glass_passes_the_sun_as_fresnel_says() {
    let glass = Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.0 };
    let cosine = f64::from(TO_SUN.normalize().z);
    let passed = (1.0 - fresnel(cosine)) / (1.0 + fresnel(cosine));
    for thickness in [0.006, 0.5] {
        let (corners, faces) = slab(thickness);
        let raycaster = sunlit(glass, &corners, &faces, 0.0);
        assert_radiance(&raycaster, AT_FLOOR, KD * SUNLIGHT * cosine * passed * FRAC_1_PI);
    }
}

#[test]
fn a_mirror_adds_the_sun_that_it_reflects() {
    let wall = [[-5.0, -9.0, 0.0], [-5.0, 9.0, 0.0], [-5.0, 9.0, 9.0], [-5.0, -9.0, 9.0]];
    let raycaster = sunlit(MIRROR, &wall, &[[0, 1, 2, 3]], 0.0);
    // The mirror throws the light from x > 0 back to where x is below its own shadow.
    let eye = (DVec3::new(-3.8, 0.3, 1.0), DVec3::new(-0.4, -0.3, -1.0));
    let cosine = f64::from(TO_SUN.normalize().z);
    assert_radiance(&raycaster, eye, KD * SUNLIGHT * cosine * 1.9 * FRAC_1_PI);
}

#[test]
fn a_block_throws_its_sunlight_where_plain_paths_find_it() {
    // Rough metal and a curved body are found by plain samples, too, but rarely.
    let (corners, faces) = slab(1.0);
    let beside = (DVec3::new(4.6, -0.3, 1.0), DVec3::new(0.4, 0.3, -1.0));
    for (bsdf, eye) in [
        (Bsdf::Dielectric { ior: 1.5, transmittance: [0.9; 3], alpha: 0.15 }, AT_FLOOR),
        (Bsdf::Conductor { ks: [0.9; 3], alpha: 0.15 }, beside),
    ] {
        let raycaster = sunlit(bsdf, &corners, &faces, 0.0);
        let mut engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
        engine.secondary = None;
        let (n, many) = (100_000, 400_000);
        let aimed = estimate(&engine, &raycaster, eye, n);
        engine.caustics = None;
        let plain = estimate(&engine, &raycaster, eye, many);
        let error = (aimed.1 / n as f64 + plain.1 / many as f64).sqrt();
        assert!((aimed.0 - plain.0).abs() < 4.5 * error, "{bsdf:?}: {aimed:?} {plain:?}");
    }
}

#[test]
fn solid_glass_passes_the_sky_and_aimed_samples_find_it() {
    let wall = Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.0 };
    let (corners, faces) = slab(0.1);
    let raycaster = sunlit(wall, &corners, &faces, 2.0);
    let mut engine = PathEngine::new(&raycaster, Some(0), Direct::Both, 1);
    assert!(engine.caustics.is_some());
    let (n, many) = (200_000, 200_000);
    let aimed = estimate(&engine, &raycaster, AT_FLOOR, n);
    engine.caustics = None;
    let plain = estimate(&engine, &raycaster, AT_FLOOR, many);
    let error = (aimed.1 / n as f64 + plain.1 / many as f64).sqrt();
    assert!((aimed.0 - plain.0).abs() < 4.5 * error, "{aimed:?} {plain:?}");
    assert!(error < 0.01 * aimed.0, "{aimed:?} {plain:?}");
}

#[test]
fn a_mirror_of_the_sky_makes_no_photons_and_one_of_the_sun_does() {
    let (corners, faces) = slab(0.006);
    let under = |sky| {
        let raycaster = sunlit(MIRROR, &corners, &faces, sky);
        PathEngine::new(&raycaster, None, Direct::Both, 1).caustics.is_some()
    };
    assert!(under(0.0) && !under(2.0));
}
