//! Tests the variance that samples state against the variance that they have.

use crate::common::{BLACK, Model};
use glam::DVec3;
use holo_scene::Bsdf;
use holo_tracer::{Settings, Tracer};

fn room() -> Model {
    let mut model = Model { sky: [0.2, 0.3, 0.4], ..Model::default() };
    let wall = model.material(Bsdf::Diffuse { kd: [0.7, 0.5, 0.3] }, [0.0; 3]);
    let lamp = model.material(BLACK, [4.0, 5.0, 6.0]);
    model.cuboid([-2.0; 3], [2.0; 3], false, wall);
    model.polygon(&[[-1.0, -1.0, 1.9], [-1.0, 1.0, 1.9], [1.0, 1.0, 1.9], [1.0, -1.0, 1.9]], lamp);
    model
}

#[allow(clippy::expect_used, reason = "a test fails by it")]
fn tracer(paths: u32) -> Tracer {
    Tracer::new(room().scene(), Settings { bounces: None, paths }).expect("a tracer")
}

const SAMPLES: u64 = 20_000;

#[test]
fn the_stated_variance_is_the_variance_of_samples() {
    let direction = DVec3::new(0.5, 0.6, -0.3).normalize();
    for paths in [2, 3, 4, 7, 16] {
        let tracer = tracer(paths);
        let found: Vec<(f64, f64)> = (0..SAMPLES)
            .map(|seed| {
                let (traced, variance) = tracer.trace_with_variance(DVec3::ZERO, direction, seed);
                (f64::from(traced.radiance[1]), variance.expect("more than one path")[1])
            })
            .collect();
        let n = SAMPLES as f64;
        let mean = found.iter().map(|f| f.0).sum::<f64>() / n;
        // The square of a sample's error is an unbiased estimate of the same variance, so the
        // differences have expectation 0.
        let differences =
            found.iter().map(|(value, variance)| variance - (value - mean).powi(2) * n / (n - 1.0));
        let (sum, squares) =
            differences.fold((0.0, 0.0), |(s, q): (f64, f64), d| (s + d, q + d * d));
        // Five pairs of tests: by chance once in 15,000 runs.
        assert!((sum / squares.sqrt()).abs() < 4.5, "{paths} paths: {}", sum / squares.sqrt());
        // An estimate that is 20 % off would fail the test.
        assert!(
            squares.sqrt() * 4.5 < 0.2 * found.iter().map(|f| f.1).sum::<f64>(),
            "{paths} paths"
        );

        let plain: Vec<f64> = (0..SAMPLES)
            .map(|seed| f64::from(tracer.trace(DVec3::ZERO, direction, seed).radiance[1]))
            .collect();
        let plain_mean = plain.iter().sum::<f64>() / n;
        let variance = |values: &mut dyn Iterator<Item = f64>, mean: f64| {
            values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)
        };
        let with = variance(&mut found.iter().map(|f| f.0), mean);
        let without = variance(&mut plain.iter().copied(), plain_mean);
        let z = (mean - plain_mean) / ((with + without) / n).sqrt();
        assert!(z.abs() < 4.5, "{paths} paths: the means differ by {z} standard errors");
    }
}

#[test]
fn one_path_has_no_estimate_and_constant_radiance_has_no_variance() {
    let wall = DVec3::new(0.5, 0.6, -0.3);
    let (traced, variance) = tracer(1).trace_with_variance(DVec3::ZERO, wall, 0);
    assert!(traced.radiance[0] > 0.0 && traced.distance > 2.0 && variance.is_none());
    let tracer = tracer(8);
    // The lamp, the sky, and an invalid ray.
    for (eye, direction, radiance) in [
        (DVec3::ZERO, DVec3::Z, [4.0, 5.0, 6.0]),
        (DVec3::X * 9.0, DVec3::X, [0.2, 0.3, 0.4]),
        (DVec3::NAN, DVec3::X, [0.0; 3]),
    ] {
        let (traced, variance) = tracer.trace_with_variance(eye, direction, 0);
        assert_eq!((traced.radiance, variance), (radiance, Some([0.0; 3])));
        assert_eq!(traced.distance, tracer.trace(eye, direction, 0).distance);
    }
}
