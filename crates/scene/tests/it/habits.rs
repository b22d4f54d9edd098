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
