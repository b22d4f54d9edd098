//! Tests properties of surfaces besides colour: normals, roughness and metalness from textures,
//! colours of vertices, and suns.

#![allow(clippy::unwrap_used)]

use crate::common::messages;
use base64::Engine as _;
use glam::Vec3;
use holo_scene::{Bsdf, LoadOptions, Loaded, PunctualBeam, PunctualLight, Scene, SceneError, Sun};
use std::fmt::Write;
use std::path::Path;

/// Writes a picture of one texel.
fn picture(path: &Path, [r, g, b]: [u8; 3]) {
    image::RgbImage::from_raw(1, 1, vec![r, g, b]).unwrap().save(path).unwrap();
}

/// A square in the plane z = 0 from (0, 0) to (1, 1), whose picture stands upright on it.
fn square(mtl: &str) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    picture(&folder.path().join("normals.png"), [204, 128, 230]);
    picture(&folder.path().join("heights.png"), [90, 90, 90]);
    picture(&folder.path().join("finish.png"), [51, 204, 0]);
    let text = format!("newmtl m\nKd 0.5 0.5 0.5\n{mtl}\n");
    std::fs::write(folder.path().join("s.mtl"), text).unwrap();
    let obj = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
               usemtl m\nf 1/1 2/2 3/3 4/4\n";
    let path = folder.path().join("s.obj");
    std::fs::write(&path, obj).unwrap();
    holo_scene::load(&path, &LoadOptions::default()).unwrap()
}

fn normal(scene: &Scene) -> Vec3 {
    scene.mapped_normal(0, [0.3, 0.3], 0.0, Vec3::Z).unwrap()
}

#[test]
fn a_picture_of_normals_bends_to_its_right_with_its_strength() {
    for keyword in ["norm", "map_Bump", "bump", "map_Kn"] {
        let loaded = square(&format!("{keyword} normals.png"));
        assert!(loaded.warnings.is_empty(), "{keyword}: {:?}", loaded.warnings);
        // (0.6, 0, 0.8), in bytes.
        assert!(normal(&loaded.scene).distance(Vec3::new(0.6, 0.0, 0.8)) < 0.01, "{keyword}");
        assert!(!loaded.scene.is_plain(0) && !loaded.scene.has_even_finish(0));
    }
    let half = square("map_Bump -bm 0.5 normals.png").scene;
    assert!(normal(&half).distance(Vec3::new(0.3, 0.0, 0.8).normalize()) < 0.01);
    let plain = square("");
    assert_eq!(plain.scene.mapped_normal(0, [0.3, 0.3], 0.0, Vec3::Z), None);
    assert!(plain.scene.is_plain(0) && plain.scene.has_even_finish(0));
}

#[test]
fn a_picture_of_heights_is_left_out_with_its_line() {
    let loaded = square("map_Bump heights.png");
    assert_eq!(
        messages(&loaded),
        ["s.mtl:3: `heights.png`: it has heights, not normals; it is left out"]
    );
    assert_eq!(loaded.scene.mapped_normal(0, [0.3, 0.3], 0.0, Vec3::Z), None);
}

#[test]
fn roughness_and_metalness_of_textures_are_factors_and_their_mean_is_the_material() {
    let of = |mtl: &str| {
        let scene = square(mtl).scene;
        (scene.finish(0, 0.3, 0.3, 0.0), scene.materials[0].bsdf)
    };
    let near = |found: [f32; 2], expected: [f32; 2]| {
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6)
    };
    // Red is 0.2 and green 0.8.
    let (finish, bsdf) = of("Pm 0\nmap_Pr finish.png");
    assert!(near(finish.unwrap(), [0.2, 0.0]), "{finish:?}");
    assert!(matches!(bsdf, Bsdf::Coated { alpha, .. } if (alpha - 0.04).abs() < 1e-6), "{bsdf:?}");
    let (finish, bsdf) = of("Pr 0.5\nPm 1\nmap_Pr -imfchan g finish.png");
    assert!(near(finish.unwrap(), [0.4, 1.0]), "{finish:?}");
    assert!(matches!(bsdf, Bsdf::Conductor { alpha, .. } if (alpha - 0.16).abs() < 1e-6));
    // A factor of zero beside its texture is an exporter's default.
    let (finish, bsdf) = of("Pr 0.9\nPm 0\nmap_Pm -imfchan g finish.png");
    assert!(near(finish.unwrap(), [0.9, 0.8]), "{finish:?}");
    assert!(matches!(bsdf, Bsdf::Conductor { .. }));
    // Glass is even.
    let (finish, bsdf) = of("illum 4\nmap_Pr finish.png");
    assert!(finish.is_none() && matches!(bsdf, Bsdf::ThinGlass { .. }), "{bsdf:?}");
    assert_eq!(of("Pr 0.5").0, None);
}

fn obj(text: &str) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.obj");
    std::fs::write(&path, text).unwrap();
    holo_scene::load(&path, &LoadOptions::default()).unwrap()
}

#[test]
fn colours_after_vertices_are_those_of_surfaces() {
    for (scale, opacity) in [(1.0, ""), (255.0, ""), (1.0, " 1.0")] {
        let [full, half] = [scale, scale * 188.0 / 255.0];
        let loaded = obj(&format!(
            "v 9 9 9\nv 0 0 0 {full} 0 0{opacity}\nv 1 0 0 0 {full} 0{opacity}\n\
             v 0 1 0 0 0 {half}{opacity}\nv 0 0 1\nf 2 3 4\nf 2 3 5\n"
        ));
        let at = |t: u32, u: f32, v: f32| loaded.scene.reflectance(t, u, v, 0.0);
        assert_eq!([at(0, 0.0, 0.0), at(0, 1.0, 0.0)], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert!((at(0, 0.0, 1.0)[2] - 0.503).abs() < 1e-3, "{:?}", at(0, 0.0, 1.0));
        assert_eq!(at(0, 0.5, 0.0), [0.5, 0.5, 0.0]);
        assert_eq!(at(1, 0.0, 1.0), [1.0; 3], "a vertex without a colour");
        assert!(loaded.scene.has_texture(0) && loaded.scene.features().textures);
        assert_eq!(
            messages(&loaded)[..1],
            ["s.obj: the colours of vertices are taken for materials that are not defined"]
        );
    }
    let white = obj("v 0 0 0 1 1 1\nv 1 0 0 1 1 1\nv 0 1 0 1 1 1\nf 1 2 3\n");
    assert_eq!(white.scene.shading, None);
}

#[test]
fn polygons_keep_the_colours_of_their_corners() {
    // A concave polygon, divided in another order than that of its corners.
    let loaded =
        obj("v 0 0 0 0 0 0\nv 4 0 0 1 0 0\nv 4 4 0 1 1 0\nv 3 1 0 0.75 0.25 0\nv 0 4 0 0 1 0\n\
         f 1 2 3 4 5\n");
    let scene = &loaded.scene;
    for t in scene.triangles() {
        for (k, [u, v]) in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
            let at = scene.corners(t)[k] + scene.origin.as_vec3();
            let expected = [at.x / 4.0, at.y / 4.0].map(|byte| {
                let byte = (byte * 255.0).round() / 255.0;
                if byte <= 0.04045 { byte / 12.92 } else { ((byte + 0.055) / 1.055).powf(2.4) }
            });
            let found = scene.reflectance(t, u, v, 0.0);
            assert!((found[0] - expected[0]).abs() + (found[1] - expected[1]).abs() < 1e-5);
        }
    }
}

#[test]
fn corners_on_edges_and_twice_leave_a_polygon_its_area() {
    let plain = [[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2], [0, 1]];
    let mut reversed = plain.to_vec();
    reversed.reverse();
    let twice = |k: usize| [&plain[..=k], &plain[k..]].concat();
    let all = [plain.to_vec(), reversed].into_iter().chain((0..8).map(twice));
    for (outline, offset) in all.flat_map(|o| [(o.clone(), [0, 0]), (o, [342, 389])]) {
        for first in 0..outline.len() {
            let mut text = String::new();
            for [x, y] in &outline {
                writeln!(text, "v {} {} 7", x + offset[0], y + offset[1]).unwrap();
            }
            let face = (0..outline.len()).map(|k| (first + k) % outline.len() + 1);
            text += &face.fold("f".to_owned(), |face, corner| format!("{face} {corner}"));
            let scene = obj(&text).scene;
            let normal = scene.normal(0);
            assert!(scene.triangles().all(|t| scene.normal(t) == normal), "{text}");
            let area: f64 = scene.triangles().map(|t| scene.area(t)).sum();
            assert_eq!(area, 3.0, "{text}");
        }
    }
}

#[test]
fn colours_of_a_later_object_belong_to_it_alone() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.mtl"), "newmtl m\nKd 0.25 0.5 0.75\n").unwrap();
    let path = folder.path().join("s.obj");
    let text = "mtllib s.mtl\nvt 0 0\nvt 1 0\nvt 0 1\no a\nv 0 0 0\nv 1 0 0\nv 0 1 0\n\
                usemtl m\nf 1 2 3\no b\nv 0 0 1 1 0 0\nv 1 0 1 0 1 0\nv 0 1 1 0 0 1\n\
                usemtl colours\nf 4/3 5/1 6/2\n";
    std::fs::write(&path, text).unwrap();
    let scene = holo_scene::load(&path, &LoadOptions::default()).unwrap().scene;
    let at = |t: u32, u: f32, v: f32| scene.reflectance(t, u, v, 0.0);
    assert_eq!(at(0, 0.3, 0.3), [0.25, 0.5, 0.75]);
    let corners = [at(1, 0.0, 0.0), at(1, 1.0, 0.0), at(1, 0.0, 1.0)];
    assert_eq!(corners, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
}

/// A glTF file of one triangle with coordinates and colours, and other members.
fn gltf(material: &str, more: &str, node: &str) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let mut numbers = vec![0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    numbers.extend([0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    // Colours are linear, with an opacity.
    numbers.extend([0.5, 0.25, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.25, 0.0, 1.0]);
    let bytes: Vec<u8> = numbers.iter().flat_map(|c| c.to_le_bytes()).collect();
    let engine = base64::engine::general_purpose::STANDARD;
    let (data, mut images) = (engine.encode(&bytes), String::new());
    for texel in [[204, 128, 230], [0, 51, 204]] {
        let file = folder.path().join("t.png");
        picture(&file, texel);
        let file = engine.encode(std::fs::read(file).unwrap());
        write!(images, r#"{{"uri":"data:image/png;base64,{file}"}},"#).unwrap();
    }
    let images = images.trim_end_matches(',');
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},
        "buffers":[{{"byteLength":{},"uri":"data:application/octet-stream;base64,{data}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":24}},
            {{"buffer":0,"byteOffset":60,"byteLength":48}}],
        "accessors":[
            {{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
            {{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}},
            {{"bufferView":2,"componentType":5126,"count":3,"type":"VEC4"}}],
        "images":[{images}],"textures":[{{"source":0}},{{"source":1}}],
        "materials":[{{"name":"m",{material}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1,"COLOR_0":2}},
            "material":0}}]}}],
        "nodes":[{{"mesh":0}}{node}],"scenes":[{{"nodes":[0{}]}}],"scene":0{more}}}"#,
        bytes.len(),
        if node.is_empty() { "" } else { ",1" }
    );
    let path = folder.path().join("s.gltf");
    std::fs::write(&path, json).unwrap();
    holo_scene::load(&path, &LoadOptions::default()).unwrap()
}

const DETAILS: &str = r#""normalTexture":{"index":0,"scale":0.5},
    "pbrMetallicRoughness":{"metallicFactor":1,"roughnessFactor":0.5,
    "metallicRoughnessTexture":{"index":1}}"#;

#[test]
fn gltf_has_normals_roughness_metalness_and_colours() {
    let loaded = gltf(DETAILS, "", "");
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let scene = &loaded.scene;
    assert!(normal(scene).distance(Vec3::new(0.3, 0.0, 0.8).normalize()) < 0.01);
    // Green is roughness, and blue metalness.
    let [roughness, metalness] = scene.finish(0, 0.3, 0.3, 0.0).unwrap();
    assert!((roughness - 0.1).abs() < 1e-6 && (metalness - 0.8).abs() < 1e-6);
    let alpha = match scene.materials[0].bsdf {
        Bsdf::Conductor { alpha, .. } => alpha,
        other => panic!("{other:?}"),
    };
    assert!((alpha - 0.01).abs() < 1e-6, "{alpha}");
    let found = scene.reflectance(0, 0.0, 0.0, 0.0);
    // Bytes of sRGB are at most 0.0045 of light apart here.
    assert!((found[0] - 0.5).abs() < 0.005 && (found[1] - 0.25).abs() < 0.005 && found[2] == 0.0);
}

#[test]
fn a_directional_light_is_a_sun_that_shines_along_its_node() {
    let lights = r#","extensionsUsed":["KHR_lights_punctual"],"extensions":{"KHR_lights_punctual":
        {"lights":[{"type":"directional","intensity":17900,"color":[1,0.5,0]}]}}"#;
    // Turned by 90° around x, so that -z becomes +y.
    let node = r#",{"rotation":[0.70710678,0,0,0.70710678],
        "extensions":{"KHR_lights_punctual":{"light":0}}}"#;
    let loaded = gltf(DETAILS, lights, node);
    let [Sun { towards, irradiance }] = loaded.scene.suns[..] else { panic!() };
    assert!(Vec3::from(towards).distance(Vec3::NEG_Y) < 1e-6, "{towards:?}");
    assert_eq!(irradiance, [100.0, 50.0, 0.0]);
    assert_eq!(loaded.scene.features().suns, 1);
    assert_eq!(messages(&loaded), ["s.gltf: directional lights are suns of half a degree (1)"]);
}

/// Adds a point light and a spot light.
fn with_punctual_lights(scene: Scene) -> Scene {
    let point = PunctualLight {
        name: "lamp".to_owned(),
        group: "all lamps".to_owned(),
        position: [1.0, 2.0, -3.0],
        intensity: [1.0, 0.0, 2.0],
        radius: 0.01,
        beam: PunctualBeam::Everywhere,
    };
    let beam = PunctualBeam::Cone { axis: [0.0, 0.6, 0.8], inner: 0.2, outer: 1.5 };
    let spot = PunctualLight { beam, ..point.clone() };
    scene.with_punctual_lights(vec![point, spot]).unwrap()
}

#[test]
fn impossible_punctual_lights_are_refused() {
    let good = with_punctual_lights(square("").scene).punctual_lights;
    let refused = |change: &dyn Fn(&mut PunctualLight)| {
        let mut lights = good.clone();
        change(&mut lights[1]);
        let error = square("").scene.with_punctual_lights(lights).unwrap_err();
        assert!(matches!(error, SceneError::PunctualLight(1)), "{error}");
    };
    let cone = |axis, inner, outer| PunctualBeam::Cone { axis, inner, outer };
    refused(&|light| light.position[0] = f32::NAN);
    refused(&|light| light.intensity = [0.0; 3]);
    refused(&|light| light.intensity[1] = -1.0);
    refused(&|light| light.intensity[1] = f32::INFINITY);
    refused(&|light| light.radius = 0.0);
    refused(&|light| light.name = "n".repeat(2000));
    refused(&|light| light.beam = cone([0.0; 3], 0.1, 0.2));
    refused(&|light| light.beam = cone([0.0, 0.0, 1.0], 0.3, 0.2));
    refused(&|light| light.beam = cone([0.0, 0.0, 1.0], 0.3, 4.0));
    let many = square("").scene.with_punctual_lights(vec![good[0].clone(); 65_537]).unwrap_err();
    assert_eq!(many.to_string(), "65537 punctual lights are more than the limit of 65536");
}

#[test]
fn all_of_it_survives_packing_and_damage_is_refused() {
    let lit = |scene: Scene| {
        let sun = Sun { towards: [0.0, 0.6, 0.8], irradiance: [3.0, 2.0, 1.0] };
        scene.with_suns(vec![sun]).unwrap()
    };
    for scene in [
        lit(gltf(DETAILS, "", "").scene),
        lit(square("").scene),
        with_punctual_lights(square("").scene),
        with_punctual_lights(lit(square("norm normals.png").scene)),
        square("norm normals.png").scene,
        square("map_Pr finish.png").scene,
        obj("v 0 0 0 1 0 0\nv 1 0 0 1 1 1\nv 0 1 0 1 1 1\nf 1 2 3\n").scene,
    ] {
        let packed = scene.pack();
        let unpacked = Scene::unpack(&packed).unwrap();
        assert_eq!(unpacked, scene);
        assert!(unpacked.pack() == packed);
        for length in 0..packed.len() {
            assert!(Scene::unpack(&packed[..length]).is_err(), "{length}");
        }
        for at in 0..packed.len() {
            let mut changed = packed.clone();
            changed[at] ^= 1 << (at % 8);
            if let Ok(scene) = Scene::unpack(&changed) {
                assert!(scene.pack() == changed, "byte {at} has two packings");
            }
        }
    }
}

#[test]
fn suns_without_direction_or_light_are_refused() {
    let with = |towards: [f32; 3], irradiance: [f32; 3]| {
        square("").scene.with_suns(vec![Sun { towards, irradiance }]).unwrap_err()
    };
    for (towards, irradiance) in [
        ([0.0; 3], [1.0; 3]),
        ([0.0, 0.0, 2.0], [1.0; 3]),
        ([0.0, f32::NAN, 1.0], [1.0; 3]),
        ([0.0, 0.0, 1.0], [0.0; 3]),
        ([0.0, 0.0, 1.0], [1.0, -1.0, 1.0]),
        ([0.0, 0.0, 1.0], [f32::INFINITY; 3]),
    ] {
        assert!(matches!(with(towards, irradiance), SceneError::Sun(0)));
    }
    let sun = Sun { towards: [0.0, 0.0, 1.0], irradiance: [1.0; 3] };
    let many = square("").scene.with_suns(vec![sun; 17]).unwrap_err();
    assert_eq!(many.to_string(), "17 suns are more than the limit of 16");
}
