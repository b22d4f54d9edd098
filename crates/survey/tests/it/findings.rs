//! Findings in small scenes with one fault each.

#![allow(clippy::unwrap_used)]

use glam::DVec3;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use holo_survey::findings;
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
