//! Tests which triangles are shiny objects.

#![allow(clippy::unwrap_used)]

use std::f64::consts::{PI, TAU};

use crate::common::instanced;
use glam::DVec3;
use holo_scene::{Bsdf, Material, Scene, ShinyObjects};

const MIRROR: Bsdf = Bsdf::Mirror { ks: [0.9; 3] };

/// The triangles of a ball.
fn ball(centre: DVec3, radius: f64) -> Vec<[DVec3; 3]> {
    let at = |ring: u32, turn: u32| {
        let (height, angle) = (PI * f64::from(ring) / 12.0, TAU * f64::from(turn % 24) / 24.0);
        // The poles are one point each.
        let flat = if ring.is_multiple_of(12) { 0.0 } else { height.sin() };
        centre + radius * DVec3::new(flat * angle.cos(), flat * angle.sin(), -height.cos())
    };
    let quad = |(ring, turn): (u32, u32)| {
        let corners =
            [at(ring, turn), at(ring, turn + 1), at(ring + 1, turn + 1), at(ring + 1, turn)];
        [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
    };
    let quads = (0..12).flat_map(|ring| (0..24).map(move |turn| (ring, turn)));
    quads.flat_map(quad).collect()
}

/// The faces of a cube.
fn cube(centre: DVec3, half: f64) -> Vec<[DVec3; 3]> {
    let corner = |bits: usize| {
        let side = |axis: usize| if bits >> axis & 1 == 1 { half } else { -half };
        centre + DVec3::new(side(0), side(1), side(2))
    };
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let halves = |q: &[usize; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]].map(|t| t.map(corner));
    quads.iter().flat_map(halves).collect()
}

/// A scene of these shapes.
fn scene(shapes: &[(Vec<[DVec3; 3]>, Bsdf)]) -> Scene {
    let mut triangles: Vec<[DVec3; 3]> = Vec::new();
    let mut ids = Vec::new();
    for (number, (shape, _)) in (0..).zip(shapes) {
        triangles.extend(shape);
        ids.extend(vec![number; shape.len()]);
    }
    let corners: Vec<[u32; 3]> =
        (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let material = |(_, bsdf): &(_, Bsdf)| Material { bsdf: *bsdf, ..Material::grey("m") };
    let materials = shapes.iter().map(material).collect();
    Scene::from_world(triangles.as_flattened(), &corners, &ids, materials, [0.0; 3]).unwrap().0
}

#[test]
fn connected_curved_triangles_of_one_shiny_material_are_an_object() {
    let (left, right) = (DVec3::new(-2.0, 0.0, 0.0), DVec3::new(2.0, 0.0, 1.0));
    let both = [ball(left, 1.0), ball(right, 0.5)].concat();
    let glass = Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.0 };
    let brass = Bsdf::Conductor { ks: [0.9, 0.8, 0.4], alpha: 0.2 };
    let scene = scene(&[
        (both.clone(), MIRROR),
        (ball(DVec3::Z * 5.0, 1.0), Bsdf::Diffuse { kd: [0.5; 3] }),
        (cube(DVec3::Z * 9.0, 1.0), MIRROR),
        (ball(DVec3::Y * 6.0, 0.2), glass),
        (ball(DVec3::Y * 8.0, 0.3), brass),
    ]);
    let shiny = ShinyObjects::find(&scene).unwrap();
    let expected = [(0, left), (0, right), (3, DVec3::Y * 6.0), (4, DVec3::Y * 8.0)];
    assert_eq!(shiny.centres().len(), expected.len());
    for (object, (material, at)) in (0..).zip(expected) {
        let (centre, at) = (shiny.centres()[object as usize], (at - scene.origin).as_vec3());
        assert!(centre.distance(at) < 1e-5, "{centre} {at}");
        let own = shiny.triangles_of(object);
        // The quadrilaterals at the poles are triangles.
        assert_eq!(own.len(), ball(DVec3::ZERO, 1.0).len() - 2 * 24);
        let is_own = |triangle| shiny.of(triangle) == Some(object);
        let is_of = |triangle| scene.material_id(triangle) == material;
        assert!(own.iter().all(|&(_, triangle)| is_own(triangle) && is_of(triangle)));
    }
    assert!(shiny.triangles_of(4).is_empty());
    let of_ball = ball(left, 1.0).len() as u32;
    assert_eq!((shiny.of(0), shiny.of(of_ball)), (Some(0), Some(1)));
    // The diffuse ball and the mirrors of the flat cube are none.
    let first = scene.triangles().find(|&t| scene.material_id(t) == 1).unwrap();
    assert_eq!((shiny.of(first), shiny.of(u32::MAX)), (None, None));
    assert!(
        scene.triangles().filter(|&t| scene.material_id(t) == 2).all(|t| shiny.of(t).is_none())
    );
}

#[test]
fn balls_that_touch_in_a_point_are_two_objects() {
    let scene = scene(&[([ball(DVec3::ZERO, 1.0), ball(DVec3::Z * 2.0, 1.0)].concat(), MIRROR)]);
    assert_eq!(ShinyObjects::find(&scene).unwrap().centres().len(), 2);
}

#[test]
fn scenes_of_flat_or_dull_surfaces_have_no_shiny_objects() {
    assert_eq!(ShinyObjects::find(&scene(&[(cube(DVec3::ZERO, 1.0), MIRROR)])), None);
    let dull = Bsdf::Diffuse { kd: [0.5; 3] };
    assert_eq!(ShinyObjects::find(&scene(&[(ball(DVec3::ZERO, 1.0), dull)])), None);
}

#[test]
fn instances_have_the_objects_of_their_flattened_scene() {
    let mut shared = instanced::scene();
    for material in &mut shared.materials {
        material.bsdf = MIRROR;
    }
    assert_eq!(ShinyObjects::find(&shared), ShinyObjects::find(&shared.flattened()));
}
