//! Textures and smooth normals: energy, shadows and expectations.

use std::f64::consts::{PI, TAU};
use std::io::Cursor;
use std::sync::Arc;

use glam::DVec3;
use holo_scene::{Bsdf, CutOut, Maps, Material, Scene, Shading, Texture, Wrap, to_octahedral};

use crate::{Settings, Tracer};

/// A sphere of radius 1 as so many facets around, with smooth normals if wanted.
fn sphere(around: u32, smooth: bool, bsdf: Bsdf, sky: [f32; 3]) -> Scene {
    let at = |i: u32, j: u32| {
        let (sin, cos) = (f64::from(2 * j) / f64::from(around) * PI).sin_cos();
        let (y, x) = (f64::from(i % around) / f64::from(around) * TAU).sin_cos();
        DVec3::new(x * sin, y * sin, cos)
    };
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (i, j) in (0..around).flat_map(|i| (0..around / 2).map(move |j| (i, j))) {
        let first = positions.len() as u32;
        positions.extend([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    let material = Material { bsdf, ..Material::grey("ball") };
    let ids = vec![0; triangles.len()];
    let (scene, _) = Scene::from_world(&positions, &triangles, &ids, vec![material], sky).unwrap();
    if !smooth {
        return scene;
    }
    let normal = |t: u32| scene.corners(t).map(|c| to_octahedral(c.normalize()));
    let normals = scene.triangles().map(normal).collect();
    scene.with_shading(Shading { normals, ..Shading::default() }).unwrap()
}

fn tracer(scene: Scene, bounces: Option<u32>) -> Tracer {
    Tracer::new(Arc::new(scene), Settings { bounces, paths: 64 }).unwrap()
}

/// Returns means of radiance from a distance, over a disc that the ball fills, by ring.
fn rings(tracer: &Tracer, count: usize) -> Vec<f64> {
    let ring = |k: usize| {
        let radius = (k as f64 + 0.5) / count as f64 * 0.97;
        let mean = (0..48).map(|i| {
            let (sin, cos) = (f64::from(i) / 48.0 * TAU + 0.1).sin_cos();
            let origin = DVec3::new(radius * cos, radius * sin, 10.0);
            f64::from(tracer.trace(origin, DVec3::NEG_Z, (k * 100 + i as usize) as u64).radiance[0])
        });
        mean.sum::<f64>() / 48.0
    };
    (0..count).map(ring).collect()
}

#[test]
fn a_smooth_ball_under_an_even_sky_is_as_bright_as_its_albedo_and_never_brighter() {
    for bsdf in [
        Bsdf::Diffuse { kd: [0.8; 3] },
        Bsdf::Conductor { ks: [0.8; 3], alpha: 0.3 },
        Bsdf::Mirror { ks: [0.8; 3] },
    ] {
        let found = rings(&tracer(sphere(48, true, bsdf, [1.0; 3]), None), 8);
        for (ring, &mean) in found.iter().enumerate() {
            // 3072 paths a ring, of values up to 1: three standard errors are below 0.02.
            assert!(mean < 0.82, "{bsdf:?}, ring {ring}: {mean}");
            // Terminators absorb a little near the rim, where facets turn from the eye.
            let least = if ring < 6 { 0.76 } else { 0.6 };
            assert!(mean > least, "{bsdf:?}, ring {ring}: {mean}");
        }
    }
}

#[test]
fn nothing_shines_through_a_smooth_surface_into_a_dark_ball() {
    // An eye inside a closed ball under a bright sky sees no light.
    let dark = tracer(sphere(12, true, Bsdf::Diffuse { kd: [0.8; 3] }, [100.0; 3]), None);
    for k in 0..2000u64 {
        let z = -1.0 + (k as f64 + 0.5) / 1000.0;
        let (sin, cos) = (k as f64 * 2.4).sin_cos();
        let level = (1.0 - z * z).sqrt();
        let direction = DVec3::new(level * cos, level * sin, z);
        let origin = DVec3::new(0.1, -0.2, 0.05);
        assert_eq!(dark.trace(origin, direction, k).radiance, [0.0; 3], "{k}");
    }
}

#[test]
fn smooth_normals_hide_facets() {
    // A white ball is lit by a small lamp from the side. Radiance along the equator jumps at each
    // of 24 facets, and is continuous on a smooth ball.
    let lit = |smooth: bool| {
        let ball = sphere(24, smooth, Bsdf::Diffuse { kd: [0.8; 3] }, [0.0; 3]);
        let mut positions: Vec<DVec3> = ball.points().map(|p| p.as_dvec3() + ball.origin).collect();
        let mut triangles = ball.own().triangles.to_vec();
        let first = positions.len() as u32;
        let side = [[20.0, -1.0, 9.0], [20.0, 1.0, 9.0], [20.0, 1.0, 11.0], [20.0, -1.0, 11.0]];
        positions.extend(side.map(DVec3::from));
        triangles.extend([[first, first + 2, first + 1], [first, first + 3, first + 2]]);
        let mut ids = ball.own().material_ids.to_vec();
        ids.extend([1, 1]);
        let lamp =
            Material { emission: [1000.0; 3], two_sided_emission: true, ..Material::grey("lamp") };
        let materials = vec![ball.materials[0].clone(), lamp];
        let (scene, _) =
            Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).unwrap();
        let shading = ball.shading.map(|shading| {
            let mut normals = shading.normals.clone();
            normals.extend([[[0, 0]; 3]; 2]);
            Shading { normals, ..Shading::default() }
        });
        let scene = match shading {
            Some(shading) => scene.with_shading(shading).unwrap(),
            None => scene,
        };
        let tracer = tracer(scene, Some(0));
        let at = |k: u32| {
            // Away from the edge of the shadow, which stays that of the facets.
            let x = 0.2 + 0.003 * f64::from(k);
            tracer.trace(DVec3::new(x, 0.013, 10.0), DVec3::NEG_Z, u64::from(k)).radiance[0]
        };
        let row: Vec<f32> = (0..200).map(at).collect();
        let most = row.iter().copied().fold(0.0, f32::max);
        row.windows(2).map(|pair| (pair[1] - pair[0]).abs() / most).fold(0.0, f32::max)
    };
    let (faceted, smooth) = (lit(false), lit(true));
    // The remaining jump comes from the fading of terminators. G of a facet turned by 7.5° is 0.94
    // at a cosine of 0.62, which changes the light by 0.035.
    assert!(faceted > 0.1 && smooth < 0.04, "{faceted} {smooth}");
}

/// A texture of these columns, clamped.
fn columns(texels: &[[u8; 4]]) -> Texture {
    let mut file = Vec::new();
    let image = image::RgbaImage::from_raw(texels.len() as u32, 1, texels.concat()).unwrap();
    image.write_to(&mut Cursor::new(&mut file), image::ImageFormat::Png).unwrap();
    Texture::decode(file.into(), [Wrap::Clamp; 2], true, false).unwrap()
}

/// A square of side 2 in the plane z = 0 whose texture runs along x.
fn square(material: Material, texture: Texture, maps: Maps, sky: [f32; 3], z: f64) -> Scene {
    let positions =
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| DVec3::new(x, y, z));
    let floor = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]];
    let all: Vec<DVec3> =
        positions.into_iter().chain(floor.map(|[x, y]| DVec3::new(x, y, 0.0))).collect();
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let materials = vec![material, Material::grey("floor")];
    let (scene, _) = Scene::from_world(&all, &triangles, &[0, 0, 1, 1], materials, sky).unwrap();
    let uvs = vec![
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
        [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        [[0.0; 2]; 3],
        [[0.0; 2]; 3],
    ];
    let maps = vec![maps, Maps::default()];
    let (uvs, textures) = (uvs.into(), vec![texture]);
    let shading = Shading { uvs, maps, textures, ..Shading::default() };
    scene.with_shading(shading).unwrap()
}

#[test]
fn texture_is_a_factor_to_radiance() {
    let texture = columns(&[[255; 4], [64, 64, 64, 255]]);
    for bsdf in [Bsdf::Diffuse { kd: [0.8; 3] }, Bsdf::Conductor { ks: [0.8; 3], alpha: 0.2 }] {
        let material = Material { bsdf, ..Material::grey("m") };
        let maps = Maps { base: Some(0), ..Maps::default() };
        let scene = square(material, texture.clone(), maps, [1.0; 3], 1.0);
        let tracer = tracer(scene, None);
        for (x, expected) in [(-0.9, 0.8), (0.9, 0.8 * 64.0 / 255.0)] {
            let origin = DVec3::new(x, 0.2, 5.0);
            let found = tracer.trace_paths(origin, DVec3::NEG_Z, 1, 0..4096).radiance[0];
            // The error of GGX's table, 5e-4, and of 4096 paths.
            assert!((found - expected as f32).abs() < 0.01, "{bsdf:?} {x}: {found} {expected}");
        }
    }
}

#[test]
fn a_textured_lamp_gives_the_light_of_its_texture_with_and_without_light_samples() {
    // Most of the lamp is dark. All of its light comes from one column of 16.
    let mut texels = [[0, 0, 0, 255]; 16];
    texels[3] = [255; 4];
    let lamp = Material {
        bsdf: Bsdf::Diffuse { kd: [0.0; 3] },
        emission: [10.0; 3],
        two_sided_emission: true,
        ..Material::grey("lamp")
    };
    let maps = Maps { emission: Some(0), ..Maps::default() };
    let scene = Arc::new(square(lamp, columns(&texels), maps, [0.0; 3], 1.0));
    let settings = Settings { bounces: Some(0), paths: 1 };
    let mean = |direct: crate::weighting::Direct| {
        let raycaster = Arc::new(holo_raycast::Raycaster::build(scene.clone()).unwrap());
        let tracer = Tracer::with_direct(raycaster, settings, direct, 1).unwrap();
        let (origin, direction) = (DVec3::new(2.0, 0.0, 0.5), DVec3::new(-0.7, 0.0, -0.5));
        let n = 40_000u64;
        let (mut sum, mut squares) = (0.0, 0.0);
        for path in 0..n {
            let found = f64::from(tracer.trace_path(origin, direction, 7, path).radiance[1]);
            (sum, squares) = (sum + found, squares + found * found);
        }
        let mean = sum / n as f64;
        (mean, (squares / n as f64 - mean * mean) / n as f64)
    };
    let (both, both_error) = mean(crate::weighting::Direct::Both);
    let (materials, materials_error) = mean(crate::weighting::Direct::Materials);
    let sigma = (both_error + materials_error).sqrt();
    assert!(both > 0.0 && (both - materials).abs() < 4.0 * sigma, "{both} {materials} {sigma}");
}

#[test]
fn what_is_cut_out_is_not_there_for_eyes_and_shadows() {
    let texture = columns(&[[255, 255, 255, 0], [255; 4]]);
    let maps = Maps { cut_out: Some(CutOut { texture: 0, least: 0.5 }), ..Maps::default() };
    let black = Material { bsdf: Bsdf::Diffuse { kd: [0.0; 3] }, ..Material::grey("black") };
    let scene = square(black, texture, maps, [1.0; 3], 0.05);
    let tracer = tracer(scene, Some(0));
    let seen = |x: f64| tracer.trace(DVec3::new(x, 0.1, 5.0), DVec3::NEG_Z, 3);
    let (hole, solid) = (seen(-0.5), seen(0.5));
    assert!((hole.distance - 5.0).abs() < 1e-5 && (solid.distance - 4.95).abs() < 1e-5);
    assert_eq!(solid.radiance, [0.0; 3]);
    // The floor below the hole sees nearly all of the sky.
    assert!(hole.radiance[0] > 0.4, "{:?}", hole.radiance);
}

#[test]
fn lamps_are_sampled_in_proportion_to_the_light_of_their_textures() {
    // Two lamps of the same material side by side. The one is dark, by its texture.
    let lamps = |count: usize| {
        let lamp = Material { emission: [10.0; 3], ..Material::grey("lamp") };
        let mut positions = Vec::new();
        for x in [0.5, -0.5] {
            let corners = [[0.0, 0.0], [0.0, 0.2], [0.2, 0.2], [0.2, 0.0]];
            positions.extend(corners.map(|[dx, y]| DVec3::new(x + dx, y, 1.0)));
        }
        positions.extend(
            [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]
                .map(|[x, y]| DVec3::new(x, y, 0.0)),
        );
        let lit = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 9, 10], [8, 10, 11]];
        let uvs = [0.05f32, 0.05, 0.95, 0.95, 0.05, 0.05].map(|u| [[u, 0.5]; 3]);
        let triangles = [&lit[..2 * count], &lit[4..]].concat();
        let uvs = [&uvs[..2 * count], &uvs[4..]].concat();
        let ids = [vec![0; 2 * count], vec![1; 2]].concat();
        let materials = vec![lamp, Material::grey("floor")];
        let scene = Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).unwrap().0;
        let maps = vec![Maps { emission: Some(0), ..Maps::default() }, Maps::default()];
        let textures = vec![columns(&[[255; 4], [0, 0, 0, 255]])];
        let shading = Shading { uvs: uvs.into(), maps, textures, ..Shading::default() };
        let settings = Settings { bounces: Some(0), paths: 1 };
        let raycaster =
            holo_raycast::Raycaster::build(Arc::new(scene.with_shading(shading).unwrap()));
        let direct = crate::weighting::Direct::Lights;
        let tracer =
            Tracer::with_direct(Arc::new(raycaster.unwrap()), settings, direct, 1).unwrap();
        let (origin, direction) = (DVec3::new(0.0, 0.0, 0.5), DVec3::NEG_Z);
        let n = 4000u64;
        let found = (0..n).map(|path| tracer.trace_path(origin, direction, 7, path).radiance[1]);
        let found: Vec<f64> = found.map(f64::from).collect();
        let mean = found.iter().sum::<f64>() / n as f64;
        (mean, found.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (n - 1) as f64)
    };
    let ((alone, alone_variance), (both, both_variance)) = (lamps(1), lamps(2));
    let sigma = ((alone_variance + both_variance) / 4000.0).sqrt();
    assert!(alone > 0.0 && (both - alone).abs() < 4.0 * sigma, "{both} {alone} {sigma}");
    // If the dark lamp took half of the samples, the variance would be about the square of the
    // mean.
    assert!(
        both_variance < alone_variance + 0.1 * alone * alone,
        "{both_variance} {alone_variance}"
    );
}

#[test]
fn a_path_from_afar_sees_the_mean_of_a_texture() {
    // Columns of 1 mm, seen from 10 m: a pixel there is wider. From 1 cm each is seen alone.
    let columns: Vec<[u8; 4]> =
        (0..2000).map(|k| if k % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] }).collect();
    let lamp = Material { bsdf: Bsdf::Diffuse { kd: [1.0; 3] }, ..Material::grey("board") };
    let maps = Maps { base: Some(0), ..Maps::default() };
    let scene = square(lamp, self::columns(&columns), maps, [1.0; 3], 1.0);
    let tracer = tracer(scene, Some(0));
    let seen = |height: f64| {
        let at = |k: u64| DVec3::new((k as f64 + 0.25) * 1e-3 - 0.032, 0.3, 1.0 + height);
        (0..64).map(|k| tracer.trace(at(k), DVec3::NEG_Z, k).radiance[1]).collect::<Vec<f32>>()
    };
    let spread = |seen: Vec<f32>| {
        let mean = seen.iter().sum::<f32>() / 64.0;
        (mean, seen.iter().map(|s| (s - mean).abs()).sum::<f32>() / 64.0)
    };
    let ((far, far_spread), (near, near_spread)) = (spread(seen(10.0)), spread(seen(0.01)));
    assert!((far - 0.5).abs() < 0.02 && far_spread < 0.01, "{far} {far_spread}");
    assert!((near - 0.5).abs() < 0.1 && near_spread > 0.2, "{near} {near_spread}");
}
