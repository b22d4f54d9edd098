//! Findings in small scenes with one fault each.

#![allow(clippy::unwrap_used)]

use glam::DVec3;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Maps, Material, Scene, Shading, Texture, Wrap};
use holo_survey::{findings, white_materials};
use std::sync::Arc;

/// A closed tetrahedron at a place, with its fronts outside.
fn tetrahedron(at: f64, size: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| p * size + DVec3::X * at);
    (corners.to_vec(), vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
}

fn found(positions: &[DVec3], triangles: &[[u32; 3]], kd: f32) -> Vec<(&'static str, usize)> {
    let material = Material { bsdf: Bsdf::Diffuse { kd: [kd; 3] }, ..Material::grey("m") };
    let ids = vec![0; triangles.len()];
    let scene = Scene::from_world(positions, triangles, &ids, vec![material], [0.0; 3]).unwrap().0;
    findings(&Raycaster::build(Arc::new(scene)).unwrap())
        .iter()
        .map(|found| (found.kind, found.count))
        .collect()
}

#[test]
fn each_fault_is_found_and_nothing_else() {
    let (positions, triangles) = tetrahedron(0.0, 1.0);
    let with = |change: fn(&mut Vec<[u32; 3]>)| {
        let mut triangles = triangles.clone();
        change(&mut triangles);
        found(&positions, &triangles, 0.5)
    };
    assert_eq!(with(|_| ()), []);
    assert_eq!(with(|t| t.truncate(3)), [("open edges", 3)]);
    assert_eq!(with(|t| t[3].reverse()), [("edges whose faces are turned round", 3)]);
    assert_eq!(with(|t| t.push([3, 2, 1])), [("duplicate faces", 1)]);
    let white = found(&positions, &triangles, 0.96);
    assert_eq!(white, [("materials that absorb hardly any light", 1)]);
}

#[test]
fn faces_in_one_plane_are_found_however_they_are_cut() {
    let square = |low: f64, high: f64| {
        [(low, low), (high, low), (high, high), (low, high)]
            .map(|(x, y)| DVec3::new(x, y, 0.3 * x - 0.7 * y))
    };
    let quads = [[0, 1, 2], [0, 2, 3], [4, 7, 6], [4, 6, 5]];
    let count = |low: f64, high: f64| {
        let positions = [square(0.0, 1.0), square(low, high)].concat();
        let found = found(&positions, &quads, 0.5);
        found.iter().find(|(kind, _)| kind.contains("one plane")).map(|(_, count)| *count)
    };
    assert_eq!(count(0.2, 0.7), Some(4));
    assert_eq!(count(0.9, 3.0), Some(4));
    // Squares that only touch do not overlap.
    assert_eq!(count(1.0, 2.0), None);
    assert_eq!(count(1.5, 2.0), None);
}

#[test]
fn parts_that_no_view_needs_are_found() {
    let (mut positions, mut triangles) = tetrahedron(0.0, 1.0);
    let (small, faces) = tetrahedron(5.0, 1e-5);
    positions.extend(small);
    triangles.extend(faces.iter().map(|t| t.map(|corner| corner + 4)));
    assert_eq!(found(&positions, &triangles, 0.5), [("very small parts", 1)]);
}

/// Returns whether a triangle of this material, with colours of corners and a texture of one
/// texel, is one that absorbs hardly any light.
fn is_white(bsdf: Bsdf, colour: [u8; 3], texel: Option<u8>) -> bool {
    let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let materials = vec![Material { bsdf, ..Material::grey("m") }];
    let scene = Scene::new(DVec3::ZERO, positions, vec![[0, 1, 2]], vec![0], materials, [0.0; 3]);
    let textures = texel.map(|texel| {
        // A BMP file of one texel.
        let mut file = b"BM".to_vec();
        let words = [58, 0, 54, 40, 1, 1, 1 | 24 << 16, 0, 4, 0, 0, 0, 0];
        file.extend(words.into_iter().flat_map(i32::to_le_bytes));
        file.extend([texel, texel, texel, 0]);
        Texture::decode(file.into(), [Wrap::Repeat; 2], false, false).unwrap()
    });
    let shading = Shading {
        colours: vec![[colour; 3]].into(),
        uvs: texel.iter().map(|_| [[0.5; 2]; 3]).collect(),
        maps: texel.iter().map(|_| Maps { base: Some(0), ..Maps::default() }).collect(),
        textures: textures.into_iter().collect(),
        ..Shading::default()
    };
    let scene = scene.and_then(|scene| scene.with_shading(shading)).unwrap();
    !white_materials(&scene).is_empty()
}

#[test]
fn surfaces_of_all_kinds_that_absorb_hardly_any_light_are_found() {
    let plain = |bsdf| is_white(bsdf, [255; 3], None);
    let (ior, alpha) = (1.5, 0.25);
    for share in [0.9, 0.96] {
        let colour = [share; 3];
        for bsdf in [
            Bsdf::Diffuse { kd: colour },
            Bsdf::Mirror { ks: colour },
            Bsdf::Conductor { ks: colour, alpha },
            Bsdf::Coated { kd: colour, ks: [1.0; 3], ior, alpha },
        ] {
            assert_eq!(plain(bsdf), share > 0.95, "{bsdf:?}");
        }
    }
    // A coat reflects nine percent of diffuse light before its base does.
    assert!(plain(Bsdf::Coated { kd: [0.948; 3], ks: [1.0; 3], ior, alpha }));
    assert!(!plain(Bsdf::Conductor { ks: [1.0, 0.77, 0.34], alpha }), "gold");
    assert!(!plain(Bsdf::ThinGlass { ior, transmittance: [1.0; 3] }));
    let paint = Bsdf::Diffuse { kd: [1.0; 3] };
    for (colour, texel, expected) in [
        ([255; 3], Some(255), true),
        ([255; 3], Some(240), false),
        ([240; 3], None, false),
        ([254; 3], None, true),
        ([240; 3], Some(255), false),
    ] {
        assert_eq!(is_white(paint, colour, texel), expected, "{colour:?} {texel:?}");
    }
}
