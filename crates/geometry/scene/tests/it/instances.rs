//! Tests instances of shared meshes: they look like copies, and their packed form is never trusted.

#![allow(clippy::unwrap_used)]

use crate::common::instanced::{TURNED, placement, scene, shaded, textured};
use base64::Engine as _;
use glam::{DMat3, DVec3, Vec3};
use holo_scene::{
    Geometry, HEADER_BYTES, LoadOptions, Loaded, Material, PackedError, Placement, Scene,
    SceneError, limits,
};
use proptest::prelude::*;

#[test]
fn triangles_of_instances_are_numbered_after_the_scene_s_own() {
    let scene = scene();
    assert_eq!(scene.triangles(), 0..5);
    assert_eq!(scene.own().triangles.len(), 1);
    assert_eq!(scene.material_ids().collect::<Vec<_>>(), [2, 0, 1, 0, 1]);
    assert_eq!(scene.corners(0)[1], Vec3::new(1.0, 0.0, 8.0));
    assert_eq!(
        scene.corners(1),
        [[5.0, 1.0, -3.0], [5.0, 3.0, -3.0], [3.0, 3.0, -2.5]].map(Vec3::from)
    );
    // A mirrored triangle exchanges two corners, so that its front stays its front.
    let mirrored = [[0.0, 10.0, 0.0], [-0.8, 11.0, 0.225], [-1.0, 10.0, 0.1]].map(Vec3::from);
    assert_eq!(scene.corners(3), mirrored);
    assert!(scene.normal(3).z > 0.0 && scene.normal(1).z > 0.0);
    let (low, high) = scene.bounds();
    assert_eq!(low - scene.origin, DVec3::new(-1.0, 0.0, -3.0));
    assert_eq!(high - scene.origin, DVec3::new(5.0, 11.0, 8.0));
    assert_eq!(scene.points().count(), 3 + 2 * 4);
}

#[test]
fn a_scene_with_instances_looks_like_its_flattened_form() {
    let (shared, flat) = (shaded(), shaded().flattened());
    assert!(flat.instances().is_empty());
    assert_eq!(shared.triangles(), flat.triangles());
    assert!(shared.material_ids().eq(flat.material_ids()));
    assert_eq!(shared.features(), flat.features());
    assert_eq!(shared.bounds(), flat.bounds());
    for triangle in shared.triangles() {
        assert_eq!(shared.corners(triangle), flat.corners(triangle));
        assert_eq!(shared.is_plain(triangle), flat.is_plain(triangle));
        for (u, v) in [(0.2, 0.3), (1.0, 0.0), (0.0, 1.0)] {
            let look = |scene: &Scene| {
                let normal = scene.smooth_normal(triangle, u, v);
                (scene.reflectance(triangle, u, v, 0.0), normal)
            };
            assert_eq!(look(&shared), look(&flat), "{triangle} {u} {v}");
        }
    }
    // A smooth normal stays on the side of its corner, in a mirror too.
    assert!(shared.smooth_normal(3, 0.0, 0.0).unwrap().dot(shared.normal(3)) > 0.8);
}

#[test]
fn faces_are_added_before_the_triangles_of_instances() {
    let lamp = Material { emission: [1.0; 3], ..Material::grey("lamp") };
    let square = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
    let before = shaded();
    let lit = before.clone().with_faces(&square, &[[0, 1, 2]], lamp).unwrap();
    assert_eq!(lit.material_ids().collect::<Vec<_>>(), [2, 3, 0, 1, 0, 1]);
    assert_eq!(lit.emitters().collect::<Vec<_>>(), [1]);
    for (old, new) in [(0, 0), (1, 2), (2, 3), (3, 4), (4, 5)] {
        assert_eq!(before.corners(old), lit.corners(new));
        assert_eq!(before.smooth_normal(old, 0.2, 0.7), lit.smooth_normal(new, 0.2, 0.7));
    }
    assert_eq!(lit.smooth_normal(1, 0.2, 0.7), None);
    assert_eq!(Scene::unpack(&lit.pack()).unwrap(), lit);
}

#[test]
fn instances_survive_packing_as_instances() {
    for scene in [scene(), shaded(), textured()] {
        let packed = scene.pack();
        assert_eq!(Scene::unpack(&packed).unwrap(), scene);
        assert!(scene.geometry_hash() != scene.flattened().geometry_hash());
    }
    // 88 bytes of header, 7 positions, 3 triangles, 3 materials of 33 bytes; counts, a mesh, two
    // instances; no normals and no textures.
    assert_eq!(scene().pack().len(), 88 + 7 * 12 + 3 * 16 + 3 * 33 + 8 + 8 + 2 * 100 + 8);
    assert_eq!(scene().pack()[8], 3);
    assert_eq!(scene().flattened().pack()[8], 1);
}

/// Where the packed form of [`scene`] has its meshes and instances.
const INSTANCES: usize = HEADER_BYTES + 7 * 12 + 3 * 16 + 3 * 33;

#[test]
fn damaged_instances_are_refused_with_a_reason() {
    let packed = scene().pack();
    let refused = |at: usize, bytes: &[u8]| {
        let mut damaged = packed.clone();
        damaged[INSTANCES + at..][..bytes.len()].copy_from_slice(bytes);
        Scene::unpack(&damaged).unwrap_err()
    };
    let words = |error: SceneError| error.to_string();
    // No mesh, no instance, and more than the bytes hold.
    for (at, count) in [(0, 0), (4, 0), (4, 3), (0, 1 << 10), (4, 1 << 20)] {
        let error = refused(at, &u32::to_le_bytes(count));
        assert!(matches!(error, SceneError::Packed(PackedError::Instances)), "{at} {error}");
    }
    assert!(matches!(refused(4, &[0xff; 4]), SceneError::Limit { what: "instances", .. }));
    assert!(matches!(refused(0, &[0xff; 4]), SceneError::Limit { what: "meshes", .. }));
    // A mesh with more positions or triangles than there are, and with none.
    for (at, count) in [(8, 8), (12, 4), (8, u32::MAX), (12, u32::MAX)] {
        let error = refused(at, &count.to_le_bytes());
        assert!(matches!(error, SceneError::Packed(PackedError::Instances)), "{at} {error}");
    }
    assert_eq!(words(refused(12, &[0; 4])), "instance 0: a mesh is empty or has no instance");
    assert!(matches!(refused(8, &[3, 0, 0, 0]), SceneError::PositionIndex { .. }));
    // A mesh that does not exist.
    assert_eq!(words(refused(16, &[1, 0, 0, 0])), "instance 0: its mesh does not exist");
    // Places that are not finite, flat, far away, or stretched too far.
    let second = 16 + 100 + 4;
    for number in [f64::NAN, f64::INFINITY, 1e7] {
        let error = refused(second, &number.to_le_bytes());
        assert!(matches!(error, SceneError::Packed(PackedError::Placement(1))), "{error}");
    }
    let flat = refused(second + 80, &0f64.to_le_bytes());
    assert!(matches!(flat, SceneError::Packed(PackedError::Placement(1))), "{flat}");
    let far = words(refused(second + 24, &2e12f64.to_le_bytes()));
    assert_eq!(far, "instance 1: a corner of its box is not finite or too far away");
}

#[test]
fn impossible_instances_are_refused() {
    let scene =
        || Scene::new(DVec3::ZERO, vec![], vec![], vec![], vec![Material::grey("m")], [0.0; 3]);
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mesh = |positions, triangles| Geometry { positions, triangles, material_ids: &[0] };
    let refused = |mesh: Geometry, rows: [[f64; 4]; 3]| {
        let instances = scene().unwrap().with_instances(&[mesh], &[(0, placement(rows))]);
        instances.unwrap_err().to_string()
    };
    let unused = refused(mesh(&corners, &[[0, 1, 2]]), TURNED);
    assert_eq!(unused, "instance 0: its mesh has a position that no triangle uses");
    // At 1e9, f32 moves corners by 32.
    let far = [[1.0, 0.0, 0.0, 1e9], [0.0, 1.0, 0.0, 1e9], [0.0, 0.0, 1.0, 1e9]];
    assert_eq!(refused(mesh(&corners[..3], &[[0, 1, 2]]), far), "triangle 0 has no area");
}

#[test]
fn instances_beyond_the_limit_of_triangles_are_refused() {
    // A mesh of 2¹⁶ triangles is needed more than 2¹² times.
    let triangles = vec![[0, 1, 2]; 1 << 16];
    let mesh = Geometry {
        positions: &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        triangles: &triangles,
        material_ids: &vec![0; 1 << 16],
    };
    let many = vec![(0, placement(TURNED)); (limits::MAX_TRIANGLES >> 16) + 1];
    let empty =
        Scene::new(DVec3::ZERO, vec![], vec![], vec![], vec![Material::grey("m")], [0.0; 3]);
    let error = empty.unwrap().with_instances(&[mesh], &many).unwrap_err();
    assert!(matches!(error, SceneError::Limit { what: "triangles of instances", .. }), "{error}");
}

/// Returns a scene with instances of a mesh that has one triangle many times.
fn repeated(
    triangles: usize,
    instances: usize,
    height: f32,
    emission: f32,
) -> Result<Scene, SceneError> {
    let material = Material { emission: [emission; 3], ..Material::grey("m") };
    let mesh = Geometry {
        positions: &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, height, 0.0]],
        triangles: &vec![[0, 1, 2]; triangles],
        material_ids: &vec![0; triangles],
    };
    Scene::new(DVec3::ZERO, vec![], vec![], vec![], vec![material], [0.0; 3])?
        .with_instances(&[mesh], &vec![(0, placement(TURNED)); instances])
}

#[test]
fn a_small_file_cannot_demand_millions_of_tests_or_lamps() {
    let (mesh, least) = (1 << 16, (limits::MAX_THIN_TRIANGLES >> 16) + 1);
    assert!(repeated(mesh, least, 1.0, 0.0).is_ok());
    assert!(repeated(mesh, 3, 1e-6, 0.0).is_ok());
    let error = repeated(mesh, least, 1e-6, 0.0).unwrap_err().to_string();
    let (found, limit) = (least << 16, limits::MAX_THIN_TRIANGLES);
    let words = "triangles of instances nearly without area are more than the limit of";
    assert_eq!(error, format!("{found} {words} {limit}"));

    let (mesh, least) = (1 << 10, (limits::MAX_SHARED_LAMPS >> 10) + 1);
    assert!(repeated(mesh, least - 1, 1.0, 1.0).is_ok());
    let error = repeated(mesh, least, 1.0, 1.0).unwrap_err().to_string();
    let (found, limit) = (least << 10, limits::MAX_SHARED_LAMPS);
    let words = "triangles of instances that emit light are more than the limit of";
    assert_eq!(error, format!("{found} {words} {limit}"));
}

#[test]
fn a_placement_is_finite_and_neither_flat_nor_stretched_too_far() {
    let scaled = |x: f64, y: f64, z: f64| {
        Placement::new([[x, 0.0, 0.0, 1.0], [0.0, y, 0.0, 2.0], [0.0, 0.0, z, 3.0]])
    };
    assert!(scaled(1.0, 1.0, 1.0).is_some_and(|p| !p.is_mirrored()));
    assert!(scaled(1.0, -1000.0, 1.0).is_some_and(|p| p.is_mirrored()));
    assert!(scaled(1e-5, 1e-5, 1e-5).is_some() && scaled(1e5, 1e5, 1e5).is_some());
    for (x, y, z) in [(0.0, 1.0, 1.0), (1e7, 1e7, 1e7), (1e-7, 1e-7, 1e-7), (1e4, 1.0, 1e-4)] {
        assert_eq!(scaled(x, y, z), None);
    }
    assert_eq!(scaled(f64::NAN, 1.0, 1.0), None);
}

/// Returns a glTF file of a wavy square with `side` × `side` × 2 triangles, on nodes with these
/// members. `meshes` meshes have the same arrays.
fn wavy(side: u32, meshes: usize, nodes: &[String], material: &str) -> String {
    let mut bytes = Vec::new();
    let mut normals = Vec::new();
    for (x, y) in (0..=side).flat_map(|y| (0..=side).map(move |x| (x, y))) {
        let (x, y) = (x as f32 / side as f32, y as f32 / side as f32);
        let wave = Vec3::new(x, y, 0.1 * (6.0 * x).sin());
        bytes.extend(wave.to_array().into_iter().flat_map(f32::to_le_bytes));
        let normal = Vec3::new(-0.6 * (6.0 * x).cos(), 0.0, 1.0).normalize();
        normals.extend(normal.to_array().into_iter().flat_map(f32::to_le_bytes));
    }
    let (count, positions) = ((side + 1) * (side + 1), bytes.len());
    bytes.extend(normals);
    for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
        let at = |x: u32, y: u32| y * (side + 1) + x;
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        bytes.extend([a, b, c, a, c, d].into_iter().flat_map(u32::to_le_bytes));
    }
    let indices = side * side * 6;
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let mesh =
        r#"{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1},"indices":2,"material":0}]}"#;
    let numbers: Vec<String> = (0..nodes.len()).map(|k| k.to_string()).collect();
    format!(
        r#"{{"asset":{{"version":"2.0"}},
        "buffers":[{{"byteLength":{},"uri":"data:application/octet-stream;base64,{data}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{positions}}},
            {{"buffer":0,"byteOffset":{positions},"byteLength":{positions}}},
            {{"buffer":0,"byteOffset":{},"byteLength":{}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3"}},
            {{"bufferView":1,"componentType":5126,"count":{count},"type":"VEC3"}},
            {{"bufferView":2,"componentType":5125,"count":{indices},"type":"SCALAR"}}],
        "materials":[{material}],"meshes":[{}],"nodes":[{}],"scenes":[{{"nodes":[{}]}}]}}"#,
        bytes.len(),
        2 * positions,
        4 * indices,
        vec![mesh; meshes].join(","),
        nodes.join(","),
        numbers.join(",")
    )
}

fn load(json: &str) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.gltf");
    std::fs::write(&path, json).unwrap();
    holo_scene::load(&path, &LoadOptions::default()).unwrap()
}

/// Returns nodes at different places, every third one mirrored, on one mesh or on one each.
fn nodes(count: usize, mesh: impl Fn(usize) -> usize) -> Vec<String> {
    let node = |k: usize| {
        let (mesh, x, y) = (mesh(k), 3 * (k % 10), 4 * (k / 10));
        let scale = if k.is_multiple_of(3) { "-1,2,1" } else { "1.5,1,1" };
        format!(
            r#"{{"mesh":{mesh},"translation":[{x},{y},1],"scale":[{scale}],
            "rotation":[0,0.6,0,0.8]}}"#
        )
    };
    (0..count).map(node).collect()
}

const GREY: &str = r#"{"pbrMetallicRoughness":{"metallicFactor":0}}"#;

#[test]
fn nodes_share_a_large_mesh_and_look_as_if_each_had_its_own() {
    let shared = load(&wavy(30, 1, &nodes(60, |_| 0), GREY)).scene;
    let apart = load(&wavy(30, 60, &nodes(60, |k| k), GREY)).scene;
    assert_eq!((shared.instances().len(), apart.instances().len()), (60, 0));
    assert_eq!(shared.meshes().next().unwrap().triangles.len(), 1800);
    assert_eq!(shared.triangles(), apart.triangles());
    assert!(shared.geometry_bytes() * 25 < apart.geometry_bytes());
    assert!(shared.pack().len() * 25 < apart.pack().len());
    let bound = 1e-5;
    assert!(shared.origin.distance(apart.origin) < bound);
    for triangle in shared.triangles().step_by(7) {
        let places = |scene: &Scene| scene.corners(triangle).map(|c| c.as_dvec3() + scene.origin);
        for (a, b) in places(&shared).into_iter().zip(places(&apart)) {
            assert!(a.distance(b) < bound, "{triangle} {a} {b}");
        }
        assert_eq!(shared.material(triangle), apart.material(triangle));
        let normal = |scene: &Scene| scene.smooth_normal(triangle, 0.3, 0.3).unwrap();
        assert!(normal(&shared).distance(normal(&apart)) < 1e-3, "{triangle}");
    }
    assert_eq!(Scene::unpack(&shared.pack()).unwrap(), shared);
}

#[test]
fn meshes_that_are_small_few_or_lamps_are_copied() {
    let lamp = r#"{"emissiveFactor":[1,1,1]}"#;
    for (side, count, material) in [(30, 50, GREY), (5, 3000, GREY), (30, 60, lamp)] {
        let scene = load(&wavy(side, 1, &nodes(count, |_| 0), material)).scene;
        assert!(scene.instances().is_empty(), "{side} {count}");
        assert_eq!(scene.triangles().len(), 2 * (side * side) as usize * count);
    }
}

#[test]
fn nodes_that_cannot_share_get_a_copy() {
    // One node is flat.
    let mut placed = nodes(60, |_| 0);
    placed[7] = r#"{"mesh":0,"scale":[1,1,0]}"#.to_owned();
    let scene = load(&wavy(30, 1, &placed, GREY)).scene;
    assert_eq!((scene.instances().len(), scene.own().triangles.len()), (59, 1800));
    // One is so far away that others' triangles lose their area.
    placed[8] = r#"{"mesh":0,"translation":[4e6,4e6,4e6]}"#.to_owned();
    let Loaded { scene, warnings, .. } = load(&wavy(30, 1, &placed, GREY));
    let is_reported = warnings.iter().any(|w| w.text.contains("without area are left out"));
    assert!(is_reported && scene.instances().len() < 59, "{warnings:?}");
    assert!(scene.triangles().all(|triangle| scene.area(triangle) > 0.0));
}

/// Nodes get copies if rounding leaves their triangles without area, and copies are bounded.
#[test]
fn a_small_file_cannot_demand_copies_without_end() {
    let far = |k: usize| {
        let x = if k.is_multiple_of(2) { "-4e10" } else { "4e10" };
        format!(r#"{{"mesh":0,"translation":[{x},{x},{x}]}}"#)
    };
    let nodes: Vec<String> = (0..400).map(far).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.gltf");
    std::fs::write(&path, wavy(180, 1, &nodes, GREY)).unwrap();
    let error = holo_scene::load(&path, &LoadOptions::default()).unwrap_err();
    let what = "positions and corners of meshes that must be copied";
    assert!(matches!(error, SceneError::Limit { what: found, .. } if found == what), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Corners on a coarse grid with small steps, and far places, make all kinds of thin triangles.
    #[test]
    fn a_mesh_is_accepted_if_and_only_if_all_its_placed_triangles_have_an_area(
        corners in prop::collection::vec(prop::array::uniform3(-2..=2), 3..30),
        step in prop::sample::select(vec![1e-9_f32, 1e-6, 1e-4, 1.0]),
        stretch in prop::array::uniform9(prop::sample::select(vec![0.0, 1e-3, 0.5, 1.0, -2.0])),
        sum in prop::array::uniform3(prop::sample::select(vec![0.0, 0.1, 3e3, 1e5, -1e7])),
    ) {
        let empty = |positions, triangles: Vec<[u32; 3]>| {
            let ids = vec![0; triangles.len()];
            let materials = vec![Material::grey("m")];
            Scene::new(DVec3::ZERO, positions, triangles, ids, materials, [0.0; 3])
        };
        let at = |[x, y, z]: [i32; 3]| [x as f32 * step, 1.0 + y as f32 * step, z as f32];
        let count = corners.len() / 3;
        let positions: Vec<[f32; 3]> = corners.iter().take(3 * count).map(|&p| at(p)).collect();
        let all: Vec<[u32; 3]> = (0..count as u32).map(|t| [0, 1, 2].map(|k| 3 * t + k)).collect();
        let row = |k: usize| [stretch[3 * k], stretch[3 * k + 1], stretch[3 * k + 2], sum[k]];
        let Some(placement) = Placement::new([0, 1, 2].map(row)) else { return Ok(()) };
        let has_area = |triangle: &[u32; 3]| {
            let placed = triangle.map(|c| placement.point(positions[c as usize]).to_array());
            empty(placed.to_vec(), vec![[0, 1, 2]]).is_ok()
        };
        let ids = vec![0; count];
        let mesh = Geometry { positions: &positions, triangles: &all, material_ids: &ids };
        match empty(vec![], vec![]).unwrap().with_instances(&[mesh], &[(0, placement)]) {
            Ok(_) => prop_assert!(all.iter().all(has_area)),
            Err(SceneError::NoArea(triangle)) => prop_assert!(!has_area(&all[triangle])),
            Err(other) => prop_assert!(false, "{other}"),
        }
    }

    /// Accepted bytes are canonical and valid.
    #[test]
    fn changed_bytes_give_a_valid_scene_or_an_error(
        scene in prop::sample::select(vec![scene(), shaded(), textured()]),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        flips in any::<bool>(),
    ) {
        let mut packed = scene.pack();
        for (at, value) in changes {
            let byte = at.get_mut(&mut packed);
            *byte = if flips { *byte ^ (1 << (value % 8)) } else { value };
        }
        if let Ok(scene) = Scene::unpack(&packed) {
            prop_assert_eq!(scene.pack(), packed);
            for triangle in scene.triangles() {
                prop_assert!(scene.area(triangle) > 0.0);
            }
        }
    }

    /// The inverse of a placement takes places back.
    #[test]
    fn the_inverse_takes_places_back(
        numbers in prop::array::uniform9(-10.0..10.0f64),
        sum in prop::array::uniform3(-1e4..1e4f64),
    ) {
        let matrix = DMat3::from_cols_array(&numbers);
        let row = |axis: usize| {
            let [x, y, z] = matrix.row(axis).to_array();
            [x, y, z, sum[axis]]
        };
        let Some(placement) = Placement::new([0, 1, 2].map(row)) else { return Ok(()) };
        prop_assert_eq!(placement.is_mirrored(), matrix.determinant() < 0.0);
        let inverse = DMat3::from_cols_array_2d(placement.inverse()).transpose();
        let product = inverse * matrix;
        prop_assert!(product.abs_diff_eq(DMat3::IDENTITY, 1e-8), "{product}");
    }
}
