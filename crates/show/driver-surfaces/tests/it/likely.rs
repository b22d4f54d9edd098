//! Rough metal, solid glass and coated surfaces: their likely light where nothing is known, and
//! their border with other surfaces.

#![allow(clippy::unwrap_used, missing_docs)]

use crate::common::*;
use glam::DVec3;
use holo_driver_surfaces::RaySample;
use holo_picture::View as Eye;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use std::sync::Arc;

const METAL: Bsdf = Bsdf::Conductor { ks: [0.5; 3], alpha: 0.1 };

const COATED: Bsdf = Bsdf::Coated { kd: [0.3; 3], ks: [1.0; 3], ior: 1.5, alpha: 0.1 };

/// An eye that sees the wall from the side.
const BESIDE_WALL: DVec3 = DVec3::new(-1.5, 0.5, 1.0);

fn beside_wall() -> Eye {
    let ahead = DVec3::new(1.0, 0.8, 0.0);
    Eye::new(BESIDE_WALL, ahead, DVec3::Z, Some(40.0), None, (64, 64)).unwrap()
}

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
fn solid_glass_without_samples_shows_the_light_behind_it() {
    let square = |half: f64, height: f64| {
        [(-half, -half), (half, -half), (half, half), (-half, half)]
            .map(|(x, y)| DVec3::new(x, y, height))
    };
    // Two faces of a slab lie above the floor.
    let positions = [square(2.0, 0.0), square(0.5, 0.5), square(0.5, 0.45)].concat();
    let faces: Vec<[u32; 3]> =
        (0..3).flat_map(|k| [[0, 1, 2], [0, 2, 3]].map(|f| f.map(|c| c + 4 * k))).collect();
    let (mut floor, mut glass) = (Material::grey("floor"), Material::grey("glass"));
    floor.bsdf = Bsdf::Diffuse { kd: [0.5; 3] };
    glass.bsdf = Bsdf::Dielectric { ior: 1.5, transmittance: [0.9, 0.8, 0.7], alpha: 0.3 };
    let materials = vec![floor, glass];
    let made = Scene::from_world(&positions, &faces, &[0, 0, 1, 1, 1, 1], materials, [1.0; 3]);
    let raycaster = Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap());
    let (view, drawn) = seen_by(&raycaster, &floor_rays(200, |_, _| 0.4), &eye());
    let mut found = 0;
    for (seen, pixel) in view.seen.iter().zip(drawn.pixels).filter(|(seen, _)| seen.material == 1) {
        for (shown, passed) in pixel.into_iter().zip([0.9_f32, 0.8, 0.7]) {
            let expected = 0.4 * passed * passed;
            assert!((shown / expected - 1.0).abs() < 0.02, "{pixel:?} at {:?}", seen.point);
        }
        found += 1;
    }
    assert!(found > 100, "{found} pixels see glass");
}

#[test]
fn a_coated_surface_shows_what_is_known_of_it_from_other_directions() {
    let raycaster = walled_room(COATED);
    // The wall was only seen from the front, and by few rays. The floor is much brighter.
    let known = [wall_rays(6, 0.25), floor_rays(200, |_, _| 2.0)].concat();
    let (view, drawn) = seen_by(&raycaster, &known, &beside_wall());
    let mut found = 0;
    for (seen, pixel) in view.seen.iter().zip(drawn.pixels).filter(|(seen, _)| seen.material == 1) {
        assert!((pixel[1] / 0.25 - 1.0).abs() < 0.1, "{pixel:?} at {:?}", seen.point);
        found += 1;
    }
    assert!(found > 1000, "{found} pixels see the wall");
}

#[test]
fn a_coat_shows_details_that_are_known_from_other_directions() {
    // A shadow on the wall was only seen from the front.
    let in_shadow = |ray: RaySample| RaySample {
        radiance: ray.radiance.map(|c| c * halves(ray.origin.x, 0.0)),
        ..ray
    };
    let known: Vec<RaySample> = wall_rays(200, 1.0).into_iter().map(in_shadow).collect();
    let (view, drawn) = seen_by(&walled_room(COATED), &known, &beside_wall());
    let mut found = 0;
    for (seen, pixel) in view.seen.iter().zip(drawn.pixels) {
        let x = f64::from(seen.point.x);
        // Squares of four pixels are 0.13 wide at the shadow's edge.
        if seen.material == 1 && (0.15..0.5).contains(&x.abs()) {
            let expected = halves(x, 0.0);
            assert!((pixel[1] / expected - 1.0).abs() < 0.15, "{pixel:?} at {:?}", seen.point);
            found += 1;
        }
    }
    assert!(found > 200, "{found} pixels see the wall beside the shadow's edge");
}

#[test]
fn a_coat_shows_what_it_sends_towards_the_eye() {
    // Towards the eye, the wall is twice as bright as towards the front.
    let towards_eye = |ray: &RaySample| {
        let between = ray.origin + ray.distance * ray.direction - BESIDE_WALL;
        let (direction, distance) = (between.normalize(), between.length());
        RaySample { origin: BESIDE_WALL, direction, distance, radiance: [0.5; 3], ..*ray }
    };
    let front = wall_rays(200, 0.25);
    let known: Vec<RaySample> = front.iter().map(towards_eye).chain(front.clone()).collect();
    let (view, drawn) = seen_by(&walled_room(COATED), &known, &beside_wall());
    let mut found = 0;
    for (seen, pixel) in view.seen.iter().zip(drawn.pixels).filter(|(seen, _)| seen.material == 1) {
        assert!((pixel[1] / 0.5 - 1.0).abs() < 0.1, "{pixel:?} at {:?}", seen.point);
        found += 1;
    }
    assert!(found > 1000, "{found} pixels see the wall");
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
