//! Tests glTF files with faults in parts that a picture does not need.

#![allow(clippy::unwrap_used)]

use crate::common::gltf::{
    Arrays, MATERIAL, SQUARE, base64, file, load, load_bytes, problem, square,
};
use crate::common::messages;
use holo_scene::{Bsdf, Loaded};

const MESH_NODE: &str = r#"{"mesh":0}"#;
const PAINT: Bsdf = Bsdf::Diffuse { kd: [0.2, 0.4, 0.6] };

/// The square with a material, and further members of the file.
fn plain(more: &str) -> String {
    file(&square(), &format!(r#"{SQUARE},"material":0"#), MESH_NODE, MATERIAL, more)
}

/// Checks that a file shows the square in its colour, and returns the warnings.
fn shows_the_square(json: &str) -> String {
    let loaded = load(json);
    assert_eq!(loaded.scene.triangles().len(), 2, "{json}");
    assert_eq!(loaded.scene.materials[0].bsdf, PAINT, "{json}");
    messages(&loaded).join("\n")
}

#[test]
fn a_valid_file_gives_no_warning() {
    assert_eq!(shows_the_square(&plain("")), "");
}

#[test]
fn attributes_of_applications_are_ignored_and_counted() {
    let named = plain("").replace(r#""NORMAL":1"#, r#""NORMAL":1,"_FEATURE_ID_0":3,"_X":99"#);
    let said = shows_the_square(&named);
    assert!(said.contains("attributes of vertices for applications are ignored (2)"), "{said}");
    // Unknown names and false indices of attributes without need.
    for more in [r#""TANGENT":99"#, r#""COLOR_1":99"#, r#""TEXCOORD_x":1"#, r#""FOO":null"#] {
        let json = plain("").replace(r#""NORMAL":1"#, &format!(r#""NORMAL":1,{more}"#));
        assert_eq!(shows_the_square(&json), "", "{more}");
    }
    let said = shows_the_square(&plain("").replace(r#""NORMAL":1"#, r#""NORMAL":99"#));
    assert!(said.contains("`NORMAL` of meshes names element 99 of `accessors`"), "{said}");
}

#[test]
fn an_accessor_without_bytes_is_all_zeros() {
    let targets = r#""targets":[{"POSITION":4}]"#;
    let mut arrays = square();
    arrays.accessor(r#""componentType":5126,"count":4,"type":"VEC3""#);
    let with = |weights: &str| {
        let primitive = format!(r#"{SQUARE},"material":0,{targets}"#);
        let node = format!(r#"{{"mesh":0{weights}}}"#);
        shows_the_square(&file(&arrays, &primitive, &node, MATERIAL, ""))
    };
    assert_eq!(with(""), "");
    assert_eq!(with(r#","weights":[1]"#), "");
    // As colours, zeros are black.
    let coloured = SQUARE.replace(r#""NORMAL":1"#, r#""COLOR_0":4"#);
    let json = file(&arrays, &format!(r#"{coloured},"material":0"#), MESH_NODE, MATERIAL, "");
    assert_eq!(load(&json).scene.reflectance(0, 0.2, 0.2, 0.0), [0.0; 3]);
}

#[test]
fn animations_are_counted_whatever_they_are() {
    for animation in [
        r#"{"channels":[{"sampler":0,"target":{"path":"weights"}}],"samplers":[]}"#,
        r#"{"channels":[{"sampler":7,"target":{"path":"colour","node":99}}],"samplers":null}"#,
        "{}",
        "null",
    ] {
        let said = shows_the_square(&plain(&format!(r#","animations":[{animation}]"#)));
        assert_eq!(said, "s.gltf: animations are ignored: the scene stands still (1)");
    }
}

#[test]
fn numbers_that_are_null_or_no_json_have_the_format_s_default() {
    for number in ["null", "NaN", "-Infinity", "1e999", "-nan(ind)", "\"0.5\"", "[]", "{}"] {
        let material = MATERIAL.replace(
            r#""metallicFactor":0"#,
            &format!(r#""metallicFactor":0,"roughnessFactor":{number}"#),
        );
        let json = plain("").replace(MATERIAL, &material);
        let said = shows_the_square(&json);
        assert!(said.contains("`roughnessFactor` of materials is "), "{number}: {said}");
        assert!(said.contains("the format's default is taken (1)"), "{number}: {said}");
    }
    let said = shows_the_square(&plain("").replace(MESH_NODE, r#"{"mesh":0,"scale":[1,null,1]}"#));
    assert!(said.contains("`scale` of nodes is no list of 3 numbers"), "{said}");
    // Members without a value are absent.
    let json = plain(r#","skins":null,"extensionsUsed":null,"scene":null,"extras":null"#)
        .replace(MESH_NODE, r#"{"mesh":0,"children":null,"skin":null,"name":null,"camera":null}"#);
    assert_eq!(shows_the_square(&json), "");
}

#[test]
fn whole_numbers_may_have_a_fraction_of_zero() {
    let json = plain("")
        .replace(r#""count":4"#, r#""count":4.0"#)
        .replace(r#""material":0"#, r#""material":0.0"#);
    assert_eq!(shows_the_square(&json), "");
}

#[test]
fn unknown_words_have_the_format_s_default() {
    let said = shows_the_square(
        &plain("").replace(MATERIAL, &MATERIAL.replacen('{', r#"{"alphaMode":"GLASS","#, 1)),
    );
    assert!(said.contains("`alphaMode` of materials is `GLASS`"), "{said}");
    let cameras = r#","cameras":[{"type":"fish-eye"},{"type":"perspective"},{}]"#;
    let nodes = r#"{"mesh":0},{"camera":0},{"camera":1},{"camera":2}"#;
    let said = shows_the_square(&plain(cameras).replace(MESH_NODE, nodes));
    assert!(said.contains("`camera` of nodes names element 0 of `cameras`"), "{said}");
    assert!(said.contains("cameras without a plausible view are ignored (1)"), "{said}");
    let lights = r#","extensions":{"KHR_lights_punctual":{"lights":[{"type":"area"},{}]}}"#;
    let nodes = r#"{"mesh":0,"extensions":{"KHR_lights_punctual":{"light":0}}}"#;
    let said = shows_the_square(&plain(lights).replace(MESH_NODE, nodes));
    assert!(said.contains("`KHR_lights_punctual` of nodes names element 0 of `lights`"), "{said}");
}

#[test]
fn faults_where_nothing_is_used_do_not_matter() {
    for more in [
        r#","skins":[{"joints":[99]}]"#,
        r#","textures":[{"source":99,"sampler":99}]"#,
        r#","images":[{"bufferView":99}]"#,
        r#","samplers":[{"wrapS":1,"magFilter":7}]"#,
        r#","scene":0,"scenes":[{"nodes":[0]},{"nodes":[99]},null]"#,
        r#","extras":{"a":[1,{"b":null}]},"unknown":7"#,
    ] {
        assert_eq!(shows_the_square(&plain(more)), "", "{more}");
    }
    let said = shows_the_square(&plain(r#","extensionsRequired":["KHR_draco_mesh_compression"]"#));
    assert_eq!(said, "s.gltf: the extension `KHR_draco_mesh_compression` is ignored (1)");
    for (from, to) in [
        (MATERIAL, format!(r#"{MATERIAL},{{"alphaMode":7,"normalTexture":{{"index":99}}}}"#)),
        (MATERIAL, format!("{MATERIAL},null")),
        (
            r#""meshes":["#,
            r#""meshes":[{"primitives":[{"attributes":{"POSITION":99}}]},"#.to_owned(),
        ),
        (r#""bufferViews":["#, r#""bufferViews":[{"buffer":99,"byteLength":-1},"#.to_owned()),
        (r#""buffers":["#, r#""buffers":[{"uri":"nowhere.bin","byteLength":9},"#.to_owned()),
    ] {
        let mut json = plain("").replace(from, &to);
        for (list, member) in [
            ("meshes", r#""mesh":"#),
            ("bufferViews", r#""bufferView":"#),
            ("buffers", r#""buffer":"#),
        ] {
            if from.contains(list) {
                // The file's own element is the second now.
                for k in (0..9).rev() {
                    json = json.replace(&format!("{member}{k},"), &format!("{member}{},", k + 1));
                    json = json.replace(&format!("{member}{k}}}"), &format!("{member}{}}}", k + 1));
                }
            }
        }
        assert_eq!(shows_the_square(&json), "", "{to}");
    }
}

#[test]
fn false_indices_of_nodes_and_scenes_are_counted() {
    let nodes = r#"{"children":[1,99]},{"mesh":0}"#;
    let said = shows_the_square(&plain(r#","scenes":[{"nodes":[0,5]}]"#).replace(MESH_NODE, nodes));
    assert!(said.contains("`nodes` of nodes that do not exist are left out (1)"), "{said}");
    assert!(said.contains("`nodes` of scenes that do not exist are left out (1)"), "{said}");
    let said = shows_the_square(&plain(r#","scene":9,"scenes":[{"nodes":[0]}]"#));
    assert!(said.contains("the scene to show does not exist: the first one is shown"), "{said}");
}

#[test]
fn what_the_picture_needs_is_an_error_with_its_place() {
    for (json, expected) in [
        (plain("").replace(r#""indices":3"#, r#""indices":99"#), "a mesh names accessor 99 of 4"),
        (
            plain("").replace(MESH_NODE, r#"{"mesh":7}"#),
            "`mesh` of node 0 names element 7 of `meshes`, which has 1",
        ),
        (
            plain("").replacen(r#""type":"VEC3""#, r#""type":"VEC9""#, 1),
            "mesh 0 names element 0 of `accessors`, which is not complete",
        ),
        (
            plain("").replacen(r#"{"bufferView":0"#, r#"{"bufferView":99"#, 1),
            "mesh 0 names element 0 of `accessors`, which is not complete",
        ),
        (plain("").replace("data:;base64,", "nowhere"), "is not in its folder: put it there"),
        (plain("").replace(r#""2.0""#, r#""1.0""#), "it is glTF 1.0, which is not read"),
        ("[]".to_owned(), "its JSON is no object"),
        (String::new(), "it is not valid glTF"),
    ] {
        let found = problem(&json);
        assert!(found.contains(expected), "{expected}: {found}");
    }
}

#[test]
fn padding_by_zeros_ends_the_json() {
    let json = plain("") + "\0\0\0 \0";
    assert_eq!(shows_the_square(&json), "");
}

/// Returns the bytes of a binary file.
fn binary(json: &str, chunk: &[u8]) -> Vec<u8> {
    let mut file = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (bytes, kind, padding) in [(json.as_bytes(), b"JSON", 0), (chunk, b"BIN\0", 0)] {
        let length = bytes.len().next_multiple_of(4);
        file.extend((length as u32).to_le_bytes());
        file.extend(kind);
        file.extend(bytes);
        file.resize(file.len().next_multiple_of(4), padding);
    }
    let length = file.len() as u32;
    file[8..12].copy_from_slice(&length.to_le_bytes());
    file
}

#[test]
fn a_binary_file_may_pad_its_json_with_zeros() {
    for more in ["", " ", "  ", "   "] {
        let json = plain("") + more;
        let loaded = load_bytes("s.glb", binary(&json, b"")).unwrap();
        assert_eq!(loaded.scene.triangles().len(), 2);
    }
}

#[test]
fn compressed_geometry_is_named_with_what_to_do() {
    let mut arrays = Arrays::default();
    arrays.accessor(r#""componentType":5126,"count":4,"type":"VEC3""#);
    let draco = r#""extensions":{"KHR_draco_mesh_compression":{"bufferView":0,"attributes":{"POSITION":0}}}"#;
    let primitive = format!(r#""attributes":{{"POSITION":0}},{draco}"#);
    let used = r#","extensionsUsed":["KHR_draco_mesh_compression"]"#;
    let found = problem(&file(&arrays, &primitive, MESH_NODE, "", used));
    assert!(
        found.contains(
            "mesh 0 is compressed by Draco, which is not read: export it without compression"
        ),
        "{found}"
    );
    // With plain arrays beside the compressed ones, these are read.
    let primitive = format!(r#"{SQUARE},"material":0,{draco}"#);
    let said = shows_the_square(&file(&square(), &primitive, MESH_NODE, MATERIAL, ""));
    assert_eq!(said, "");
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let packed = format!(r#""buffer":0,"extensions":{{"{name}":{{"buffer":0}}}},"#);
        let json = plain("").replace(r#""buffer":0,"#, &packed);
        assert_eq!(shows_the_square(&json), "", "plain bytes are there");
        let start = json.find(r#","uri":"data:;base64,"#).unwrap();
        let end = start + json[start..].find('}').unwrap();
        let found = problem(&(json[..start].to_owned() + &json[end..]));
        assert!(found.contains("it is compressed by meshopt (gltfpack)"), "{found}");
    }
}

#[test]
fn other_files_with_the_suffix_are_recognised() {
    for (bytes, what) in [
        (
            &b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n"[..],
            "a pointer of Git LFS",
        ),
        (b"<!DOCTYPE html><html>404 not found</html>", "a web page"),
        (b"\x1f\x8b\x08\0\0\0\0\0", "compressed by gzip"),
        (b"#usda 1.0", "a USD file"),
        (b"PK\x03\x04", "a zip archive"),
    ] {
        for name in ["s.gltf", "s.obj"] {
            let error = load_bytes(name, bytes).unwrap_err().to_string();
            assert!(error.contains(what), "{name}: {error}");
        }
    }
}

#[test]
fn pointers_of_git_lfs_in_place_of_other_files_are_named() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n";
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.bin", "a.png", "a.mtl"] {
        std::fs::write(folder.path().join(name), pointer).unwrap();
    }
    let load = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        holo_scene::load(&path, &holo_scene::LoadOptions::default())
    };
    let json = plain("");
    let start = json.find("data:;base64,").unwrap();
    let end = start + json[start..].find('"').unwrap();
    let json = json.replace(&json[start..end], "a.bin");
    let error = load("s.gltf", &json).unwrap_err().to_string();
    assert!(error.contains("`a.bin`: it is a pointer of Git LFS"), "{error}");
    let said =
        messages(&load("s.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap());
    assert!(said[0].contains("it is a pointer of Git LFS"), "{said:?}");
    std::fs::write(folder.path().join("t.mtl"), "newmtl m\nKd 1 1 1\nmap_Kd a.png\n").unwrap();
    let obj = "mtllib t.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
    let said = messages(&load("s.obj", obj).unwrap());
    assert!(said[0].contains("it is a pointer of Git LFS"), "{said:?}");
}

fn textured(image: &str, texture: &str) -> Loaded {
    let material =
        r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0},"metallicFactor":0}}"#;
    let more = format!(r#","images":[{image}],"textures":[{texture}]"#);
    load(&file(&square(), &format!(r#"{SQUARE},"material":0"#), MESH_NODE, material, &more))
}

/// A picture of one colour in a format.
fn picture(format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    // Linear 0.2, 0.4 and 0.6.
    let image = image::RgbImage::from_pixel(8, 8, image::Rgb([124, 170, 203]));
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn is_near(found: [f32; 3], expected: [f32; 3]) -> bool {
    found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.01)
}

#[test]
fn pictures_in_web_gif_and_tiff_formats_are_read() {
    for format in [image::ImageFormat::WebP, image::ImageFormat::Gif, image::ImageFormat::Tiff] {
        let uri = format!(r#"{{"uri":"data:;base64,{}"}}"#, base64(&picture(format)));
        let loaded = textured(&uri, r#"{"source":0}"#);
        let found = loaded.scene.reflectance(0, 0.2, 0.2, 0.0);
        assert!(is_near(found, [0.2, 0.4, 0.6]), "{format:?}: {found:?}");
        assert_eq!(loaded.warnings, []);
    }
    // Beside a picture that is read, or alone.
    let webp = base64(&picture(image::ImageFormat::WebP));
    let image = format!(r#"{{"uri":"data:image/webp;base64,{webp}"}}"#);
    for source in ["", r#""source":99,"#] {
        let texture = format!(r#"{{{source}"extensions":{{"EXT_texture_webp":{{"source":0}}}}}}"#);
        let loaded = textured(&image, &texture);
        assert!(is_near(loaded.scene.reflectance(0, 0.2, 0.2, 0.0), [0.2, 0.4, 0.6]));
    }
}

#[test]
fn a_texture_that_cannot_be_read_is_grey() {
    let ktx2 = base64(b"\xabKTX 20\xbb\r\n\x1a\n\0\0\0\0");
    let ktx2 = format!(r#"{{"uri":"data:;base64,{ktx2}"}}"#);
    for (image, texture, problem) in [
        (r#"{"uri":"nowhere.png"}"#, r#"{"source":0}"#, "is not in its folder"),
        (&ktx2, r#"{"source":0}"#, "it is a KTX2 picture, which is not read"),
        (&ktx2, r#"{"extensions":{"KHR_texture_basisu":{"source":0}}}"#, "it is a KTX2 picture"),
        (&ktx2, "{}", "textures without a picture are left out"),
        (&ktx2, "null", "textures without a picture are left out"),
    ] {
        let loaded = textured(image, texture);
        assert_eq!(loaded.scene.materials[0].bsdf, Bsdf::Diffuse { kd: [0.5; 3] }, "{texture}");
        let said = messages(&loaded).join("\n");
        assert!(said.contains(problem), "{problem}: {said}");
        assert!(said.contains("darkened as by grey 0.5 (1)"), "{said}");
    }
    // A texture that does not exist is missing, too.
    let material =
        r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":3},"metallicFactor":0}}"#;
    let json = file(&square(), &format!(r#"{SQUARE},"material":0"#), MESH_NODE, material, "");
    assert_eq!(load(&json).scene.materials[0].bsdf, Bsdf::Diffuse { kd: [0.5; 3] });
    // Nothing says that the surface is a metal or shines.
    let material = r#"{"emissiveFactor":[1,1,1],"emissiveTexture":{"index":3},
        "pbrMetallicRoughness":{"baseColorFactor":[0.5,0.5,0.5,1],"metallicRoughnessTexture":{"index":3}}}"#;
    let json = file(&square(), &format!(r#"{SQUARE},"material":0"#), MESH_NODE, material, "");
    let made = load(&json).scene.materials[0].clone();
    assert_eq!((made.bsdf, made.emission), (Bsdf::Diffuse { kd: [0.5; 3] }, [0.0; 3]));
}

#[test]
fn surfaces_of_which_nothing_is_stated_are_plaster() {
    let of = |primitive: &str, materials: &str| {
        let loaded = load(&file(&square(), primitive, MESH_NODE, materials, ""));
        (loaded.scene.clone(), messages(&loaded).join("\n"))
    };
    let grey = Bsdf::Diffuse { kd: [0.5; 3] };
    let (scene, said) = of(SQUARE, "");
    assert_eq!(scene.materials[0].bsdf, grey);
    assert_eq!(
        said,
        "s.gltf: meshes without a material are taken as plaster of reflectance 0.5 (1)"
    );
    for material in [
        r#"{"name":"wall"}"#,
        r#"{"pbrMetallicRoughness":{}}"#,
        r#"{"doubleSided":true}"#,
        // A member at a false place states nothing.
        r#"{"pbrMetallicRoughness":{"pbrMetallicRoughness":{"metallicFactor":0},"name":"a"}}"#,
    ] {
        let (scene, said) = of(&format!(r#"{SQUARE},"material":0"#), material);
        assert_eq!(scene.materials[0].bsdf, grey, "{material}");
        assert!(said.contains("materials that state no colour are taken as plaster"), "{said}");
    }
    // What is stated counts.
    let metal = r#"{"pbrMetallicRoughness":{"roughnessFactor":0.5}}"#;
    let (scene, said) = of(&format!(r#"{SQUARE},"material":0"#), metal);
    assert_eq!(scene.materials[0].bsdf, Bsdf::Conductor { ks: [1.0; 3], alpha: 0.25 });
    assert_eq!(said, "");
    let glass = r#"{"extensions":{"KHR_materials_transmission":{"transmissionFactor":1}}}"#;
    let (scene, _) = of(&format!(r#"{SQUARE},"material":0"#), glass);
    assert!(matches!(scene.materials[0].bsdf, Bsdf::ThinGlass { .. }));
    // Colours of vertices are those of the surface, not of a metal.
    let mut arrays = square();
    arrays.add(&[255, 128, 0, 0].repeat(4), 5121, "VEC4", 4, r#","normalized":true"#);
    let coloured = SQUARE.replace(r#""NORMAL":1"#, r#""COLOR_0":4"#);
    for (primitive, materials) in
        [(coloured.clone(), ""), (format!(r#"{coloured},"material":0"#), r#"{"name":"a"}"#)]
    {
        let scene = load(&file(&arrays, &primitive, MESH_NODE, materials, "")).scene;
        assert_eq!(scene.materials[0].bsdf, Bsdf::Diffuse { kd: [1.0; 3] });
        assert!(is_near(scene.reflectance(0, 0.2, 0.2, 0.0), [1.0, 0.502, 0.0]));
    }
}

#[test]
fn a_turn_in_a_picture_s_metadata_is_named() {
    let mut jpeg = Vec::new();
    let image = image::RgbImage::from_pixel(8, 8, image::Rgb([124, 170, 203]));
    image.write_to(&mut std::io::Cursor::new(&mut jpeg), image::ImageFormat::Jpeg).unwrap();
    // Orientation 6 in little-endian EXIF, after the start of the image.
    let mut exif =
        b"\xff\xe1\0\x22Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
            .to_vec();
    exif.splice(0..0, [0xff, 0xd8]);
    let turned = [&exif[..], &jpeg[2..]].concat();
    let load = |bytes: &[u8]| {
        let loaded =
            textured(&format!(r#"{{"uri":"data:;base64,{}"}}"#, base64(bytes)), r#"{"source":0}"#);
        assert!(is_near(loaded.scene.reflectance(0, 0.2, 0.2, 0.0), [0.2, 0.4, 0.6]));
        messages(&loaded).join("\n")
    };
    assert_eq!(load(&jpeg), "");
    assert!(load(&turned).contains("the orientation in their EXIF data is not applied"));
}
