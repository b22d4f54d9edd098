//! Tests the habits of programs that write MTL files, one for each row of the manual's table.

#![allow(clippy::unwrap_used)]

use crate::common;
use holo_scene::{Bsdf, LoadOptions};

const KD: [f32; 3] = [0.25, 0.5, 0.75];

/// Returns the scattering of the material `m` of an MTL file, and the warnings.
fn said(mtl: &str) -> (Bsdf, String) {
    let obj = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";
    let folder = tempfile::tempdir().unwrap();
    let picture = image::RgbImage::from_raw(1, 1, vec![255; 3]).unwrap();
    picture.save(folder.path().join("t.png")).unwrap();
    std::fs::write(folder.path().join("s.mtl"), mtl).unwrap();
    let loaded = common::load_in(folder.path(), obj, &LoadOptions::default()).unwrap();
    let warnings: Vec<String> = loaded.warnings.iter().map(|w| w.text.clone()).collect();
    (loaded.scene.materials[0].bsdf, warnings.join("\n"))
}

/// Returns the scattering of the material `m` of an MTL file that gives no warnings.
fn material(mtl: &str) -> Bsdf {
    let (bsdf, warnings) = said(mtl);
    assert_eq!(warnings, "", "{mtl}");
    bsdf
}

#[test]
fn blender_s_default_is_a_dull_coat_of_four_percent() {
    let mtl = "# Blender 4.1.0 MTL File: 'room.blend'\n# www.blender.org\n\nnewmtl m\nNs 250.0\n\
               Ka 1 1 1\nKd 0.25 0.5 0.75\nKs 0.5 0.5 0.5\nKe 0 0 0\nNi 1.5\nd 1.0\nillum 2\n";
    // Roughness 0.5.
    assert_eq!(material(mtl), Bsdf::Coated { kd: KD, ks: [1.0; 3], ior: 1.5, alpha: 0.25 });
    // Without the comment, the numbers mean what they say.
    let plain = mtl.split_once("newmtl").unwrap().1;
    let coat = material(&format!("newmtl{plain}"));
    let Bsdf::Coated { ks, alpha, .. } = coat else { panic!("{coat:?}") };
    assert!(ks == [0.5; 3] && (alpha - (2.0f32 / 252.0).sqrt()).abs() < 1e-6, "{coat:?}");
}

#[test]
fn blender_s_metals_have_illum_3_and_their_colour_in_kd() {
    let mtl = "# Blender MTL File: 'room.blend'\nnewmtl m\nNs 640\nKa 1 1 1\nKd 0.25 0.5 0.75\n\
               Ks 0.5 0.5 0.5\nNi 1.45\nd 1\nillum 3\n";
    let Bsdf::Conductor { ks, alpha } = material(mtl) else { panic!() };
    // Roughness 0.2.
    assert!(ks == KD && (alpha - 0.04).abs() < 1e-6, "{ks:?} {alpha}");
    assert_eq!(material(&mtl.replace("Ns 640", "Ns 1000")), Bsdf::Mirror { ks: KD });
    // Other programs mean a mirror of colour Ks.
    let plain = mtl.split_once('\n').unwrap().1.replace("Ns 640\n", "");
    assert_eq!(material(&plain), Bsdf::Mirror { ks: [0.5; 3] });
}

#[test]
fn blender_s_glass_has_illum_9_and_little_d() {
    let mtl = "# Blender 4.1.0\nnewmtl m\nNs 1000\nKd 0.5 1 1\nKs 0.5 0.5 0.5\nNi 1.45\nd 0.1\n\
               illum 9\n";
    let (bsdf, warning) = said(mtl);
    assert_eq!(bsdf, Bsdf::Diffuse { kd: [0.5, 1.0, 1.0] });
    assert!(warning.contains("is taken as diffuse"), "{warning}");
}

#[test]
fn illum_2_without_ks_is_plain() {
    let mtl = "newmtl m\nKa 0 0 0\nKd 0.25 0.5 0.75\nKs 0 0 0\nNs 10\nillum 2\n";
    assert_eq!(material(mtl), Bsdf::Diffuse { kd: KD });
}

#[test]
fn a_black_kd_beside_a_texture_is_white() {
    for kd in ["Kd 0 0 0\n", ""] {
        let mtl = format!("newmtl m\n{kd}illum 1\nmap_Kd t.png\n");
        assert_eq!(material(&mtl), Bsdf::Diffuse { kd: [1.0; 3] });
    }
    assert_eq!(material("newmtl m\nKd 0 0 0\nillum 1\n"), Bsdf::Diffuse { kd: [0.0; 3] });
}

#[test]
fn max_writes_d_and_tr_and_d_counts() {
    let opaque = "newmtl m\n\tNs 10\n\tNi 1.5\n\td 1\n\tTr 0\n\tTf 1 1 1\n\tillum 2\n\
                  \tKd 0.25 0.5 0.75\n\tKs 0 0 0\n";
    assert_eq!(material(opaque), Bsdf::Diffuse { kd: KD });
    let clear = opaque.replace("d 1\n\tTr 0", "d 0.25\n\tTr 0.75");
    assert_eq!(material(&clear), Bsdf::Diffuse { kd: KD });
    // Programs that mean `d` write `Tr 1` for opaque surfaces.
    assert_eq!(material("newmtl m\nKd 0.25 0.5 0.75\nTr 1\n"), Bsdf::Diffuse { kd: KD });
}

#[test]
fn sketchup_s_and_revit_s_glass_covers_little() {
    let (bsdf, _) = said("newmtl m\nKd 0.5 0.75 1\nKs 0.33 0.33 0.33\nd 0.2\n");
    assert_eq!(bsdf, Bsdf::Diffuse { kd: [0.5, 0.75, 1.0] });
    let revit = "newmtl m\nKd 0.4 0.8 0.8\nKs 1 1 1\nNs 200\nTr 0.75\nillum 2\n";
    assert!(matches!(material(revit), Bsdf::Coated { kd: [0.4, 0.8, 0.8], .. }));
    // SketchUp's highlights on opaque surfaces have no width.
    let (bsdf, warning) = said("newmtl m\nKd 0.25 0.5 0.75\nKs 0.33 0.33 0.33\n");
    assert_eq!(bsdf, Bsdf::Diffuse { kd: KD });
    assert!(warning.contains("`Ks` is ignored without `illum`"), "{warning}");
}

#[test]
fn rhino_s_black_tf_is_a_default() {
    let mtl = "newmtl m\nKa 0 0 0\nKd 0.25 0.5 0.75\nKs 1 1 1\nTf 0 0 0\nd 0.2\nNs 0\n";
    let (bsdf, _) = said(mtl);
    assert_eq!(bsdf, Bsdf::Diffuse { kd: KD });
    let stated = mtl.replace("Tf 0 0 0", "Tf 0.9 0.9 0.9\nNi 1.52\nillum 4");
    assert_eq!(material(&stated), Bsdf::ThinGlass { ior: 1.52, transmittance: [0.9; 3] });
}

#[test]
fn maya_s_illum_4_of_air_is_opaque() {
    let mtl = "newmtl m\nillum 4\nKd 0.25 0.5 0.75\nKa 0 0 0\nTf 1 1 1\nNi 1.00\n";
    let (bsdf, warning) = said(mtl);
    assert_eq!(bsdf, Bsdf::Diffuse { kd: KD });
    assert!(warning.contains("taken as opaque"), "{warning}");
    let glass = material(&mtl.replace("Ni 1.00", "Ni 1.5"));
    assert_eq!(glass, Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] });
}

#[test]
fn pr_and_pm_are_roughness_and_metalness() {
    let of = |more: &str| material(&format!("newmtl m\nKd 0.25 0.5 0.75\nillum 2\n{more}\n"));
    let coat = Bsdf::Coated { kd: KD, ks: [1.0; 3], ior: 1.5, alpha: 0.25 };
    assert_eq!(of("Pr 0.5\nPm 0"), coat);
    assert_eq!(of("Pr 0.5\nPm 1"), Bsdf::Conductor { ks: KD, alpha: 0.25 });
    assert_eq!(of("Pr 0\nPm 1"), Bsdf::Mirror { ks: KD });
    assert_eq!(of("Pr 0.9\nPm 0"), Bsdf::Diffuse { kd: KD });
}

#[test]
fn cinema_4d_writes_illum_7_for_everything() {
    let mtl = "# WaveFront *.mtl file (generated by CINEMA 4D)\nnewmtl m\nKa 1 1 1\n\
               Kd 0.25 0.5 0.75\nKs 1 1 1\nNs 50\nillum 7\nnewmtl n\nillum 7\nnewmtl o\nillum 1\n";
    let (bsdf, warning) = said(mtl);
    assert_eq!(bsdf, Bsdf::Diffuse { kd: KD });
    assert_eq!(
        warning,
        "`illum 7` counts as 1 (2 in the file): Cinema 4D writes it for everything"
    );
    // Others mean glass.
    let plain = mtl.split_once('\n').unwrap().1;
    assert!(matches!(said(plain).0, Bsdf::ThinGlass { .. }), "{:?}", said(plain));
}

#[test]
fn maya_writes_tf_as_one_minus_transparency() {
    let glass = "newmtl m\nillum 4\nKd 0.25 0.5 0.75\nKa 0 0 0\nTf 0 0 0\nNi 1.8\nKs 1 1 1\n";
    let clear = Bsdf::ThinGlass { ior: 1.8, transmittance: [1.0; 3] };
    let (bsdf, warning) = said(glass);
    assert_eq!(bsdf, clear, "a pane that transmits nothing is no glass");
    assert!(warning.contains("`Tf` is taken as 1 - transparency"), "{warning}");
    // Beside opaque paint, any `Tf` is Maya's.
    let paint = "newmtl paint\nillum 4\nKd 0.8 0.8 0.8\nKa 0 0 0\nTf 1 1 1\nNi 1\n";
    let tinted = glass.replace("Tf 0 0 0", "Tf 0.25 0.5 0.75");
    let expected = Bsdf::ThinGlass { ior: 1.8, transmittance: [0.75, 0.5, 0.25] };
    assert_eq!(said(&(tinted.clone() + paint)).0, expected);
    assert_eq!(said(&(glass.replace("Tf 0 0 0", "Tf 1 1 1") + paint)).0, Bsdf::Diffuse { kd: KD });
    // Alone, or in another order of statements, it is the format's.
    let plain = Bsdf::ThinGlass { ior: 1.8, transmittance: [0.25, 0.5, 0.75] };
    assert_eq!(material(&tinted), plain);
    let other = "newmtl o\nKd 1 1 1\nillum 1\n";
    assert_eq!(said(&(tinted + paint + other)).0, plain);
}

/// Returns the materials of triangles of an OBJ file whose material `g` is solid glass, and the
/// warnings.
fn glass(obj: &str) -> (Vec<Bsdf>, String) {
    let mtl = "newmtl g\nNi 1.5\nTf 1 1 1\nillum 7\nnewmtl w\nKd 0.5 0.5 0.5\n";
    let obj = format!("mtllib s.mtl\nusemtl g\n{obj}");
    let loaded = common::load_with(obj, mtl, &LoadOptions::default()).unwrap();
    let warnings: Vec<String> = loaded.warnings.iter().map(|w| w.text.clone()).collect();
    let scene = loaded.scene;
    (scene.triangles().map(|t| scene.material(t).bsdf).collect(), warnings.join("\n"))
}

#[test]
fn a_single_sheet_of_solid_glass_is_a_pane() {
    let pane = Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] };
    let solid = Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.0 };
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    let (found, said) = glass(square);
    assert_eq!(found, [pane; 2]);
    assert!(said.contains("enclose nothing: they are taken as panes (1)"), "{said}");
    // A window of two sheets without a rim encloses glass, and so does a box with a crack.
    let behind = "v 0 0 -0.1\nv 1 0 -0.1\nv 1 1 -0.1\nv 0 1 -0.1\n";
    let (found, said) = glass(&format!("{square}{behind}f 8 7 6 5\n"));
    assert_eq!((found, said.as_str()), (vec![solid; 4], ""));
    let sides = "f 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\n";
    let (found, said) = glass(&format!("{square}{behind}f 8 7 6 5\n{sides}"));
    assert_eq!((found, said.as_str()), (vec![solid; 10], ""));
    // Another surface may close it.
    let closed = format!("{square}{behind}{sides}f 4 8 5 1\nusemtl w\nf 8 7 6 5\n");
    let (found, said) = glass(&closed);
    assert_eq!((&found[..10], said.as_str()), (&[solid; 10][..], ""));
    // Both at once.
    let apart = "v 5 0 0\nv 6 0 0\nv 6 1 0\nf 9 10 11\n";
    let (found, said) = glass(&format!("{square}{behind}f 8 7 6 5\n{sides}f 4 8 5 1\n{apart}"));
    assert_eq!((&found[..12], found[12]), (&[solid; 12][..], pane));
    assert!(said.contains("taken as panes (1)"), "{said}");
}

#[test]
fn names_are_compared_in_one_normal_form() {
    // One letter in the MTL file, and a letter with an accent of its own in the OBJ file.
    for (defined, used) in [("B\u{f6}den", "Bo\u{308}den"), ("Bo\u{308}den", "B\u{f6}den")] {
        let obj = format!("mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl {used}\nf 1 2 3\n");
        let mtl = format!("newmtl {defined}\nKd 0.25 0.5 0.75\n");
        let loaded = common::load_with(obj, &mtl, &LoadOptions::default()).unwrap();
        assert_eq!(loaded.warnings, []);
        assert_eq!(loaded.scene.materials[0].bsdf, Bsdf::Diffuse { kd: KD });
    }
}

#[test]
fn blanks_tabs_and_carriage_returns_after_names_do_not_count() {
    let obj = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl  m\nf 1 2 3\n\
               usemtl\tm\r\nf 1 2 4\nusemtl m \t\nf 1 3 4\n";
    for mtl in ["newmtl  m\nKd .25 .5 .75\n", "newmtl\tm \r\nKd .25 .5 .75\r\n"] {
        let loaded = common::load_with(obj, mtl, &LoadOptions::default()).unwrap();
        assert_eq!(loaded.warnings, []);
        let scene = loaded.scene;
        assert!(scene.triangles().all(|t| scene.material(t).bsdf == Bsdf::Diffuse { kd: KD }));
    }
}

#[test]
fn textures_that_cannot_be_read_are_grey() {
    let grey = Bsdf::Diffuse { kd: [0.5; 3] };
    for mtl in ["Kd 1 1 1\nmap_Kd nowhere.jpg", "map_Kd nowhere.jpg", "Kd 0 0 0\nmap_Kd s.obj"] {
        let (bsdf, warning) = said(&format!("newmtl m\n{mtl}\n"));
        assert_eq!(bsdf, grey, "{mtl}");
        assert!(warning.contains("grey 0.5 is taken"), "{warning}");
    }
    assert_eq!(said("newmtl m\nKd 1 1 1\nmap_Kd t.png\n").0, Bsdf::Diffuse { kd: [1.0; 3] });
}
