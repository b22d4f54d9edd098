//! Tests pictures of surfaces that are partly covered.

#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::{eye, on_sheet, rays, seen_by};
use glam::DVec3;
use holo_driver_surfaces::RaySample;
use holo_picture::View as Eye;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Cover, Material, Scene, Shading};
use holo_tracer::{Settings, Tracer};
use std::sync::Arc;

/// A floor of 4 × 4 at height 0, and a sheet of 1 × 1 at height 0.5 with this opacity.
fn room(opacity: f32, sheet: Bsdf, glow: f32) -> Arc<Raycaster> {
    room_of_sheets(&[0.5], opacity, sheet, glow)
}

/// The same with sheets at these heights.
fn room_of_sheets(heights: &[f64], opacity: f32, sheet: Bsdf, glow: f32) -> Arc<Raycaster> {
    let square = |half: f64, height: f64| {
        [(-half, -half), (half, -half), (half, half), (-half, half)]
            .map(|(x, y)| DVec3::new(x, y, height))
    };
    let mut positions = square(2.0, 0.0).to_vec();
    positions.extend(heights.iter().flat_map(|&height| square(0.5, height)));
    let squares = 0..=heights.len() as u32;
    let triangles: Vec<[u32; 3]> =
        squares.flat_map(|n| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|v| 4 * n + v))).collect();
    let materials_of: Vec<u32> = (0..triangles.len()).map(|n| u32::from(n > 1)).collect();
    let sheet = Material { bsdf: sheet, emission: [glow; 3], ..Material::grey("sheet") };
    let materials = vec![Material::grey("floor"), sheet];
    let scene = Scene::from_world(&positions, &triangles, &materials_of, materials, [1.0; 3]);
    let covers = vec![Cover::default(), Cover { opacity, ..Cover::default() }];
    let shading = Shading { covers, ..Shading::default() };
    let scene = scene.unwrap().0.with_shading(shading).unwrap();
    Arc::new(Raycaster::build(Arc::new(scene)).unwrap())
}

/// Rays straight down: of those to the sheet, every third one meets it and shows 0.1. The others
/// show the floor's radiance of 0.8.
fn samples() -> Vec<RaySample> {
    let down = rays(96, |_, _| 0.8).into_iter().enumerate();
    let sample = |(number, ray): (usize, RaySample)| {
        let is_met = number % 3 == 0 && on_sheet(ray.origin.x, ray.origin.y);
        let (distance, radiance) = if is_met { (1.5, 0.1) } else { (2.0, 0.8) };
        RaySample { distance, radiance: [radiance; 3], ..ray }
    };
    down.map(sample).collect()
}

#[test]
fn a_covered_sheet_shows_what_is_behind_with_the_rest() {
    for opacity in [0.1, 0.3, 0.7, 0.95] {
        let room = room(opacity, Bsdf::Diffuse { kd: [0.5; 3] }, 0.0);
        let (mut view, drawn) = seen_by(&room, &samples(), &eye());
        let expected = opacity * 0.1 + (1.0 - opacity) * 0.8;
        let at = |column: usize, row: usize| drawn.pixels[row * 64 + column][0];
        for (column, row) in [(32, 32), (28, 36), (36, 30)] {
            let found = at(column, row);
            assert!((found - expected).abs() < 0.01, "{opacity}: {found}, not {expected}");
        }
        assert!((at(3, 3) - 0.8).abs() < 0.01);
        // The refined picture agrees, and no pixel on the sheet's edge is darker or brighter.
        view.look_into_edges();
        let (store, _) = crate::common::kept(&room, &samples());
        let refined = holo_driver_surfaces::Gathered::new(&view, &store).draw(&view, &store, None);
        assert!((refined.pixels[32 * 64 + 32][0] - expected).abs() < 0.01);
        let range = expected - 0.01..0.81;
        assert!(refined.pixels.iter().all(|pixel| range.contains(&pixel[0])), "{opacity}");
    }
}

#[test]
fn each_of_two_sheets_close_together_shows_its_own_light() {
    let opacity = 0.7;
    let sheet = Bsdf::Diffuse { kd: [0.5; 3] };
    let room = room_of_sheets(&[0.5, 0.49], opacity, sheet, 0.0);
    let down = rays(96, |_, _| 0.8).into_iter().enumerate();
    let sample = |(number, ray): (usize, RaySample)| {
        let is_on = on_sheet(ray.origin.x, ray.origin.y);
        let (distance, radiance) = match number % 4 {
            0 | 1 if is_on => (1.5, 0.1),
            2 if is_on => (1.51, 0.9),
            _ => (2.0, 0.8),
        };
        RaySample { distance, radiance: [radiance; 3], ..ray }
    };
    let samples: Vec<RaySample> = down.map(sample).collect();
    let passed = 1.0 - opacity;
    let expected = opacity * 0.1 + passed * opacity * 0.9 + passed * passed * 0.8;
    // From the side, pixels show places of the two sheets that do not lie above each other.
    let (at, ahead) = (DVec3::new(0.0, -2.0, 1.5), DVec3::new(0.0, 2.0, -1.0));
    let from_side = Eye::new(at, ahead, DVec3::Z, Some(60.0), None, (64, 64)).unwrap();
    for eye in [eye(), from_side] {
        let (_, drawn) = seen_by(&room, &samples, &eye);
        for (column, row) in [(32, 32), (28, 33), (36, 31)] {
            let found = drawn.pixels[row * 64 + column][0];
            assert!((found - expected).abs() < 0.01, "{found}, not {expected}");
        }
    }
}

#[test]
fn a_lamp_that_covers_little_adds_little() {
    let room = room(0.25, Bsdf::Diffuse { kd: [0.0; 3] }, 2.0);
    let (_, drawn) = seen_by(&room, &samples(), &eye());
    let found = drawn.pixels[32 * 64 + 32][0];
    assert!((found - (0.25 * 2.0 + 0.75 * 0.8)).abs() < 0.01, "{found}");
}

/// What a tracer brings, pictures show: both agree over a part of the sheet and of the floor.
#[test]
fn pictures_of_traced_samples_are_as_bright_as_the_samples() {
    let room = room(0.4, Bsdf::Diffuse { kd: [0.2; 3] }, 0.0);
    let tracer = Tracer::with_raycaster(room.clone(), Settings::default()).unwrap();
    let random = |number: u64| (holo_display::split_mix(number) >> 11) as f64 / (1u64 << 53) as f64;
    let (eye, side) = (eye(), 64.0);
    let trace = |x: f64, y: f64, seed: u64| {
        let (origin, direction) = eye.ray(x / side, 1.0 - y / side);
        let traced = tracer.trace(origin, direction, seed);
        RaySample {
            origin,
            direction,
            distance: traced.distance,
            uncertainty: 1e-4,
            radiance: traced.radiance,
            paths: 1,
        }
    };
    let samples: Vec<RaySample> =
        (0..60_000).map(|n| trace(side * random(2 * n), side * random(2 * n + 1), n)).collect();
    let (_, drawn) = seen_by(&room, &samples, &eye);
    for (left, top) in [(28, 28), (8, 50)] {
        let block = || (top..top + 8).flat_map(|y| (left..left + 8).map(move |x| (x, y)));
        let shown: f32 = block().map(|(x, y)| drawn.pixels[y * 64 + x][0]).sum::<f32>() / 64.0;
        let (mut sum, mut squares) = (0.0, 0.0);
        for n in 0..8000 {
            let (x, y) = (8.0 * random(7 * n + 3), 8.0 * random(7 * n + 5));
            let traced = trace(left as f64 + x, top as f64 + y, n + 1_000_000).radiance[0];
            (sum, squares) = (sum + f64::from(traced), squares + f64::from(traced * traced));
        }
        let mean = sum / 8000.0;
        let error = ((squares / 8000.0 - mean * mean) / 8000.0).sqrt();
        // The picture's own samples of the block are fewer: 940 on average.
        let bound = 4.5 * error * (1.0 + 8000.0f64 / 940.0).sqrt();
        let away = (f64::from(shown) - mean).abs();
        assert!(away < bound, "{left} {top}: {shown} is not {mean} within {bound}");
    }
}

/// Returns samples straight down of a room whose sheet is met by this many rays of ten, and then
/// shows `met`. The others show the floor's radiance of 0.8.
fn samples_of_tenths(tenths: usize, met: f32) -> Vec<RaySample> {
    let down = rays(100, |_, _| 0.8).into_iter().enumerate();
    let sample = |(number, ray): (usize, RaySample)| {
        let is_met = (number + 3 * (number / 100)) % 10 < tenths;
        let is_met = is_met && on_sheet(ray.origin.x, ray.origin.y);
        let (distance, radiance) = if is_met { (1.5, met) } else { (2.0, 0.8) };
        RaySample { distance, radiance: [radiance; 3], ..ray }
    };
    down.map(sample).collect()
}

/// Expects this radiance in the middle of the sheet, in the first and in the refined picture.
fn expect_sheet(room: &Arc<Raycaster>, samples: &[RaySample], expected: f32) {
    let (mut view, drawn) = seen_by(room, samples, &eye());
    for at in [(32, 32), (28, 36), (36, 30)] {
        let found = drawn.pixels[at.1 * 64 + at.0][0];
        assert!((found - expected).abs() < 0.01, "{found}, not {expected}");
    }
    view.look_into_edges();
    let (store, _) = crate::common::kept(room, samples);
    let refined = holo_driver_surfaces::Gathered::new(&view, &store).draw(&view, &store, None);
    let found = refined.pixels[32 * 64 + 32][0];
    assert!((found - expected).abs() < 0.01, "{found}, not {expected}, refined");
    let shown = || refined.pixels.iter().map(|pixel| pixel[0]);
    let (least, most) = (shown().fold(f32::MAX, f32::min), shown().fold(0.0, f32::max));
    // Squares at the edge of a pane have samples through it and samples beside it. What it mirrors
    // is taken out of both: at most 0.2 · 0.2 / 0.8 of light.
    let is_within = least > expected.min(0.8) - 0.05 && most < expected.max(0.8) + 0.05;
    assert!(is_within, "{least} to {most} instead of {expected} and 0.8");
}

#[test]
fn a_partly_covered_mirror_shows_the_sky_and_what_is_behind() {
    for tenths in [1, 3, 5, 7, 9] {
        let opacity = tenths as f32 / 10.0;
        let room = room(opacity, Bsdf::Mirror { ks: [0.3; 3] }, 0.0);
        let expected = opacity * 0.3 + (1.0 - opacity) * 0.8;
        expect_sheet(&room, &samples_of_tenths(tenths, 0.3), expected);
    }
}

#[test]
fn a_partly_covered_pane_passes_and_mirrors_by_its_cover() {
    // A pane of index 2 transmits 0.8 at right angles.
    let met = 0.8 * 0.8 + 0.2 * 1.0;
    for tenths in [2, 4, 6, 9] {
        let opacity = tenths as f32 / 10.0;
        let pane = Bsdf::ThinGlass { ior: 2.0, transmittance: [1.0; 3] };
        let room = room(opacity, pane, 0.0);
        let expected = opacity * met + (1.0 - opacity) * 0.8;
        expect_sheet(&room, &samples_of_tenths(tenths, met), expected);
    }
}
