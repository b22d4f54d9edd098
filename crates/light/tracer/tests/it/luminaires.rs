//! Tests luminaires against closed forms: their intensity far away, and their flux in a room.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use holo_photometry::{LuminousOpening, OpeningShape, PhotometricWeb, WebPole};
use holo_scene::{Bsdf, HungLuminaire, Scene};
use holo_tracer::{Settings, Tracer};

use crate::common::{Estimate, Model, estimate};

/// Lumens per watt of three equal channels.
const EFFICACY: f64 = 179.0;

/// A web of this many candela by the angle from the nadir and by longitude, radians.
fn web(candela: impl Fn(f64, f64) -> f64) -> Arc<PhotometricWeb> {
    let (rows, columns) = (181, 73);
    let polar: Vec<f32> = (0..rows).map(|at| (f64::from(at) * PI / 180.0) as f32).collect();
    let turns: Vec<f32> = (0..columns).map(|at| (f64::from(at) * PI / 36.0) as f32).collect();
    let value = |turn: f32| {
        polar.iter().map(|p| candela(f64::from(*p), f64::from(turn)) as f32).collect::<Vec<_>>()
    };
    let values = turns.iter().flat_map(|&turn| value(turn)).collect();
    Arc::new(PhotometricWeb::new(WebPole::Nadir, polar.clone(), turns.clone(), values).unwrap())
}

fn hung(web: &Arc<PhotometricWeb>, opening: LuminousOpening, axes: [DVec3; 3]) -> HungLuminaire {
    HungLuminaire {
        name: "lamp".into(),
        group: "lamps".into(),
        place: DVec3::ZERO,
        axes,
        web: Arc::clone(web),
        mesh: Arc::new(opening.mesh(web.halves())),
        colour: [1.0; 3],
    }
}

const UPRIGHT: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];
const POINT: LuminousOpening = LuminousOpening { shape: OpeningShape::Point, size: [0.0; 3] };

fn tracer(model: &Model, lamps: &[HungLuminaire], bounces: Option<u32>) -> Tracer {
    let scene = Scene::clone(&model.scene()).with_luminaires_hung(lamps, 1.0).unwrap();
    Tracer::new(Arc::new(scene), Settings { bounces, paths: 1 }).unwrap()
}

/// Returns the illuminance of a surface of this reflectance, seen along a ray, lx.
fn illuminance(tracer: &Tracer, from: DVec3, to: DVec3, reflectance: f64, paths: u64) -> Estimate {
    let Estimate { mean, error } = estimate(tracer, from, to - from, paths);
    let lux = |radiance: f64| radiance * EFFICACY * PI / reflectance;
    Estimate { mean: mean.map(lux), error: error.map(lux) }
}

/// Directions all around.
fn directions(count: u32) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |at| {
        let z = 1.0 - (2.0 * f64::from(at) + 1.0) / f64::from(count);
        let (y, x) = (2.399_963_229_7 * f64::from(at)).sin_cos();
        let level = (1.0 - z * z).sqrt();
        DVec3::new(level * x, level * y, z)
    })
}

#[test]
fn far_away_every_opening_has_the_intensity_of_its_web_in_its_frame() {
    const AWAY: f64 = 60.0;
    let shapes = [
        (OpeningShape::Point, [0.0; 3]),
        (OpeningShape::Rectangle, [1.2, 0.3, 0.0]),
        (OpeningShape::Ellipse, [0.4, 0.6, 0.0]),
        (OpeningShape::Box, [1.2, 0.3, 0.1]),
        (OpeningShape::CylinderAlongX, [1.2, 0.1, 0.1]),
        (OpeningShape::CylinderAlongY, [0.1, 1.2, 0.1]),
        (OpeningShape::CylinderAlongZ, [0.2, 0.2, 0.5]),
        (OpeningShape::Ellipsoid, [0.3, 0.3, 0.3]),
    ];
    let lamp = web(|polar, turn| {
        1000.0
            + 500.0 * polar.cos()
            + 300.0 * polar.sin() * turn.cos()
            + 150.0 * polar.sin() * turn.sin()
    });
    let turned = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.3, 1.1);
    let axes = UPRIGHT.map(|axis| turned * axis);
    for (shape, size) in shapes {
        let mut model = Model::default();
        let white = model.material(Bsdf::Diffuse { kd: [1.0; 3] }, [0.0; 3]);
        // A small plate in each direction, which faces the lamp.
        for away in directions(200) {
            let (a, b) = away.any_orthonormal_pair();
            let place = away * AWAY;
            let corners = [-a - b, b - a, a + b, a - b].map(|c| (place + c * 0.2).to_array());
            model.polygon(&corners, white);
        }
        let opening = LuminousOpening { shape, size };
        let tracer = tracer(&model, &[hung(&lamp, opening, axes)], Some(0));
        let is_flat = matches!(shape, OpeningShape::Rectangle | OpeningShape::Ellipse);
        let (mut compared, mut ratios) = (0, 0.0);
        for away in directions(200) {
            let local = DVec3::from(axes.map(|axis| axis.dot(away)));
            // Edge on, a flat lamp has no area from which the light could come.
            if is_flat && local.z.abs() < 0.02 {
                continue;
            }
            // Along a tube, its small ends are all that is seen, and few samples find them.
            let along = match shape {
                OpeningShape::CylinderAlongX => local.x,
                OpeningShape::CylinderAlongY => local.y,
                _ => 0.0,
            };
            if along.abs() > 0.98 {
                continue;
            }
            let expected = f64::from(lamp.intensity(local.as_vec3())) / (AWAY * AWAY);
            let from = away * (AWAY - 1.0) + away.any_orthonormal_vector() * 0.3;
            let found = illuminance(&tracer, from, away * AWAY, 1.0, 1000);
            let bound = 4.5 * found.error[0] + 5e-3 * expected;
            assert!(
                (found.mean[0] - expected).abs() < bound,
                "{shape:?} {away}: {found:?} {expected}"
            );
            assert!(found.error[0] < 0.05 * expected, "{shape:?} {away}: {found:?} {expected}");
            compared += 1;
            ratios += found.mean[0] / expected;
        }
        assert!(compared > 190);
        let ratio = ratios / f64::from(compared);
        // All directions have the same random numbers, so their errors do not average out. Those of
        // tubes, with faces of many normals, are the largest.
        let is_tube = !is_flat && !matches!(shape, OpeningShape::Point | OpeningShape::Box);
        let most = if is_tube { 1e-2 } else { 3e-3 };
        assert!((ratio - 1.0).abs() < most, "{shape:?}: {ratio}");
    }
}

#[test]
fn an_even_lamp_in_a_cube_lights_it_by_the_closed_form() {
    // CIE 171, case 5.8: 10,000 lm in the middle of a cube of 4 m.
    let lamp = web(|_, _| 10_000.0 / (4.0 * PI));
    for reflectance in [0.2, 0.5, 0.8] {
        let mut model = Model::default();
        let white = model.material(Bsdf::Diffuse { kd: [reflectance as f32; 3] }, [0.0; 3]);
        model.cuboid([-2.0; 3], [2.0; 3], false, white);
        let lamps = [hung(&lamp, POINT, UPRIGHT)];
        let direct = tracer(&model, &lamps, Some(0));
        let from = DVec3::new(0.9, 0.7, 0.0);
        for (at, expected) in [
            (DVec3::new(0.0, 0.0, -2.0), 10_000.0 / (4.0 * PI) / 4.0),
            (
                DVec3::new(1.999, 1.999, -2.0),
                10_000.0 / (4.0 * PI) * 2.0 / 11.992_002_f64.powf(1.5),
            ),
        ] {
            let found = illuminance(&direct, from, at, reflectance, 4000);
            let bound = 4.5 * found.error[0] + 1e-3 * expected;
            assert!((found.mean[0] - expected).abs() < bound, "{at}: {found:?} {expected}");
        }
        // The mean over all faces, on a grid of midpoints.
        let whole = tracer(&model, &lamps, None);
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        for face in 0..6 {
            for (i, j) in (0..20).flat_map(|i| (0..20).map(move |j| (i, j))) {
                let at = |k: i32| -1.9 + 0.2 * f64::from(k);
                let side = if face % 2 == 0 { -2.0 } else { 2.0 };
                let mut place = [at(i), at(j), side];
                place.rotate_right(face / 2);
                for _ in 0..24 {
                    // Equal random numbers would give all places equal errors.
                    count += 1.0;
                    let towards = DVec3::from(place) - from;
                    let traced = whole.trace(from, towards, count as u64);
                    let lux = f64::from(traced.radiance[0]) * EFFICACY * PI / reflectance;
                    sum += lux;
                    squares += lux * lux;
                }
            }
        }
        let mean: f64 = sum / count;
        // Places differ too, so this is more than the error.
        let error = ((squares / count - mean * mean) / count).sqrt();
        let expected = 10_000.0 / 96.0 / (1.0 - reflectance);
        assert!(error < 3e-3 * expected, "{reflectance}: {error}");
        assert!(
            (mean - expected).abs() < 4.5 * error + 2e-3 * expected,
            "{reflectance}: {mean} ± {error} is not {expected}"
        );
    }
}

#[test]
fn a_row_of_narrow_lamps_lights_each_place_by_their_sum() {
    // Beams of about 20°, of which no two light the same place much.
    let lamp = web(|polar, _| 3000.0 * polar.cos().max(0.0).powi(40));
    let panel = LuminousOpening { shape: OpeningShape::Ellipse, size: [0.02, 0.02, 0.0] };
    let mut model = Model::default();
    let white = model.material(Bsdf::Diffuse { kd: [0.5; 3] }, [0.0; 3]);
    model.square(0.0, 30.0, true, white);
    let lamps: Vec<HungLuminaire> = (0..100)
        .map(|at| HungLuminaire {
            place: DVec3::new(f64::from(at % 10) * 2.0 - 9.0, f64::from(at / 10) * 2.0 - 9.0, 3.0),
            ..hung(&lamp, panel, UPRIGHT)
        })
        .collect();
    let tracer = tracer(&model, &lamps, Some(0));
    for at in [DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.3, -0.4, 0.0), DVec3::new(-9.4, 8.2, 0.0)] {
        let expected: f64 = lamps
            .iter()
            .map(|one| {
                let away = at - one.place;
                let intensity = f64::from(lamp.intensity(away.normalize().as_vec3()));
                intensity * -away.z / away.length().powi(3)
            })
            .sum();
        let found = illuminance(&tracer, at + DVec3::new(0.4, 0.2, 1.0), at, 0.5, 40_000);
        // The tree knows where each lamp shines. Otherwise, the error would be fifteen times as
        // large.
        assert!(found.error[0] < 6e-3 * expected, "{at}: {found:?} {expected}");
        let bound = 4.5 * found.error[0] + 1e-3 * expected;
        assert!((found.mean[0] - expected).abs() < bound, "{at}: {found:?} {expected}");
    }
}

#[test]
fn a_lamp_is_seen_with_the_radiance_of_its_web() {
    let lamp = web(|polar, turn| 200.0 + 100.0 * polar.cos() + 50.0 * polar.sin() * turn.cos());
    let panel = LuminousOpening { shape: OpeningShape::Rectangle, size: [0.6, 0.3, 0.0] };
    let mut model = Model::default();
    let black = model.material(Bsdf::Diffuse { kd: [0.0; 3] }, [0.0; 3]);
    model.square(-50.0, 1.0, true, black);
    let tracer = tracer(&model, &[hung(&lamp, panel, UPRIGHT)], None);
    for away in directions(40).filter(|away| away.z.abs() > 0.05) {
        let seen = tracer.trace(away * 3.0, -away, 1).radiance[1];
        let expected = f64::from(lamp.intensity(away.as_vec3())) / (0.18 * away.z.abs() * EFFICACY);
        assert!((f64::from(seen) / expected - 1.0).abs() < 1e-3, "{away}: {seen} {expected}");
    }
}
