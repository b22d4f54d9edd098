//! Tests the materials that MTL files become.

#![allow(clippy::unwrap_used)]

use crate::common::{load_with, messages};
use holo_scene::{Bsdf, LoadOptions, Loaded, Material, SceneError};

fn try_load(mtl: &str) -> Result<Loaded, SceneError> {
    // A solid: a single sheet cannot be solid glass.
    let obj = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl m\n\
               f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    load_with(obj, mtl, &LoadOptions::default())
}

/// Returns the material `m` with these statements, and warnings.
fn material(statements: &str) -> (Material, Vec<String>) {
    let loaded = try_load(&format!("newmtl m\n{statements}\n")).unwrap();
    (loaded.scene.materials[0].clone(), messages(&loaded))
}

/// Returns its scattering; there must be no warning.
fn bsdf(statements: &str) -> Bsdf {
    let (material, warnings) = material(statements);
    assert!(warnings.is_empty(), "{statements}: {warnings:?}");
    material.bsdf
}

const KD: [f32; 3] = [0.1, 0.2, 0.3];
const KS: [f32; 3] = [0.4, 0.5, 0.6];

#[test]
fn illumination_models_are_the_surfaces_of_the_table() {
    let alpha = |ns: f64| (2.0 / (ns + 2.0)).sqrt() as f32;
    let cases = [
        ("Kd .1 .2 .3", Bsdf::Diffuse { kd: KD }),
        ("kd .1 .2 .3\nILLUM 1", Bsdf::Diffuse { kd: KD }),
        ("Kd .1 .2 .3\nKs .4 .5 .6\nillum 1\nNs 5", Bsdf::Diffuse { kd: KD }),
        ("Kd .1 .2 .3\nKs 0 0 0\nillum 2", Bsdf::Diffuse { kd: KD }),
        ("Kd 0.8", Bsdf::Diffuse { kd: [0.8; 3] }),
        ("Kd\t1e-1  +.2 \\\n 0.30 # warm", Bsdf::Diffuse { kd: KD }),
        ("Kd 1 1 1\nKd .1 .2 .3\nillum 1.0", Bsdf::Diffuse { kd: KD }),
        ("Ks .4 .5 .6\nillum 3\nNs 4998", Bsdf::Mirror { ks: KS }),
        ("Ks .4 .5 .6\nillum 3\nNs 999", Bsdf::Mirror { ks: KS }),
        ("Ks .4 .5 .6\nillum 3", Bsdf::Mirror { ks: KS }),
        ("Ks 0 0 0\nillum 3", Bsdf::Mirror { ks: [0.0; 3] }),
        ("Ks .4 .5 .6\nillum 3\nNs 98", Bsdf::Conductor { ks: KS, alpha: alpha(98.0) }),
        ("Ks .4 .5 .6\nillum 3\nNs 0", Bsdf::Conductor { ks: KS, alpha: 1.0 }),
        (
            "Ks 1 1 1\nTf .4 .5 .6\nNi 1.52\nd 0\nillum 4",
            Bsdf::ThinGlass { ior: 1.52, transmittance: KS },
        ),
        ("illum 4", Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] }),
        ("illum 7\nNi 1.33", Bsdf::Dielectric { ior: 1.33, transmittance: [1.0; 3], alpha: 0.0 }),
        (
            "illum 7\nNs 1000\nTf 0.5",
            Bsdf::Dielectric { ior: 1.5, transmittance: [0.5; 3], alpha: 0.0 },
        ),
        (
            "illum 7\nNs 30",
            Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: alpha(30.0) },
        ),
        (
            "Kd .1 .2 .3\nKs .4 .5 .6\nillum 2\nNs 198\nNi 1.4\nd 1",
            Bsdf::Coated { kd: KD, ks: KS, ior: 1.4, alpha: alpha(198.0) },
        ),
        (
            "Kd .1 .2 .3\nKs .4 .5 .6\nillum 2",
            Bsdf::Coated { kd: KD, ks: KS, ior: 1.5, alpha: 1.0 },
        ),
    ];
    for (statements, expected) in cases {
        assert_eq!(bsdf(statements), expected, "{statements}");
    }
}

#[test]
fn emission_is_one_sided_by_default_and_lamps_need_no_albedo() {
    let obj = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\nusemtl w\nf 3 2 1\n";
    let mtl = "newmtl m\nKe 17 12 4\nnewmtl w\nKd 0.5\n";
    for two_sided_lights in [false, true] {
        let options = LoadOptions { two_sided_lights, sky: [0.0, 1.0, 2.0] };
        let loaded = load_with(obj, mtl, &options).unwrap();
        let scene = loaded.scene;
        assert_eq!(loaded.warnings, []);
        assert_eq!(scene.materials[0].emission, [17.0, 12.0, 4.0]);
        assert_eq!(scene.materials[0].bsdf, Bsdf::Diffuse { kd: [0.0; 3] });
        assert_eq!(scene.materials[0].two_sided_emission, two_sided_lights);
        assert!(!scene.materials[1].two_sided_emission);
        assert_eq!(
            (scene.emitters().collect::<Vec<_>>(), scene.sky.as_even()),
            (vec![0], Some([0.0, 1.0, 2.0]))
        );
    }
}

#[test]
fn impossible_skies_are_refused() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    for bad in [-1.0, f32::NAN, f32::INFINITY, 1e30] {
        let options = LoadOptions { sky: [0.0, bad, 0.0], ..LoadOptions::default() };
        assert!(matches!(load_with(obj, "", &options), Err(SceneError::Sky)));
    }
}

#[test]
fn implausible_values_are_clamped_with_a_warning() {
    let cases = [
        (
            "Kd 1.5 0.5 -1",
            Bsdf::Diffuse { kd: [1.0, 0.5, 0.0] },
            "`Kd 1.5 0.5 -1` is implausible; it is clamped to [0, 1]",
        ),
        (
            "Ks 2\nillum 3\nNs 9999",
            Bsdf::Mirror { ks: [1.0; 3] },
            "`Ks 2 2 2` is implausible; it is clamped to [0, 1]",
        ),
        (
            "Ni 40\nillum 4",
            Bsdf::ThinGlass { ior: 10.0, transmittance: [1.0; 3] },
            "`Ni` 40 is impossible; 10 is taken",
        ),
        (
            "Ks 1\nNs -5\nillum 3",
            Bsdf::Conductor { ks: [1.0; 3], alpha: 1.0 },
            "`Ns` -5 is impossible; 0 is taken",
        ),
        (
            "Kd 1\nKs 1\nNi 1\nNs 0\nillum 2",
            Bsdf::Coated { kd: [1.0; 3], ks: [1.0; 3], ior: 1.5, alpha: 1.0 },
            "`Ni` 1 would make a coat invisible; 1.5 is taken",
        ),
    ];
    for (statements, expected, warning) in cases {
        let (material, warnings) = material(statements);
        assert_eq!(material.bsdf, expected);
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0].ends_with(warning), "{warnings:?}");
    }
    let (lamp, warnings) = material("Ke -1 2 1e30");
    assert_eq!((lamp.emission, warnings.len()), ([0.0, 2.0, 1e20], 1));
}

#[test]
fn tr_of_one_is_opaque() {
    let half = Bsdf::Diffuse { kd: [0.5; 3] };
    // Exporters that write both mean `d`, and `Tr 1` alone is an opaque surface's.
    assert_eq!(bsdf("Kd .5\nd 1\nTr 1"), half);
    assert_eq!(bsdf("Kd .5\nTr 1\nillum 2"), half);
}

#[test]
fn unsupported_statements_give_warnings_with_their_line() {
    let cases = [
        (
            "Kd 1 1 1\nmap_Kd -s 1 1 1 my wood.png",
            "s.mtl:3: `my wood.png`: texture `my wood.png` is not in the model's folder; grey 0.5 is taken",
        ),
        (
            "Kd 1 1 1\nmap_Ks b.png",
            "s.mtl:3: `map_Ks b.png` is ignored: this texture is not supported",
        ),
        ("Kd 1 1 1\nPs 0.5\nPs 0.6", "s.mtl:3: `Ps` is unknown and ignored (reported once)"),
        ("Kd .5\nillum 300", "s.mtl:3: material `m`: `illum` of this kind is taken as diffuse"),
        ("Kd .5\nillum -4", "s.mtl:3: material `m`: `illum` of this kind is taken as diffuse"),
        ("Kd .5\nillum 5", "s.mtl:3: material `m`: `illum` of this kind is taken as diffuse"),
        ("Kd .5\nillum 3", "s.mtl:3: material `m`: `illum 3` without `Ks` is taken as diffuse"),
        ("Kd .5\nKs 1", "s.mtl:1: material `m`: `Ks` is ignored without `illum`"),
        ("illum 1", "s.mtl:1: material `m`: it has no RGB `Kd`; grey 0.5 is taken"),
    ];
    for (statements, warning) in cases {
        let (_, warnings) = material(statements);
        assert_eq!(warnings[0], warning, "{statements}");
    }
}

#[test]
fn malformed_statements_are_left_out_with_their_line() {
    let cases = [
        ("Kd 1 2", "`Kd` takes three numbers, found 2"),
        ("Kd", "`Kd` takes three numbers, found 0"),
        ("Kd 1 nan 1", "`Kd` takes finite numbers, found `nan`"),
        ("Ke inf 0 0", "`Ke` takes finite numbers, found `inf`"),
        ("Ns", "`Ns` takes one number, found 0"),
        ("Ni 1 2", "`Ni` takes one number, found 2"),
        ("d x", "`d` takes a finite number, found `x`"),
        ("Tf 1 1 nan", "`Tf` takes finite numbers, found `nan`"),
        ("Tr inf", "`Tr` takes a finite number, found `inf`"),
        ("illum 1.5", "`illum` takes an integer, found `1.5`"),
        ("Kd spectral f.rfl 1", "`Kd` takes RGB colours, and this is `spectral`"),
    ];
    for (statement, problem) in cases {
        let (material, warnings) = material(&format!("Kd .1 .2 .3\n{statement}"));
        assert_eq!(material.bsdf, Bsdf::Diffuse { kd: KD }, "{statement}");
        assert_eq!(warnings, [format!("s.mtl:3: {problem}; it is left out")], "{statement}");
    }
    let loaded = try_load("Kd 1 1 1\nnewmtl m\nKd 0.5\n").unwrap();
    assert_eq!(messages(&loaded), ["s.mtl:1: `Kd` comes before any `newmtl`; it is left out"]);
}

#[test]
fn the_last_of_two_materials_of_one_name_counts() {
    let loaded = try_load("newmtl m\nKd 0.1\nnewmtl m\nKd 0.2\n").unwrap();
    assert_eq!(loaded.scene.materials[0].bsdf, Bsdf::Diffuse { kd: [0.2; 3] });
    assert_eq!(loaded.warnings.len(), 1);
    assert_eq!(loaded.warnings[0].line, Some(3));
}
