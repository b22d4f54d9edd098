//! Tests thin slabs of solid glass, which are panes in their middle.

#![allow(clippy::unwrap_used)]

use crate::common::gltf::{Arrays, file, load};
use crate::common::{load_with, messages};
use glam::{DMat3, DVec3};
use holo_scene::{Bsdf, LoadOptions, Loaded, Scene};
use std::fmt::Write as _;

const SOLID: Bsdf = Bsdf::Dielectric { ior: 1.5, transmittance: [0.5, 1.0, 1.0], alpha: 0.0 };
/// Light crosses two boundaries of a slab.
const PANE: Bsdf = Bsdf::ThinGlass { ior: 1.5, transmittance: [0.25, 1.0, 1.0] };

/// The text of an OBJ file.
#[derive(Default)]
struct Obj {
    text: String,
    corners: usize,
}

impl Obj {
    /// Adds a prism over a polygon, from height 0 to this one, as `placed`. The upper face has a
    /// corner in its middle.
    fn prism(mut self, polygon: &[[f64; 2]], height: f64, placed: impl Fn(DVec3) -> DVec3) -> Obj {
        let count = polygon.len();
        for z in [0.0, height] {
            for [x, y] in polygon {
                let DVec3 { x, y, z } = placed(DVec3::new(*x, *y, z));
                writeln!(self.text, "v {x} {y} {z}").unwrap();
            }
        }
        let middle =
            polygon.iter().fold(DVec3::ZERO, |sum, p| sum + DVec3::new(p[0], p[1], height));
        let DVec3 { x, y, z } = placed((middle / count as f64).with_z(height));
        writeln!(self.text, "v {x} {y} {z}").unwrap();
        let first = self.corners + 1;
        let lower: Vec<String> = (0..count).rev().map(|k| (first + k).to_string()).collect();
        writeln!(self.text, "f {}", lower.join(" ")).unwrap();
        for (k, next) in (0..count).map(|k| (k, (k + 1) % count)) {
            let [a, b] = [first + k, first + next];
            writeln!(self.text, "f {} {} {}", a + count, b + count, first + 2 * count).unwrap();
            writeln!(self.text, "f {a} {b} {} {}", b + count, a + count).unwrap();
        }
        self.corners += 2 * count + 1;
        self
    }

    /// The same for a square of side 1.
    fn slab(self, height: f64, placed: impl Fn(DVec3) -> DVec3) -> Obj {
        self.prism(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], height, placed)
    }

    fn load(&self, mtl: &str) -> Loaded {
        let obj = format!("mtllib s.mtl\nusemtl g\n{}", self.text);
        load_with(obj, mtl, &LoadOptions::default()).unwrap()
    }
}

const GLASS: &str = "newmtl g\nNi 1.5\nTf 0.5 1 1\nillum 7\nnewmtl w\nKd 0.5 0.5 0.5\n";

/// Returns the scattering of each triangle.
fn bsdfs(scene: &Scene) -> Vec<Bsdf> {
    scene.triangles().map(|triangle| scene.material(triangle).bsdf).collect()
}

/// Returns whether nothing of a model became a pane.
fn stays_solid(obj: &Obj, mtl: &str) -> bool {
    let loaded = obj.load(mtl);
    let is_solid = |bsdf: &Bsdf| matches!(bsdf, Bsdf::Dielectric { .. });
    bsdfs(&loaded.scene).iter().all(is_solid) && messages(&loaded).is_empty()
}

#[test]
fn a_thin_slab_is_a_pane_in_its_middle() {
    let disc: Vec<[f64; 2]> =
        (0..48).map(|k| f64::from(k).to_radians() * 7.5).map(|t| [t.cos(), t.sin()]).collect();
    let turn = DMat3::from_rotation_x(0.7) * DMat3::from_rotation_y(-0.4);
    let far = DVec3::new(5e5, 5.4e6, 300.0);
    let turned = |p: DVec3| turn * p + far;
    let mirrored = |p: DVec3| p.with_x(-p.x);
    let cases: [(Obj, f64, DVec3); 4] = [
        (Obj::default().slab(0.006, |p| p), 1.0, DVec3::Z),
        (Obj::default().slab(0.006, mirrored), 1.0, DVec3::Z),
        (Obj::default().slab(0.02, turned), 1.0, turn * DVec3::Z),
        (
            Obj::default().prism(&disc, 0.04, turned),
            24.0 * 7.5f64.to_radians().sin(),
            turn * DVec3::Z,
        ),
    ];
    for (obj, area, normal) in cases {
        let loaded = obj.load(GLASS);
        let said = ["s.obj: thin slabs of solid glass are taken as panes in their middle (1)"];
        assert_eq!(messages(&loaded), said);
        let scene = loaded.scene;
        assert!(bsdfs(&scene).iter().all(|bsdf| *bsdf == PANE));
        let found: f64 = scene.triangles().map(|triangle| scene.area(triangle)).sum();
        assert!((found - area).abs() < 1e-4 * area, "{found} is not {area}");
        for triangle in scene.triangles() {
            assert!(scene.normal(triangle).as_dvec3().dot(normal).abs() > 0.999_9);
        }
    }
    // The place, beside a wall that stays as it is.
    let mut obj = Obj::default().slab(0.006, |p| p);
    obj.text += "usemtl w\nv 0 0 3\nv 1 0 3\nv 0 1 3\nf -3 -2 -1\n";
    let scene = obj.load(GLASS).scene;
    assert_eq!(bsdfs(&scene), [PANE, PANE, Bsdf::Diffuse { kd: [0.5; 3] }]);
    let height = |triangle: u32| scene.corners(triangle).map(|p| f64::from(p.z) + scene.origin.z);
    assert!((0..2).flat_map(height).all(|z| (z - 0.003).abs() < 1e-6));
    assert!(height(2).iter().all(|z| (z - 3.0).abs() < 1e-6));
}

#[test]
fn glass_that_bends_or_blurs_light_stays_solid() {
    let thick = Obj::default().slab(0.1, |p| p);
    let wedge = Obj::default().slab(0.006, |p| p.with_z(p.z * (1.0 + p.x)));
    let bent = Obj::default().slab(0.006, |p| p.with_z(p.z + 0.1 * p.x * p.y));
    let thin = Obj::default().slab(0.006, |p| p);
    for obj in [&thick, &wedge, &bent] {
        assert!(stays_solid(obj, GLASS));
    }
    assert!(stays_solid(&thin, &GLASS.replace("illum 7", "Ns 20\nillum 7")));
    assert!(stays_solid(&thin, &GLASS.replace("illum 7", "Ke 1 1 1\nillum 7")));
    assert!(!stays_solid(&thin, GLASS));
}

#[test]
fn slabs_that_touch_other_glass_stay_solid() {
    let slab = || Obj::default().slab(0.006, |p| p);
    // A second layer, and water behind a wall of glass.
    assert!(stays_solid(&slab().slab(0.004, |p| p + DVec3::new(0.0, 0.0, 0.006)), GLASS));
    assert!(stays_solid(&slab().slab(0.5, |p| p + DVec3::new(0.0, 0.0, 0.006)), GLASS));
    // Two panes with air between them, a row, and a corner.
    for place in [
        |p: DVec3| p + DVec3::new(0.0, 0.0, 0.016),
        |p: DVec3| p + DVec3::new(1.0, 0.0, 0.0),
        |p: DVec3| DVec3::new(1.0 + p.z, p.y, p.x),
    ] {
        let loaded = slab().slab(0.006, place).load(GLASS);
        let is_corner = place(DVec3::X).z == 1.0;
        // Glass that meets in a corner may be one part.
        if !is_corner {
            assert_eq!(bsdfs(&loaded.scene), [PANE; 4], "{:?}", messages(&loaded));
        }
    }
    // Solid glass elsewhere keeps the material.
    let apart = slab().slab(0.5, |p| p + DVec3::new(5.0, 0.0, 0.0));
    let found = bsdfs(&apart.load(GLASS).scene);
    assert_eq!(found.iter().filter(|bsdf| **bsdf == PANE).count(), 2);
    assert_eq!(found.iter().filter(|bsdf| **bsdf == SOLID).count(), 14);
}

#[test]
fn slabs_of_shared_meshes_are_panes_too() {
    let mut arrays = Arrays::default();
    let box_of = |height: f32| -> Vec<f32> {
        (0..8)
            .flat_map(|k| [(k & 1) as f32, (k >> 1 & 1) as f32, height * (k >> 2) as f32])
            .collect()
    };
    let faces = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    let faces: Vec<u8> = faces.into_iter().flatten().collect();
    let strip: Vec<f32> = (0..300).flat_map(|k| [k as f32, (k % 2) as f32, 2.0]).collect();
    arrays.floats("VEC3", &box_of(0.006));
    arrays.add(&faces, 5121, "SCALAR", 36, "");
    arrays.floats("VEC3", &strip);
    let primitive = r#""attributes":{"POSITION":0},"indices":1,"material":0},
        {"attributes":{"POSITION":2},"mode":5"#;
    let glass = r#"{"pbrMetallicRoughness":{"roughnessFactor":0,"baseColorFactor":[1,1,1,1]},
        "extensions":{"KHR_materials_transmission":{"transmissionFactor":1},
        "KHR_materials_volume":{"thicknessFactor":0.006}}}"#;
    let nodes: Vec<String> =
        (0..1000).map(|k| format!(r#"{{"mesh":0,"translation":[0,{},0]}}"#, 9 * k)).collect();
    let loaded = load(&file(&arrays, primitive, &nodes.join(","), glass, ""));
    assert_eq!(loaded.scene.instances().len(), 1000);
    assert_eq!(loaded.scene.triangles().len(), 1000 * 300);
    let said = messages(&loaded);
    assert!(said.iter().any(|text| text.ends_with("panes in their middle (1)")), "{said:?}");
    assert!(!said.iter().any(|text| text.contains("without area")), "{said:?}");
}
