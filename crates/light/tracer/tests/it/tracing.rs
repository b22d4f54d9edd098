//! Tests the properties that callers rely on: distances, reproducibility, far eyes, and bad input.

use crate::common::{BLACK, Model, estimate};
use glam::DVec3;
use holo_scene::Bsdf;
use holo_tracer::{MAX_PATHS, Settings, Tracer, TracerError};

fn room(offset: DVec3) -> Model {
    let mut model = Model::default();
    let wall = model.material(Bsdf::Diffuse { kd: [0.7, 0.5, 0.3] }, [0.0; 3]);
    let light = model.material(BLACK, [4.0; 3]);
    let low = (offset - 2.0).to_array();
    let high = (offset + 2.0).to_array();
    model.cuboid(low, high, false, wall);
    let lamp = [[-1.0, -1.0, 1.9], [-1.0, 1.0, 1.9], [1.0, 1.0, 1.9], [1.0, -1.0, 1.9]];
    model.polygon(&lamp.map(|c| (DVec3::from_array(c) + offset).to_array()), light);
    model
}

#[test]
fn a_sample_is_a_function_of_its_seed_and_the_mean_of_its_paths() {
    let scene = room(DVec3::ZERO).scene();
    let (eye, direction) = (DVec3::ZERO, DVec3::new(0.5, 0.6, -0.3).normalize());
    let many = Tracer::new(scene.clone(), Settings { bounces: None, paths: 16 }).expect("a tracer");
    let whole = many.trace(eye, direction, 5);
    assert_eq!(whole, many.trace(eye, direction, 5));
    assert_ne!(whole.radiance, many.trace(eye, direction, 6).radiance);
    let mean: f64 =
        (0..16).map(|p| f64::from(many.trace_path(eye, direction, 5, p).radiance[0])).sum::<f64>()
            / 16.0;
    assert!((mean - f64::from(whole.radiance[0])).abs() < 1e-5 * mean);
    let elsewhere = std::thread::spawn(move || {
        let tracer = Tracer::new(scene, Settings { bounces: None, paths: 16 }).expect("a tracer");
        tracer.trace(eye, direction, 5)
    });
    assert_eq!(elsewhere.join().expect("no panic"), whole);
}

#[test]
fn map_coordinates_and_far_eyes_lose_no_precision() {
    let near = room(DVec3::ZERO).tracer(None);
    let offset = DVec3::new(4_500_000.0, -5_200_000.0, 300.0);
    let mapped = room(offset).tracer(None);
    let direction = DVec3::new(0.48, 0.6, -0.64);
    let (a, b) = (near.trace(DVec3::ZERO, direction, 1), mapped.trace(offset, direction, 1));
    assert_eq!(a, b);
    // From 1e7 units away, looking through a wall that is seen from behind: the near wall's outside
    // is hit.
    let target = DVec3::new(2.0, 0.3, 0.2);
    let back = DVec3::new(-0.8, 0.36, 0.48);
    let far = near.trace(target - back * 1e7, back, 1);
    assert!((far.distance - 1e7).abs() < 1e-5, "{}", far.distance);
    assert_eq!(near.trace(target - back * 1e7, -back, 1).distance, f64::INFINITY);
}

#[test]
fn invalid_rays_are_black_and_rays_past_everything_see_the_sky() {
    let mut model = room(DVec3::ZERO);
    model.sky = [1.0, 2.0, 3.0];
    let tracer = model.tracer(None);
    for (origin, direction) in [
        (DVec3::NAN, DVec3::X),
        (DVec3::X * f64::INFINITY, DVec3::X),
        (DVec3::ZERO, DVec3::ZERO),
        (DVec3::ZERO, DVec3::new(f64::NAN, 1.0, 0.0)),
        (DVec3::ZERO, DVec3::X * f64::INFINITY),
    ] {
        let traced = tracer.trace(origin, direction, 0);
        assert_eq!(
            (traced.radiance, traced.distance),
            ([0.0; 3], f64::INFINITY),
            "{origin} {direction}"
        );
    }
    for origin in [DVec3::X * 3.0, DVec3::X * 1e30] {
        let traced = tracer.trace(origin, DVec3::X, 0);
        assert_eq!((traced.radiance, traced.distance), ([1.0, 2.0, 3.0], f64::INFINITY));
    }
    let empty = Model { sky: [1.0; 3], ..Model::default() }.tracer(None);
    assert_eq!(empty.trace(DVec3::ZERO, DVec3::X, 0).radiance, [1.0; 3]);
}

#[test]
fn settings_out_of_range_are_refused() {
    let scene = room(DVec3::ZERO).scene();
    for paths in [0, MAX_PATHS + 1] {
        let error = Tracer::new(scene.clone(), Settings { bounces: None, paths }).err();
        assert!(matches!(error, Some(TracerError::Paths(found)) if found == paths));
    }
}

#[test]
fn every_material_at_every_angle_gives_finite_light() {
    let t = [0.9, 0.8, 0.7];
    for bsdf in [
        Bsdf::Diffuse { kd: t },
        Bsdf::Mirror { ks: t },
        Bsdf::Conductor { ks: t, alpha: 1e-6 },
        Bsdf::Conductor { ks: t, alpha: 1.0 },
        Bsdf::ThinGlass { ior: 1.5, transmittance: t },
        Bsdf::Dielectric { ior: 1.5, transmittance: t, alpha: 0.0 },
        Bsdf::Dielectric { ior: 1.0, transmittance: t, alpha: 0.3 },
        Bsdf::Dielectric { ior: 0.7, transmittance: t, alpha: 0.01 },
        Bsdf::Coated { kd: t, ks: t, ior: 1.5, alpha: 0.05 },
        Bsdf::Coated { kd: [0.0; 3], ks: [0.0; 3], ior: 1.0, alpha: 1e-6 },
    ] {
        let mut model = room(DVec3::ZERO);
        model.sky = [0.1; 3];
        let m = model.material(bsdf, [0.0; 3]);
        model.cuboid([-0.5; 3], [0.5; 3], true, m);
        let tracer = model.tracer(None);
        for i in 0..200 {
            let height = 0.5 + 1e-6 * f64::from(i).exp2().min(1e6);
            let e = estimate(
                &tracer,
                DVec3::new(-1.5, 0.1, height.min(1.8)),
                DVec3::new(1.0, 0.0, -0.5 * f64::from(i % 4)),
                50,
            );
            assert!(e.mean.iter().all(|m| m.is_finite() && *m >= 0.0), "{bsdf:?}: {e:?}");
        }
    }
}
