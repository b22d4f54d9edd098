//! Suns, textures of normals, roughness and metalness, and colours of corners: closed forms, energy
//! and shadows.

use std::f64::consts::PI;
use std::io::Cursor;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::Raycaster;
use holo_scene::{
    Bsdf, Channel, FinishMap, Maps, Material, NormalMap, Scene, Shading, Sun, Texture, WHITE, Wrap,
};

use crate::weighting::Direct;
use crate::{Settings, Tracer};

/// A texture of these columns, clamped.
fn columns(texels: &[[u8; 4]]) -> Texture {
    picture(texels.len() as u32, texels)
}

/// A texture of numbers in rows of this width, clamped.
fn picture(width: u32, texels: &[[u8; 4]]) -> Texture {
    let mut file = Vec::new();
    let height = texels.len() as u32 / width;
    let image = image::RgbaImage::from_raw(width, height, texels.concat()).unwrap();
    image.write_to(&mut Cursor::new(&mut file), image::ImageFormat::Png).unwrap();
    Texture::decode(file.into(), [Wrap::Clamp; 2], true, false).unwrap()
}

fn material(bsdf: Bsdf) -> Material {
    Material { bsdf, ..Material::grey("m") }
}

/// Returns a square of side 2 around the origin that faces +z. Its picture extends to the right
/// along x, and up along y.
fn square(bsdf: Bsdf, maps: Maps, texture: Texture) -> Scene {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let corners = corners.map(|[x, y]| DVec3::new(x, y, 0.0));
    let (scene, _) = Scene::from_world(
        &corners,
        &[[0, 1, 2], [0, 2, 3]],
        &[0, 0],
        vec![material(bsdf)],
        [0.0; 3],
    )
    .unwrap();
    let uvs = vec![[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]], [[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]];
    let uvs = uvs.into();
    let shading = Shading { uvs, maps: vec![maps], textures: vec![texture], ..Shading::default() };
    scene.with_shading(shading).unwrap()
}

const WHITE_PAINT: Bsdf = Bsdf::Diffuse { kd: [0.8; 3] };
const IRRADIANCE: f32 = 500.0;

fn sun(towards: Vec3) -> Sun {
    Sun { towards: towards.normalize().to_array(), irradiance: [IRRADIANCE; 3] }
}

fn tracer(scene: Scene) -> Tracer {
    Tracer::new(Arc::new(scene), Settings { bounces: Some(0), paths: 1 }).unwrap()
}

/// Returns the mean of `count` paths down to a point of the plane z = 0, and its variance.
fn mean(tracer: &Tracer, x: f64, y: f64, direction: DVec3, count: u64) -> [f64; 2] {
    let direction = direction.normalize();
    let origin = DVec3::new(x, y, 0.0) - direction * 3.0;
    let (mut sum, mut squares) = (0.0, 0.0);
    for path in 0..count {
        let found = f64::from(tracer.trace_path(origin, direction, 11, path).radiance[0]);
        (sum, squares) = (sum + found, squares + found * found);
    }
    let (n, mean) = (count as f64, sum / count as f64);
    [mean, (squares / n - mean * mean) / n]
}

fn normals(texel: [u8; 3]) -> (Maps, Texture) {
    let [r, g, b] = texel;
    let normal = Some(NormalMap { texture: 0, strength: 1.0 });
    (Maps { normal, ..Maps::default() }, columns(&[[r, g, b, 255]]))
}

#[test]
fn a_sun_lights_a_tilted_surface_by_its_cosine() {
    for towards in [Vec3::Z, Vec3::new(0.8, 0.3, 0.6)] {
        let plain = square(WHITE_PAINT, Maps::default(), columns(&[[255; 4]]));
        let tracer = tracer(plain.with_suns(vec![sun(towards)]).unwrap());
        let [found, _] = mean(&tracer, 0.2, 0.1, DVec3::NEG_Z, 256);
        let cosine = f64::from(towards.normalize().z);
        let expected = 0.8 / PI * f64::from(IRRADIANCE) * cosine;
        // Points of the disc have cosines that differ by 0.004.
        assert!((found / expected - 1.0).abs() < 1e-3, "{towards}: {found} {expected}");
    }
}

#[test]
fn two_suns_add_up_and_eyes_see_neither() {
    let suns = vec![sun(Vec3::Z), Sun { irradiance: [5.0; 3], ..sun(Vec3::new(0.0, 1.0, 1.0)) }];
    let plain = square(WHITE_PAINT, Maps::default(), columns(&[[255; 4]]));
    let tracer = tracer(plain.with_suns(suns).unwrap());
    let [found, variance] = mean(&tracer, 0.2, 0.1, DVec3::NEG_Z, 4000);
    let expected = 0.8 / PI * (f64::from(IRRADIANCE) + 5.0 * 0.5f64.sqrt());
    let bound = 4.0 * variance.sqrt() + 1e-3 * expected;
    assert!((found - expected).abs() < bound, "{found} {expected} {bound}");
    let up = tracer.trace(DVec3::Z, DVec3::Z, 1);
    assert_eq!(up.radiance, [0.0; 3]);
}

#[test]
fn panes_let_their_share_of_the_sun_through_and_walls_none() {
    let with_cover = |bsdf: Bsdf| {
        let at = |z: f64, size: f64| {
            [[-size, -size], [size, -size], [size, size], [-size, size]]
                .map(|[x, y]| DVec3::new(x, y, z))
        };
        let positions = [at(0.0, 1.0), at(0.5, 2.0)].concat();
        let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        let materials = vec![material(WHITE_PAINT), material(bsdf)];
        let scene = Scene::from_world(&positions, &triangles, &[0, 0, 1, 1], materials, [0.0; 3]);
        let tracer = tracer(scene.unwrap().0.with_suns(vec![sun(Vec3::Z)]).unwrap());
        // The eye is below the cover.
        let direction = DVec3::new(0.3, 0.0, -0.4);
        f64::from(tracer.trace(DVec3::new(0.0, 0.0, 0.4), direction, 3).radiance[0])
    };
    let whole = 0.8 / PI * f64::from(IRRADIANCE);
    let glass = with_cover(Bsdf::ThinGlass { ior: 1.5, transmittance: [0.9; 3] });
    // Both faces reflect 4 %, and light between them: 1 - 2·0.04 / 1.04.
    let expected = whole * 0.9 * (1.0 - 0.08 / 1.04);
    assert!((glass / expected - 1.0).abs() < 2e-3, "{glass} {expected}");
    assert_eq!(with_cover(WHITE_PAINT), 0.0);
}

#[test]
fn light_samples_and_reflections_agree_about_a_sun() {
    for bsdf in [
        Bsdf::Conductor { ks: [0.9; 3], alpha: 0.1 },
        Bsdf::Coated { kd: [0.3; 3], ks: [1.0; 3], ior: 1.5, alpha: 0.1 },
    ] {
        let scene = square(bsdf, Maps::default(), columns(&[[255; 4]]));
        let scene = Arc::new(scene.with_suns(vec![sun(Vec3::new(0.5, 0.0, 0.8))]).unwrap());
        let found = [Direct::Both, Direct::Lights, Direct::Materials].map(|direct| {
            let raycaster = Arc::new(Raycaster::build(scene.clone()).unwrap());
            let settings = Settings { bounces: Some(0), paths: 1 };
            let tracer = Tracer::with_direct(raycaster, settings, direct, 1).unwrap();
            // Near the mirror's direction.
            mean(&tracer, 0.1, 0.1, DVec3::new(0.45, 0.0, -0.8), 200_000)
        });
        let [both, lights, materials] = found;
        assert!(both[0] > 10.0, "{found:?}");
        for other in [lights, materials] {
            let sigma = (both[1] + other[1]).sqrt();
            let bound = 4.0 * sigma + 2e-3 * both[0];
            assert!((both[0] - other[0]).abs() < bound, "{bsdf:?}: {found:?}");
        }
    }
}

#[test]
fn a_texture_of_normals_tilts_both_sides_of_a_surface() {
    // Red points to the right, along x, and green up, along y. Sine 0.6 and cosine 0.8.
    for (texel, normal) in
        [([204, 128, 230], Vec3::new(0.6, 0.0, 0.8)), ([128, 51, 230], Vec3::new(0.0, -0.6, 0.8))]
    {
        // A bump of the front is a dent of the back.
        for side in [1.0, -1.0] {
            let (maps, texture) = normals(texel);
            let tilted = square(WHITE_PAINT, maps, texture);
            let towards = Vec3::new(0.3, 0.2, 0.9 * side).normalize();
            let tracer = tracer(tilted.with_suns(vec![sun(towards)]).unwrap());
            let down = DVec3::NEG_Z * f64::from(side);
            let [found, _] = mean(&tracer, 0.2, 0.1, down, 256);
            let cosine = towards.dot(normal * side);
            // Chiang et al. 2019, eq. 4: fading near the facet's own shadow.
            let g = (towards.z.abs() / (cosine * normal.z)).min(1.0);
            let fade = g + g * g - g * g * g;
            let expected = 0.8 / PI * f64::from(IRRADIANCE * cosine * fade);
            // Texels are bytes: cosines of normals are off by up to 0.01.
            assert!((found / expected - 1.0).abs() < 0.02, "{texel:?} {side}: {found} {expected}");
        }
    }
}

/// A texture of rough normals: every texel points elsewhere, up to 55° away.
fn rough_normals(side: u32) -> Texture {
    let texel = |k: u32| {
        let angle = f64::from(k) * 2.399_963;
        let sine = 0.8 * (f64::from(k * 7 % 16) / 15.0).sqrt();
        let byte = |c: f64| ((0.5 + 0.5 * c) * 255.0).round() as u8;
        let z = (1.0 - sine * sine).sqrt();
        [byte(sine * angle.cos()), byte(sine * angle.sin()), byte(z), 255]
    };
    picture(side, &(0..side * side).map(texel).collect::<Vec<_>>())
}

#[test]
fn bumps_reflect_no_more_than_their_material() {
    for bsdf in [
        WHITE_PAINT,
        Bsdf::Conductor { ks: [0.8; 3], alpha: 0.2 },
        Bsdf::Mirror { ks: [0.8; 3] },
        Bsdf::Coated { kd: [0.8; 3], ks: [0.8; 3], ior: 1.5, alpha: 0.2 },
    ] {
        let (maps, _) = normals([128, 128, 255]);
        let mut scene = square(bsdf, maps, rough_normals(16));
        scene.sky = [1.0; 3].into();
        let settings = Settings { bounces: None, paths: 1 };
        let tracer = Tracer::new(Arc::new(scene), settings).unwrap();
        for direction in [DVec3::NEG_Z, DVec3::new(1.0, 0.0, -0.4)] {
            let mut sum = 0.0;
            for k in 0..40 {
                let (x, y) = (f64::from(k % 8) / 4.0 - 0.9, f64::from(k / 8) / 2.5 - 0.9);
                sum += mean(&tracer, x, y, direction, 256)[0] / 40.0;
            }
            // Reflections into the surface are lost, and nothing is gained.
            assert!(sum < 0.81 && sum > 0.4, "{bsdf:?} {direction}: {sum}");
        }
    }
}

#[test]
fn nothing_shines_through_bumps_into_a_dark_box() {
    let at = |k: usize| DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64);
    let corners: Vec<DVec3> = (0..8).map(at).collect();
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> =
        quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let uvs = vec![[[0.0, 0.0], [3.0, 0.0], [3.0, 3.0]]; 12];
    for bsdf in [WHITE_PAINT, Bsdf::Conductor { ks: [0.9; 3], alpha: 0.1 }] {
        let materials = vec![material(bsdf)];
        let scene = Scene::from_world(&corners, &triangles, &[0; 12], materials, [100.0; 3]);
        let (maps, _) = normals([128, 128, 255]);
        let textures = vec![rough_normals(16)];
        let shading =
            Shading { uvs: uvs.clone().into(), maps: vec![maps], textures, ..Shading::default() };
        let suns = vec![sun(Vec3::new(0.3, 0.2, 1.0)), sun(Vec3::NEG_X)];
        let scene = scene.unwrap().0.with_shading(shading).unwrap().with_suns(suns).unwrap();
        let settings = Settings { bounces: Some(4), paths: 4 };
        let dark = Tracer::new(Arc::new(scene), settings).unwrap();
        for k in 0..500u64 {
            let z = -1.0 + (k as f64 + 0.5) / 250.0;
            let (sin, cos) = (k as f64 * 2.4).sin_cos();
            let level = (1.0 - z * z).sqrt();
            let direction = DVec3::new(level * cos, level * sin, z);
            let origin = DVec3::new(0.4, 0.6, 0.45);
            assert_eq!(dark.trace(origin, direction, k).radiance, [0.0; 3], "{k}");
        }
    }
}

/// A finish of red roughness and green metalness.
fn finish() -> Maps {
    let channel = |channel| Channel { texture: Some(0), channel, factor: 1.0 };
    let finish = Some(FinishMap { roughness: channel(0), metalness: channel(1) });
    Maps { finish, ..Maps::default() }
}

#[test]
fn points_look_as_materials_of_their_roughness_and_metalness() {
    let kd = [0.6; 3];
    let byte = |share: f64| (share * 255.0f64).round() as u8;
    // Multiples of 1/63, which tables are made for.
    let [low, high] = [13.0 / 63.0, 38.0 / 63.0];
    let alpha = |roughness: f64| (roughness * roughness) as f32;
    for (roughness, metalness, same) in [
        (low, 1.0, Bsdf::Conductor { ks: kd, alpha: alpha(low) }),
        (high, 1.0, Bsdf::Conductor { ks: kd, alpha: alpha(high) }),
        (low, 0.0, Bsdf::Coated { kd, ks: [1.0; 3], ior: 1.5, alpha: alpha(low) }),
        (0.9, 0.0, Bsdf::Diffuse { kd }),
    ] {
        let texture = columns(&[[byte(roughness), byte(metalness), 0, 255]]);
        // The mean of the material is another: the texture decides.
        let mean_of_all = Bsdf::Coated { kd, ks: [1.0; 3], ior: 1.5, alpha: 0.3 };
        let [textured, plain] =
            [(mean_of_all, finish()), (same, Maps::default())].map(|(bsdf, maps)| {
                let scene = square(bsdf, maps, texture.clone());
                let scene = scene.with_suns(vec![sun(Vec3::new(0.5, 0.0, 0.8))]).unwrap();
                mean(&tracer(scene), 0.1, 0.1, DVec3::new(0.4, 0.1, -0.8), 256)
            });
        assert!(plain[0] > 1.0, "{same:?}");
        // The disc is sampled alike, so only rounding differs.
        assert!((textured[0] / plain[0] - 1.0).abs() < 1e-3, "{same:?}: {textured:?} {plain:?}");
    }
}

#[test]
fn metal_of_any_roughness_reflects_all_light() {
    let texels: Vec<[u8; 4]> = (0..16).map(|k| [k * 17, 255, 0, 255]).collect();
    let mut scene =
        square(Bsdf::Conductor { ks: [1.0; 3], alpha: 0.3 }, finish(), columns(&texels));
    scene.sky = [1.0; 3].into();
    let tracer = tracer(scene);
    for k in 0..8 {
        let [found, variance] =
            mean(&tracer, -0.9 + 0.25 * f64::from(k), 0.2, DVec3::new(0.3, 0.0, -1.0), 4000);
        // The error of tables, and of 4000 paths.
        let bound = 4.0 * variance.sqrt() + 2e-3;
        assert!((found - 1.0).abs() < bound, "{k}: {found} {bound}");
    }
}

#[test]
fn colours_of_corners_are_interpolated_as_light() {
    let plain = square(WHITE_PAINT, Maps::default(), columns(&[[255; 4]]));
    let colours = vec![[WHITE, [0, 188, 0], [188, 0, 0]], [WHITE; 3]];
    let scene =
        plain.with_shading(Shading { colours: colours.into(), ..Shading::default() }).unwrap();
    let tracer = tracer(scene.with_suns(vec![sun(Vec3::Z)]).unwrap());
    let origin = DVec3::new(1.0 / 3.0, -1.0 / 3.0, 1.0);
    let found = tracer.trace(origin, DVec3::NEG_Z, 1).radiance;
    let whole = 0.8 / std::f32::consts::PI * IRRADIANCE;
    // 188 of sRGB is 0.503 of light.
    for (found, share) in found.iter().zip([1.503 / 3.0, 1.503 / 3.0, 1.0 / 3.0]) {
        assert!((found / whole - share).abs() < 2e-3, "{found} {share}");
    }
}
