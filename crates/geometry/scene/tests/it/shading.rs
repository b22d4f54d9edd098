//! Tests normals and textures, from files to points on surfaces.

#![allow(clippy::unwrap_used)]

use crate::common::messages;
use glam::Vec3;
use holo_scene::{Bsdf, LoadOptions, Loaded, PackedError, Scene, SceneError, VERSION};
use std::path::Path;

/// Writes a picture of these rows, red, green, blue and opacity.
fn picture(path: &Path, rows: &[&[[u8; 4]]]) {
    let raw: Vec<u8> = rows.concat().concat();
    let size = (rows[0].len() as u32, rows.len() as u32);
    image::RgbaImage::from_raw(size.0, size.1, raw).unwrap().save(path).unwrap();
}

const RED: [u8; 4] = [255, 0, 0, 255];
const BLUE: [u8; 4] = [0, 0, 255, 255];
const CLEAR: [u8; 4] = [0, 255, 0, 0];

/// A square of two triangles whose texture has red above blue, with another to the right of it.
fn square(mtl: &str, more: &str) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    picture(&folder.path().join("two.png"), &[&[RED], &[BLUE]]);
    picture(&folder.path().join("holes.png"), &[&[RED, CLEAR]]);
    picture(&folder.path().join("mask.png"), &[&[[0, 0, 0, 255], [255; 4]]]);
    std::fs::write(folder.path().join("s.mtl"), format!("newmtl m\n{mtl}\nnewmtl plain\nKd 0.5\n"))
        .unwrap();
    let obj = format!(
        "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
         usemtl m\nf 1/1 2/2 3/3 4/4\n{more}"
    );
    let path = folder.path().join("s.obj");
    std::fs::write(&path, obj).unwrap();
    holo_scene::load(&path, &LoadOptions::default()).unwrap()
}

/// Barycentrics in the first triangle of the square, whose corners are (0,0), (1,0) and (1,1).
fn at(x: f32, y: f32) -> [f32; 2] {
    [x - y, y]
}

fn reflectance(scene: &Scene, x: f32, y: f32) -> [f32; 3] {
    let [u, v] = at(x, y);
    scene.reflectance(0, u, v, 0.0)
}

#[test]
fn a_texture_is_a_factor_to_the_colour_and_stands_upright() {
    let loaded = square("Kd 0.5 0.5 0.5\nmap_Kd -clamp on two.png", "");
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let scene = &loaded.scene;
    assert_eq!(reflectance(scene, 0.9, 0.1), [0.0, 0.0, 0.5]);
    assert_eq!(reflectance(scene, 0.95, 0.9), [0.5, 0.0, 0.0]);
    assert!(scene.has_texture(0) && scene.features().textures);
    // A large footprint gives the mean of both.
    let wide = scene.reflectance(0, 0.5, 0.2, 5.0);
    assert!(wide.iter().zip([0.25, 0.0, 0.25]).all(|(a, b)| (a - b).abs() < 0.003), "{wide:?}");
}

#[test]
fn black_or_no_colour_beside_a_texture_is_white() {
    for mtl in ["Kd 0 0 0\nmap_Kd two.png", "map_Kd two.png"] {
        let loaded = square(mtl, "");
        assert_eq!(loaded.scene.materials[0].bsdf, Bsdf::Diffuse { kd: [1.0; 3] }, "{mtl}");
    }
    let lamp = square("Kd 0\nmap_Ke -clamp on two.png", "").scene;
    assert_eq!(lamp.materials[0].emission, [1.0; 3]);
    let [u, v] = at(0.9, 0.1);
    assert_eq!(lamp.emission_texture(0, u, v, 0.0), Some([0.0, 0.0, 1.0]));
}

#[test]
fn opacity_is_that_of_a_mask_or_of_the_picture_itself() {
    for (map, left) in [("holes.png", false), ("mask.png", true)] {
        let scene = square(&format!("Kd 1\nmap_d -clamp on {map}"), "").scene;
        assert!(scene.has_cut_outs());
        let [u, v] = at(0.1, 0.05);
        assert_eq!(scene.is_cut_out(0, u, v), left, "{map}");
        let [u, v] = at(0.9, 0.05);
        assert_eq!(scene.is_cut_out(0, u, v), !left, "{map}");
    }
}

#[test]
fn triangles_without_area_take_their_coordinates_with_them() {
    // A triangle without area lies between two with it.
    let more = "f 1/1 1/1 2/2\nf 1/3 2/4 3/1\n";
    let plain = square("map_Kd two.png", "f 1/3 2/4 3/1\n").scene;
    assert_eq!(square("map_Kd two.png", more).scene.shading, plain.shading);
}

#[test]
fn a_scene_without_textures_in_use_has_no_shading_and_the_plain_packing() {
    let plain = square("Kd 0.5", "").scene;
    assert_eq!(plain.shading, None);
    assert_eq!(plain.pack()[8..12], VERSION.to_le_bytes());
    assert_eq!(reflectance(&plain, 0.5, 0.2), [0.5; 3]);
    let missing = square("Kd 0.5\nmap_Kd none.png", "");
    assert_eq!(missing.scene.shading, None);
    assert_eq!(
        messages(&missing),
        ["s.mtl:3: `none.png`: texture `none.png` is not in the model's folder; grey 0.5 is taken"]
    );
}

#[test]
fn normals_and_textures_survive_packing_and_damage_is_refused() {
    let normals = "vn 0 0 1\nvn 0.1 0 1\nvn 0 0.1 1\nf 1//1 2//2 3//3\n";
    for scene in [
        square("map_Kd two.png\nmap_d mask.png", normals).scene,
        square("map_Kd -clamp on two.png", "").scene,
        square("Kd 1", normals).scene,
    ] {
        assert!(scene.shading.is_some());
        let packed = scene.pack();
        let unpacked = Scene::unpack(&packed).unwrap();
        assert_eq!(unpacked, scene);
        assert!(unpacked.pack() == packed);
        for length in (0..packed.len()).step_by(3) {
            assert!(Scene::unpack(&packed[..length]).is_err(), "{length}");
        }
        let mut longer = packed.clone();
        longer.push(0);
        let error = Scene::unpack(&longer).unwrap_err();
        assert!(matches!(error, SceneError::Packed(PackedError::Shading)), "{error}");
    }
}

#[test]
fn given_normals_are_interpolated_and_turned_to_the_front() {
    let loaded = square("Kd 1", "vn 0.6 0 0.8\nvn 0 0 -1\nf 1//1 2//2 3//1\n");
    let scene = &loaded.scene;
    assert_eq!(scene.smooth_normal(0, 0.2, 0.2), None, "a facet");
    let near = |found: Option<Vec3>, expected: Vec3| found.unwrap().distance(expected) < 2e-4;
    let tilted = Vec3::new(0.6, 0.0, 0.8);
    assert!(near(scene.smooth_normal(2, 0.0, 0.0), tilted));
    assert!(near(scene.smooth_normal(2, 1.0, 0.0), Vec3::Z), "the winding decides");
    assert!(near(scene.smooth_normal(2, 0.5, 0.0), (tilted + Vec3::Z).normalize()));
}

#[test]
fn smoothing_groups_make_normals_where_none_are_given() {
    let ridge = "v 0 0 9\nv 1 0 9.2\nv 1 1 9.2\nv 2 0 9\n";
    let smooth = square("Kd 1", &format!("{ridge}s 1\nf 5 6 7\nf 6 8 7\n")).scene;
    let top = smooth.smooth_normal(2, 1.0, 0.0).unwrap();
    assert!(top.distance(Vec3::Z) < 1e-3, "{top}");
    let flat = square("Kd 1", &format!("{ridge}s off\nf 5 6 7\nf 6 8 7\n")).scene;
    assert_eq!(flat.shading, None);
}

#[test]
fn pictures_that_cannot_be_read_are_left_out_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.png"), b"\x89PNG\r\n\x1a\nnothing").unwrap();
    std::fs::write(folder.path().join("s.mtl"), "newmtl m\nmap_Kd bad.png\n").unwrap();
    let path = folder.path().join("s.obj");
    std::fs::write(&path, "mtllib s.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let loaded = holo_scene::load(&path, &LoadOptions::default()).unwrap();
    let warnings = messages(&loaded);
    assert!(
        warnings[0].starts_with("s.mtl:2: `bad.png`: the texture cannot be read"),
        "{warnings:?}"
    );
    assert_eq!(loaded.scene.shading, None);
}
