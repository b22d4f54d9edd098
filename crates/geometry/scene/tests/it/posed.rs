//! Tests instances, skins, morph targets, hidden nodes and quantized meshes of glTF files.

#![allow(clippy::unwrap_used)]

use crate::common::gltf::{Arrays, MATERIAL, SQUARE, file, load, problem, square};
use crate::common::messages;
use glam::{DVec3, Vec3};
use holo_scene::Scene;

/// Returns the bounds of each triangle's square, in order, rounded to thousandths.
fn squares(scene: &Scene) -> Vec<([f64; 3], [f64; 3])> {
    let rounded = |p: DVec3| ((p * 1000.0).round() / 1000.0 + 0.0).to_array();
    let mut found: Vec<([f64; 3], [f64; 3])> = scene
        .triangles()
        .step_by(2)
        .map(|t| {
            let corners = [t, t + 1].map(|t| scene.corners(t)).as_flattened().to_vec();
            let low = corners.iter().copied().fold(Vec3::INFINITY, Vec3::min);
            let high = corners.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
            [low, high].map(|p| rounded(p.as_dvec3() + scene.origin)).into()
        })
        .collect();
    found.sort_by(|a, b| a.partial_cmp(b).unwrap());
    found
}

fn at(arrays: &Arrays, primitive: &str, nodes: &str, more: &str) -> Scene {
    load(&file(arrays, &format!(r#"{primitive},"material":0"#), nodes, MATERIAL, more)).scene
}

fn instanced(attributes: &str) -> String {
    format!(
        r#"{{"mesh":0,"scale":[0.5,0.5,0.5],"extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{{attributes}}}}}}}}}"#
    )
}

#[test]
fn instances_of_a_node_are_placed_relative_to_it() {
    let mut arrays = square();
    arrays.floats("VEC3", &[-4.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 8.0, 0.0]);
    arrays.floats("VEC3", &[1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
    // A quarter about z, as shares of 127.
    arrays.add(
        &[0, 0, 0, 127, 0, 0, 0, 127, 0, 0, 90, 90],
        5120,
        "VEC4",
        3,
        r#","normalized":true"#,
    );
    let plain = at(&arrays, SQUARE, &instanced(r#""TRANSLATION":4"#), "");
    let square = |x: f64, y: f64, half: f64| ([x - half, y - 0.5, 0.0], [x + half, y + 0.5, 0.0]);
    assert_eq!(
        squares(&plain),
        [square(-2.0, 0.0, 0.5), square(0.0, 4.0, 0.5), square(2.0, 0.0, 0.5)]
            .map(|(low, high)| (low, high))
    );
    let scaled = at(&arrays, SQUARE, &instanced(r#""TRANSLATION":4,"SCALE":5,"ROTATION":6"#), "");
    assert_eq!(
        squares(&scaled),
        [square(-2.0, 0.0, 0.5), square(0.0, 4.0, 0.5), square(2.0, 0.0, 1.0)]
    );
    // Rotation turns the normal: about x, by half a turn.
    let mut arrays = crate::common::gltf::square();
    arrays.floats("VEC4", &[1.0, 0.0, 0.0, 0.0]);
    let turned = at(&arrays, SQUARE, &instanced(r#""ROTATION":4"#), "");
    assert!(turned.normal(0).distance(Vec3::NEG_Z) < 1e-6);
}

#[test]
fn false_arrays_of_instances_are_left_out_and_their_number_is_bounded() {
    let loaded = load(&file(
        &square(),
        &format!(r#"{SQUARE},"material":0"#),
        &instanced(r#""TRANSLATION":99"#),
        MATERIAL,
        "",
    ));
    assert_eq!(loaded.scene.triangles().len(), 2);
    let said = messages(&loaded).join("\n");
    assert!(said.contains("`TRANSLATION` of nodes names element 99 of `accessors`"), "{said}");
    // Without bytes, a small file could state any number.
    for count in [1_u64 << 40, 2 << 20] {
        let mut arrays = square();
        arrays.accessor(&format!(r#""componentType":5126,"count":{count},"type":"VEC3""#));
        let primitive = format!(r#"{SQUARE},"material":0"#);
        let nodes = instanced(r#""TRANSLATION":4"#);
        let found = problem(&file(&arrays, &primitive, &nodes, MATERIAL, ""));
        assert!(found.contains("elements and no bytes"), "{count}: {found}");
    }
}

#[test]
fn many_instances_of_a_large_mesh_share_it() {
    // A strip of 100 squares, 2,000 times.
    let mut arrays = Arrays::default();
    let corners: Vec<f32> = (0..202_u8)
        .flat_map(|k| [f32::from(k / 2), f32::from(k % 2), f32::from(k) * 0.01])
        .collect();
    arrays.floats("VEC3", &corners);
    let places: Vec<f32> = (0..2000_u16).flat_map(|k| [0.0, f32::from(k) * 2.0, 0.0]).collect();
    arrays.floats("VEC3", &places);
    let nodes = instanced(r#""TRANSLATION":1"#);
    let scene = at(&arrays, r#""attributes":{"POSITION":0},"mode":5"#, &nodes, "");
    assert_eq!(scene.triangles().len(), 2000 * 200);
    assert_eq!(scene.instances().len(), 2000);
}

/// A square whose four corners follow joints 0 and 1 with these weights.
fn skinned(weights: [[f32; 2]; 4]) -> Arrays {
    let mut arrays = square();
    arrays.add(&[0, 1, 0, 0].repeat(4), 5121, "VEC4", 4, "");
    let weights: Vec<f32> = weights.iter().flat_map(|[a, b]| [*a, *b, 0.0, 0.0]).collect();
    arrays.floats("VEC4", &weights);
    arrays
}

const SKINNED: &str =
    r#""attributes":{"POSITION":0,"NORMAL":1,"JOINTS_0":4,"WEIGHTS_0":5},"indices":3"#;

#[test]
fn a_skin_has_the_pose_of_its_joints() {
    // Its own node does not place it.
    let nodes = r#"{"mesh":0,"skin":0,"translation":[100,0,0]},{"translation":[5,0,0],"children":[2]},
        {"scale":[0.25,0.25,0.25]}"#;
    let skins = r#","skins":[{"joints":[2]}]"#;
    let arrays = skinned([[1.0, 0.0]; 4]);
    let scene = at(&arrays, SKINNED, nodes, skins);
    assert_eq!(squares(&scene), [([4.75, -0.25, 0.0], [5.25, 0.25, 0.0])]);
    assert!(messages(&load(&file(&arrays, SKINNED, nodes, "", skins))).len() == 1);
    // The inverse of the bind matrix applies first: here it undoes a translation by 1.
    let mut bound = skinned([[1.0, 0.0]; 4]);
    let mut unbind =
        glam::Mat4::from_translation(Vec3::new(-1.0, 0.0, 0.0)).to_cols_array().to_vec();
    unbind.extend(glam::Mat4::IDENTITY.to_cols_array());
    let matrices = bound.floats("MAT4", &unbind);
    let skins = format!(r#","skins":[{{"joints":[2,1],"inverseBindMatrices":{matrices}}}]"#);
    let scene = at(&bound, SKINNED, nodes, &skins);
    assert_eq!(squares(&scene), [([4.5, -0.25, 0.0], [5.0, 0.25, 0.0])]);
}

#[test]
fn weights_blend_joints_and_need_not_sum_to_one() {
    let nodes = r#"{"mesh":0,"skin":0},{},{"translation":[0,2,0]}"#;
    let skins = r#","skins":[{"joints":[1,2]}]"#;
    // The upper corners move by half, the lower ones not at all.
    let weights = [[1.0, 0.0], [3.0, 0.0], [1.0, 1.0], [0.25, 0.25]];
    let scene = at(&skinned(weights), SKINNED, nodes, skins);
    assert_eq!(squares(&scene), [([-1.0, -1.0, 0.0], [1.0, 2.0, 0.0])]);
    // Vertices without weights stay where their node is.
    let scene = at(
        &skinned([[0.0; 2]; 4]),
        SKINNED,
        &nodes.replacen("{", r#"{"translation":[0,0,3],"#, 1),
        skins,
    );
    assert_eq!(squares(&scene), [([-1.0, -1.0, 3.0], [1.0, 1.0, 3.0])]);
}

#[test]
fn a_mirrored_joint_keeps_the_front() {
    let nodes = r#"{"mesh":0,"skin":0},{"scale":[-1,1,1]}"#;
    let scene = at(&skinned([[1.0, 0.0]; 4]), SKINNED, nodes, r#","skins":[{"joints":[1,1]}]"#);
    assert!(scene.normal(0).distance(Vec3::Z) < 1e-6);
}

#[test]
fn a_skin_that_is_not_complete_is_left_out() {
    let nodes = r#"{"mesh":0,"skin":0}"#;
    let arrays = skinned([[1.0, 0.0]; 4]);
    let json = file(
        &arrays,
        &format!(r#"{SKINNED},"material":0"#),
        nodes,
        MATERIAL,
        r#","skins":[{"joints":[9]}]"#,
    );
    let loaded = load(&json);
    assert_eq!(squares(&loaded.scene), [([-1.0, -1.0, 0.0], [1.0, 1.0, 0.0])]);
    assert!(messages(&loaded).join("\n").contains("`skin` of nodes names element 0 of `skins`"));
}

#[test]
fn morph_targets_move_vertices_by_their_weights() {
    let mut arrays = square();
    arrays.floats("VEC3", &[0.0, 0.0, 4.0].repeat(4));
    arrays.floats("VEC3", &[8.0, 0.0, 0.0].repeat(4));
    let primitive = format!(r#"{SQUARE},"targets":[{{"POSITION":4}},{{"POSITION":5}}]"#);
    let moved = |node: &str, mesh: &str| {
        let json = file(
            &arrays,
            &format!(r#"{primitive},"material":0"#),
            &format!(r#"{{"mesh":0{node}}}"#),
            MATERIAL,
            "",
        );
        let loaded = load(&json.replace(r#""meshes":[{"#, &format!(r#""meshes":[{{{mesh}"#)));
        assert_eq!(loaded.warnings, []);
        squares(&loaded.scene)[0].0
    };
    assert_eq!(moved("", ""), [-1.0, -1.0, 0.0]);
    assert_eq!(moved("", r#""weights":[0.5,0],"#), [-1.0, -1.0, 2.0]);
    assert_eq!(moved(r#","weights":[0,0.25]"#, r#""weights":[0.5,0],"#), [1.0, -1.0, 0.0]);
    assert_eq!(moved(r#","weights":[0.25,0.25]"#, ""), [1.0, -1.0, 1.0]);
}

#[test]
fn hidden_nodes_and_their_children_are_left_out() {
    let hidden = r#""extensions":{"KHR_node_visibility":{"visible":false}}"#;
    let nodes =
        format!(r#"{{"mesh":0}},{{{hidden},"children":[2]}},{{"mesh":0,"translation":[9,0,0]}}"#);
    let json = file(
        &square(),
        &format!(r#"{SQUARE},"material":0"#),
        &nodes,
        MATERIAL,
        r#","extensionsUsed":["KHR_node_visibility"]"#,
    );
    let loaded = load(&json);
    assert_eq!(squares(&loaded.scene), [([-1.0, -1.0, 0.0], [1.0, 1.0, 0.0])]);
    assert_eq!(
        messages(&loaded),
        ["s.gltf: nodes are left out, because the file says that they are not visible (1)"]
    );
    let shown = load(&json.replace("false", "true"));
    assert_eq!((shown.scene.triangles().len(), shown.warnings.len()), (4, 0));
}

#[test]
fn quantized_meshes_are_shares_of_their_range() {
    let mut arrays = Arrays::default();
    let short =
        |values: &[i16]| -> Vec<u8> { values.iter().flat_map(|v| v.to_le_bytes()).collect() };
    // Packed at 6 bytes, as the format does not allow; then at 8.
    let corners = [[-32767, -32767, 0], [32767, -32767, 0], [32767, 32767, 0], [-32767, 32767, 0]];
    arrays.add(&short(corners.as_flattened()), 5122, "VEC3", 4, r#","normalized":true"#);
    arrays.add(&[0, 0, 127].repeat(4), 5120, "VEC3", 4, r#","normalized":true"#);
    arrays.add(&[0, 1, 2, 0, 2, 3], 5121, "SCALAR", 6, "");
    let padded = corners.map(|[x, y, z]| [x, y, z, 0]);
    let view = arrays.view(&short(padded.as_flattened()), r#","byteStride":8"#);
    arrays
        .accessor(&format!(r#""bufferView":{view},"componentType":5122,"count":4,"type":"VEC3""#));
    let primitive = |k: usize| format!(r#""attributes":{{"POSITION":{k},"NORMAL":1}},"indices":2"#);
    let scene = at(&arrays, &primitive(0), r#"{"mesh":0,"scale":[2,2,2]}"#, "");
    assert_eq!(squares(&scene), [([-2.0, -2.0, 0.0], [2.0, 2.0, 0.0])]);
    let scene = at(&arrays, &primitive(3), r#"{"mesh":0}"#, "");
    assert_eq!(squares(&scene), [([-32767.0, -32767.0, 0.0], [32767.0, 32767.0, 0.0])]);
}

#[test]
fn strides_of_zero_or_less_than_the_format_allows_are_read() {
    let json = file(&square(), &format!(r#"{SQUARE},"material":0"#), r#"{"mesh":0}"#, MATERIAL, "");
    let loaded = load(&json.replacen(r#""byteLength":48"#, r#""byteLength":48,"byteStride":0"#, 1));
    assert_eq!(squares(&loaded.scene), [([-1.0, -1.0, 0.0], [1.0, 1.0, 0.0])]);
    assert_eq!(
        messages(&loaded),
        ["s.gltf: strides of zero bytes are taken as those of packed arrays (1)"]
    );
    let packed = load(&json.replace(r#""byteLength":6}"#, r#""byteLength":6,"byteStride":1}"#));
    assert_eq!(squares(&packed.scene), squares(&loaded.scene));
    // An offset of zero may be left out.
    let without = load(&json.replace(r#""byteOffset":0,"#, ""));
    assert_eq!(squares(&without.scene), squares(&loaded.scene));
}

#[test]
fn sparse_values_are_normalized_over_a_base_of_zeros() {
    let mut arrays = square();
    let at = arrays.view(&[1, 0, 0, 0], "");
    let values = arrays.view(&[255, 128, 0, 255], "");
    arrays.accessor(&format!(
        r#""componentType":5121,"count":4,"type":"VEC4","normalized":true,"sparse":{{"count":1,
        "indices":{{"bufferView":{at},"componentType":5121}},"values":{{"bufferView":{values}}}}}"#
    ));
    let coloured = SQUARE.replace(r#""NORMAL":1"#, r#""COLOR_0":4"#);
    let scene = load(&file(&arrays, &coloured, r#"{"mesh":0}"#, "", "")).scene;
    let near = |found: [f32; 3], expected: [f32; 3]| {
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.004)
    };
    // Index 1 is the second corner of the first triangle.
    assert!(near(scene.reflectance(0, 1.0, 0.0, 0.0), [1.0, 0.50196, 0.0]));
    assert!(near(scene.reflectance(0, 0.0, 0.0, 0.0), [0.0; 3]));
}
