//! Tests that light on instances is that on copies, bit for bit.
#![allow(clippy::expect_used, reason = "a test fails by it")]

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_scene::{
    Bsdf, CUT_OUT, CutOut, Geometry, Maps, Material, Placement, Scene, Shading, Texture, Wrap,
    to_octahedral,
};
use holo_tracer::{Settings, Tracer};

/// Returns a picture of squares that are green, red or black, as a BMP file of 32 bits a pixel. As
/// a mask, it is clear where it is black.
fn checks(is_mask: bool) -> Texture {
    let side = 8_i32;
    let mut file = b"BM".to_vec();
    let words = [54 + 4 * side * side, 0, 54, 40, side, side, 1 | 32 << 16, 0, 0, 0, 0, 0, 0];
    file.extend(words.into_iter().flat_map(i32::to_le_bytes));
    for k in 0..side * side {
        let (x, y) = (k % side, k / side);
        file.extend([[230, 255, 60, 0], [230, 60, 255, 0], [0; 4]][((x + 2 * y) % 3) as usize]);
    }
    Texture::decode(file.into(), [Wrap::Repeat; 2], is_mask, is_mask).expect("a picture")
}

/// Returns a floor with a lamp above it, and instances of a ball between them: smooth and glossy,
/// half of it textured with holes. Some are mirrored or flattened.
fn scene() -> Scene {
    let (around, down) = (24_u32, 12_u32);
    let mut positions = Vec::new();
    for k in 0..=down {
        for i in 0..around {
            let (sin, cos) = (std::f32::consts::PI * k as f32 / down as f32).sin_cos();
            let (y, x) = (std::f32::consts::TAU * i as f32 / around as f32).sin_cos();
            positions.push([x * sin, y * sin, cos]);
        }
    }
    let (mut triangles, mut ids) = (Vec::new(), Vec::new());
    for (k, i) in (0..down).flat_map(|k| (0..around).map(move |i| (k, i))) {
        let at = |k: u32, i: u32| k * around + i % around;
        let [a, b, c, d] = [at(k, i), at(k + 1, i), at(k + 1, i + 1), at(k, i + 1)];
        let own = [[a, b, c], [a, c, d]];
        // At a pole, one of the two has no area.
        triangles.extend(own.iter().skip(usize::from(k == down - 1)).take(if k == 0 {
            1
        } else {
            2
        }));
        ids.resize(triangles.len(), u32::from(i % 2 == 0));
    }
    let mut poles = vec![false; positions.len()];
    triangles.as_flattened().iter().for_each(|&corner| poles[corner as usize] = true);
    let number: Vec<u32> = poles
        .iter()
        .scan(0, |next, &is_used| Some(std::mem::replace(next, *next + u32::from(is_used))))
        .collect();
    let used: Vec<[f32; 3]> =
        positions.iter().zip(&poles).filter(|(_, is_used)| **is_used).map(|(p, _)| *p).collect();
    let normals = triangles.iter().map(|t: &[u32; 3]| {
        t.map(|c| to_octahedral(Vec3::from(positions[c as usize]).normalize()))
    });
    let normals: Vec<_> = normals.collect();
    let uvs: Vec<_> = triangles
        .iter()
        .map(|t| t.map(|c| [positions[c as usize][0], positions[c as usize][2]]))
        .collect();
    triangles.as_flattened_mut().iter_mut().for_each(|corner| *corner = number[*corner as usize]);

    let square = |z: f32, h: f32| [[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]];
    let own: Vec<[f32; 3]> = square(0.0, 9.0).into_iter().chain(square(8.0, 1.0)).collect();
    let glossy = Bsdf::Coated { kd: [0.6, 0.5, 0.4], ks: [0.04; 3], ior: 1.5, alpha: 0.2 };
    let lamp = Material { emission: [40.0; 3], ..Material::grey("lamp") };
    let materials = vec![
        Material { bsdf: glossy, ..Material::grey("glossy") },
        Material::grey("textured"),
        Material::grey("floor"),
        lamp,
    ];
    let rows = |x: f64, y: f64, stretch: [f64; 3], turn: f64| {
        let (sin, cos) = turn.sin_cos();
        let [a, b, c] = stretch;
        let rows = [[a * cos, -b * sin, 0.0, x], [a * sin, b * cos, 0.0, y], [0.0, 0.0, c, 1.5]];
        (0, Placement::new(rows).expect("possible"))
    };
    let placed = [
        rows(0.0, 0.0, [1.0; 3], 0.3),
        rows(2.5, 0.5, [-1.0, 1.0, 1.0], 1.0),
        rows(-2.5, 1.0, [1.2, 0.4, 1.4], 2.0),
        rows(0.5, -2.5, [0.5, 0.6, -0.7], 4.0),
    ];
    let floor = vec![[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]];
    let ball = Geometry { positions: &used, triangles: &triangles, material_ids: &ids };
    let scene = Scene::new(DVec3::ZERO, own, floor, vec![2, 2, 3, 3], materials, [0.1; 3])
        .and_then(|scene| scene.with_instances(&[ball], &placed))
        .expect("valid");
    let cut_out = CutOut { texture: 1, least: CUT_OUT };
    let textured = Maps { base: Some(0), cut_out: Some(cut_out), ..Maps::default() };
    let shading = Shading {
        uvs: vec![[[0.0; 2]; 3]; 4].into_iter().chain(uvs).collect(),
        normals: vec![[[0; 2]; 3]; 4].into_iter().chain(normals).collect(),
        textures: vec![checks(false), checks(true)],
        maps: vec![Maps::default(), textured, Maps::default(), Maps::default()],
        ..Shading::default()
    };
    scene.with_shading(shading).expect("it fits")
}

#[test]
fn a_picture_of_instances_is_that_of_copies() {
    let shared = Arc::new(scene());
    let flat = Arc::new(shared.flattened());
    let settings = Settings { bounces: None, paths: 4 };
    let [shared, flat] = [shared, flat].map(|s| Tracer::new(s, settings).expect("a tracer"));
    let (mut lit, mut on_balls) = (0, 0);
    for pixel in 0..48 * 36_u32 {
        let (x, y) = (f64::from(pixel % 48) / 48.0 - 0.5, f64::from(pixel / 48) / 36.0 - 0.5);
        let (eye, forward) = (DVec3::new(0.0, -7.0, 4.0), DVec3::new(0.0, 0.9, -0.35));
        let up = DVec3::new(0.0, 0.35, 0.9);
        let direction = (forward + DVec3::X * x * 1.2 - up * y * 0.9).normalize();
        let trace = |tracer: &Tracer| {
            let traced = tracer.trace(eye, direction, u64::from(pixel));
            (traced.radiance.map(f32::to_bits), traced.distance.to_bits())
        };
        assert_eq!(trace(&shared), trace(&flat), "pixel {pixel}");
        let traced = shared.trace(eye, direction, u64::from(pixel));
        lit += usize::from(traced.radiance[0] > 0.0);
        let at = eye + direction * traced.distance;
        on_balls += usize::from(traced.distance.is_finite() && at.z > 0.01 && at.z < 7.0);
    }
    assert!(lit > 1000 && on_balls > 150, "{lit} {on_balls}");
}
