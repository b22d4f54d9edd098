//! Rough metal: its likely light where nothing is known, and its border with other surfaces.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::*;
use glam::DVec3;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use std::sync::Arc;

const METAL: Bsdf = Bsdf::Conductor { ks: [0.5; 3], alpha: 0.1 };

#[test]
fn rough_metal_without_samples_shows_the_light_that_it_mirrors() {
    let raycaster = walled_room(METAL);
    // The floor is as bright as the sky, so the metal reflects radiance 1 everywhere.
    let (view, drawn) = seen_by(&raycaster, &floor_rays(200, |_, _| 1.0), &to_wall());
    let mut found = 0;
    for (seen, pixel) in view.seen.iter().zip(drawn.pixels).filter(|(seen, _)| seen.material == 1) {
        assert!((pixel[1] / 0.5 - 1.0).abs() < 0.02, "{pixel:?} at {:?}", seen.point);
        found += 1;
    }
    assert!(found > 1000, "{found} pixels see metal");
}

#[test]
fn metal_and_plaster_in_one_plane_do_not_share_light() {
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let left = [corner(-2.0, -2.0), corner(0.0, -2.0), corner(0.0, 2.0), corner(-2.0, 2.0)];
    let right = left.map(|at| at + DVec3::X * 2.0);
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let (mut plaster, mut metal) = (Material::grey("plaster"), Material::grey("metal"));
    (plaster.bsdf, metal.bsdf) = (Bsdf::Diffuse { kd: [0.5; 3] }, METAL);
    let positions = [left, right].concat();
    let materials = vec![plaster, metal];
    let made = Scene::from_world(&positions, &triangles, &[0, 0, 1, 1], materials, [1.0; 3]);
    let raycaster = Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap());
    let shown = |x: f64, _: f64| if x < 0.0 { 0.8 } else { 0.02 };
    let (view, drawn) = seen_by(&raycaster, &noisy(floor_rays(150, shown)), &eye());
    let beside: Vec<f32> = (view.seen.iter().zip(drawn.pixels))
        .filter(|(seen, _)| seen.material == 1 && seen.point.x < 0.2 && seen.point.y.abs() < 0.4)
        .map(|(_, pixel)| pixel[1])
        .collect();
    let mean = beside.iter().sum::<f32>() / beside.len() as f32;
    assert!(beside.len() > 50 && (mean / 0.02 - 1.0).abs() < 0.2, "{mean}, {}", beside.len());
}
