//! Light from samples to surfels.

use glam::Vec3;
use holo_splats::{LightPoint, SurfelCells};

use crate::common::random;

/// Samples of a floor of 1 by 1. `light` is that of a place, and noise multiplies it.
fn floor(count: u64, normal: Option<Vec3>, light: impl Fn(Vec3) -> f32) -> Vec<LightPoint> {
    let point = |at: u64| {
        let place = Vec3::new(random(3 * at), random(3 * at + 1), 0.0);
        // Exponential noise of mean 1: its standard deviation is as great as the light.
        let noise = -(1.0 - random(3 * at + 2)).ln();
        let towards = Vec3::new(random(at + 77) - 0.5, random(at + 99) - 0.5, 0.7).normalize();
        LightPoint {
            position: place,
            normal,
            towards,
            radiance: [light(place) * noise * 0.5; 3],
            reflectance: [0.5; 3],
            drawn_colour: [1.0; 3],
            paths: 1,
            is_directional: false,
            shines: false,
        }
    };
    (0..count).map(point).collect()
}

#[test]
fn smoothed_light_is_true_within_its_standard_error_and_shadows_keep_their_edges() {
    let truth = |place: Vec3| if place.x < 0.5 { 4.0 } else { 1.0 };
    let mut cells = SurfelCells::new(0.02, 100_000);
    floor(40_000, Some(Vec3::Z), truth).chunks(7000).for_each(|some| cells.add(some));
    assert_eq!(cells.samples(), 40_000);
    let surfels = cells.into_surfels();
    assert!((2400..=2500).contains(&surfels.len()), "{}", surfels.len());
    let (mut within, mut squares, mut inside) = (0, 0.0, 0);
    for surfel in &surfels {
        let light = surfel.light[1] / 0.5;
        let is_edge = (surfel.position.x - 0.5).abs() < 0.05;
        if is_edge {
            continue;
        }
        let truth = truth(surfel.position);
        inside += 1;
        squares += (light / truth - 1.0).powi(2);
        within += usize::from((light - truth).abs() < 3.0 * surfel.error * light);
        assert!(surfel.error < 0.2, "{surfel:?}");
    }
    let error = (squares / inside as f32).sqrt();
    // One cell alone has an error of 1/4.
    assert!(error < 0.1, "{error}");
    assert!(within * 100 > inside * 80, "{within} of {inside} within three standard errors");
    let step = |low: f32, high: f32| {
        let here = surfels.iter().filter(|s| (low..high).contains(&s.position.x));
        let lights: Vec<f32> = here.map(|surfel| surfel.light[1]).collect();
        lights.iter().sum::<f32>() / lights.len() as f32
    };
    assert!(step(0.42, 0.46) > 1.8 && step(0.54, 0.58) < 0.7, "the shadow's edge is lost");
}

#[test]
fn the_mean_of_all_light_stays() {
    let points = floor(60_000, Some(Vec3::Z), |place| 1.0 + place.y);
    let radiance: f32 = points.iter().map(|point| point.radiance[0]).sum::<f32>() / 60_000.0;
    let mut cells = SurfelCells::new(0.02, 100_000);
    cells.add(&points);
    let surfels = cells.into_surfels();
    let mean = surfels.iter().map(|s| s.light[0]).sum::<f32>() / surfels.len() as f32;
    assert!((mean / radiance - 1.0).abs() < 0.03, "{mean} {radiance}");
}

#[test]
fn rare_bright_paths_keep_their_light_and_make_no_specks() {
    let mut points = floor(50_000, Some(Vec3::Z), |_| 1.0);
    for (number, point) in points.iter_mut().enumerate() {
        point.radiance = [if number % 400 == 0 { 200.0 } else { 0.5 }; 3];
    }
    let radiance = points.iter().map(|point| f64::from(point.radiance[0])).sum::<f64>() / 50_000.0;
    let mut cells = SurfelCells::new(0.02, 100_000);
    cells.add(&points);
    let lights: Vec<f32> = cells.into_surfels().iter().map(|surfel| surfel.light[0]).collect();
    let mean = lights.iter().map(|&light| f64::from(light)).sum::<f64>() / lights.len() as f64;
    // The 125 bright paths lie in cells of 20 ± 4.5 samples: 4.5 standard errors of their share.
    assert!((mean / radiance - 1.0).abs() < 0.05, "{mean} {radiance}");
    let most = lights.iter().fold(0.0, |most: f32, light| most.max(*light));
    assert!(f64::from(most) < 4.0 * radiance, "{most}: one path alone makes 10.5");
}

#[test]
fn without_a_scene_normals_are_those_of_the_neighbours() {
    let mut cells = SurfelCells::new(0.03, 100_000);
    cells.add(&floor(30_000, None, |_| 1.0));
    let surfels = cells.into_surfels();
    let upright = surfels.iter().filter(|surfel| surfel.normal.z > 0.98).count();
    assert!(upright * 100 > surfels.len() * 95, "{upright} of {}", surfels.len());
}

#[test]
fn cells_become_larger_instead_of_more() {
    let mut cells = SurfelCells::new(0.005, 2000);
    floor(50_000, Some(Vec3::Z), |_| 1.0).chunks(5000).for_each(|some| cells.add(some));
    assert!(cells.len() <= 2000 && cells.spacing() > 0.02, "{}", cells.spacing());
    assert_eq!(cells.samples(), 50_000);
    let surfels = cells.into_surfels();
    let weight: f32 = surfels.iter().map(|surfel| surfel.light[0]).sum();
    assert!((weight / surfels.len() as f32 - 0.5).abs() < 0.05);
}

#[test]
fn samples_that_are_no_numbers_are_left_out() {
    let mut points = floor(1000, Some(Vec3::Z), |_| 1.0);
    points[3].radiance = [f32::NAN, 1.0, 1.0];
    points[4].position = Vec3::splat(f32::INFINITY);
    points[5].radiance = [f32::INFINITY; 3];
    let mut cells = SurfelCells::new(0.1, 1000);
    cells.add(&points);
    assert_eq!(cells.samples(), 997);
    let surfels = cells.into_surfels();
    assert!(surfels.iter().all(|surfel| surfel.light[0].is_finite() && surfel.error.is_finite()));
}
