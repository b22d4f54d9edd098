//! Tests OBJ files: what is read exactly, and errors and warnings with their lines.

#![allow(clippy::unwrap_used)]

use crate::common::{error, load, load_in, load_with, messages};
use glam::DVec3;
use holo_scene::{LoadOptions, Scene, SceneError, load_watched};
use proptest::prelude::*;

const SQUARE: &str = "v 0 0 0\nv 2 0 0\nv 2 4 0\nv 0 4 0\n";

/// Returns the world coordinates of the corners of all triangles.
fn world(scene: &Scene) -> Vec<[DVec3; 3]> {
    let corner = |p: glam::Vec3| p.as_dvec3() + scene.origin;
    scene.triangles().map(|t| scene.corners(t).map(corner)).collect()
}

#[test]
fn a_square_is_two_triangles_around_its_centre() {
    let scene = load(format!("{SQUARE}f 1 2 3 4\n")).unwrap().scene;
    assert_eq!(scene.origin, DVec3::new(1.0, 2.0, 0.0));
    assert_eq!(
        scene.own().positions,
        [[-1.0, -2.0, 0.0], [1.0, -2.0, 0.0], [1.0, 2.0, 0.0], [-1.0, 2.0, 0.0]]
    );
    assert_eq!(scene.own().triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(scene.bounds(), (DVec3::ZERO, DVec3::new(2.0, 4.0, 0.0)));
    assert_eq!((scene.area(0), scene.normal(1)), (4.0, glam::Vec3::Z));
}

#[test]
fn corners_may_be_written_in_all_forms_of_the_format() {
    let plain = load(format!("{SQUARE}f 1 2 3 4\n")).unwrap().scene;
    for face in [
        "f 1/1 2/2 3/3 4/4",
        "f 1//1 2//1 3//9 4//1",
        "f 1/1/1 2/2/1 3/3/1 4/4/1",
        "f -4 -3 -2 -1",
        "fo 1 2 3 4",
    ] {
        assert_eq!(load(format!("{SQUARE}{face}\n")).unwrap().scene, plain, "{face}");
    }
}

#[test]
fn reading_a_long_file_reports_progress() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.obj");
    let text = SQUARE.to_owned() + &"f 1 2 3 4\n".repeat(300_000);
    std::fs::write(&path, &text).unwrap();
    let mut reports = Vec::new();
    load_watched(&path, &LoadOptions::default(), &mut |report| reports.push(report)).unwrap();
    assert_eq!(reports.len(), 4, "one for every 65,536 lines");
    assert!(reports.is_sorted_by(|a, b| a.bytes < b.bytes && a.triangles < b.triangles));
    let last = reports[3];
    assert_eq!(last.total_bytes, text.len() as u64);
    assert!(last.bytes > text.len() as u64 / 2 && last.bytes < text.len() as u64, "{last:?}");
    assert!(last.triangles > 2 * 250_000, "{last:?}");
}

#[test]
fn negative_indices_count_from_the_latest_vertex_at_that_line() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 5\nv 1 0 5\nv 0 1 5\nf -3 -2 -1\n";
    let triangles = world(&load(obj).unwrap().scene);
    assert_eq!(triangles[0][0], DVec3::ZERO);
    assert_eq!(triangles[1][0], DVec3::new(0.0, 0.0, 5.0));
}

#[test]
fn blanks_line_ends_comments_continuations_and_the_byte_order_mark_do_not_matter() {
    let plain = load(format!("{SQUARE}f 1 2 3 4\n")).unwrap();
    let odd = "\u{feff}# made by hand C:\\\r\n\r\nv  0\t0 0 \r\nv 2 0 0 # right\r\n\tv 2 4 0\r\nv 0 4 0 1.0\r\nf 1 2 \\\r\n  3 4 \r\n";
    assert_eq!(load(odd).unwrap().scene, plain.scene);
    assert_eq!(load(odd.replace("\r\n", "\r")).unwrap().scene, plain.scene);
    // Lines count as in an editor.
    assert_eq!(load(odd).unwrap().warnings[0].line, Some(7));
}

#[test]
fn bytes_that_are_not_utf8_are_allowed_in_comments() {
    let obj = [b"# caf\xe9\n".as_slice(), SQUARE.as_bytes(), b"f 1 2 3\n"].concat();
    assert_eq!(load(obj).unwrap().scene.triangles().len(), 1);
}

#[test]
fn a_concave_polygon_is_covered_once() {
    let obj = "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 0.5 1 0\nf 1 2 3 4\n";
    let scene = load(obj).unwrap().scene;
    assert_eq!(scene.triangles().len(), 2);
    assert_eq!(scene.area(0) + scene.area(1), 1.5);
    assert!((0..2).all(|t| scene.normal(t) == glam::Vec3::Z));
}

#[test]
fn problems_of_polygons_give_warnings_with_their_line() {
    let bow = "v 0 0 0\nv 3 3 0\nv 3 0 0\nv 0 2 0\nv 1 -4 0\nv -2 1 0\nv 4 1 0\n";
    let obj = format!("{bow}f 1 2 3\nf 1 3 2 7\n\nf 1 2 \\\n 3 4 5 6 7\nf 1 2 3\nf 4 4 5\n");
    let warnings = messages(&load(obj).unwrap());
    assert_eq!(
        warnings[0],
        "s.obj:11: a polygon crosses itself or is very long: its triangles may overlap"
    );
    assert_eq!(warnings[2], "s.obj:14: triangles without area are left out (1 in the file)");
}

#[test]
fn more_faces_than_are_parsed_at_once_keep_their_corners_and_materials() {
    // Faces are parsed 2²⁰ at a time; vertices are shared among as many.
    const AT_ONCE: usize = 1 << 20;
    let faces = |n: usize, face: &str| face.repeat(n);
    let obj = format!(
        "{SQUARE}usemtl a\n{}f 1 2 3 4\n{}usemtl b\n{}",
        faces(AT_ONCE - 2, "f 1 2 3\n"),
        faces(10, "f -1 -2 -3\n"),
        faces(10, "f 1 2 4\n")
    );
    let scene = load(obj).unwrap().scene;
    let corners = world(&scene);
    let [p, q, r, s] =
        [[0.0, 0.0], [2.0, 0.0], [2.0, 4.0], [0.0, 4.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
    let expected =
        [(AT_ONCE - 1, [p, q, r], 0), (1, [p, r, s], 0), (10, [s, r, q], 0), (10, [p, q, s], 1)];
    let mut at = 0;
    for (n, triangle, material) in expected {
        assert!(corners[at..at + n].iter().all(|&found| found == triangle), "{triangle:?}");
        assert!(
            scene.own().material_ids[at..at + n].iter().all(|&found| found == material),
            "{triangle:?}"
        );
        at += n;
    }
    assert_eq!((corners.len(), scene.own().positions.len()), (at, 8));
}

/// A triangle that is always read, before statements that cannot be.
const GOOD: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

#[test]
fn what_cannot_be_read_is_left_out_with_its_line_and_a_count() {
    let cases = [
        ("v 1 2", "`v` takes three numbers of at most 1e12, found `1 2`"),
        ("v 1 2 x", "`v` takes three numbers of at most 1e12, found `1 2 x`"),
        ("v 1 2 nan", "`v` takes three numbers of at most 1e12, found `1 2 nan`"),
        ("v 1 1e999 2", "`v` takes three numbers of at most 1e12, found `1 1e999 2`"),
        ("v 1 1e13 2", "`v` takes three numbers of at most 1e12, found `1 1e13 2`"),
        ("v 1 . 2", "`v` takes three numbers of at most 1e12, found `1 . 2`"),
        ("f 1 2", "`f` takes at least three corners, found 2"),
        ("f", "`f` takes at least three corners, found 0"),
        ("f 1 0 1", "`f` names vertex 0 after 3 (the first is 1)"),
        ("f 1 1 9", "`f` names vertex 9, but there are 3"),
        ("f 1 1 -9", "`f` names vertex -9 after 3 (the first is 1)"),
        (
            "f 1 1 -9223372036854775808",
            "`f` names vertex -9223372036854775808 after 3 (the first is 1)",
        ),
        ("f 1 1 1.5", "`f` takes corners as v, v/vt, v//vn or v/vt/vn, found `1.5`"),
        ("f 1 1 1/x", "`f` takes corners as v, v/vt, v//vn or v/vt/vn, found `1/x`"),
        ("f 1 1 1/1/1/1", "`f` takes corners as v, v/vt, v//vn or v/vt/vn, found `1/1/1/1`"),
        ("mtllib", "`mtllib` names no file"),
    ];
    for (statement, problem) in cases {
        let loaded = load(format!("{GOOD}{statement}\n{statement}\n")).unwrap();
        assert_eq!(loaded.scene.triangles().len(), 1, "{statement}");
        let expected = format!("s.obj:5: {problem}; it is left out (2 lines)");
        assert!(messages(&loaded).contains(&expected), "{statement}: {:?}", messages(&loaded));
    }
}

#[test]
fn a_vertex_that_cannot_be_read_keeps_its_number_and_spoils_only_its_faces() {
    let obj =
        "v 0 0 0\nv 1 0 0\nv 0 nan 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 5 3 1\nf -1 -4 -5\n";
    let loaded = load(obj).unwrap();
    let [o, x, y, z] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    assert_eq!(world(&loaded.scene), [[o, x, y], [z, x, o]]);
    assert_eq!(
        messages(&loaded)[1],
        "s.obj:6: `f` names vertex 3, which could not be read; it is left out (2 lines)"
    );
}

#[test]
fn a_face_may_name_vertices_of_later_lines() {
    let obj = "usemtl a\nf 1 2 4\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl b\nf 1 2 3\nv 0 0 1\n";
    let scene = load(obj).unwrap().scene;
    let [o, x, y, z] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    assert_eq!(world(&scene), [[o, x, y], [o, x, z]]);
    let names = scene.material_ids().map(|id| scene.materials[id as usize].name.as_str());
    assert_eq!(names.collect::<Vec<_>>(), ["b", "a"]);
}

#[test]
fn numbers_and_utf16_are_read_as_exporters_write_them() {
    let plain = load("v 0 0 0\nv 310 0 0\nv 0 1.5 0\nf 1 2 3\n").unwrap().scene;
    let odd = "v 0 0 +0\nv 3.1+e2 0 0\nv 0 1,5 0\nf 1 2 3\n";
    assert_eq!(load(odd).unwrap().scene, plain);
    let utf16: Vec<u8> =
        "\u{feff}".chars().chain(odd.chars()).flat_map(|c| (c as u16).to_le_bytes()).collect();
    assert_eq!(load(utf16).unwrap().scene, plain);
}

#[test]
fn a_file_without_triangles_is_refused_by_what_it_is() {
    let cases = [
        ("", "it is empty"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "none of its triangles (1) has an area"),
        ("v 0 0 0\nv 1 0 0\n", "it has only points (2 `v` lines) and no face"),
        ("v 0 0 0\nv 1 0 0\nl 1 2\n", "it has only points and lines (2 `v` lines) and no face"),
        (
            "v 0 0 0\nf 1 1 x\nf 1 2 3\n",
            "all faces (2) are left out; the first reason, line 2: `f` takes corners as v, v/vt, v//vn or v/vt/vn, found `x`",
        ),
        ("solid cube\nfacet normal 0 0 1\n", "it is an STL file"),
        ("newmtl a\nKd 1 1 1\n", "it is an MTL file: name the .obj file that uses it"),
        ("\u{1}\0\0\0binary", "it is a binary file, and OBJ is text"),
        ("dear diary", "it has no `v` and no `f` line, so it is no OBJ file"),
    ];
    for (obj, instead) in cases {
        assert_eq!(error(load(obj)), format!("s.obj: no triangle in it: {instead}"), "{obj:?}");
    }
}

#[test]
fn a_missing_file_and_a_folder_are_errors_with_their_path() {
    let folder = tempfile::tempdir().unwrap();
    for path in [folder.path().join("no.obj"), folder.path().to_owned()] {
        let error = holo_scene::load(&path, &LoadOptions::default()).unwrap_err();
        assert!(matches!(error, SceneError::Io { .. }), "{error}");
        assert!(error.to_string().starts_with(&*path.to_string_lossy()), "{error}");
    }
}

#[test]
fn ignored_statements_give_one_warning_with_the_first_line() {
    let obj = format!(
        "{SQUARE}vn 0 0 1\nvn 0 0 1\nvt 0 0\nusemtl a\nf 1 2 3\nf 1 1 2\nf 2 2 2\nl 1 2\np 1\ncurv 1 2\ncurv 3\nv 9 9 9 2\n\
         g a\no b\ns off\n"
    );
    let loaded = load(obj).unwrap();
    assert_eq!(loaded.scene.triangles().len(), 1);
    let expected = [
        "s.obj:12: lines and points (`l`, `p`) are ignored (2 lines)",
        "s.obj:14: `curv` is unknown and ignored (2 lines)",
        "s.obj:16: the weight of `v` is ignored",
        "s.obj:8: no MTL file was read; grey diffuse 0.5 is taken for all materials (1)",
        "s.obj:10: triangles without area are left out (2 in the file)",
    ];
    assert_eq!(messages(&loaded), expected);
}

#[test]
fn unused_vertices_do_not_move_the_origin() {
    let scene = load(format!("v 1e9 0 0\n{SQUARE}f 2 3 4\n")).unwrap().scene;
    assert_eq!((scene.origin, scene.own().positions.len()), (DVec3::new(1.0, 2.0, 0.0), 3));
}

#[test]
fn a_building_at_map_coordinates_loses_nothing() {
    // A hundredth of a unit at 5e6 is far below the precision of f32 there (0.5).
    let obj = "v 5000000.01 4000000.02 0\nv 5000000.51 4000000.02 0\nv 5000000.01 4000000.27 0\nf 1 2 3\n";
    let scene = load(obj).unwrap().scene;
    let corners = world(&scene)[0];
    let expected = [[5000000.01, 4000000.02], [5000000.51, 4000000.02], [5000000.01, 4000000.27]];
    for (corner, [x, y]) in corners.into_iter().zip(expected) {
        // Half a unit of f32 at the largest relative coordinate, 0.25, and one of f64 at 5e6.
        assert!(
            (corner - DVec3::new(x, y, 0.0)).abs().max_element() <= 2f64.powi(-26) + 1e-9,
            "{corner}"
        );
    }
}

#[test]
fn materials_are_found_under_all_names_of_files_and_materials() {
    let mtl = "newmtl Material #25\nKd 0.1 0.2 0.3\nnewmtl red # the wall\nKd 0.9 0 0\n";
    let names = [
        ("my file.mtl", "mtllib my file.mtl"),
        ("my file.mtl", "mtllib \"my file.mtl\""),
        ("sub/b.mtl", "mtllib sub\\b.mtl"),
        ("b.mtl", "mtllib a.mtl b.mtl"),
        ("b.mtl", "mtllib b.mtl # written by hand"),
        ("b.mtl", "mtllib b.mat"),
        ("b.mtl", "mtllib C:\\Users\\me\\b.mtl"),
    ];
    for (file, statement) in names {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("sub")).unwrap();
        std::fs::write(folder.path().join(file), mtl).unwrap();
        let obj =
            format!("usemtl red\n{SQUARE}f 1 2 3\nusemtl Material #25\nf 1 3 4\n{statement}\n");
        let loaded = load_in(folder.path(), obj, &LoadOptions::default()).unwrap();
        let bsdfs: Vec<_> = loaded.scene.materials.iter().map(|m| m.bsdf).collect();
        let kd = |kd| holo_scene::Bsdf::Diffuse { kd };
        assert_eq!(bsdfs, [kd([0.9, 0.0, 0.0]), kd([0.1, 0.2, 0.3])], "{statement}");
        assert_eq!(
            loaded.warnings.len(),
            usize::from(statement.contains("a.mtl")),
            "{:?}",
            loaded.warnings
        );
    }
}

#[test]
fn a_line_names_several_mtl_files_with_spaces_in_their_names() {
    let kd = |kd| holo_scene::Bsdf::Diffuse { kd };
    for (statement, missing) in [
        ("my a.mtl my other b.mtl", 0),
        ("\"my a.mtl\" \"my other b.mtl\"", 0),
        ("my a.mtl my c.mtl my other b.mtl no.mtl", 2),
    ] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("my a.mtl"), "newmtl a\nKd 0.25 0 0\n").unwrap();
        std::fs::write(folder.path().join("my other b.mtl"), "newmtl b\nKd 0 0.5 0\n").unwrap();
        let obj = format!("mtllib {statement}\n{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n");
        let loaded = load_in(folder.path(), obj, &LoadOptions::default()).unwrap();
        let found: Vec<_> = loaded.scene.materials.iter().map(|m| m.bsdf).collect();
        assert_eq!(found, [kd([0.25, 0.0, 0.0]), kd([0.0, 0.5, 0.0])], "{statement}");
        assert_eq!(loaded.warnings.len(), missing, "{:?}", loaded.warnings);
    }
}

#[test]
fn faces_share_a_material_by_name_and_unknown_ones_are_grey() {
    let obj = format!(
        "{SQUARE}mtllib s.mtl\nf 1 2 3\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\nusemtl a\nf 2 3 4\nusemtl unused\n"
    );
    let loaded = load_with(obj, "newmtl a\nKd 0.25 0.5 0.75\n", &LoadOptions::default()).unwrap();
    assert_eq!(loaded.scene.own().material_ids, [0, 1, 2, 1]);
    let names: Vec<_> = loaded.scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["default", "a", "b"]);
    assert_eq!(loaded.scene.materials[2].bsdf, holo_scene::Bsdf::Diffuse { kd: [0.5; 3] });
    let expected = [
        "s.obj:6: faces before any `usemtl`; grey diffuse 0.5 is taken",
        "s.obj:9: no MTL file has a material `b`; grey diffuse 0.5 is taken",
    ];
    assert_eq!(messages(&loaded), expected);
}

#[test]
fn a_missing_mtl_file_and_a_folder_give_warnings() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("folder")).unwrap();
    let obj = format!(
        "mtllib no.mtl\nmtllib folder\nmtllib no.mtl\n{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n"
    );
    let loaded = load_in(folder.path(), obj, &LoadOptions::default()).unwrap();
    assert!(
        loaded.scene.materials.iter().all(|m| m.bsdf == holo_scene::Bsdf::Diffuse { kd: [0.5; 3] })
    );
    let warnings = messages(&loaded);
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    assert!(
        warnings[0].starts_with("s.obj:1: `mtllib` cannot be read: ")
            && warnings[0].contains("no.mtl: ")
    );
    assert!(warnings[1].starts_with("s.obj:2: ") && warnings[1].ends_with("folder: not a file"));
    assert_eq!(
        warnings[2],
        "s.obj:8: no MTL file was read; grey diffuse 0.5 is taken for all materials (2)"
    );
}

#[test]
fn without_a_readable_mtllib_the_mtl_file_of_the_same_name_is_taken() {
    let obj = format!("{SQUARE}usemtl a\nf 1 2 3\n");
    let loaded = load_with(obj, "newmtl a\nKd 0.25\n", &LoadOptions::default()).unwrap();
    assert_eq!(loaded.scene.materials[0].bsdf, holo_scene::Bsdf::Diffuse { kd: [0.25; 3] });
    let warnings = messages(&loaded);
    assert!(warnings[0].starts_with("s.obj: materials are taken from "), "{warnings:?}");
}

#[test]
fn warnings_of_hostile_files_are_bounded() {
    let mut obj = format!("{SQUARE}mtllib s.mtl\n");
    (0..5000).for_each(|k| obj += &format!("usemtl m{k}\nf 1 2 3\nkeyword{k}\n"));
    let loaded = load_with(obj, "", &LoadOptions::default()).unwrap();
    assert_eq!(loaded.warnings.len(), holo_scene::limits::MAX_WARNINGS + 1);
    assert!(messages(&loaded).last().unwrap().ends_with("more warnings"));
}

#[test]
fn a_face_of_very_many_corners_is_left_out() {
    let corners = |count: usize| format!("{SQUARE}f 1 2 3\nf{}\n", " 1 2 3 4".repeat(count / 4));
    let most = holo_scene::limits::MAX_CORNERS;
    let loaded = load(corners(most + 4)).unwrap();
    assert_eq!(loaded.scene.triangles().len(), 1);
    let said = messages(&loaded).join("\n");
    assert!(said.contains("`f` takes at most 65536 corners; it is left out"), "{said}");
}

#[test]
fn a_name_that_is_too_long_is_refused() {
    let long = "x".repeat(2000);
    assert_eq!(error(load(format!("usemtl {long}\n"))), "s.obj:1: more than 1024 bytes in a name");
    let mtl = format!("newmtl {long}\n");
    let obj = format!("mtllib s.mtl\n{SQUARE}f 1 2 3\n");
    assert_eq!(
        error(load_with(obj, &mtl, &LoadOptions::default())),
        "s.mtl:1: more than 1024 bytes in a name"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Files in all forms of the format, whose contents the generator knows.
    #[test]
    fn the_triangles_and_materials_are_those_that_were_written(
        points in prop::collection::vec(prop::array::uniform3(-100.0..100.0f64), 5..20),
        faces in prop::collection::vec((prop::collection::vec(0usize..20, 3), any::<[bool; 3]>(), 0usize..4), 1..30),
    ) {
        let mut obj = String::new();
        let (mut triangles, mut names) = (Vec::new(), Vec::new());
        points.iter().for_each(|[x, y, z]| obj += &format!("v {x} {y}\t{z:e} # {x}\r\n"));
        let mut count = points.len();
        for (corners, [negative, group, vertex], material) in faces {
            let corners: Vec<usize> = corners.iter().map(|k| k % points.len()).collect();
            if corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0] {
                continue;
            }
            if group {
                obj += "g another\n";
            }
            if vertex {
                obj += "v 1e3 -.5 7. \\\n  1\nvn 0 0 1\n";
                count += 1;
            }
            let written = |k: usize| if negative { k as i64 - count as i64 } else { k as i64 + 1 };
            let [a, b, c] = [0, 1, 2].map(|k| written(corners[k]));
            obj += &format!("usemtl m{material}\nf {a} {b}//1 {c}/2 # f 1\n");
            triangles.push([0, 1, 2].map(|k| DVec3::from_array(points[corners[k]])));
            names.push(format!("m{material}"));
        }
        prop_assume!(!triangles.is_empty());
        let scene = load(&obj).unwrap().scene;
        prop_assert_eq!(scene.triangles().len(), triangles.len());
        for (a, b) in world(&scene).iter().flatten().zip(triangles.iter().flatten()) {
            // Relative coordinates are at most 100; this is half a unit of f32 there.
            prop_assert!((*a - *b).abs().max_element() <= 100.0 * 2f64.powi(-24) * 1.001, "{} {}", a, b);
        }
        let read: Vec<_> = scene.material_ids().map(|id| &scene.materials[id as usize].name).collect();
        prop_assert_eq!(read, names.iter().collect::<Vec<_>>());
        // Every used point exists once, whatever groups and materials use it.
        let used: std::collections::HashSet<_> = triangles.iter().flatten().map(|p| p.to_array().map(f64::to_bits)).collect();
        prop_assert_eq!(scene.own().positions.len(), used.len());
    }

    /// Any text gives a valid scene or an error.
    #[test]
    fn no_text_panics(obj in "((v|f|l|usemtl|mtllib s.mtl|vn|#|\\\\|q)?[ \t/0-9.eE+\\-na#\\\\\r]{0,20}\n){0,30}", mtl in "((newmtl|Kd|Ks|Ns|d|Tr|Ni|illum|map_Kd|Tf|Ke)? ?[ 0-9.eE+\\-na#]{0,12}\n){0,30}") {
        let obj = format!("mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl\nf 1 2 3\n{obj}");
        if let Ok(loaded) = load_with(obj, &mtl, &LoadOptions::default()) {
            prop_assert_eq!(&Scene::unpack(&loaded.scene.pack()).unwrap(), &loaded.scene);
        }
    }
}
