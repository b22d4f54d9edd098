//! Tests glTF files: geometry, materials, cameras, lights, and files with false counts and offsets.

#![allow(clippy::unwrap_used)]

use crate::common::gltf::{Arrays, file};
use crate::common::{self, messages};
use base64::Engine as _;
use glam::{DVec3, Vec3};
use holo_scene::{Bsdf, LoadOptions, Loaded, PunctualBeam, Scene, SceneError};
use proptest::prelude::*;

/// Positions of a triangle, indices as bytes, and one sparse replacement.
fn buffer() -> Vec<u8> {
    let positions = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut bytes: Vec<u8> = positions.iter().flat_map(|c| c.to_le_bytes()).collect();
    bytes.extend([0u8, 1, 2, 0]);
    bytes.extend([0.0f32, 2.0, 0.0].iter().flat_map(|c| c.to_le_bytes()));
    bytes.extend([2u8, 0, 0, 0]);
    bytes
}

/// The buffer, views and accessors of every test, as members of a glTF object.
fn arrays() -> String {
    let bytes = buffer();
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    format!(
        r#""asset":{{"version":"2.0"}},
        "buffers":[{{"byteLength":{},"uri":"data:application/octet-stream;base64,{data}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":4}},
            {{"buffer":0,"byteOffset":40,"byteLength":12}},{{"buffer":0,"byteOffset":52,"byteLength":4}}],
        "accessors":[
            {{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
            {{"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}},
            {{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,2,0],
              "sparse":{{"count":1,"indices":{{"bufferView":3,"componentType":5121}},"values":{{"bufferView":2}}}}}}]"#,
        bytes.len()
    )
}

/// One triangle on one node, with other members.
fn triangle(more: &str) -> String {
    format!(
        r#"{{{},"meshes":[{{"name":"tri","primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
        "nodes":[{{"mesh":0}}],"scenes":[{{"nodes":[0]}}],"scene":0,{more}}}"#,
        arrays()
    )
}

fn load_named(name: &str, bytes: &[u8]) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    holo_scene::load(&path, &LoadOptions::default())
}

fn load(json: &str) -> Result<Loaded, SceneError> {
    load_named("s.gltf", json.as_bytes())
}

fn problem(json: &str) -> String {
    let error = load(json).unwrap_err().to_string();
    error.split_once("s.gltf: ").unwrap().1.to_owned()
}

fn corners(scene: &Scene) -> Vec<[DVec3; 3]> {
    let place = |p: Vec3| (p.as_dvec3() + scene.origin).round();
    scene.triangles().map(|t| scene.corners(t).map(place)).collect()
}

/// Returns the scattering of a material with these members, and warnings.
fn material(members: &str) -> (holo_scene::Material, Vec<String>) {
    let loaded = load(&triangle(&format!(r#""materials":[{{"name":"m",{members}}}]"#))).unwrap();
    (loaded.scene.materials[0].clone(), messages(&loaded))
}

const GREY: &str =
    r#""materials":[{"pbrMetallicRoughness":{"roughnessFactor":1,"metallicFactor":0}}]"#;

#[test]
fn nodes_place_meshes_and_a_mirrored_one_keeps_its_front() {
    let nodes = r#""nodes":[{"children":[1,2],"translation":[10,0,0]},{"mesh":0,"scale":[2,2,2]},
        {"mesh":0,"scale":[-1,1,1]}]"#;
    let json = triangle(GREY).replace(r#""nodes":[{"mesh":0}]"#, nodes);
    let loaded = load(&json).unwrap();
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let expected = [
        [at(10.0, 0.0), at(12.0, 0.0), at(10.0, 2.0)],
        [at(10.0, 0.0), at(10.0, 1.0), at(9.0, 0.0)],
    ];
    assert_eq!(corners(&loaded.scene), expected);
    assert!((0..2).all(|t| loaded.scene.normal(t) == Vec3::Z));
    assert_eq!(loaded.about.up.unwrap().value, [0.0, 1.0, 0.0]);
    assert_eq!(loaded.about.unit.unwrap().value, 1.0);
}

#[test]
fn sparse_accessors_strips_and_fans_are_read() {
    let with =
        |from: &str, to: &str| corners(&load(&triangle(GREY).replace(from, to)).unwrap().scene);
    let sparse = with(r#""POSITION":0"#, r#""POSITION":2"#);
    assert_eq!(sparse[0][2], DVec3::new(0.0, 2.0, 0.0));
    let plain = with("", "");
    for mode in [r#""mode":5,"indices":1"#, r#""mode":6,"indices":1"#] {
        assert_eq!(with(r#""indices":1"#, mode), plain);
    }
    assert_eq!(with(r#""indices":1,"#, ""), plain, "without indices, in order");
    assert_eq!(with(r#","min":[0,0,0],"max":[1,1,0]"#, ""), plain, "without bounds");
}

#[test]
fn binary_files_and_files_with_buffers_beside_them_are_the_same_scene() {
    let plain = load(&triangle(GREY)).unwrap().scene;
    let json = triangle(GREY);
    let uri = &json[json.find(r#","uri""#).unwrap()..json.find("}],\n").unwrap()];
    let mut text = json.replace(uri, "");
    text += &" ".repeat(text.len().next_multiple_of(4) - text.len());
    let binary = buffer();
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((12 + 8 + text.len() + 8 + binary.len()).to_le_bytes()[..4].iter());
    for (bytes, kind) in [(text.as_bytes(), b"JSON"), (&binary, b"BIN\0")] {
        glb.extend(&bytes.len().to_le_bytes()[..4]);
        glb.extend(kind);
        glb.extend(bytes);
    }
    assert_eq!(load_named("s.glb", &glb).unwrap().scene, plain);
    assert_eq!(load_named("misnamed.obj", &glb).unwrap().scene, plain, "contents decide");
    for length in 0..12_u8 {
        glb[8..12].copy_from_slice(&[length, 0, 0, 0]);
        let error = load_named("s.glb", &glb).unwrap_err().to_string();
        assert!(error.contains(&format!("it says that it has {length} bytes")), "{error}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.gltf");
    std::fs::write(folder.path().join("my mesh.bin"), &binary).unwrap();
    std::fs::write(&path, json.replace(uri, r#","uri":"my%20mesh.bin""#)).unwrap();
    assert_eq!(holo_scene::load(&path, &LoadOptions::default()).unwrap().scene, plain);
    std::fs::write(&path, json.replace(uri, r#","uri":"../my%20mesh.bin""#)).unwrap();
    std::fs::rename(folder.path().join("my mesh.bin"), folder.path().join("other.bin")).unwrap();
    let error = holo_scene::load(&path, &LoadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("is not in its folder"), "{error}");
}

#[test]
fn materials_are_those_of_the_table() {
    let pbr = |members: &str| {
        format!(r#""pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.25,1,1],{members}}}"#)
    };
    let base = [0.5, 0.25, 1.0];
    let white = [1.0; 3];
    let plastic = Bsdf::Coated { kd: base, ks: white, ior: 1.5, alpha: 0.25 };
    let plain = pbr(r#""metallicFactor":0,"roughnessFactor":1"#);
    let glass =
        r#""KHR_materials_transmission":{"transmissionFactor":1},"KHR_materials_ior":{"ior":1.25}"#;
    let cases = [
        (plain.clone(), Bsdf::Diffuse { kd: base }),
        (pbr(r#""metallicFactor":0,"roughnessFactor":0.5"#), plastic),
        (
            pbr(r#""metallicFactor":1,"roughnessFactor":0.5"#),
            Bsdf::Conductor { ks: base, alpha: 0.25 },
        ),
        (pbr(r#""metallicFactor":1,"roughnessFactor":0"#), Bsdf::Mirror { ks: base }),
        (
            format!(
                r#"{plain},"extensions":{{"KHR_materials_clearcoat":{{"clearcoatFactor":1,"clearcoatRoughnessFactor":0.5}}}}"#
            ),
            plastic,
        ),
        (
            format!(r#"{},"extensions":{{{glass}}}"#, pbr(r#""roughnessFactor":0"#)),
            Bsdf::ThinGlass { ior: 1.25, transmittance: base },
        ),
    ];
    for (members, expected) in cases {
        let (material, warnings) = material(&members);
        assert_eq!((material.bsdf, warnings), (expected, vec![]), "{members}");
    }
    let (veil, warnings) =
        material(&format!(r#""alphaMode":"BLEND",{}"#, plain.replace("1,1]", "1,0.25]")));
    assert_eq!((veil.bsdf, warnings), (Bsdf::Diffuse { kd: base }, vec![]));
}

#[test]
fn glass_with_a_volume_is_solid_if_it_encloses_something() {
    let glass = r#"{"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,1],"roughnessFactor":0},
        "extensions":{"KHR_materials_transmission":{"transmissionFactor":1},
        "KHR_materials_ior":{"ior":1.25},"KHR_materials_volume":{"thicknessFactor":2,
        "attenuationDistance":1,"attenuationColor":[0.5,1,1]}}}"#;
    let mut arrays = Arrays::default();
    arrays.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    arrays.add(&[0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], 5121, "SCALAR", 12, "");
    arrays.add(&[0, 1, 2], 5121, "SCALAR", 3, "");
    let with = |indices: usize| {
        let primitive =
            format!(r#""attributes":{{"POSITION":0}},"indices":{indices},"material":0"#);
        let loaded = common::gltf::load(&file(&arrays, &primitive, r#"{"mesh":0}"#, glass, ""));
        (loaded.scene.materials[0].bsdf, messages(&loaded))
    };
    let transmittance = [0.25, 0.25, 1.0];
    assert_eq!(with(1), (Bsdf::Dielectric { ior: 1.25, transmittance, alpha: 0.0 }, vec![]));
    let (pane, warnings) = with(2);
    assert_eq!(pane, Bsdf::ThinGlass { ior: 1.25, transmittance });
    assert!(warnings[0].contains("they are taken as panes (1)"), "{warnings:?}");
}

#[test]
fn emission_is_a_luminance_and_shines_on_both_sides_if_the_material_does() {
    let lamp = r#""emissiveFactor":[1,0.5,0],"extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":179}}"#;
    let (one, _) = material(lamp);
    assert_eq!((one.emission, one.two_sided_emission), ([1.0, 0.5, 0.0], false));
    assert!(material(&format!(r#"{lamp},"doubleSided":true"#)).0.two_sided_emission);
}

#[test]
fn cameras_are_views_and_lights_have_their_intensity() {
    let more = format!(
        r#"{GREY},"cameras":[{{"type":"perspective","perspective":{{"yfov":0.5,"znear":0.1}}}}],
        "extensionsUsed":["KHR_lights_punctual","VENDOR_x"],
        "extensionsRequired":["VENDOR_x","VENDOR_y"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":179}},
            {{"type":"spot","intensity":179,"spot":{{"outerConeAngle":0.5}}}},{{"type":"directional"}}]}}}}"#
    );
    let light = |n: usize| format!(r#"{{"extensions":{{"KHR_lights_punctual":{{"light":{n}}}}}}}"#);
    let nodes = format!(
        r#""nodes":[{{"mesh":0,"children":[1,2,3,4]}},{{"name":"eye","camera":0,"translation":[1,2,3]}},{},{},{}]"#,
        light(0),
        light(1),
        light(2)
    );
    let loaded = load(&triangle(&more).replace(r#""nodes":[{"mesh":0}]"#, &nodes)).unwrap();
    let [camera] = &loaded.about.cameras[..] else { panic!("{:?}", loaded.about) };
    assert_eq!(
        (camera.name.as_str(), camera.eye, camera.direction),
        ("eye", [1.0, 2.0, 3.0], [0.0, 0.0, -1.0])
    );
    assert!((camera.height - 0.5f64.to_degrees()).abs() < 1e-4);
    let warnings = messages(&loaded);
    for part in ["VENDOR_x", "VENDOR_y", "directional", "point lights", "spot lights"] {
        assert!(
            warnings.iter().any(|w| w.contains(part) && w.ends_with("(1)")),
            "{part}: {warnings:?}"
        );
    }
    let [point, spot] = &loaded.scene.punctual_lights[..] else { panic!() };
    let place = Vec3::from(point.position).as_dvec3() + loaded.scene.origin;
    assert!(place.length() < 1e-6, "{place}");
    assert_eq!((point.intensity, point.beam), ([1.0; 3], PunctualBeam::Everywhere));
    assert_eq!((point.name.as_str(), point.group.as_str()), ("2", "light 0"));
    let axis = [0.0, 0.0, -1.0];
    assert_eq!(spot.beam, PunctualBeam::Cone { axis, inner: 0.0, outer: 0.5 });
    assert_eq!(loaded.scene.features().punctual_lights, 2);
}

/// Loads the triangle, scaled, with one light of these members at (0, 0, 1).
fn with_light(light: &str, scale: f64) -> Loaded {
    let more = format!(
        r#"{GREY},"extensionsUsed":["KHR_lights_punctual"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{{light}}}]}}}}"#
    );
    let nodes = format!(
        r#""nodes":[{{"mesh":0,"scale":[{scale},{scale},{scale}]}},{{"name":"lamp",
        "translation":[0,0,1],"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}}]"#
    );
    let scenes = r#""scenes":[{"nodes":[0,1]}]"#;
    let json = triangle(&more).replace(r#""nodes":[{"mesh":0}]"#, &nodes);
    load(&json.replace(r#""scenes":[{"nodes":[0]}]"#, scenes)).unwrap()
}

#[test]
fn the_sphere_of_a_light_follows_the_size_of_the_scene_up_to_a_centimetre() {
    let radius = |scale: f64| {
        let loaded = with_light(r#""type":"point","intensity":100"#, scale);
        f64::from(loaded.scene.punctual_lights[0].radius)
    };
    let diagonal = 2_f64.sqrt();
    for scale in [1e-4, 0.01, 1.0] {
        assert!((radius(scale) / (1e-3 * diagonal * scale) - 1.0).abs() < 1e-5, "{scale}");
    }
    assert!((radius(1000.0) - 0.01).abs() < 1e-6);
}

#[test]
fn impossible_lights_are_counted_and_unusual_units_are_named() {
    let said = |light: &str| messages(&with_light(light, 1.0)).join("\n");
    let plain = "s.gltf: point lights give light and are not seen (1)";
    assert_eq!(said(r#""type":"point","intensity":100"#), plain);
    for candela in ["15.9", "200", "1000", "15.9154943"] {
        assert_eq!(said(&format!(r#""type":"point","intensity":{candela}"#)), plain);
    }
    for (light, part) in [
        (r#""type":"point","intensity":10870.282"#, "200 W × 683 lm/W ÷ 4π"),
        (r#""type":"point","intensity":54.35141"#, "of 1 W × 683 lm/W ÷ 4π"),
        (r#""type":"point","intensity":5,"range":3"#, "ranges of lights are ignored"),
        (r#""type":"point","intensity":0"#, "of node lamp has no intensity"),
        (r#""type":"point","intensity":-1"#, "without a plausible intensity"),
        (r#""type":"spot","spot":{"innerConeAngle":0.6,"outerConeAngle":0.5}"#, "angles"),
        (r#""type":"spot","spot":{"innerConeAngle":-1,"outerConeAngle":0.5}"#, "angles"),
        (r#""type":"spot","spot":{"outerConeAngle":3}"#, "angles"),
        (r#""type":"spot","spot":{"outerConeAngle":0}"#, "angles"),
    ] {
        let found = said(light);
        assert!(found.contains(part), "{light}: {found}");
    }
    let kept = with_light(r#""type":"point","intensity":10870.282"#, 1.0).scene;
    assert!((kept.punctual_lights[0].intensity[0] * 179.0 / 10870.282 - 1.0).abs() < 1e-6);
}

#[test]
fn nodes_with_several_parents_are_there_several_times_and_circles_end() {
    let with = |nodes: &str, roots: &str| {
        let json =
            triangle(GREY).replace(r#""nodes":[{"mesh":0}]"#, &format!(r#""nodes":[{nodes}]"#));
        let scenes = format!(r#""scene":0,"scenes":[{{"nodes":[{roots}]}}],"nodes":"#);
        load(&json.replacen(r#""nodes":"#, &scenes, 1))
    };
    let leaf = r#"{"mesh":0,"translation":[2,0,0]}"#;
    let two = format!(
        r#"{{"children":[1,2]}},{{"children":[3]}},{{"children":[3],"scale":[2,2,2]}},{leaf}"#
    );
    let loaded = with(&two, "0").unwrap();
    assert_eq!((loaded.scene.triangles(), messages(&loaded)), (0..2, vec![]));
    let x = |triangle| f64::from(loaded.scene.corners(triangle)[0].x) + loaded.scene.origin.x;
    assert_eq!([x(0), x(1)], [2.0, 4.0]);
    // A node that a scene names twice is there once.
    assert_eq!(with(r#"{"mesh":0}"#, "0,0").unwrap().scene.triangles(), 0..1);
    for (nodes, triangles) in [
        (r#"{"mesh":0,"children":[0]}"#, 0..1),
        (r#"{"mesh":0,"children":[1]},{"children":[2]},{"mesh":0,"children":[1]}"#, 0..2),
    ] {
        let loaded = with(nodes, "0").unwrap();
        assert_eq!(loaded.scene.triangles(), triangles);
        let said = messages(&loaded);
        assert_eq!(said, ["s.gltf: nodes that are their own descendants are left out there (1)"]);
    }
    // Forty nodes with the next one as both children would be 2⁴⁰ copies.
    let mut chain: Vec<String> =
        (1..40).map(|next| format!(r#"{{"children":[{next},{next}]}}"#)).collect();
    chain.push(leaf.to_owned());
    let error = with(&chain.join(","), "0").unwrap_err().to_string();
    assert!(error.contains("copies of them have no end"), "{error}");
}

#[test]
fn false_counts_and_offsets_are_refused_with_the_place() {
    let json = triangle(GREY);
    let cases = [
        (
            json.replace(r#""byteLength":36"#, r#""byteLength":3600"#),
            "ends beyond its buffer, which has 56 bytes",
        ),
        (
            json.replace(r#""count":3,"type":"VEC3""#, r#""count":30,"type":"VEC3""#),
            "accessor 0 of 30 elements is longer than its 36 bytes",
        ),
        (json.replace(r#""mesh":0}"#, r#""mesh":7}"#), "`mesh` of node 0 names element 7"),
        (json.replace("base64,", "base64,*"), "is damaged: its base64 data"),
        (
            json.replace(r#""type":"VEC3""#, r#""type":"VEC2""#),
            "accessor 0 has 2 components, and 3 are needed",
        ),
        (
            json.replace(r#""nodes":[{"mesh":0}]"#, r#""nodes":[{}]"#),
            "no triangle in it: it is glTF whose meshes (1) have no triangle in view",
        ),
        (json.replace(r#""POSITION":0"#, r#""POSITION":9"#), "a mesh names accessor 9 of 3"),
        ("{".to_owned(), "it is not valid glTF"),
        (
            r#"{"asset":{"version":"1.0"},"meshes":{"box":{"primitives":[]}}}"#.to_owned(),
            "it is glTF 1.0, which is not read: export it as glTF 2.0",
        ),
        (r#"{"meshes":{"box":{"primitives":[]}}}"#.to_owned(), "it is glTF 1.0"),
    ];
    for (json, expected) in cases {
        let found = problem(&json);
        assert!(found.contains(expected), "{expected}: {found}");
    }
    assert!(
        problem(&json.replace(r#""count":3,"type":"VEC3""#, r#""count":30,"type":"VEC3""#))
            .starts_with("node 0, mesh tri: ")
    );
}

#[test]
fn textures_lie_as_their_transform_says_and_masks_are_cut_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.png");
    let texels = vec![255, 0, 0, 255, 0, 0, 255, 0];
    image::RgbaImage::from_raw(2, 1, texels).unwrap().save(&path).unwrap();
    let file = base64::engine::general_purpose::STANDARD.encode(std::fs::read(&path).unwrap());
    // The corner at (1, 0, 0) lies at u = 1 of the texture, and the others at 0.
    let load = |transform: &str, mode: &str| {
        let more = format!(
            r#""images":[{{"uri":"data:image/png;base64,{file}"}}],"samplers":[{{"wrapS":33071}}],
            "textures":[{{"source":0,"sampler":0}}],
            "materials":[{{{mode}"pbrMetallicRoughness":{{"metallicFactor":0,"baseColorFactor":[0.5,1,1,1],
              "baseColorTexture":{{"index":0{transform}}}}}}}]"#
        );
        let json = triangle(&more).replace(r#""POSITION":0"#, r#""POSITION":0,"TEXCOORD_0":0"#);
        load(&json).unwrap()
    };
    let scene = load("", "").scene;
    assert_eq!(scene.reflectance(0, 0.0, 0.0, 0.0), [0.5, 0.0, 0.0]);
    assert_eq!(scene.reflectance(0, 1.0, 0.0, 0.0), [0.0, 0.0, 1.0]);
    assert!(!scene.has_cut_outs());
    let moved = r#","extensions":{"KHR_texture_transform":{"offset":[0.5,0],"scale":[-0.5,1]}}"#;
    let scene = load(moved, r#""alphaMode":"MASK","#).scene;
    assert_eq!(scene.reflectance(0, 1.0, 0.0, 0.0), [0.5, 0.0, 0.0]);
    assert!(!scene.is_cut_out(0, 1.0, 0.0));
    // Opacity falls from 1 to 0 between the middles of the texels.
    for (mode, least) in [
        (r#""alphaMode":"MASK","#, 0.5),
        (r#""alphaMode":"MASK","alphaCutoff":0.2,"#, 0.2),
        (r#""alphaMode":"MASK","alphaCutoff":0.8,"#, 0.8),
    ] {
        let scene = load("", mode).scene;
        for opacity in [0.1, 0.3, 0.6, 0.9] {
            let u = 0.75 - 0.5 * opacity;
            assert_eq!(scene.is_cut_out(0, u, 0.0), opacity < least, "{mode} {opacity}");
        }
        assert_eq!(Scene::unpack(&scene.pack()).unwrap(), scene);
    }
}

#[test]
fn normals_turn_with_their_node() {
    let normals = triangle(GREY).replace(r#""POSITION":0"#, r#""POSITION":0,"NORMAL":0"#);
    let flat = load(&normals).unwrap().scene;
    // Positions as normals: 0, x and y. The first is the facet's.
    let near = |found: Option<Vec3>, expected: Vec3| found.unwrap().distance(expected) < 2e-4;
    assert!(near(flat.smooth_normal(0, 0.0, 0.0), Vec3::Z));
    assert!(near(flat.smooth_normal(0, 1.0, 0.0), Vec3::X));
    let turned = normals.replace(
        r#""nodes":[{"mesh":0}]"#,
        r#""nodes":[{"mesh":0,"rotation":[0,0,0.70710678,0.70710678]}]"#,
    );
    let turned = load(&turned).unwrap().scene;
    assert!(near(turned.smooth_normal(0, 1.0, 0.0), Vec3::Y));
}

#[test]
fn pictures_without_a_file_or_a_type_are_left_out_or_found_by_their_bytes() {
    let textured = |image: &str| {
        let material = r#""materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}]"#;
        let more = format!(r#"{material},"textures":[{{"source":0}}],"images":[{image}]"#);
        load(&triangle(&more)).unwrap()
    };
    for (image, problem) in [
        ("{}", "it names no file"),
        (r#"{"mimeType":"image/png"}"#, "it names no file"),
        (r#"{"bufferView":0}"#, "format could not be determined"),
    ] {
        let loaded = textured(image);
        let said: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
        assert!(said.join("\n").contains(problem), "{image}: {said:?}");
        assert!(loaded.scene.shading.is_none(), "{image}");
    }
}

#[test]
fn files_that_require_unknown_extensions_open_if_their_shape_is_there() {
    let more = r#""extensionsRequired":["KHR_texture_basisu"],"extensionsUsed":["KHR_texture_basisu"],
        "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
        "textures":[{"extensions":{"KHR_texture_basisu":{"source":0}}}],"images":[{"uri":"a.ktx2"}]"#;
    let loaded = load(&triangle(more)).unwrap();
    assert_eq!(loaded.scene.triangles().len(), 1);
    let said = messages(&loaded).join("\n");
    for words in ["`KHR_texture_basisu` is ignored (1)", "`a.ktx2` is not in its folder"] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn triangles_that_name_no_vertex_are_left_out_and_counted() {
    let json = triangle(GREY)
        .replace(r#""componentType":5121,"count":3"#, r#""componentType":5121,"count":4"#);
    let fan = json.replace(r#""indices":1"#, r#""mode":6,"indices":1"#);
    assert_eq!(load(&fan).unwrap().scene.triangles().len(), 1);
    let loaded = load(
        &json
            .replace(r#""byteOffset":36,"byteLength":4"#, r#""byteOffset":35,"byteLength":6"#)
            .replace(r#""count":4"#, r#""count":6"#),
    )
    .unwrap_err();
    assert!(loaded.to_string().contains("no triangle"), "{loaded}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Files with some bytes changed give a valid scene or an error.
    #[test]
    fn no_damage_panics(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4), cut in any::<prop::sample::Index>()) {
        let mut bytes = triangle(GREY).into_bytes();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let whole = load_named("s.gltf", &bytes);
        if let Ok(loaded) = whole {
            prop_assert_eq!(&Scene::unpack(&loaded.scene.pack()).unwrap(), &loaded.scene);
        }
        bytes.truncate(cut.index(bytes.len()));
        let _ = load_named("s.gltf", &bytes);
    }
}
