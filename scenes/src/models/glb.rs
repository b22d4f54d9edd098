//! A binary glTF file as Blender exports it: +y up, a camera, a point light, a sun,
//! metallic-roughness and normals by textures.

use std::fmt::Write;

use glam::{DVec2, DVec3};

use super::parts::PartFace;
use super::png;

/// Materials: name and its members.
const MATERIALS: [(&str, &str); 5] = [
    (
        "Wall",
        r#""pbrMetallicRoughness":{"baseColorFactor":[0.8,0.77,0.7,1],"metallicFactor":0,"roughnessFactor":0.9}"#,
    ),
    (
        "Floor",
        r#""normalTexture":{"index":1},"pbrMetallicRoughness":{"baseColorTexture":{"index":0},"metallicRoughnessTexture":{"index":2}}"#,
    ),
    (
        "Table",
        r#""pbrMetallicRoughness":{"baseColorFactor":[0.9,0.85,0.75,1],"metallicFactor":1,"roughnessFactor":0.35}"#,
    ),
    (
        "Glass",
        r#""pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0},"extensions":{"KHR_materials_transmission":{"transmissionFactor":1}}"#,
    ),
    (
        "Vase",
        r#""pbrMetallicRoughness":{"baseColorFactor":[0.6,0.12,0.1,1],"metallicFactor":0,"roughnessFactor":0.2}"#,
    ),
];

/// Returns the bytes of a model. Faces are fans.
pub(super) fn glb(faces: &[PartFace]) -> Vec<u8> {
    let turn = |v: DVec3| [v.x as f32, v.z as f32, -v.y as f32];
    let (mut binary, mut views) = (Vec::new(), String::new());
    let (mut accessors, mut primitives) = (String::new(), String::new());
    let mut count = 0;
    for (number, (name, _)) in MATERIALS.iter().enumerate() {
        let (mut points, mut normals, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
        for face in faces.iter().filter(|face| face.material == *name) {
            for k in 2..face.corners.len() {
                for corner in [0, k - 1, k] {
                    points.push(turn(face.corners[corner]));
                    normals.push(turn(face.normals[corner]));
                    let DVec2 { x, y } = face.uvs[corner];
                    uvs.push([x as f32, 1.0 - y as f32]);
                }
            }
        }
        let (low, high) = points.iter().fold(([f32::MAX; 3], [f32::MIN; 3]), |(low, high), p| {
            let each = |f: fn(f32, f32) -> f32, a: [f32; 3]| std::array::from_fn(|k| f(a[k], p[k]));
            (each(f32::min, low), each(f32::max, high))
        });
        let vertices = points.len();
        let bounds = format!(r#","min":{low:?},"max":{high:?}"#);
        for (numbers, kind, bounds) in [
            (points.concat(), "VEC3", bounds.as_str()),
            (normals.concat(), "VEC3", ""),
            (uvs.concat(), "VEC2", ""),
        ] {
            let (offset, length) = (binary.len(), 4 * numbers.len());
            binary.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
            let _ = write!(views, r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}},"#);
            let _ = write!(
                accessors,
                r#"{{"bufferView":{count},"componentType":5126,"count":{vertices},"type":"{kind}"{bounds}}},"#
            );
            count += 1;
        }
        let [p, n, t] = [count - 3, count - 2, count - 1];
        let _ = write!(
            primitives,
            r#"{{"attributes":{{"POSITION":{p},"NORMAL":{n},"TEXCOORD_0":{t}}},"material":{number}}},"#
        );
    }
    for picture in [png::tiles(), png::tile_normals(), png::tile_finish()] {
        let (offset, length) = (binary.len(), picture.len());
        let _ = write!(views, r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}},"#);
        binary.extend(picture);
        binary.resize(binary.len().next_multiple_of(4), 0);
    }
    let picture = |number: usize, name: &str| {
        let view = count + number;
        format!(r#"{{"bufferView":{view},"mimeType":"image/png","name":"{name}"}}"#)
    };
    let images = [picture(0, "tiles"), picture(1, "bevels"), picture(2, "gloss")].join(",");
    let materials =
        MATERIALS.map(|(name, members)| format!(r#"{{"name":"{name}",{members}}}"#)).join(",");
    let trimmed = |list: &str| list.trim_end_matches(',').to_owned();
    let json = format!(
        r#"{{"asset":{{"generator":"Khronos glTF Blender I/O v4.1.62","version":"2.0"}},
"extensionsUsed":["KHR_lights_punctual","KHR_materials_transmission"],
"extensions":{{"KHR_lights_punctual":{{"lights":[{{"name":"Lamp","type":"point","color":[1,0.9,0.75],"intensity":120}},{{"name":"Sun","type":"directional","color":[1,0.95,0.85],"intensity":2049}}]}}}},
"scene":0,"scenes":[{{"name":"Scene","nodes":[0,1,2,3]}}],
"nodes":[{{"mesh":0,"name":"Kitchen"}},{{"camera":0,"name":"Camera","translation":[0.5,1.5,-0.5],"rotation":[-0.0825,-0.4287,-0.0393,0.8988]}},
{{"extensions":{{"KHR_lights_punctual":{{"light":0}}}},"name":"Lamp","translation":[2.6,2.2,-1.8]}},
{{"extensions":{{"KHR_lights_punctual":{{"light":1}}}},"name":"Sun","rotation":[-0.8345,0.4172,0.0,0.3599]}}],
"cameras":[{{"name":"Camera","type":"perspective","perspective":{{"yfov":0.9,"znear":0.1}}}}],
"materials":[{materials}],"textures":[{{"sampler":0,"source":0}},{{"sampler":0,"source":1}},{{"sampler":0,"source":2}}],"samplers":[{{}}],
"images":[{images}],
"meshes":[{{"name":"Kitchen","primitives":[{}]}}],
"accessors":[{}],"bufferViews":[{}],"buffers":[{{"byteLength":{}}}]}}"#,
        trimmed(&primitives),
        trimmed(&accessors),
        trimmed(&views),
        binary.len()
    );
    let mut text = json.into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut file = b"glTF".to_vec();
    let total = 12 + 8 + text.len() + 8 + binary.len();
    file.extend([2u32, total as u32].iter().flat_map(|n| n.to_le_bytes()));
    for (bytes, kind) in [(&text, b"JSON"), (&binary, b"BIN\0")] {
        file.extend((bytes.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(bytes);
    }
    file
}
