//! Tests scenes with many lights, and how the error falls with the number of paths.

use std::f64::consts::PI;

use crate::common::{BLACK, Model, estimate, expect, form_factor};
use glam::DVec3;
use holo_scene::Bsdf;
use holo_tracer::{Sampler, Tracer};

const KD: [f32; 3] = [0.8, 0.5, 0.2];
const LE: [f32; 3] = [3.0, 5.0, 7.0];

fn lit(factor: f64) -> [f64; 3] {
    [0, 1, 2].map(|c| f64::from(KD[c]) * f64::from(LE[c]) * factor)
}

fn floor(model: &mut Model) {
    let floor = model.material(Bsdf::Diffuse { kd: KD }, [0.0; 3]);
    model.square(0.0, 50.0, true, floor);
}

/// A ceiling at height 2 of 32 by 32 luminous squares that face down.
fn ceiling(two_sided: bool) -> Model {
    let mut model = Model::default();
    floor(&mut model);
    let light = model.material(BLACK, LE);
    if two_sided {
        model.two_sided(light);
    }
    for i in 0..32 {
        for j in 0..32 {
            let (x, y) = (f64::from(i) * 0.5 - 8.0, f64::from(j) * 0.5 - 8.0);
            model.polygon(
                &[[x, y, 2.0], [x, y + 0.5, 2.0], [x + 0.5, y + 0.5, 2.0], [x + 0.5, y, 2.0]],
                light,
            );
        }
    }
    model
}

#[test]
fn a_luminous_ceiling_of_2048_triangles_lights_as_one_panel() {
    let panel = [[-8.0, -8.0, 2.0], [-8.0, 8.0, 2.0], [8.0, 8.0, 2.0], [8.0, -8.0, 2.0]];
    for two_sided in [false, true] {
        let tracer = ceiling(two_sided).tracer(Some(0));
        for (x, y) in [(0.1, 0.2), (7.9, 7.9), (20.0, 3.0)] {
            let point = DVec3::new(x, y, 0.0);
            let eye = point + DVec3::new(0.3, -0.4, 1.0);
            expect(
                estimate(&tracer, eye, point - eye, 10_000),
                lit(form_factor(&panel, point, DVec3::Z)),
            );
        }
    }
}

#[test]
fn a_small_source_obeys_the_fourth_power_of_the_cosine() {
    // A plane that faces the source receives L A cos⁴ / h². The source's size of 1/1000 of the
    // height leaves an error of 1e-6.
    let mut model = Model::default();
    floor(&mut model);
    let light = model.material(BLACK, LE);
    let (h, half) = (2.0, 1e-3);
    model.square(h, half, false, light);
    let tracer = model.tracer(Some(0));
    for x in [0.0, 1.0, 3.0, 10.0] {
        let point = DVec3::new(x, 0.0, 0.0);
        let cosine = h / (h * h + x * x).sqrt();
        let factor = 4.0 * half * half * cosine.powi(4) / (h * h) / PI;
        let eye = point + DVec3::new(0.0, -0.4, 1.0);
        expect(estimate(&tracer, eye, point - eye, 5_000), lit(factor));
    }
}

#[test]
fn a_far_source_of_great_power_and_a_near_weak_one_add_up() {
    let mut model = Model::default();
    floor(&mut model);
    let weak = model.material(BLACK, LE);
    let strong = model.material(BLACK, LE.map(|c| c * 1e6));
    let near = [[-0.1, -0.1, 0.5], [-0.1, 0.1, 0.5], [0.1, 0.1, 0.5], [0.1, -0.1, 0.5]];
    let far =
        [[900.0, -1.0, 1000.0], [900.0, 1.0, 1000.0], [902.0, 1.0, 1000.0], [902.0, -1.0, 1000.0]];
    model.polygon(&near, weak);
    model.polygon(&far, strong);
    let point = DVec3::new(0.2, 0.1, 0.0);
    let factor = form_factor(&near, point, DVec3::Z) + 1e6 * form_factor(&far, point, DVec3::Z);
    let eye = point + DVec3::new(0.3, -0.4, 0.3);
    expect(estimate(&model.tracer(Some(0)), eye, point - eye, 20_000), lit(factor));
}

#[test]
fn a_point_in_an_emitter_s_plane_gets_nothing_from_it() {
    // The floor continues as an emitter. Another emitter, edge-on, stands across it.
    let mut model = Model::default();
    floor(&mut model);
    let light = model.material(BLACK, LE);
    model.two_sided(light);
    model.polygon(
        &[[50.0, -1.0, 0.0], [52.0, -1.0, 0.0], [52.0, 1.0, 0.0], [50.0, 1.0, 0.0]],
        light,
    );
    model.polygon(&[[3.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 0.0, 2.0], [3.0, 0.0, 2.0]], light);
    let tracer = model.tracer(Some(0));
    // Not 0: the floor's diagonal runs there, and points within rounding of an edge are moved off
    // it and out of the plane.
    for x in [49.9, 30.0, 1.0] {
        let point = DVec3::new(x, 0.0, 0.0);
        let eye = point + DVec3::new(0.0, -0.4, 1.0);
        assert_eq!(estimate(&tracer, eye, point - eye, 5_000).mean, [0.0; 3], "{x}");
    }
}

/// Adds a sphere of radius 1 about the origin, of `n` by `2 n` patches, seen from inside. Patches
/// for which `emits` is true have the second material.
fn sphere(model: &mut Model, n: usize, materials: [u32; 2], emits: impl Fn(usize, usize) -> bool) {
    let at = |i: usize, j: usize| {
        let (theta, phi) = (PI * i as f64 / n as f64, PI * (j % (2 * n)) as f64 / n as f64);
        [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()]
    };
    for i in 0..n {
        for j in 0..2 * n {
            let material = materials[usize::from(emits(i, j))];
            let q = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            if i > 0 {
                model.polygon(&[q[0], q[1], q[2]], material);
            }
            if i + 1 < n {
                model.polygon(&[q[0], q[2], q[3]], material);
            }
        }
    }
}

#[test]
fn an_integrating_sphere_has_the_irradiance_of_its_closed_form() {
    // E = Φ / (A (1 - ρ)) everywhere, if the emitting cap reflects as the rest does. Reflected
    // light makes Φ ρ / (A (1 - ρ)) of it. 2,048 of 16,000 triangles emit. A polyhedron with facets
    // of 2.8 degrees (0.049) deviates from a sphere by about half of 0.049²: 1.5e-3.
    let (n, rho) = (64, 0.7);
    let mut model = Model::default();
    let wall = model.material(Bsdf::Diffuse { kd: [rho; 3] }, [0.0; 3]);
    let light = model.material(Bsdf::Diffuse { kd: [rho; 3] }, [2.0; 3]);
    sphere(&mut model, n, [wall, light], |i, _| i < 8);
    let scene = model.scene();
    let area: f64 = scene.triangles().map(|t| scene.area(t)).sum();
    let emitting: f64 = scene.emitters().map(|t| scene.area(t)).sum();
    assert!(scene.emitters().count() > 1_500);
    let rho = f64::from(rho);
    let flux = 2.0 * PI * emitting;
    for (bounces, irradiance) in [
        (Some(0), flux / area),
        (Some(1), flux * (1.0 + rho) / area),
        (None, flux / (area * (1.0 - rho))),
    ] {
        let tracer = model.tracer(bounces);
        let (mut sum, mut squares, n) = (0.0, 0.0, 60_000);
        for seed in 0..n {
            // Points all over the lower half, because facets are tilted against the sphere to
            // either side.
            let [x, y] = Sampler::new(!seed, 0).two().map(f64::from);
            let (z, phi) = (-x, 2.0 * PI * y);
            let direction =
                DVec3::new((1.0 - z * z).sqrt() * phi.cos(), (1.0 - z * z).sqrt() * phi.sin(), z);
            let radiance = f64::from(tracer.trace(DVec3::ZERO, direction, seed).radiance[0]);
            sum += radiance;
            squares += radiance * radiance;
        }
        let n = n as f64;
        let (mean, expected) = (sum / n, rho / PI * irradiance);
        let error = ((squares / n - mean * mean) / n).sqrt();
        assert!(
            (mean - expected).abs() < 4.5 * error + 1.5e-3 * expected,
            "{bounces:?}: {mean} ± {error} is not {expected}"
        );
    }
}

/// Returns the variance of means of `paths` paths, and its own standard error.
fn variance(tracer: &Tracer, paths: u64, seeds: u64) -> (f64, f64) {
    let eye = DVec3::new(0.3, -0.4, 1.0);
    let values: Vec<f64> = (0..seeds)
        .map(|seed| {
            f64::from(
                tracer.trace_paths(eye, DVec3::new(0.2, 0.3, -1.0), seed, 0..paths).radiance[1],
            )
        })
        .collect();
    let n = seeds as f64;
    let mean = values.iter().sum::<f64>() / n;
    let central = |k: i32| values.iter().map(|v| (v - mean).powi(k)).sum::<f64>() / n;
    let (second, fourth) = (central(2), central(4));
    (second, ((fourth - second * second) / n).sqrt())
}

#[test]
fn error_falls_with_paths_at_least_as_fast_as_for_independent_paths() {
    // A lit floor under a black ceiling with a window to the sky: light, sky and indirect light
    // together.
    let mut model = Model { sky: [0.3; 3], ..Model::default() };
    floor(&mut model);
    let wall = model.material(Bsdf::Diffuse { kd: [0.6; 3] }, [0.0; 3]);
    let light = model.material(BLACK, LE);
    model.polygon(&[[1.0, -3.0, 0.0], [1.0, 3.0, 0.0], [1.0, 3.0, 3.0], [1.0, -3.0, 3.0]], wall);
    model.square(2.0, 0.5, false, light);
    let tracer = model.tracer(None);
    let (one, one_error) = variance(&tracer, 1, 20_000);
    for paths in [4, 16, 64] {
        let (many, many_error) = variance(&tracer, paths, 2_000);
        let n = paths as f64;
        let bound = one / n + 4.5 * (one_error / n).hypot(many_error);
        println!("{paths} paths: variance {:.3} of independent ones'", many * n / one);
        assert!(many <= bound, "{paths}: {many} ± {many_error}, {one} ± {one_error}");
    }
    // At 64 paths, stratification must clearly lower the variance.
    let (many, many_error) = variance(&tracer, 64, 2_000);
    assert!(many + 4.5 * many_error < 0.6 * one / 64.0, "{many} ± {many_error}, {one}");
}
