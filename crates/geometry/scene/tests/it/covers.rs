//! Tests where surfaces are: opacity in files, its packing, and its values at points.

#![allow(clippy::unwrap_used)]

use crate::common::{load_in, messages};
use holo_scene::{Bsdf, Channel, Cover, LoadOptions, Loaded, Scene, Warning};
use std::path::Path;

const KD: [f32; 3] = [0.25, 0.5, 0.75];

/// Writes a picture of two texels with these opacities.
fn picture(path: &Path, opacities: [u8; 2]) {
    let raw = opacities.map(|opacity| [255, 255, 255, opacity]).concat();
    image::RgbaImage::from_raw(2, 1, raw).unwrap().save(path).unwrap();
}

/// Loads a triangle with these statements about its material.
fn obj(mtl: &str) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    picture(&folder.path().join("mask.png"), [255, 0]);
    picture(&folder.path().join("veil.png"), [51, 255]);
    picture(&folder.path().join("whole.png"), [255, 255]);
    std::fs::write(folder.path().join("s.mtl"), format!("newmtl m\nKd 0.25 0.5 0.75\n{mtl}\n"))
        .unwrap();
    let obj = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.25 0\nvt 0.75 0\nvt 0.25 1\n\
               usemtl m\nf 1/1 2/2 3/3\n";
    load_in(folder.path(), obj, &LoadOptions::default()).unwrap()
}

/// Returns the opacities of a triangle at its first two corners. The scene must be equal to its
/// packed form.
fn opacities(scene: &Scene) -> [f32; 2] {
    assert_eq!(Scene::unpack(&scene.pack()).unwrap(), *scene);
    [[0.0, 0.0], [1.0, 0.0]].map(|[u, v]| scene.opacity(0, u, v))
}

fn are_near(found: [f32; 2], expected: [f32; 2]) -> bool {
    found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6)
}

#[test]
fn d_and_tr_and_map_d_are_coverage_at_every_value() {
    for (mtl, expected) in [
        ("d 1", [1.0; 2]),
        ("Tr 1", [1.0; 2]),
        ("d 0.7", [0.7; 2]),
        ("d 0.1\nillum 2", [0.1; 2]),
        ("d 0.5\nKs 1 1 1\nillum 2", [0.5; 2]),
        ("Ks 1 1 1\nd 0.4\nillum 3", [0.4; 2]),
        ("Tr 0.25", [0.75; 2]),
        ("d 0.25\nTr 0", [0.25; 2]),
        ("d 0.3\nPr 0.2", [0.3; 2]),
        ("d 0.3\nTf 1 1 1", [0.3; 2]),
        ("d 0.3\nillum 4", [1.0; 2]),
        ("d 0.3\nillum 7", [1.0; 2]),
        ("map_d -clamp on mask.png", [1.0, 0.0]),
        ("map_d -clamp on veil.png", [0.2, 1.0]),
        ("map_d -clamp on whole.png", [1.0; 2]),
        ("d 0\nmap_d -clamp on mask.png", [1.0, 0.0]),
        ("Tr 1\nmap_d -clamp on veil.png", [0.2, 1.0]),
        ("d 0.5\nmap_d -clamp on veil.png", [0.1, 0.5]),
        ("d 0.5\nmap_d -clamp on mask.png", [0.5, 0.0]),
    ] {
        let loaded = obj(mtl);
        let found = opacities(&loaded.scene);
        assert!(are_near(found, expected), "{mtl}: {found:?}");
        let of_covers = |warning: &&Warning| !warning.text.contains("enclose nothing");
        assert_eq!(loaded.warnings.iter().find(of_covers), None, "{mtl}");
        let is_whole = expected == [1.0; 2];
        assert_eq!(loaded.scene.has_covers(), !is_whole, "{mtl}");
        assert!(!is_whole || loaded.scene.shading.is_none(), "{mtl}");
    }
    let nowhere = obj("d 0");
    assert_eq!(opacities(&nowhere.scene), [0.0; 2]);
    assert!(messages(&nowhere)[0].contains("it is nowhere: its `d` is 0"));
}

#[test]
fn tf_in_colour_beside_d_tints_the_light_that_passes() {
    let scene = obj("d 0.25\nTf 1 0.5 0\nillum 2").scene;
    let pane = Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0, 0.5, 0.0] };
    assert_eq!(scene.materials[0].bsdf, pane);
    let base = scene.base(0).unwrap();
    assert_eq!(base.bsdf, Bsdf::Diffuse { kd: KD });
    assert_eq!((scene.glass_share(0, 0.3, 0.3), opacities(&scene)), (Some(0.75), [1.0; 2]));
}

/// Loads a triangle with members of its glTF material and of its accessor of colours. Its vertices
/// have opacities 0, 0.2 and 1.
fn gltf(material: &str, colours: &str) -> Loaded {
    let mut bytes = Vec::new();
    let positions = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let uvs = [[0.25f32, 0.0], [0.75, 0.0], [0.25, 0.0]];
    let vertex = [[255u8, 255, 255, 0], [255, 255, 255, 51], [255; 4]];
    positions.as_flattened().iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    uvs.as_flattened().iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    bytes.extend(vertex.as_flattened());
    use base64::Engine;
    let encode = |bytes: &[u8]| base64::engine::general_purpose::STANDARD.encode(bytes);
    let folder = tempfile::tempdir().unwrap();
    let image = |opacities| {
        let path = folder.path().join("t.png");
        picture(&path, opacities);
        let file = encode(&std::fs::read(&path).unwrap());
        format!(r#"{{"uri":"data:image/png;base64,{file}"}}"#)
    };
    let images = [image([51, 255]), image([0, 255])].join(",");
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"scenes":[{{"nodes":[0]}}],"scene":0,
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1{colours}}},
        "material":0}}]}}],
        "buffers":[{{"byteLength":{},"uri":"data:application/octet-stream;base64,{}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":24}},
        {{"buffer":0,"byteOffset":60,"byteLength":12}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
        {{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}},
        {{"bufferView":2,"componentType":5121,"normalized":true,"count":3,"type":"VEC4"}}],
        "images":[{images}],"samplers":[{{"wrapS":33071}}],
        "textures":[{{"source":0,"sampler":0}},{{"source":1,"sampler":0}}],
        "materials":[{{{material}}}]}}"#,
        bytes.len(),
        encode(&bytes)
    );
    let path = folder.path().join("s.gltf");
    std::fs::write(&path, json).unwrap();
    holo_scene::load(&path, &LoadOptions::default()).unwrap()
}

fn pbr(alpha: f32, texture: Option<u32>) -> String {
    let texture =
        texture.map_or(String::new(), |t| format!(r#","baseColorTexture":{{"index":{t}}}"#));
    format!(
        r#""pbrMetallicRoughness":{{"metallicFactor":0,"baseColorFactor":[0.25,0.5,0.75,{alpha}]{texture}}}"#
    )
}

#[test]
fn gltf_alpha_is_the_product_of_factor_texture_and_vertices() {
    const VERTICES: &str = r#","COLOR_0":2"#;
    let of = |mode: &str| format!(r#""alphaMode":"{mode}""#);
    let cutoff = |cutoff: f32| format!(r#""alphaMode":"MASK","alphaCutoff":{cutoff}"#);
    for (mode, alpha, texture, vertices, expected) in [
        (of("OPAQUE"), 0.3, Some(0), VERTICES, [1.0; 2]),
        (of("BLEND"), 0.7, None, "", [0.7; 2]),
        (of("BLEND"), 0.5, Some(0), "", [0.1, 0.5]),
        (of("BLEND"), 1.0, Some(1), "", [0.0, 1.0]),
        (of("BLEND"), 1.0, None, VERTICES, [0.0, 0.2]),
        (of("BLEND"), 0.5, None, VERTICES, [0.0, 0.1]),
        (of("BLEND"), 0.5, Some(1), VERTICES, [0.0, 0.1]),
        (of("BLEND"), 1.0, Some(1), VERTICES, [0.0, 0.2]),
        (of("BLEND"), 0.0, None, "", [0.0; 2]),
        (of("MASK"), 0.2, None, "", [0.0; 2]),
        (of("MASK"), 0.6, None, "", [1.0; 2]),
        (cutoff(0.1), 0.2, None, "", [1.0; 2]),
        (cutoff(0.1), 1.0, None, VERTICES, [0.0, 1.0]),
        (cutoff(0.1), 0.4, None, VERTICES, [0.0; 2]),
        (cutoff(0.15), 1.0, Some(0), VERTICES, [0.0, 1.0]),
        (cutoff(0.25), 1.0, Some(0), VERTICES, [0.0; 2]),
        (cutoff(0.0), 0.0, None, "", [1.0; 2]),
        (cutoff(1.5), 1.0, None, "", [0.0; 2]),
        (of("MASK"), 0.4, Some(0), "", [0.0; 2]),
    ] {
        let what = format!("{mode} {alpha} {texture:?} {vertices}");
        let loaded = gltf(&format!("{mode},{}", pbr(alpha, texture)), vertices);
        let found = opacities(&loaded.scene);
        assert!(are_near(found, expected), "{what}: {found:?}");
        assert!(loaded.warnings.is_empty(), "{what}: {:?}", loaded.warnings);
        assert_eq!(loaded.scene.has_covers(), expected != [1.0; 2], "{what}");
    }
}

#[test]
fn transmission_is_glass_for_a_share_of_the_light() {
    let pane = Bsdf::ThinGlass { ior: 1.5, transmittance: KD };
    for (members, share) in [
        (r#""transmissionFactor":1"#, None),
        (r#""transmissionFactor":0.45"#, Some([0.45; 2])),
        (r#""transmissionFactor":0.9,"transmissionTexture":{"index":0}"#, Some([0.9; 2])),
    ] {
        let glass = format!(r#""extensions":{{"KHR_materials_transmission":{{{members}}}}}"#);
        let loaded = gltf(&format!("{glass},{}", pbr(1.0, None)), "");
        let scene = &loaded.scene;
        assert_eq!(Scene::unpack(&scene.pack()).unwrap(), *scene);
        assert_eq!(scene.materials[0].bsdf, pane);
        let found = share.map(|_| [0.0, 1.0].map(|u| scene.glass_share(0, u, 0.0).unwrap()));
        assert_eq!((found, scene.base(0).is_some()), (share, share.is_some()), "{members}");
        let base = scene.base(0).map(|base| base.bsdf);
        assert!(base.is_none_or(|base| base == Bsdf::Diffuse { kd: KD }), "{base:?}");
    }
    let none = r#""extensions":{"KHR_materials_transmission":{"transmissionFactor":0}}"#;
    let scene = gltf(&format!("{none},{}", pbr(1.0, None)), "").scene;
    assert_eq!((scene.materials[0].bsdf, scene.shading), (Bsdf::Diffuse { kd: KD }, None));
    // Solid glass is always there.
    let solid = r#""alphaMode":"BLEND","extensions":{
        "KHR_materials_transmission":{"transmissionFactor":1},
        "KHR_materials_volume":{"thicknessFactor":1}}"#;
    let loaded = gltf(&format!("{solid},{}", pbr(0.5, None)), "");
    assert_eq!(opacities(&loaded.scene), [1.0; 2]);
    let expected = "s.gltf: materials of solid glass with an alpha are whole (1)";
    assert_eq!(messages(&loaded)[0], expected);
}

#[test]
fn impossible_covers_are_refused() {
    let scene = obj("d 0.5\nTf 1 0.5 0").scene;
    let mut shading = *scene.shading.clone().unwrap();
    for bad in [-0.1, 1.5, f32::NAN] {
        shading.covers[0].opacity = bad;
        assert!(scene.clone().with_shading(shading.clone()).is_err());
    }
    shading.covers[0] = Cover { least: 2.0, ..Cover::default() };
    assert!(scene.clone().with_shading(shading.clone()).is_err());
    shading.covers[0] = Cover { texture: Some(3), ..Cover::default() };
    assert!(scene.clone().with_shading(shading.clone()).is_err());
    let mut base = scene.base(0).unwrap();
    base.glass = Channel { texture: None, channel: 3, factor: 0.5 };
    shading.covers[0] = Cover { base: Some(base), ..Cover::default() };
    assert!(scene.clone().with_shading(shading.clone()).is_err());
    base = holo_scene::Base { bsdf: scene.materials[0].bsdf, ..scene.base(0).unwrap() };
    shading.covers[0] = Cover { base: Some(base), ..Cover::default() };
    assert!(scene.clone().with_shading(shading).is_err());
}
