//! Tests the engine `gather` against closed forms and the engine `path`.
//!
//! Rays of one run share cells, so they are not independent. Each test makes several runs with
//! cells of their own, and takes the standard error from their spread.

use crate::common::{BLACK, Model};
use glam::DVec3;
use holo_scene::Bsdf;
use holo_tracer::Tracer;

/// Returns the green radiance of a ray's number-th path in a run.
fn green(tracer: &Tracer, eye: DVec3, towards: DVec3, run: u64, number: u64) -> f64 {
    let seed = run << 32 | number;
    f64::from(tracer.trace(eye, towards.normalize(), seed).radiance[1])
}

/// Returns mean and standard error over runs of what `measure` returns, each with new cells.
fn of_runs(mut tracer: Tracer, runs: u64, measure: impl Fn(&Tracer, u64) -> f64) -> (f64, f64) {
    let mut found = Vec::new();
    for run in 0..runs {
        tracer = tracer.with_gather();
        found.push(measure(&tracer, run));
    }
    assert_eq!(tracer.nonfinite_paths(), 0);
    mean_and_error(&found)
}

fn mean_and_error(found: &[f64]) -> (f64, f64) {
    let n = found.len() as f64;
    let mean = found.iter().sum::<f64>() / n;
    (mean, (found.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt())
}

/// Checks that a mean is as expected within a relative bias and 5 standard errors of 16 or more
/// runs, which fails by chance about once in 6,000 sets of seeds; the seeds are fixed.
#[track_caller]
fn expect_mean((mean, error): (f64, f64), expected: f64, bias: f64) {
    let difference = (mean - expected).abs();
    assert!(
        difference <= 5.0 * error + (bias + 1e-5) * expected,
        "{mean} ± {error} is not {expected}"
    );
}

/// Directions all around.
fn around(number: u64) -> DVec3 {
    let z = (number as f64 * 0.754_877_666).fract() * 1.98 - 0.99;
    let (sin, cos) = (number as f64 * 2.399_963).sin_cos();
    let ring = (1.0 - z * z).sqrt();
    DVec3::new(ring * cos, ring * sin, z)
}

/// A closed box whose walls reflect different shares and emit the rest: the radiance is 1
/// everywhere. Whatever stands in it and absorbs nothing changes nothing.
fn furnace(fill: impl FnOnce(&mut Model)) -> Tracer {
    let mut model = Model::default();
    for (axis, albedos) in [[0.2_f32, 0.9], [0.5, 0.7], [0.05, 0.8]].into_iter().enumerate() {
        for (positive, kd) in [false, true].into_iter().zip(albedos) {
            let wall = model.material(Bsdf::Diffuse { kd: [kd; 3] }, [1.0 - kd; 3]);
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |a: f64, b: f64| {
                let mut corner = [0.0; 3];
                (corner[axis], corner[j], corner[k]) = (if positive { 1.0 } else { -1.0 }, a, b);
                corner
            };
            let mut corners =
                [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            if positive {
                corners.reverse();
            }
            model.polygon(&corners, wall);
        }
    }
    fill(&mut model);
    model.tracer(None)
}

fn furnace_mean(tracer: Tracer) -> (f64, f64) {
    of_runs(tracer, 24, |tracer, run| {
        let eye = DVec3::new(0.1, 0.2, -0.3);
        (0..2000).map(|n| green(tracer, eye, around(n), run, n)).sum::<f64>() / 2000.0
    })
}

#[test]
fn a_furnace_of_walls_of_different_albedo_has_the_exact_brightness() {
    expect_mean(furnace_mean(furnace(|_| {})), 1.0, 0.0);
}

#[test]
fn white_things_of_every_kind_in_a_furnace_change_nothing() {
    let white = [1.0; 3];
    for bsdf in [
        Bsdf::Diffuse { kd: white },
        Bsdf::Coated { kd: white, ks: white, ior: 1.5, alpha: 0.1 },
        Bsdf::Mirror { ks: white },
        Bsdf::Conductor { ks: white, alpha: 0.3 },
        Bsdf::ThinGlass { ior: 1.5, transmittance: white },
        Bsdf::Dielectric { ior: 1.5, transmittance: white, alpha: 0.0 },
    ] {
        let tracer = furnace(|model| {
            let material = model.material(bsdf, [0.0; 3]);
            model.cuboid([-0.5, 0.4, -0.9], [0.3, 0.8, 0.4], true, material);
        });
        // The tables of coats and rough metals have an error of 5e-4 for each reflection.
        expect_mean(furnace_mean(tracer), 1.0, 2e-3);
    }
}

#[test]
fn cells_hold_light_of_as_many_bounces_as_count() {
    for bounces in [0, 1, 2, 5] {
        let mut model = Model::default();
        let wall = model.material(Bsdf::Diffuse { kd: [0.6; 3] }, [1.0; 3]);
        model.cuboid([-1.0, -2.0, -1.5], [1.0, 2.0, 1.5], false, wall);
        let found = of_runs(model.tracer(Some(bounces)), 16, |tracer, run| {
            let eye = DVec3::new(0.1, 0.2, -0.3);
            (0..2000).map(|n| green(tracer, eye, around(n), run, n)).sum::<f64>() / 2000.0
        });
        let expected = (0..bounces as i32 + 2).map(|k| 0.6_f64.powi(k)).sum();
        expect_mean(found, expected, 0.0);
    }
}

/// Two closed rooms on one floor, with a thin wall between them. One has a lamp.
fn rooms(wall: f64) -> Model {
    let mut model = Model::default();
    let white = model.material(Bsdf::Diffuse { kd: [0.8; 3] }, [0.0; 3]);
    let lamp = model.material(BLACK, [1000.0; 3]);
    // Floor and outer walls are common to both, and so is their material.
    model.cuboid([-3.0, -2.0, 0.0], [3.0, 2.0, 2.5], false, white);
    model.cuboid([-wall, -2.0, 0.0], [wall, 2.0, 2.5], true, white);
    let square = [[-1.0, -1.0, 2.4], [-1.0, 1.0, 2.4], [-2.0, 1.0, 2.4], [-2.0, -1.0, 2.4]];
    model.polygon(&square, lamp);
    model
}

#[test]
fn no_light_passes_from_a_bright_room_to_a_dark_one_on_the_same_floor() {
    let tracer = rooms(0.004).tracer(None).with_gather();
    let (mut bright, mut dark) = (0.0, 0.0);
    for n in 0..40_000 {
        let towards = around(n);
        bright += green(&tracer, DVec3::new(-0.5, 0.3, 1.2), towards, 0, n);
        dark += green(&tracer, DVec3::new(0.5, 0.3, 1.2), towards, 1, n);
    }
    assert!(bright > 0.0);
    assert_eq!(dark, 0.0);
}

/// A lamp behind two corners: two walls, each open at the other end.
fn corridor() -> Model {
    let mut model = Model::default();
    let white = model.material(Bsdf::Diffuse { kd: [0.8; 3] }, [0.0; 3]);
    let lamp = model.material(BLACK, [30.0; 3]);
    model.cuboid([0.0, 0.0, 0.0], [6.0, 4.0, 2.0], false, white);
    model.cuboid([1.9, 0.0, 0.0], [2.0, 2.8, 2.0], true, white);
    model.cuboid([3.9, 1.2, 0.0], [4.0, 4.0, 2.0], true, white);
    model.polygon(&[[4.6, 1.0, 1.9], [4.6, 2.0, 1.9], [5.6, 2.0, 1.9], [5.6, 1.0, 1.9]], lamp);
    model
}

/// Returns mean and standard error of the engine `path` over views, from independent parts.
fn truth(tracer: &Tracer, eye: DVec3, views: u64, parts: u64) -> (f64, f64) {
    let part = |part: u64| {
        (0..views).map(|n| green(tracer, eye, around(n), 1 << 20 | part, n)).sum::<f64>()
            / views as f64
    };
    mean_and_error(&(0..parts).map(part).collect::<Vec<_>>())
}

/// Checks the mean of a view from `eye` against paths, within a relative bias.
fn expect_as_paths(model: &Model, eye: DVec3, bias: f64) {
    const VIEWS: u64 = 1500;
    let (mean, error) = truth(&model.tracer(None), eye, VIEWS, 40);
    let found = of_runs(model.tracer(None), 16, |tracer, run| {
        (0..VIEWS).map(|n| green(tracer, eye, around(n), run, n)).sum::<f64>() / VIEWS as f64
    });
    expect_mean((found.0, found.1.hypot(error)), mean, bias);
}

#[test]
fn light_that_comes_around_two_corners_is_as_bright_as_with_paths() {
    expect_as_paths(&corridor(), DVec3::new(0.8, 0.8, 1.0), 0.02);
}

#[test]
fn a_box_with_blocks_is_as_bright_as_with_paths() {
    let mut model = Model::default();
    let white = model.material(Bsdf::Diffuse { kd: [0.7, 0.6, 0.5] }, [0.0; 3]);
    let lamp = model.material(BLACK, [20.0; 3]);
    model.cuboid([-2.0, -3.0, 0.0], [2.0, 3.0, 2.5], false, white);
    model.cuboid([0.4, -1.0, 0.0], [1.2, 0.5, 0.8], true, white);
    // It shines upwards only: most of the room has nothing but indirect light.
    let square = [[-0.3, -0.3, 1.5], [0.3, -0.3, 1.5], [0.3, 0.3, 1.5], [-0.3, 0.3, 1.5]];
    model.polygon(&square, lamp);
    // With two lamps, light samples and continuations follow what earlier paths found.
    let small = [[1.2, 2.4, 1.0], [1.4, 2.4, 1.0], [1.4, 2.6, 1.0], [1.2, 2.6, 1.0]];
    model.polygon(&small, lamp);
    expect_as_paths(&model, DVec3::new(-1.5, -2.5, 1.2), 0.01);
}
